//! Turns the declaration into the [`Model`], which is complete and consistent; anything else is rejected.

use fmu_terms::{Causality, DataType, Initial, Variability};
use fmu_terms::{Precision, Version};

use crate::check;
use crate::declaration::{Declaration, Described, VariableDeclaration};
use crate::dependencies;
use crate::error::Refusals;
use crate::flatten::Flat;
use crate::interfaces::Fmi;
use crate::model::{Field, Model, Place, Quantity, ReadsByMode, Scalar, Texts};
use crate::package::Package;
use crate::start::Start;
use crate::units::Units;
use crate::units::declaration::UnitDeclaration;
use crate::value_type::ValueType;

/// The suffix of the model identifier of an FMU for Scheduled Execution.
const SCHEDULED: &str = "Scheduled";

/// Flattens and checks a declaration.
pub(crate) fn model<'a>(
    declaration: &'a Declaration,
    units: &'a [UnitDeclaration],
    package: &'a Package,
    fmi: Fmi,
) -> Result<Model<'a>, Refusals> {
    let given = |text: &str| Some(text.to_owned()).filter(|text| !text.is_empty());
    let library = declaration.model_identifier.clone().unwrap_or_else(|| package.name.replace('-', "_"));
    let mut refusals = Refusals::default();
    check::declaration(declaration, &library, &mut refusals);
    refusals.check()?;
    let mut flat = Flat::new(declaration)?;
    flat.look_up_reads();
    flat.look_up_clocks();
    flat.look_up_previous();
    let units = flat.find_units(&Units::new(units));
    let Flat { parts, scalars, names, reads_elements, mut refusals, .. } = flat;
    let mut model = Model {
        declaration,
        fmi,
        identifier: library.clone(),
        library,
        description: declaration.description.clone().or_else(|| given(&package.description)),
        author: declaration.author.clone().or_else(|| given(&package.authors.replace(':', ", "))),
        license: declaration.license.clone().or_else(|| given(&package.license)),
        version: &package.version,
        log_categories: log_categories(&declaration.log_categories),
        units,
        parts,
        scalars,
        names,
        reads_elements,
        is_bare_metal: package.is_bare_metal,
        is_single_precision: false,
    };
    if package.is_bare_metal {
        model.parts.iter_mut().flat_map(|part| &mut part.fields).for_each(|field| field.is_boxed = false);
    }
    model.is_single_precision =
        package.precision == Precision::Single && model.in_place(Place::States).next().is_none();
    if model.is_single_precision {
        compute_in_single_precision(&mut model, &mut refusals);
    }
    check::model::variables(&model, &mut refusals);
    dependencies::refuse_cycles(&model.scalars, &mut refusals);
    refusals.check()?;
    if fmi.version == Version::Two {
        leave_out_clocks(&mut model.scalars);
    }
    if fmi.version == Version::Three && fmi.interfaces.model_exchange() {
        add_event_indicators(&mut model, &mut refusals);
        refusals.check()?;
    }
    if fmi.interfaces.scheduled_execution()
        && let Some(clock) = &declaration.sample_clock
    {
        model.identifier += SCHEDULED;
        add_sample_clock(&mut model, clock);
    }
    check::model::terminals(&model, &mut refusals);
    refusals.check()?;
    Ok(model)
}

/// Has the model compute with `f32`. What importers and calibration tools see stays a Real.
fn compute_in_single_precision(model: &mut Model<'_>, refusals: &mut Refusals) {
    for Scalar { name, key, start, data_type, .. } in &model.scalars {
        if let Some(Start::Real(value)) = start
            && *data_type == DataType::Real
            && value.abs() > f32::MAX.into()
        {
            refusals.add(
                format!("{key}.start"),
                format!("{name}: {value:e} is beyond the numbers of single precision"),
            );
        }
    }
    let fields = model.parts.iter_mut().flat_map(|part| &mut part.fields);
    for field in fields.filter(|field| field.data_type == DataType::Real) {
        field.data_type = ValueType::Standard(DataType::Float32);
    }
}

