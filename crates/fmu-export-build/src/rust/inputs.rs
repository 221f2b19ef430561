//! Access to the Real inputs by position, to interpolate them.

use std::fmt::Write as _;

use super::generator::Generator;
use super::tables::repeated;

impl Generator<'_, '_> {
    pub(super) fn inputs_impl(&self) -> String {
        let (mut getters, mut setters) = (String::new(), String::new());
        for (first, variable) in self.real_inputs() {
            let path = &self.first(variable).path;
            if variable.is_array() {
                let (end, [flat, flat_mut]) = (
                    first + variable.positions.len(),
                    [false, true].map(|is_mutable| self.flat(variable, is_mutable)),
                );
                let _ = writeln!(
                    getters,
                    "            {first}..{end} => f64::from(self.{flat}[position - {first}]),"
                );
                let _ = writeln!(
                    setters,
                    "        self.{flat_mut}.iter_mut().enumerate().for_each(|(index, input)| *input = value({first} + index) as Real);"
                );
            } else {
                let _ = writeln!(getters, "            {first} => f64::from(self.{path}),");
                let _ = writeln!(setters, "        self.{path} = value({first}) as Real;");
            }
        }
        let bounds = repeated(
            "::fmu_export::RealInput",
            self.real_inputs().map(|(_, variable)| {
                let (min, max) = self.bounds(self.first(variable));
                (variable, format!("::fmu_export::RealInput {{ min: {min}, max: {max} }}"))
            }),
        );
        format!(
            "
impl ::fmu_export::Inputs for Inputs {{
    const REALS: &'static [::fmu_export::RealInput] = {bounds};

    fn real(&self, position: usize) -> f64 {{
        match position {{
{getters}            _ => 0.0,
        }}
    }}

    fn set_reals(&mut self, value: impl Fn(usize) -> f64) {{
        let _ = &value;
{setters}    }}
}}
"
        )
    }
}
