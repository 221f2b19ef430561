//! Valves in the gas path: wastegates, bypass and surge valve, each an area that its opening uncovers.

use super::orifice::Orifice;

/// A valve in the gas path.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// Effective area in m² when fully open: area times discharge coefficient.
    pub open_area: f64,
    /// The flow function.
    pub orifice: Orifice,
}

/// What a valve does at an instant.
#[derive(Clone, Copy, Debug)]
pub struct PortFlow {
    /// Effective area in m².
    pub area: f64,
    /// Flow in kg/s; negative: backwards.
    pub mass_flow: f64,
}

impl Port {
    /// The flow at an opening (0 … 1) from the first to the second side, each given by pressure (Pa) and
    /// temperature (K). The area is proportional to the opening.
    #[must_use]
    pub fn flow(&self, opening: f64, first: (f64, f64), second: (f64, f64)) -> PortFlow {
        let area = opening * self.open_area;
        PortFlow { area, mass_flow: self.orifice.mass_flow(area, first, second) }
    }

    /// The same for the flap of the high-pressure wastegate, whose area grows with the square of the
    /// opening. With a linear law the boost pressure would react far more strongly to the first opening
    /// than to the rest, and the control loop relies on a gain that varies less.
    #[must_use]
    pub fn flap_flow(&self, opening: f64, first: (f64, f64), second: (f64, f64)) -> PortFlow {
        self.flow(opening * opening, first, second)
    }
}
