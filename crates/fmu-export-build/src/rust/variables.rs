//! All variables of a model: what the runtime sees of them, through the traits `Described`, `Accessed` and `Numbered`.

use std::path::Path;

use super::audit::is_evaluated;
use super::generator::Generator;
use crate::model::Place;

impl Generator<'_, '_> {
    pub(super) fn variables_impl(&self, resources: Option<&Path>) -> String {
        let resources = resources.map_or_else(String::new, |folder| {
            format!("    const RESOURCES: Option<&'static str> = Some({:?});\n", folder.to_string_lossy())
        });
        let tables = [
            self.default_tolerance(),
            self.strict_states(),
            self.event_indicators(),
            self.dependencies(),
            self.clock_tables(),
            self.has_calculated_parameters(),
            self.is_single_precision().to_owned(),
        ]
        .concat();
        let access = [
            self.accessors(),
            self.rounding().to_owned(),
            self.clocks(),
            self.marks("mark_calculated", is_evaluated),
            self.marks("mark_calculated_parameters", |scalar| scalar.place == Place::CalculatedParameters),
            self.forgetting(),
            self.first_non_finite(),
        ]
        .concat();
        format!(
            "
impl ::fmu_export::Described for Variables {{
    const DESCRIPTION: &'static fmi::ModelDescription = &DESCRIPTION;
    const MODEL_DESCRIPTION_XML: &'static str = include_str!(\"modelDescription.xml\");
    const STATE_NOMINALS: &'static [f64] = {nominals};
{resources}{tables}}}

impl ::fmu_export::Accessed for Variables {{
    type Inputs = Inputs;

    fn inputs(&self) -> &Inputs {{
        &self.inputs
    }}

    fn inputs_mut(&mut self) -> &mut Inputs {{
        &mut self.inputs
    }}

    fn has_parameters_of(&self, other: &Self) -> bool {{
        self.parameters == other.parameters
    }}

    fn states_from_start(&mut self) {{
        self.states.clone_from(&self.start);
    }}

    fn swap_states_and_start(&mut self) {{
        ::core::mem::swap(&mut self.states, &mut self.start);
    }}
{access}}}

impl ::fmu_export::Numbered for Variables {{{numbers}{zero}}}
",
            nominals = self.nominals(),
            numbers = self.numbers(),
            zero = self.zero(),
        )
    }

    /// The precision, for the description.
    fn is_single_precision(&self) -> &'static str {
        if self.model.is_single_precision { "    const IS_SINGLE_PRECISION: bool = true;\n" } else { "" }
    }

    /// How a Real is rounded, if it is.
    fn rounding(&self) -> &'static str {
        if !self.model.is_single_precision {
            return "";
        }
        "
    fn rounded(value: f64) -> f64 {
        f64::from(value as Real)
    }
"
    }

    /// Variables without values, and with the derivatives as states.
    fn zero(&self) -> String {
        let of = |place: Place| {
            let name = place.field_name();
            if self.is_real(place) { format!("{name}.map(|_| 0.0)") } else { name.to_owned() }
        };
        let field = |name: &str, value: &str| format!("            {name}: {value},\n");
        let states = of(Place::States);
        let mut fields = field("parameters", &of(Place::Parameters));
        if self.has(Place::CalculatedParameters) {
            fields += &field("calculated_parameters", &of(Place::CalculatedParameters));
        }
        fields += &field("inputs", &of(Place::Inputs));
        for name in ["start", "states", "derivatives"] {
            fields += &field(name, &states);
        }
        fields += &field("locals", &of(Place::Locals));
        fields += &field("outputs", &of(Place::Outputs));
        if self.has(Place::Clocks) {
            fields += &field("clocks", "Clocks::default()");
        }
        format!(
            "
    fn zero() -> Self {{
        let Self {{ parameters, {calculated}inputs, states, locals, outputs, .. }} = Self::default();
        Self {{
{fields}        }}
    }}

    fn along_derivatives(&self) -> Self {{
        Self {{ start: self.derivatives.clone(), ..Self::zero() }}
    }}
",
            calculated = self.calculated_field(),
        )
    }
}
