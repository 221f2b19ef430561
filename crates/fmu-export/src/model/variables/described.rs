//! What the JSON says of a model's variables: constants, and what is found by a value reference.

use core::ops::Range;

use crate::model::description::{
    ClockDescription, Dependencies, ModelDescription, ScalarVariable, ValueReference, VariableDescription,
    Version,
};

/// The description of a model's variables.
pub trait Described: 'static {
    /// The model's description.
    const DESCRIPTION: &'static ModelDescription;
    /// The text of the modelDescription.xml; part of a library only if used.
    const MODEL_DESCRIPTION_XML: &'static str;
    /// The nominal values of the states; 1 if undeclared.
    const STATE_NOMINALS: &'static [f64];
    /// The states with a range outside which the equations are invalid; ascending.
    const STRICT_STATES: &'static [(Range<usize>, f64, f64)] = &[];
    /// The names of the event indicators.
    const EVENT_INDICATORS: &'static [&'static str] = &[];
    /// The positions of the indicators that no event may leave positive.
    const LIMITS: &'static [usize] = &[];
    /// In FMI 3.0, the value reference of the first event indicator's variable; those of the others follow.
    const FIRST_EVENT_INDICATOR: ValueReference = ValueReference::MAX;
    /// The relative tolerance of the JSON's `default_experiment`.
    const DEFAULT_TOLERANCE: Option<f64> = None;
    /// The Real outputs and derivatives, each with the variables on which it depends according to `reads` in the
    /// model's JSON. [`check_dependencies`](crate::check_dependencies) uses them, and importers that ask for the
    /// dependencies of each element; other libraries do not contain them.
    const DEPENDENCIES: &'static [Dependencies] = &[];
    /// What initialization computes, with its dependencies; only if importers may ask for the dependencies of each
    /// element.
    const INITIAL_DEPENDENCIES: &'static [Dependencies] = &[];
    /// Whether a Real output or derivative depends explicitly on time, or may.
    const DEPENDS_ON_TIME: bool = false;
    /// Whether there are calculated parameters, or locals that follow from parameters only.
    const HAS_CALCULATED_PARAMETERS: bool = false;
    /// Whether the JSON declares clocks. If not, Scheduled Execution has one, of a sampled model's period.
    const HAS_CLOCKS: bool = false;
    /// Whether the numbers of Reals are `f32`, which sampled models alone can have.
    const IS_SINGLE_PRECISION: bool = false;
    /// The clocks: inputs first, by priority, then the others.
    const CLOCKS: &'static [ClockDescription] = &[];
    /// The variables and arrays that belong to clocks, each with the clocks' value references; ascending.
    const CLOCKED: &'static [(ValueReference, &'static [ValueReference])] = &[];
    /// The folder from which the FMU's resources come, if it has any; for a model without an FMU, and no part of libraries.
    const RESOURCES: Option<&'static str> = None;
    /// The number of scalars with the value references 0, 1, 2, … at the front of the description, which need no search.
    const FRONT: usize = front(Self::DESCRIPTION.variables);
    /// The value references of the first Real inputs, if they are scalars with consecutive ones: their positions follow.
    const REAL_INPUTS: Range<ValueReference> = real_inputs(Self::DESCRIPTION.variables);
    /// Whether arrays are variables, as in FMI 3.0.
    const HAS_ARRAYS: bool =
        matches!(Self::DESCRIPTION.version, Version::Three) && has_arrays(Self::DESCRIPTION.variables);

    /// The attributes of the variable with a value reference. The elements of an array share theirs.
    #[must_use]
    #[inline]
    fn attributes(reference: ValueReference) -> Option<&'static VariableDescription> {
        Self::description(reference).map(|variable| variable.description)
    }

    /// The scalar variable with a value reference.
    #[must_use]
    #[inline]
    fn description(reference: ValueReference) -> Option<ScalarVariable> {
        Self::description_near(reference, &mut 0)
    }

    /// The scalar variable with a value reference, where it is likely to be an element of the array that was found last, at
    /// this position in the description or the next.
    #[must_use]
    #[inline]
    fn description_near(reference: ValueReference, last: &mut usize) -> Option<ScalarVariable> {
        let (variables, position) = (Self::DESCRIPTION.variables, reference as usize);
        if position < Self::FRONT {
            return Some(ScalarVariable { description: &variables[position], element: 0 });
        }
        if Self::FRONT == variables.len() {
            return None;
        }
        // The elements of an array of states alternate with their derivatives, which are the next variable.
        let find =
            |first: usize| at(variables, first, reference).or_else(|| at(variables, first + 1, reference));
        let found = find(*last).or_else(|| {
            let after = variables.partition_point(|variable| variable.value_reference <= reference);
            *last = after.saturating_sub(2);
            find(*last)
        });
        if found.is_some_and(|found| {
            found.stride == 1 && found.value_reference > variables[*last].value_reference
        }) {
            *last += 1;
        }
        found
    }

    /// Consecutive value references of one type: those of the variable at a position in the description, with which those
    /// of its derivative may alternate; none if others are between them.
    #[must_use]
    fn of_one_type(position: usize) -> Range<ValueReference> {
        let variables = Self::DESCRIPTION.variables;
        let variable = &variables[position];
        let first = variable.value_reference;
        let alternates = |other: &VariableDescription| {
            (other.value_reference, other.stride, other.elements, other.data_type)
                == (first + 1, 2, variable.elements, variable.data_type)
        };
        let count = match variable.stride {
            1 => variable.elements,
            2 if variables.get(position + 1).is_some_and(alternates) => 2 * variable.elements,
            _ => 0,
        };
        first..first + count
    }

    /// The scalar variables, each with its value reference.
    #[must_use]
    fn described() -> impl Iterator<Item = (ValueReference, ScalarVariable)> + Clone {
        Self::DESCRIPTION.variables.iter().flat_map(VariableDescription::scalars)
    }

    /// The value references of a variable's elements, or that of a scalar. In FMI 3.0 an array is one variable, with the
    /// value reference of its first element.
    #[must_use]
    fn elements(reference: ValueReference) -> Option<impl Iterator<Item = ValueReference>> {
        let variable = Self::description(reference)?;
        let (count, stride) = if Self::HAS_ARRAYS { (variable.elements, variable.stride) } else { (1, 1) };
        let is_whole = !Self::HAS_ARRAYS || variable.value_reference == reference;
        is_whole.then(|| (reference..).step_by(stride as usize).take(count as usize))
    }

    /// The name of the state at a position.
    #[cfg(not(target_os = "none"))]
    #[must_use]
    fn state_name(position: usize) -> String {
        let mut states = Self::described().filter(|(_, variable)| variable.state() == Some(position));
        states.next().map(|(_, variable)| variable.name().to_string()).unwrap_or_default()
    }
}

