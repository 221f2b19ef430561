//! From the declaration to the [`Model`], which is complete and consistent: anything else is rejected on the way.

use std::collections::BTreeMap;

use fmu_terms::Version;

use crate::check;
use crate::data_type::DataType;
use crate::declaration::{Causality, Declaration, Described, Initial, Variability, VariableDeclaration};
use crate::dependencies;
use crate::error::Refusals;
use crate::flatten::Flat;
use crate::interfaces::Fmi;
use crate::model::{Field, Model, Part, Place, Scalar};
use crate::package::Package;
use crate::units::Units;
use crate::units::declaration::UnitDeclaration;

/// What an FMU for Scheduled Execution adds to the identifier of the same model's other FMU.
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
    let Flat { mut parts, mut scalars, names, mut refusals, .. } = flat;
    check::model::variables(declaration, fmi, &parts, &scalars, &mut refusals);
    dependencies::refuse_cycles(&scalars, &mut refusals);
    refusals.check()?;
    if fmi.version == Version::Three && fmi.interfaces.model_exchange() {
        add_event_indicators(&declaration.event_indicators, &mut scalars, &names, &mut refusals);
        refusals.check()?;
    }
    let mut identifier = library.clone();
    if fmi.interfaces.scheduled_execution()
        && let Some(clock) = &declaration.sample_clock
    {
        identifier += SCHEDULED;
        add_sample_clock(clock, &mut parts, &mut scalars);
    }
    let model = Model {
        declaration,
        fmi,
        library,
        identifier,
        description: declaration.description.clone().or_else(|| given(&package.description)),
        author: declaration.author.clone().or_else(|| given(&package.authors.replace(':', ", "))),
        license: declaration.license.clone().or_else(|| given(&package.license)),
        version: &package.version,
        log_categories: log_categories(&declaration.log_categories),
        units,
        parts,
        scalars,
        names,
    };
    check::model::terminals(&model, &mut refusals);
    refusals.check()?;
    Ok(model)
}

/// Adds a sampled model's clock, with the value reference after all others. Everything that changes does so at its
/// ticks, depending on all that is known then.
fn add_sample_clock<'a>(clock: &'a VariableDeclaration, parts: &mut [Part<'a>], scalars: &mut Vec<Scalar>) {
    let position = scalars.len();
    for scalar in scalars.iter_mut() {
        if matches!(scalar.place, Place::Inputs | Place::Outputs | Place::Locals)
            && matches!(scalar.variability, Variability::Continuous | Variability::Discrete)
        {
            scalar.variability = Variability::Discrete;
            scalar.clocks = vec![position];
            scalar.reads = None;
        }
    }
    let last = scalars.iter().map(|scalar| scalar.value_reference).max().unwrap_or(0);
    let field = Field {
        declaration: clock,
        place: Place::Clocks,
        data_type: DataType::Clock,
        positions: vec![position],
    };
    scalars.push(Scalar {
        name: clock.name.clone(),
        field: [0, parts[0].fields.len()],
        value_reference: last + 1,
        description: clock.description.clone(),
        place: Place::Clocks,
        causality: Causality::Input,
        variability: Variability::Discrete,
        data_type: DataType::Clock,
        unit: None,
        path: field.name(),
        ..Scalar::time()
    });
    parts[0].fields.push(field);
}

/// Adds the event indicators, variables in FMI 3.0, with the value references after all others.
fn add_event_indicators(
    indicators: &[String],
    scalars: &mut Vec<Scalar>,
    names: &BTreeMap<String, Vec<usize>>,
    refusals: &mut Refusals,
) {
    let last = scalars.iter().map(|scalar| scalar.value_reference).max().unwrap_or(0);
    for (number, (name, value_reference)) in indicators.iter().zip(last + 1..).enumerate() {
        let indicator = Scalar {
            name: format!("event_indicators.{name}"),
            value_reference,
            description: Some(format!("Event indicator {name}")),
            place: Place::EventIndicators,
            causality: Causality::Local,
            initial: Some(Initial::Calculated),
            unit: None,
            reads: None,
            initial_reads: None,
            ..Scalar::time()
        };
        if names.contains_key(&indicator.name) {
            let reason = format!("{}: another variable has this name", indicator.name);
            refusals.add(format!("event_indicators[{number}]"), reason);
        }
        scalars.push(indicator);
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
