//! The diagram of the coupled system: the controller at the upper left, the plant at the lower right.
//!
//! ```text
//!   ┌────────────┐
//!   │ controller ├───────┐ commands
//!   └─┬───────┬──┘       │
//!     │       └──────┐   │
//!     │  measurements│   │
//!     │            ┌─┴───┴─┐
//!   ──┴────────────┤ plant ├── other outputs
//!   other inputs   └───────┘
//! ```
//!
//! The components span the canvas, because OMSimulator refuses files with another canvas size.

use fmu_package::Placement;

/// The distance of neighbouring lines in mm.
const PITCH: f64 = 10.0;
/// The smallest width of a component in mm, for its name.
const SMALLEST: f64 = 60.0;

/// The number of connectors at each side.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Inputs from the environment to the controller only.
    pub controller_inputs: usize,
    /// Inputs from the environment to the plant only.
    pub plant_inputs: usize,
    /// Inputs from the environment to both components.
    pub shared_inputs: usize,
    /// Signals from the controller to the plant.
    pub commands: usize,
    /// Signals from the plant to the controller.
    pub measurements: usize,
    /// Outputs from the plant to the environment only.
    pub plant_outputs: usize,
}

/// The placement of components and connectors, in mm from the canvas's lower left corner.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    counts: Counts,
    /// The controller's rectangle.
    pub controller: Placement,
    /// The plant's rectangle.
    pub plant: Placement,
}

impl Layout {
    /// Places components with these numbers of connectors.
    pub fn new(counts: Counts) -> Self {
        let span = |connectors: usize| PITCH * (connectors + 1) as f64;
        let plant_height =
            span(counts.plant_inputs + counts.shared_inputs).max(span(counts.plant_outputs)).max(SMALLEST);
        let plant_width = span(counts.measurements + counts.commands).max(SMALLEST);
        let controller_height = span(counts.controller_inputs).max(span(counts.commands)).max(SMALLEST);
        let controller_width = span(counts.shared_inputs + counts.measurements).max(SMALLEST);
        let gap = span(2 * counts.measurements);
        let bottom = plant_height + gap;
        let left = controller_width + 4.0 * PITCH;
        Self {
            counts,
            controller: Placement {
                lower_left: (0.0, bottom),
                upper_right: (controller_width, bottom + controller_height),
            },
            plant: Placement { lower_left: (left, 0.0), upper_right: (left + plant_width, plant_height) },
        }
    }

    /// The right edge of the canvas.
    fn right(&self) -> f64 {
        self.plant.upper_right.0
    }

    /// A connector for an input of the controller only, at its left side.
    pub fn controller_input(&self, index: usize) -> (f64, f64) {
        (0.0, self.controller.upper_right.1 - PITCH * (index + 1) as f64)
    }

    /// The connectors for an input of both: the system's, the controller's at its lower side, the plant's at
    /// its left side.
    pub fn shared_input(&self, index: usize) -> [(f64, f64); 3] {
        let system = self.plant_input(self.counts.plant_inputs + index);
        let controller = (PITCH * (index + 1) as f64, self.controller.lower_left.1);
        [(0.0, system.1), controller, (self.plant.lower_left.0, system.1)]
    }

    /// A connector for an input of the plant only, at its left side.
    pub fn plant_input(&self, index: usize) -> (f64, f64) {
        (self.plant.lower_left.0, self.plant.upper_right.1 - PITCH * (index + 1) as f64)
    }

    /// The connectors of a command: the controller's at its right side, the plant's at its upper side, the
    /// system's at the right edge.
    pub fn command(&self, index: usize) -> [(f64, f64); 3] {
        let controller =
            (self.controller.upper_right.0, self.controller.upper_right.1 - PITCH * (index + 1) as f64);
        // The uppermost line goes to the connector at the far right: no two lines cross.
        let from_right = PITCH * (index + 1) as f64;
        let plant = (self.plant.upper_right.0 - from_right, self.plant.upper_right.1);
        [controller, plant, (self.right(), controller.1)]
    }

    /// The connectors of a measurement: the plant's at its upper side, the controller's at its lower side, the
    /// system's at the right edge; and the height of the line between the first two.
    pub fn measurement(&self, index: usize) -> ([(f64, f64); 3], f64) {
        let from_left = PITCH * (index + 1) as f64;
        let plant = (self.plant.lower_left.0 + from_left, self.plant.upper_right.1);
        let controller =
            (PITCH * (self.counts.shared_inputs + index + 1) as f64, self.controller.lower_left.1);
        let height = plant.1 + from_left;
        let system = (self.right(), height + PITCH * self.counts.measurements as f64);
        ([plant, controller, system], height)
    }

    /// A connector for another output of the plant, at its right side.
    pub fn plant_output(&self, index: usize) -> (f64, f64) {
        (self.right(), self.plant.upper_right.1 - PITCH * (index + 1) as f64)
    }

    pub fn canvas(&self) -> Placement {
        Placement { lower_left: (0.0, 0.0), upper_right: (self.right(), self.controller.upper_right.1) }
    }
}

/// A point's relative position in a rectangle, from 0 to 1.
pub fn relative((x, y): (f64, f64), Placement { lower_left, upper_right }: Placement) -> (f64, f64) {
    ((x - lower_left.0) / (upper_right.0 - lower_left.0), (y - lower_left.1) / (upper_right.1 - lower_left.1))
}