/// The value reference after all others.
fn next_reference(scalars: &[Scalar]) -> u32 {
    scalars.iter().map(|scalar| scalar.value_reference + 1).max().unwrap_or(0)
}

/// Lets nothing refer to clocks: in FMI 2.0, what changes at their ticks changes at time events.
fn leave_out_clocks(scalars: &mut [Scalar]) {
    let are_clocks: Vec<_> = scalars.iter().map(|scalar| scalar.place == Place::Clocks).collect();
    for scalar in scalars {
        scalar.clocked.clocks.clear();
        if scalar.clocked.is_previous {
            // It is of an earlier event.
            scalar.reads.in_steps = Some([].into());
        }
        (scalar.clocked.previous, scalar.clocked.is_previous) = (None, false);
        for reads in [&mut scalar.reads.in_steps, &mut scalar.reads.in_initialization].into_iter().flatten() {
            if reads.iter().any(|&read| are_clocks[read]) {
                *reads = reads.iter().copied().filter(|&read| !are_clocks[read]).collect();
            }
        }
    }
}

/// Adds the clock of a sampled model. Every variable changes only at its ticks, and depends on everything known then.
fn add_sample_clock<'a>(model: &mut Model<'a>, clock: &'a VariableDeclaration) {
    let position = model.scalars.len();
    for scalar in &mut model.scalars {
        if matches!(scalar.place, Place::Inputs | Place::Outputs | Place::Locals)
            && matches!(scalar.variability, Variability::Continuous | Variability::Discrete)
        {
            scalar.variability = Variability::Discrete;
            scalar.clocked.clocks = vec![position];
            scalar.reads.in_steps = None;
        }
    }
    let fields = &mut model.parts[0].fields;
    let field = Field {
        declaration: clock,
        place: Place::Clocks,
        data_type: ValueType::Standard(DataType::Clock),
        positions: vec![position],
        is_boxed: false,
    };
    model.scalars.push(Scalar {
        name: clock.name.clone(),
        field: [0, fields.len()],
        value_reference: next_reference(&model.scalars),
        texts: Texts { description: clock.description.clone(), aliases: vec![] },
        place: Place::Clocks,
        causality: Causality::Input,
        variability: Variability::Discrete,
        data_type: ValueType::Standard(DataType::Clock),
        quantity: Quantity::default(),
        path: field.name(),
        ..Scalar::time()
    });
    fields.push(field);
}

/// Adds the event indicators, variables in FMI 3.0.
fn add_event_indicators(model: &mut Model<'_>, refusals: &mut Refusals) {
    for (number, name) in model.declaration.event_indicators.iter().enumerate() {
        let indicator = Scalar {
            name: format!("event_indicators.{name}"),
            value_reference: next_reference(&model.scalars),
            texts: Texts { description: Some(format!("Event indicator {name}")), aliases: vec![] },
            place: Place::EventIndicators,
            causality: Causality::Local,
            initial: Some(Initial::Calculated),
            quantity: Quantity::default(),
            reads: ReadsByMode::default(),
            ..Scalar::time()
        };
        if model.names.contains_key(&indicator.name) {
            let reason = format!("{}: another variable has this name", indicator.name);
            refusals.add(format!("event_indicators[{number}]"), reason);
        }
        model.scalars.push(indicator);
    }
}

/// The runtime's log categories, unless declared, and the declared ones.
fn log_categories(declared: &[Described]) -> Vec<Described> {
    let default = [("logStatusError", "errors"), ("logStatusWarning", "warnings"), ("logEvents", "events")];
    default
        .into_iter()
        .filter(|(name, _)| declared.iter().all(|category| category.name != *name))
        .map(|(name, description)| Described { name: name.to_owned(), description: description.to_owned() })
        .chain(declared.iter().cloned())
        .collect()
}
