//! The functions of an FMU's library, by the tables of calls of each version.

use fmu_terms::{Interface, Version, Word};

/// Declares the names in a version's table of calls, each with what has the function: the library, all instances, or
/// those of an interface.
macro_rules! names {
    ($table:ident $($owner:ident { $($name:ident $parameters:tt $(-> $result:ty)? $(: $phases:tt)?;)* })*) => {
        const $table: &[(&str, &str)] = &[$($((stringify!($owner), stringify!($name)),)*)*];
    };
}

fmu_abi::fmi2_calls!(names, FMI2);
fmu_abi::fmi3_calls!(names, FMI3);

fn table(version: Version) -> &'static [(&'static str, &'static str)] {
    match version {
        Version::Two => FMI2,
        Version::Three => FMI3,
    }
}

/// All functions of a version.
pub fn functions(version: Version) -> impl Iterator<Item = &'static str> {
    table(version).iter().map(|(_, name)| *name)
}

/// The functions that a library exports for the interfaces of its model identifier; in FMI 3.0 all.
pub fn exported_functions(version: Version, interfaces: &[Interface]) -> impl Iterator<Item = &'static str> {
    let is_exported = move |owner: &str| {
        ["Library", "All"].contains(&owner)
            || Interface::of(owner).is_some_and(|owner| interfaces.contains(&owner))
    };
    let exported =
        table(version).iter().filter(move |(owner, _)| version == Version::Three || is_exported(owner));
    exported.map(|(_, name)| *name)
}
