//! FMUs' libraries with their functions, of one version and interface.

use std::ffi::CString;
use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use fmu_io::temporary::Folder;
use fmu_terms::{DataType, Interface, Version};

use super::super::messages::Missing;
use super::super::numbers::NumberType;
use super::component::{Instantiation, NotMade, UseOfEvents};
use super::interfaces::{Functions, Handle};
use super::library::{Library, Numbered};
use super::{fmi2, fmi3};

/// The library of an FMU, loaded for one interface.
pub struct Loaded {
    functions: Arc<dyn Functions>,
    library: Arc<Library>,
}

impl Loaded {
    /// Loads a library in an FMU's folder for co-simulation or Model Exchange.
    ///
    /// # Errors
    /// When it cannot be loaded, or lacks a function.
    pub fn new(folder: Folder, path: &Path, version: Version, interface: Interface) -> Result<Self> {
        let library = Library::load(folder, path)?;
        // SAFETY: the library is of this version.
        let functions = unsafe {
            match version {
                Version::Two => fmi2::load(&library.symbols, interface)?,
                Version::Three => fmi3::load(&library.symbols, interface)?,
            }
        };
        Ok(Self { functions, library: Arc::new(library) })
    }

    /// Makes an instance of a name, a GUID or instantiation token, and where the resources are.
    ///
    /// # Errors
    /// If the FMU refuses.
    pub fn instantiate(&self, texts: [CString; 3], events: UseOfEvents) -> Result<Handle, NotMade> {
        let library = Arc::clone(&self.library);
        let instantiation = Instantiation { library, texts, events };
        // SAFETY: the functions were looked up in this library.
        unsafe { Arc::clone(&self.functions).instantiate(instantiation) }
    }

    /// The FMU's folder.
    pub fn folder(&self) -> &Path {
        self.library.folder.path()
    }

    /// Refuses a library that cannot tell its texts.
    pub fn refuse_no_texts(&self) -> Result<(), Missing> {
        self.functions.refuse_no_texts()
    }

    /// Refuses a library without Event Mode in co-simulation.
    pub fn refuse_no_event_mode(&self) -> Result<(), Missing> {
        self.functions.refuse_no_event_mode()
    }

    /// The functions for a variable's type, if they are those of a type of numbers.
    pub fn number_type(&self, data_type: DataType) -> Option<NumberType> {
        let numbers = self.functions.numbers();
        let found = |wanted| numbers.iter().position(|number| number.data_type == wanted);
        // An enumeration has the functions of the version's integers.
        let place = match data_type {
            DataType::Enumeration => found(DataType::Int64).or_else(|| found(DataType::Integer)),
            data_type => found(data_type),
        }?;
        let Numbered { data_type, memory, .. } = numbers[place];
        Some(NumberType { place, data_type, memory })
    }
}
