//! The last call to an FMU, in a file by which the parent of this process learns which FMU ended it or hangs.
//!
//! The file is mapped into memory, which outlives the process however that ends: by a signal, `_exit`, or the parent. A
//! call writes there without a system call.

use std::cell::RefCell;
use std::ffi::c_void;
use std::fs::{self, File};
use std::io::{self, Write};
#[cfg(unix)]
use std::os::fd::AsRawFd;
#[cfg(windows)]
use std::os::windows::io::AsRawHandle;
use std::path::Path;
use std::slice;

use fmu_solve::display::Seconds;

/// The size of the file. Its first byte is the state; then come an FMU's name, which may be cut, the time, and a
/// function. A text ends with a NUL.
const SIZE: usize = 1024;
/// Where the name begins.
const NAME: usize = 1;
/// Where the time and the function begin.
const CALL: usize = 900;
// The states.
const IN_CALL: u8 = 1;
const AFTER_CALL: u8 = 2;

thread_local! {
    /// The mapped file, once this thread tells its calls.
    static MAPPED: RefCell<Option<Mapped>> = const { RefCell::new(None) };
}

struct Mapped {
    file: &'static mut [u8],
    /// The number of the FMU whose name is in the file.
    fmu: Option<usize>,
}

unsafe extern "C" {
    /// Defined in process.c.
    fn fmu_master_map(file: isize, size: usize) -> *mut c_void;
}

/// From now on, this thread tells its calls to FMUs in a new file, for [`LastCall::read`].
///
/// # Errors
/// When the file cannot be written or mapped.
pub fn tell_last_call(path: &Path) -> io::Result<()> {
    // A file with holes would need the disk later.
    fs::write(path, [0; SIZE])?;
    let file = File::options().read(true).write(true).open(path)?;
    #[cfg(unix)]
    let handle = isize::try_from(file.as_raw_fd()).map_err(io::Error::other)?;
    #[cfg(windows)]
    let handle = file.as_raw_handle() as isize;
    // SAFETY: the file is open and of this size; the mapping stays when it is closed.
    let mapped = unsafe { fmu_master_map(handle, SIZE) }.cast::<u8>();
    if mapped.is_null() {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: the mapping is of this size, stays for ever, and nothing else in this process uses it.
    let file = unsafe { slice::from_raw_parts_mut(mapped, SIZE) };
    MAPPED.set(Some(Mapped { file, fmu: None }));
    Ok(())
}

/// Makes a call to an FMU, and tells it: the FMU's number and name, and the function's name with the time reached (s), if
/// there is one.
pub fn told<T>(
    (fmu, name): (usize, &str),
    (function, time): (&str, Option<f64>),
    call: impl FnOnce() -> T,
) -> T {
    tell(|mapped| {
        if mapped.fmu != Some(fmu) {
            mapped.fmu = Some(fmu);
            put(&mut mapped.file[NAME..CALL], name);
        }
        let (place, text) = mapped.file[CALL..].split_at_mut(size_of::<f64>());
        // What is not a number is no time.
        place.copy_from_slice(&time.unwrap_or(f64::NAN).to_le_bytes());
        put(text, function);
        mapped.file[0] = IN_CALL;
    });
    let result = call();
    tell(|mapped| mapped.file[0] = AFTER_CALL);
    result
}

fn tell(what: impl FnOnce(&mut Mapped)) {
    MAPPED.with_borrow_mut(|mapped| mapped.as_mut().map(what));
}

/// Writes a text and a NUL, as far as they fit.
fn put(mut place: &mut [u8], text: &str) {
    for part in [text, "\0"] {
        let _ = place.write_all(part.as_bytes());
    }
}

/// The last call to an FMU by a process that has told its calls.
#[derive(Debug, PartialEq, Eq)]
pub struct LastCall {
    /// The name of the instance, or of the library while there is none.
    pub fmu: String,
    /// The function, with the time reached if there is one.
    pub call: String,
    /// Whether the call has returned.
    pub has_returned: bool,
}

impl LastCall {
    /// Reads the file of [`tell_last_call`]; none if there is none, or no call was told.
    #[must_use]
    pub fn read(path: &Path) -> Option<Self> {
        let told = fs::read(path).ok()?;
        let (state, name) = (told.first()?, told.get(NAME..CALL)?);
        let (time, function) = told.get(CALL..)?.split_first_chunk()?;
        let text = |place: &[u8]| {
            let text = place.split(|byte| *byte == 0).next().unwrap_or_default();
            String::from_utf8_lossy(text).into_owned()
        };
        let (fmu, mut call, time) = (text(name), text(function), f64::from_le_bytes(*time));
        if !time.is_nan() {
            call += &format!(" at {} s", Seconds(time));
        }
        match *state {
            IN_CALL => Some(Self { fmu, call, has_returned: false }),
            AFTER_CALL => Some(Self { fmu, call, has_returned: true }),
            _ => None,
        }
    }
}
