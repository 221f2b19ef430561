//! One declared variable.

use fmu_terms::{Causality, DataType, Initial, Variability, Version};
use serde_json::Value;

use crate::check::clocks;
use crate::declaration::{Declaration, OneOrEach, VariableDeclaration};
use crate::error::{Blame, refuse_if};
use crate::model::Place;
use crate::names::{field_name, variable_name};
use crate::start::Start;
use crate::texts::text;
use crate::value_type::ValueType;

/// The most scalar variables in a model: the description in FMI 2.0 takes some 350 bytes for each.
const MOST_VARIABLES: usize = 100_000;

/// The most dimensions of an array.
const MOST_DIMENSIONS: usize = 16;

/// The results of one variable's checks.
pub(crate) struct Checked {
    pub(crate) place: Place,
    pub(crate) data_type: ValueType,
    pub(crate) variability: Variability,
    pub(crate) initial: Option<Initial>,
    /// The start values of the variable's scalars, row by row.
    pub(crate) starts: Option<Vec<Start>>,
}

/// Checks one declared variable; `before` scalars precede it.
pub(crate) fn check(
    declaration: &Declaration,
    variable: &VariableDeclaration,
    start: Option<&Value>,
    before: usize,
) -> Result<Checked, Blame> {
    texts(variable)?;
    size(variable, before)?;
    let enumerations: Vec<_> = declaration.enumerations.iter().map(|known| known.name.as_str()).collect();
    let real_types: Vec<_> = declaration.real_types.iter().map(|known| known.name.as_str()).collect();
    let data_type = ValueType::find(&variable.data_type, &enumerations, &real_types);
    let data_type = data_type.map_err(|reason| ("type", reason))?;
    let (place, variability) = place(variable, data_type)?;
    let initial = initial(variable, place, variability)?;
    reads(variable, place, variability, initial)?;
    unit(variable, data_type)?;
    bounds(variable, data_type)?;
    clocks::keys(variable, data_type)?;
    clocked(variable, variability)?;
    has_start(start.is_some(), data_type, place, variability, initial)?;
    let starts = start.map(|start| Start::all(declaration, variable, data_type, start));
    let starts = starts.transpose().map_err(|reason| ("start", reason))?;
    Ok(Checked { place, data_type, variability, initial, starts })
}

/// Name and descriptions.
fn texts(variable: &VariableDeclaration) -> Result<(), Blame> {
    variable_name(&variable.name).map_err(|reason| ("name", reason))?;
    let rust_name = variable.rust_name.as_deref();
    rust_name.map_or(Ok(()), field_name).map_err(|reason| ("rust_name", reason))?;
    for alias in &variable.aliases {
        variable_name(&alias.name).map_err(|reason| ("aliases", reason))?;
        alias.description.as_deref().map_or(Ok(()), text).map_err(|reason| ("aliases", reason))?;
    }
    let of_derivative = variable.derivative.as_ref().and_then(|derivative| derivative.description.as_ref());
    for (key, description) in
        [("description", variable.description.as_ref()), ("derivative.description", of_derivative)]
    {
        description.map_or(Ok(()), |description| text(description)).map_err(|reason| (key, reason))?;
    }
    Ok(())
}

/// The dimensions, and how many scalars there are with the `before` that precede it.
fn size(variable: &VariableDeclaration, before: usize) -> Result<(), Blame> {
    refuse_if(variable.sizes.contains(&0), "dimensions", "a dimension is 0")?;
    let reason = format_args!("an array has at most {MOST_DIMENSIONS} dimensions");
    refuse_if(variable.sizes.len() > MOST_DIMENSIONS, "dimensions", reason)?;
    let with_derivative = if variable.derivative.is_some() { 2 } else { 1 };
    let scalars =
        variable.sizes.iter().try_fold(with_derivative, |product: usize, &size| product.checked_mul(size));
    let is_too_large = scalars.is_none_or(|scalars| before.saturating_add(scalars) > MOST_VARIABLES);
    let key = if variable.sizes.is_empty() { "name" } else { "dimensions" };
    let reason = format_args!(
        "a model has at most {MOST_VARIABLES} variables, counting array elements and derivatives"
    );
    refuse_if(is_too_large, key, reason)
}

/// What changes at ticks of clocks only is discrete or tunable.
fn clocked(variable: &VariableDeclaration, variability: Variability) -> Result<(), Blame> {
    let is_clocked = !variable.clocks.is_empty();
    let is_discrete = variability == Variability::Discrete;
    let reason = "a variable with clocks is 'discrete' or 'tunable'";
    refuse_if(is_clocked && !is_discrete && variability != Variability::Tunable, "clocks", reason)?;
    let reason = "a variable with a previous value is 'discrete' and has 'clocks'";
    refuse_if(variable.previous.is_some() && !(is_clocked && is_discrete), "previous", reason)
}

