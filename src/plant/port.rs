//! Valves in the gas path: wastegates, bypass and surge valve, each an area uncovered by its opening.

use super::orifice::Orifice;
use super::variables::{PortLocals, PortParameters};
use fmu_export::Number;

#[derive(Clone, Copy, Debug)]
pub struct Port<D = f64> {
    /// Effective area in m² when fully open.
    open_area: D,
    orifice: Orifice<D>,
}

impl<D: Number> Port<D> {
    /// A valve with the flow function of its gas.
    pub fn new(parameters: PortParameters<D>, orifice: Orifice<D>) -> Self {
        Self { open_area: parameters.area * parameters.discharge_coefficient, orifice }
    }

    /// The flow at an opening (0 … 1) from the first to the second side, each given by pressure (Pa) and
    /// temperature (K). The area is proportional to the opening.
    pub fn flow(&self, opening: D, first: (D, D), second: (D, D)) -> PortLocals<D> {
        let effective_area = opening * self.open_area;
        PortLocals { effective_area, mass_flow: self.orifice.mass_flow(effective_area, first, second) }
    }

    /// [`Self::flow`] for a known temperature ratio of isentropic flow from the first to the second side.
    pub fn flow_at(&self, opening: D, first: (D, D), second: (D, D), temperature_ratio: D) -> PortLocals<D> {
        let effective_area = opening * self.open_area;
        PortLocals {
            effective_area,
            mass_flow: self.orifice.mass_flow_at(effective_area, first, second, temperature_ratio),
        }
    }
}
