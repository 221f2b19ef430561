//! The package of a build script's model.

use std::env;

use fmu_terms::Precision;

/// The package of a model. The declaration need not repeat its metadata.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Package {
    /// The package's name.
    pub name: String,
    /// The package's version.
    pub version: String,
    /// The package's description, or empty.
    pub description: String,
    /// The package's authors, separated by colons, or empty.
    pub authors: String,
    /// The SPDX expression of the package's license, or empty.
    pub license: String,
    /// Whether it is compiled for a target without an operating system, and thus without files and a heap.
    pub is_bare_metal: bool,
    /// The precision of models without states.
    pub precision: Precision,
}

impl Package {
    /// The package whose build script runs, for double precision.
    ///
    /// # Panics
    /// Outside a build script.
    #[must_use]
    pub fn of_build_script() -> Self {
        let variable =
            |name| env::var(name).unwrap_or_else(|_| panic!("{name} is set for build scripts only"));
        Self {
            name: variable("CARGO_PKG_NAME"),
            version: variable("CARGO_PKG_VERSION"),
            description: variable("CARGO_PKG_DESCRIPTION"),
            authors: variable("CARGO_PKG_AUTHORS"),
            license: variable("CARGO_PKG_LICENSE"),
            is_bare_metal: variable("CARGO_CFG_TARGET_OS") == "none",
            precision: Precision::default(),
        }
    }
}