/// How many variables at the front are scalars whose value references are their positions.
const fn front(variables: &[VariableDescription]) -> usize {
    let mut position = 0;
    while position < variables.len()
        && variables[position].value_reference as usize == position
        && variables[position].dimensions.is_empty()
    {
        position += 1;
    }
    position
}

/// The value references of the first Real inputs that are consecutive scalars.
const fn real_inputs(variables: &[VariableDescription]) -> Range<ValueReference> {
    let mut found = 0..0;
    let mut position = 0;
    while position < variables.len() {
        let VariableDescription { value_reference, first_real_input, elements, .. } = &variables[position];
        let is_next = match first_real_input {
            Some(0) => true,
            Some(input) => *input == (found.end - found.start) as usize && *value_reference == found.end,
            None => false,
        };
        if is_next && *elements == 1 {
            found =
                if found.start == found.end { *value_reference } else { found.start }..*value_reference + 1;
        }
        position += 1;
    }
    found
}

/// Whether any variable is an array.
const fn has_arrays(variables: &[VariableDescription]) -> bool {
    let mut position = 0;
    while position < variables.len() {
        if !variables[position].dimensions.is_empty() {
            return true;
        }
        position += 1;
    }
    false
}

/// The scalar variable with a value reference, if it is an element of the variable at a position.
#[inline]
fn at(
    variables: &'static [VariableDescription],
    position: usize,
    reference: ValueReference,
) -> Option<ScalarVariable> {
    let description = variables.get(position)?;
    let distance = reference.checked_sub(description.value_reference)?;
    let element = match description.stride {
        1 => distance,
        stride if distance % stride == 0 => distance / stride,
        _ => return None,
    };
    (element < description.elements).then_some(ScalarVariable { description, element: element as usize })
}
