//! FMUs under other names and units.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use fmu_package::{FmuDescription, Translation};

/// Gives an FMU different names and units, so that it fits a scenario written for another FMU.
pub trait NameMap: fmt::Debug + Send + Sync {
    /// The FMU in these names and units.
    ///
    /// # Errors
    /// When the FMU is not the one that the map is for.
    fn translation(&self, fmu: &FmuDescription) -> Result<Translation>;

    /// The map as a text, the same for equal maps: the key of [`LoadedFmus`](crate::LoadedFmus).
    fn text(&self) -> String;
}

/// Reads the file of a map, which a scenario names. A program without maps returns an error.
pub type ReadMap = fn(&Path) -> Result<Arc<dyn NameMap>>;
