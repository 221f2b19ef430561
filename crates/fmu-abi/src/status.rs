//! A function's return value, alike in every FMI version.

/// `fmi2Status` and `fmi3Status`, as returned to importers. From an importer it is a `c_int`, since it may be any
/// number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(C)]
#[allow(missing_docs)]
pub enum Status {
    #[default]
    Ok = 0,
    Warning = 1,
    Discard = 2,
    Error = 3,
    Fatal = 4,
    /// FMI 2.0 only.
    Pending = 5,
}
