//! Valves in the gas path: wastegates, bypass and surge valve, each an area that its opening uncovers.

use super::orifice::Orifice;
use super::scalar::Scalar;

/// A valve in the gas path.
#[derive(Clone, Copy, Debug)]
pub struct Port<D = f64> {
    /// Effective area in m² when fully open: area times discharge coefficient.
    pub open_area: D,
    /// The flow function.
    pub orifice: Orifice<D>,
}

/// What a valve does at an instant.
#[derive(Clone, Copy, Debug)]
pub struct PortFlow<D = f64> {
    /// Effective area in m².
    pub area: D,
    /// Flow in kg/s; negative: backwards.
    pub mass_flow: D,
}

impl<D: Scalar> Port<D> {
    /// The flow at an opening (0 … 1) from the first to the second side, each given by pressure (Pa) and
    /// temperature (K). The area is proportional to the opening.
    #[must_use]
    pub fn flow(&self, opening: D, first: (D, D), second: (D, D)) -> PortFlow<D> {
        let area = opening * self.open_area;
        PortFlow { area, mass_flow: self.orifice.mass_flow(area, first, second) }
    }

    /// The same where it is known by which ratio isentropic flow from the first to the second side changes the
    /// temperature.
    #[must_use]
    pub fn flow_at(&self, opening: D, first: (D, D), second: (D, D), temperature_ratio: D) -> PortFlow<D> {
        let area = opening * self.open_area;
        PortFlow { area, mass_flow: self.orifice.mass_flow_at(area, first, second, temperature_ratio) }
    }
}
