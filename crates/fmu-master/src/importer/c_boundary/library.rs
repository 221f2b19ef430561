//! An FMU's library: how it is loaded, and how functions are looked up in it.

use std::ffi::{c_int, c_void};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Result, anyhow};
use fmu_abi::ValueReference;
use fmu_io::temporary::Folder;
use fmu_terms::DataType;

use super::super::messages::Missing;
use super::super::numbers::Memory;
use super::live::{Call, Live};
use super::logger::CallbackFunctions;
use super::process::contained;

/// Why a library was not loaded. One from `PythonFMU` expects Python in the process.
fn not_loaded(error: libloading::Error) -> anyhow::Error {
    // The loader's text is the source of the error.
    let text = format!("{:#}", anyhow::Error::new(error));
    let remedy = if ["_Py", "Py"].iter().any(|symbol| text.contains(&format!("undefined symbol: {symbol}"))) {
        "; FMUs of PythonFMU expect Python's library in the process: put LD_PRELOAD=libpython3.11.so, with the path and \
         the version of yours, before the command"
    } else {
        ""
    };
    let package = missing_package(&text)
        .map_or(String::new(), |package| format!("; Debian and Ubuntu have it in the package {package}"));
    anyhow!("its library cannot be loaded: {text}{remedy}{package}")
}

/// Libraries that FMUs of Fortran, C++ and others need, with the beginnings of the names of their packages, which the number
/// of the library's version follows.
const PACKAGES: [(&str, &str); 9] = [
    ("libgfortran.so.", "libgfortran"),
    ("libquadmath.so.", "libquadmath"),
    ("libgomp.so.", "libgomp"),
    ("libstdc++.so.", "libstdc++"),
    ("libc++.so.", "libc++"),
    ("libblas.so.", "libblas"),
    ("liblapack.so.", "liblapack"),
    ("libtinfo.so.", "libtinfo"),
    ("libncurses.so.", "libncurses"),
];

/// The package with a missing library, from the loader's message.
fn missing_package(text: &str) -> Option<String> {
    let library =
        text.split(": cannot open shared object file").next().filter(|name| name.len() < text.len())?;
    let library = library.rsplit(' ').next()?;
    PACKAGES.iter().find_map(|(prefix, package)| {
        let version = library.strip_prefix(prefix)?;
        Some(format!("{package}{}", version.split('.').next()?))
    })
}

/// A function of a library.
#[derive(Clone, Copy)]
pub struct Function<F> {
    pub name: &'static str,
    pub pointer: F,
}

/// A loaded library, in which functions are looked up.
pub struct Symbols(libloading::Library);

impl Symbols {
    /// A function that the library must have.
    ///
    /// # Safety
    /// `F` is the type that the standard declares for this name.
    pub unsafe fn get<F: Copy>(&self, name: &'static str) -> Result<Function<F>, Missing> {
        // SAFETY: the caller's promise.
        let symbol = unsafe { self.0.get::<F>(name) };
        symbol.map(|symbol| Function { name, pointer: *symbol }).map_err(|_| Missing(name))
    }
}

/// Declares the functions of a version that a library has together, with their names, and how they are looked up.
macro_rules! functions {
    ($version:ident: $($(#[$meta:meta])* $table:ident { $($field:ident: $name:ident),* $(,)? })*) => {$(
        $(#[$meta])*
        #[derive(Clone, Copy)]
        struct $table {
            $($field: Function<types::$version::$name>),*
        }

        impl $table {
            /// # Safety
            /// The library is one of the version.
            unsafe fn load(symbols: &Symbols) -> Result<Self, Missing> {
                // SAFETY: the standard declares these types for these names.
                unsafe { Ok(Self { $($field: symbols.get::<types::$version::$name>(stringify!($name))?),* }) }
            }
        }
    )*};
}
pub(super) use functions;

// Of every type of numbers: a pointer to numbers is one to bytes.
type References = *const ValueReference;

/// The functions of a type of numbers, in FMI 2.0 and 3.0, where the number of values follows.
pub type Get2 = unsafe extern "C" fn(*mut c_void, References, usize, *mut c_void) -> c_int;
pub type Set2 = unsafe extern "C" fn(*mut c_void, References, usize, *const c_void) -> c_int;
pub type Get3 = unsafe extern "C" fn(*mut c_void, References, usize, *mut c_void, usize) -> c_int;
pub type Set3 = unsafe extern "C" fn(*mut c_void, References, usize, *const c_void, usize) -> c_int;

/// A type of numbers that a version has functions for.
pub struct Numbered {
    pub data_type: DataType,
    /// The memory of its values.
    pub memory: Memory,
    /// The names of the functions that get and set it.
    pub get: &'static str,
    pub set: &'static str,
}

impl Numbered {
    pub const fn new(data_type: DataType, memory: Memory, get: &'static str, set: &'static str) -> Self {
        Self { data_type, memory, get, set }
    }

    /// The functions that get and set the type.
    ///
    /// # Safety
    /// `Get` and `Set` are the types that the version declares for these names.
    pub unsafe fn load<Get: Copy, Set: Copy>(
        &self,
        symbols: &Symbols,
    ) -> Result<(Function<Get>, Function<Set>), Missing> {
        // SAFETY: the caller's promise.
        unsafe { Ok((symbols.get(self.get)?, symbols.get(self.set)?)) }
    }
}

/// The library of an FMU. As long as this exists, it stays loaded, and its folder stays.
pub struct Library {
    pub symbols: Symbols,
    // The callbacks of freed instances, for later ones. Dropped after the library, whose code may use them until it is
    // unloaded.
    callbacks: Mutex<Vec<Arc<CallbackFunctions>>>,
    _live: Live,
    pub folder: Folder,
}

impl Library {
    /// Loads a library in a folder.
    ///
    /// # Errors
    /// When it cannot be loaded.
    pub fn load(folder: Folder, path: &Path) -> Result<Self> {
        let live = Live::new(path.file_name().unwrap_or_default().to_string_lossy().into_owned());
        // SAFETY: loading runs the library's initializers; the user chose to run this FMU's code.
        let (library, _) = contained(|| live.call(Call::Load, || unsafe { libloading::Library::new(path) }));
        let symbols = Symbols(library.map_err(not_loaded)?);
        Ok(Self { symbols, callbacks: Mutex::default(), _live: live, folder })
    }

    /// Callbacks for an instance. An FMU may keep a pointer to them beyond it.
    pub fn callbacks(&self) -> Arc<CallbackFunctions> {
        self.freed().pop().unwrap_or_else(|| Arc::new(CallbackFunctions::new()))
    }

    /// Takes the callbacks of a freed instance.
    pub fn take_back(&self, callbacks: Arc<CallbackFunctions>) {
        self.freed().push(callbacks);
    }

    fn freed(&self) -> MutexGuard<'_, Vec<Arc<CallbackFunctions>>> {
        self.callbacks.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_library_is_in_a_package() {
        let message =
            |library: &str| format!("{library}: cannot open shared object file: No such file or directory");
        for (library, package) in [
            ("libgfortran.so.5", Some("libgfortran5")),
            ("libquadmath.so.0", Some("libquadmath0")),
            ("libstdc++.so.6", Some("libstdc++6")),
            ("libown.so.1", None),
        ] {
            assert_eq!(missing_package(&message(library)).as_deref(), package, "{library}");
        }
        assert_eq!(missing_package("libgfortran.so.5: wrong ELF class"), None);
    }
}
