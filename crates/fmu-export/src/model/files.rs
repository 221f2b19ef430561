//! The files that a model reads through its context, where there is an operating system.

use fmu_solve::Error;
use fmu_solve::table::ReadResource;

use crate::model::context::Context;
use crate::model::resources::{self, Resources};

/// The longest file that a model reads unless it asks for more.
const MOST_BYTES: u64 = 256 << 20;

impl<'a> Context<'a> {
    /// This context with the files of an FMU.
    pub(crate) fn with_resources(mut self, resources: &'a Resources) -> Self {
        self.resources = Some(resources);
        self
    }

    /// The content of a file in the FMU's `resources` folder, given its path there; at most 256 MiB.
    ///
    /// # Errors
    /// If the path leads out of the folder, if the file cannot be read, is too large or is not a file, or if there is no
    /// FMU.
    pub fn resource(&self, name: &str) -> Result<Vec<u8>, Error> {
        self.resource_up_to(name, MOST_BYTES)
    }

    /// The content of a file in the FMU's `resources` folder, up to a size in bytes.
    ///
    /// # Errors
    /// As [`Context::resource`].
    pub fn resource_up_to(&self, name: &str, most: u64) -> Result<Vec<u8>, Error> {
        match self.resources {
            Some(resources) => resources.read(name, most),
            None => Err(Error::new(format!(
                "the resource {name} is part of the FMU, but the model runs without one"
            ))),
        }
    }

    /// The content of a user's file, such as one that a String parameter names: a path that is absolute, or relative to
    /// the importer's current folder; at most 256 MiB. Data that belong to the FMU are [resources](Self::resource).
    ///
    /// # Errors
    /// If the file cannot be read, is too large or is not a file.
    pub fn file(&self, path: &str) -> Result<Vec<u8>, Error> {
        self.file_up_to(path, MOST_BYTES)
    }

    /// The content of a user's file, up to a size in bytes.
    ///
    /// # Errors
    /// As [`Context::file`].
    pub fn file_up_to(&self, path: &str, most: u64) -> Result<Vec<u8>, Error> {
        resources::file(path, most)
    }
}

impl ReadResource for Context<'_> {
    fn resource(&self, name: &str) -> Result<Vec<u8>, Error> {
        Context::resource(self, name)
    }
}