/// A start value where one is needed, and nowhere else (FMI 2.0.5, section 2.2.7).
fn has_start(
    has_start: bool,
    data_type: ValueType,
    place: Place,
    variability: Variability,
    initial: Option<Initial>,
) -> Result<(), Blame> {
    let needs_start = matches!(place, Place::Inputs | Place::States) || initial == Some(Initial::Exact);
    refuse_if(has_start && data_type == DataType::Clock, "start", "a Clock has no 'start' value")?;
    let unless = if variability == Variability::Discrete { ", unless 'initial' is 'exact'" } else { "" };
    let reason = format_args!("a calculated variable has no 'start' value{unless}");
    refuse_if(has_start && !needs_start, "start", reason)?;
    let kind = match place {
        Place::Inputs => "an input",
        Place::States => "a state",
        Place::Parameters => "a parameter",
        _ if variability == Variability::Constant => "a constant",
        _ => "an 'exact' variable",
    };
    let reason = format_args!("{kind} needs a 'start' value");
    refuse_if(!has_start && needs_start, "start", reason)
}

/// The combinations of causality and variability that FMI 2.0.5 allows (section 2.2.7).
fn place(variable: &VariableDeclaration, data_type: ValueType) -> Result<(Place, Variability), Blame> {
    let causality = variable.causality;
    let (is_structural, is_clock) =
        (causality == Causality::StructuralParameter, data_type == DataType::Clock);
    let reason = "a structuralParameter is of type UInt64";
    refuse_if(is_structural && data_type != DataType::UInt64, "type", reason)?;
    // The default of FMI 3.0, for both versions.
    let default = Variability::by_default(Version::Three, Some(causality), data_type.data_type().is_float());
    let variability = variable.variability.unwrap_or(default);
    let is_continuous = variability == Variability::Continuous;
    let reason = "the build fixes a structuralParameter, so it is 'fixed': the elements of larger arrays would have the \
                  references of other variables; for another size, change its 'start' and build again";
    refuse_if(is_structural && variability != Variability::Fixed, "variability", reason)?;
    let may_tick = matches!(causality, Causality::Input | Causality::Output | Causality::Local);
    refuse_if(is_clock && !may_tick, "causality", "a Clock is an input, an output or local")?;
    refuse_if(is_clock && variability != Variability::Discrete, "variability", "a Clock is discrete")?;
    let is_allowed = Initial::allowed(Version::Three, causality, variability).is_some();
    let reason = format_args!("FMI does not allow variability '{variability}' with causality '{causality}'");
    refuse_if(!is_allowed, "variability", reason)?;
    let reason = format_args!("only a Real can be continuous, not {}", variable.data_type);
    refuse_if(is_continuous && !data_type.data_type().is_float(), "variability", reason)?;
    let is_state = variable.derivative.is_some();
    let may_be_state = data_type == DataType::Real
        && is_continuous
        && matches!(causality, Causality::Local | Causality::Output);
    let reason = "only a continuous local or output Real has a 'derivative'";
    refuse_if(is_state && !may_be_state, "derivative", reason)?;
    let reason = "events can set only a state, which has a 'derivative'";
    refuse_if(variable.reinit && !is_state, "reinit", reason)?;
    for (key, is_strict, of, bound) in [
        ("strict_min", variable.strict_min, "min", variable.min),
        ("strict_max", variable.strict_max, "max", variable.max),
    ] {
        let reason = format_args!("this key is for a state, which has a 'derivative', with a '{of}'");
        refuse_if(is_strict && !(is_state && bound.is_some()), key, reason)?;
    }
    let place = match causality {
        _ if is_state => Place::States,
        _ if is_clock => Place::Clocks,
        Causality::Parameter | Causality::StructuralParameter => Place::Parameters,
        Causality::Input => Place::Inputs,
        Causality::Output => Place::Outputs,
        Causality::CalculatedParameter => Place::CalculatedParameters,
        // With clocks, it changes at their ticks.
        Causality::Local
            if matches!(variability, Variability::Fixed | Variability::Tunable)
                && variable.clocks.is_empty() =>
        {
            Place::CalculatedParameters
        }
        Causality::Local | Causality::Independent => Place::Locals,
    };
    Ok((place, variability))
}

