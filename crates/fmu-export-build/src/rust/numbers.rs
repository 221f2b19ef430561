//! The variables over any number type, with which the equations are also differentiated and recorded.

use super::generator::Generator;
use crate::model::Place;

impl Generator<'_, '_> {
    /// The variables over other number types, and their states by position.
    pub(super) fn numbers(&self) -> String {
        // Without Reals the variables are the same over all number types.
        let [of, other, number, combined, collected] = if self.has_reals() {
            let [combined, collected] =
                ["self", "numbers"].map(|numbers| format!("{numbers}.combine(other, &mut number)"));
            ["Variables<T>", "other", "mut number", &combined, &collected].map(str::to_owned)
        } else {
            ["Self", "_other", "_number", "self.clone()", "numbers.clone()"].map(str::to_owned)
        };
        let parameters = self.types_of_parameters();
        let of = format!(
            "
    type Of<T: ::fmu_export::Number> = {of};
    type Evaluation<'a, T: ::fmu_export::Number + 'a> = Evaluation<'a, T>;
{parameters}
    fn combined<T: ::fmu_export::Number>(&self, {other}: &Self, {number}: impl FnMut(f64, f64) -> T) -> {of} {{
        {combined}
    }}

    fn collected<T: ::fmu_export::Number>(numbers: &{of}, {other}: &Self, {number}: impl FnMut(T, f64) -> f64) -> Self {{
        {collected}
    }}
"
        );
        let has_states = self.is_real(Place::States);
        let each = |name: &str, place: &str| {
            if !has_states {
                return format!(
                    "
    fn {name}<T: ::fmu_export::Number>(_variables: &Self::Of<T>, _function: impl FnMut(usize, T)) {{}}
"
                );
            }
            format!(
                "
    fn {name}<T: ::fmu_export::Number>(variables: &Self::Of<T>, mut function: impl FnMut(usize, T)) {{
        let mut state = 0;
        variables.{place}.for_each(&mut |value| {{
            function(state, value);
            state += 1;
        }});
    }}
"
            )
        };
        let set = if has_states {
            "
    fn set_states<T: ::fmu_export::Number>(variables: &mut Self::Of<T>, state: impl Fn(usize) -> T) {
        let mut position = 0;
        variables.states.for_each_mut(&mut |value| {
            *value = state(position);
            position += 1;
        });
    }
"
        } else {
            "
    fn set_states<T: ::fmu_export::Number>(_variables: &mut Self::Of<T>, _state: impl Fn(usize) -> T) {}
"
        };
        let calculated = self.calculated_field();
        let evaluation = format!(
            "
    fn evaluation<'a, T: ::fmu_export::Number + 'a>(variables: &'a mut Self::Of<T>) -> Self::Evaluation<'a, T> {{
        let Variables {{ parameters, {calculated}inputs, states, derivatives, locals, outputs, .. }} = variables;
        Evaluation {{ parameters, {calculated}inputs, states, derivatives, locals, outputs }}
    }}
"
        );
        let calculation = self.calculation_of_parameters();
        let [states, derivatives] = [("each_state", "states"), ("each_derivative", "derivatives")]
            .map(|(name, place)| each(name, place));
        [&of, &evaluation, &states, &derivatives, set, calculation].concat()
    }

    /// Whether there are calculated parameters, for the description.
    pub(super) fn has_calculated_parameters(&self) -> String {
        format!("    const HAS_CALCULATED_PARAMETERS: bool = {};\n", self.has(Place::CalculatedParameters))
    }

    /// The types of what calculates parameters.
    fn types_of_parameters(&self) -> String {
        let type_of = |place: Place| match (self.has(place), self.is_real(place)) {
            (false, _) if place == Place::CalculatedParameters => "()".to_owned(),
            (_, is_real) => format!("{}{}", place.type_name(), if is_real { "<T>" } else { "" }),
        };
        format!(
            "    type Parameters<T: ::fmu_export::Number> = {};
    type CalculatedParameters<T: ::fmu_export::Number> = {};
",
            type_of(Place::Parameters),
            type_of(Place::CalculatedParameters)
        )
    }

    /// The call of what calculates parameters, if there are calculated ones.
    fn calculation_of_parameters(&self) -> &'static str {
        if !self.has(Place::CalculatedParameters) {
            return "";
        }
        "
    fn calculate_parameters<T: ::fmu_export::Number>(
        variables: &mut Self::Of<T>,
        calculate: impl FnOnce(&Self::Parameters<T>, &mut Self::CalculatedParameters<T>),
    ) {
        calculate(&variables.parameters, &mut variables.calculated_parameters);
    }
"
    }

    /// The calculated parameters in a pattern, if there are any.
    pub(super) fn calculated_field(&self) -> &'static str {
        if self.has(Place::CalculatedParameters) { "calculated_parameters, " } else { "" }
    }
}