/// How the start value is determined: a choice for states, and for discrete variables that events change. The
/// standard's default, `calculated`, does not suit variables with a start value, which all states have.
fn initial(
    variable: &VariableDeclaration,
    place: Place,
    variability: Variability,
) -> Result<Option<Initial>, Blame> {
    // The default first.
    let (allowed, reason): (&[_], _) = match place {
        Place::Inputs => (&[], "an input has no 'initial'"),
        Place::Clocks => (&[], "a Clock has no 'initial'"),
        Place::Parameters => (&[Initial::Exact], "'initial' of a parameter is 'exact'"),
        Place::States if variable.initial_reads.is_some() => {
            (&[Initial::Approx, Initial::Exact], "'initial' of a state is 'approx' or 'exact'")
        }
        Place::States => (&[Initial::Exact, Initial::Approx], "'initial' of a state is 'approx' or 'exact'"),
        _ if variability == Variability::Constant => {
            (&[Initial::Exact], "'initial' of a constant is 'exact'")
        }
        _ if variability == Variability::Discrete => (
            &[Initial::Calculated, Initial::Exact],
            "'initial' of a discrete variable is 'calculated' or 'exact'",
        ),
        _ => (
            &[Initial::Calculated],
            "'initial' of a calculated variable that is neither a state nor discrete is 'calculated'",
        ),
    };
    let is_wrong = variable.initial.is_some_and(|initial| !allowed.contains(&initial));
    refuse_if(is_wrong, "initial", reason)?;
    Ok(variable.initial.or(allowed.first().copied()))
}

/// Whether dependencies are declared only where possible.
fn reads(
    variable: &VariableDeclaration,
    place: Place,
    variability: Variability,
    initial: Option<Initial>,
) -> Result<(), Blame> {
    let (reads, initial_reads) = (variable.reads.is_some(), variable.initial_reads.is_some());
    let is_given =
        matches!(place, Place::Parameters | Place::Inputs) || variable.causality == Causality::Input;
    refuse_if(is_given && reads, "reads", "the importer sets this variable, so it reads nothing")?;
    refuse_if(
        is_given && initial_reads,
        "initial_reads",
        "the importer sets this variable, so it reads nothing",
    )?;
    let is_state = place == Place::States;
    refuse_if(is_state && reads, "reads", "a state's reads belong to its 'derivative'")?;
    refuse_if(reads && variability == Variability::Constant, "reads", "a constant reads nothing")?;
    let reason = "a variable that begins at its 'start' value reads nothing in initialization";
    refuse_if(initial_reads && initial == Some(Initial::Exact), "initial_reads", reason)
}

/// Only Reals have unit, display unit and nominal.
fn unit(variable: &VariableDeclaration, data_type: ValueType) -> Result<(), Blame> {
    if !data_type.data_type().is_float() {
        let reason = format_args!("this key is for a Real, not for {}", variable.data_type);
        refuse_if(variable.unit.is_some(), "unit", reason)?;
        refuse_if(variable.display_unit.is_some(), "display_unit", reason)?;
        refuse_if(variable.relative_quantity, "relative_quantity", reason)?;
        return refuse_if(variable.nominal.is_some(), "nominal", reason);
    }
    refuse_if(variable.unit.is_none(), "unit", "a Real needs a 'unit' ('1' if dimensionless)")?;
    if let Some(OneOrEach::Each(units)) = &variable.unit {
        let elements: usize = variable.sizes.iter().product();
        refuse_if(variable.sizes.is_empty(), "unit", "only an array can have a list of units")?;
        let reason = format_args!("the list has {} units for {elements} elements", units.len());
        refuse_if(units.len() != elements, "unit", reason)?;
        refuse_if(variable.display_unit.is_some(), "display_unit", "needs one unit, not a list")?;
    }
    nominal(variable.nominal)
}

/// The nominal of a variable or type.
pub(crate) fn nominal(nominal: Option<f64>) -> Result<(), Blame> {
    refuse_if(nominal.is_some_and(|nominal| nominal <= 0.0), "nominal", "must be greater than 0")
}

/// Min and max of a variable or type.
pub(crate) fn range(min: Option<f64>, max: Option<f64>) -> Result<(), Blame> {
    match (min, max) {
        (Some(min), Some(max)) if min > max => Err(("min", format!("{min} is greater than max {max}"))),
        _ => Ok(()),
    }
}

/// Min and max, for types that have them.
fn bounds(variable: &VariableDeclaration, data_type: ValueType) -> Result<(), Blame> {
    for (key, bound) in [("min", variable.min), ("max", variable.max)] {
        let Some(bound) = bound else { continue };
        let is_of_type = match (data_type, data_type.integer()) {
            (ValueType::Standard(DataType::Real), _) => true,
            (ValueType::Standard(DataType::Float32), _) => bound.abs() <= f32::MAX.into(),
            (_, Some((_, range))) => {
                bound.fract() == 0.0 && (exact(*range.start())..=exact(*range.end())).contains(&bound)
            }
            _ => return Err((key, format!("this key is for numbers, not for {}", variable.data_type))),
        };
        refuse_if(!is_of_type, key, format_args!("{bound} is not of type {}", variable.data_type))?;
    }
    range(variable.min, variable.max)
}

/// The nearest bound that a JSON number represents exactly.
#[expect(clippy::cast_precision_loss, reason = "every whole number up to 2 to the power of 53 is exact")]
fn exact(bound: i128) -> f64 {
    const LARGEST: i128 = 1 << f64::MANTISSA_DIGITS;
    bound.clamp(-LARGEST, LARGEST) as f64
}
