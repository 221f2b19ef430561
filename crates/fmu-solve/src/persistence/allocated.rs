//! Values whose memory is allocated, and archives that grow.

use std::collections::TryReserveError;

use super::{Archive, Direction, Persistent, too_short};
use crate::error::Error;

impl Archive<'_> {
    /// An archive for writing.
    #[must_use]
    pub fn writing() -> Self {
        Self(Direction::Writing(Vec::new()))
    }

    /// The written bytes; none when reading or filling.
    #[must_use]
    pub fn into_bytes(self) -> Vec<u8> {
        match self.0 {
            Direction::Writing(bytes) => bytes,
            Direction::Reading(_) | Direction::Filling(_) => Vec::new(),
        }
    }

    /// Writes a number of elements, or reads one, at most the number of remaining bytes.
    fn length(&mut self, length: usize) -> Result<usize, Error> {
        let mut number = length as u64;
        number.persist(self)?;
        match &self.0 {
            Direction::Writing(_) | Direction::Filling(_) => Ok(length),
            Direction::Reading(left) => {
                usize::try_from(number).ok().filter(|&number| number <= left.len()).ok_or_else(too_short)
            }
        }
    }
}

/// Appends bytes to those written.
pub(super) fn append(written: &mut Vec<u8>, bytes: &[u8]) -> Result<(), Error> {
    written.try_reserve(bytes.len()).map_err(no_memory)?;
    written.extend_from_slice(bytes);
    Ok(())
}

/// Persists a value by serde, in the format of `postcard`, which keeps the bits of each number. What is read takes no
/// more memory than its type does for as many bytes.
///
/// # Errors
/// When the value cannot be written, or the bytes are not such a value.
#[cfg(feature = "serde")]
pub fn persist_by_serde<T>(value: &mut T, archive: &mut Archive<'_>) -> Result<(), Error>
where
    T: serde::Serialize + serde::de::DeserializeOwned,
{
    let name = core::any::type_name::<T>();
    let failed = |error| Error::new(format_args!("{name} in the serialized state: {error}"));
    if !archive.is_reading() {
        let mut bytes = postcard::to_allocvec(value).map_err(failed)?;
        archive.length(bytes.len())?;
        return archive.bytes(&mut bytes);
    }
    let mut bytes = vec![0; archive.length(0)?];
    archive.bytes(&mut bytes)?;
    let (read, rest) = postcard::take_from_bytes(&bytes).map_err(failed)?;
    if !rest.is_empty() {
        return Err(Error::new(format_args!("{name} in the serialized state ends too early")));
    }
    *value = read;
    Ok(())
}

fn no_memory(_: TryReserveError) -> Error {
    Error::new("out of memory: the state does not fit")
}

impl Persistent for String {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let mut bytes = core::mem::take(self).into_bytes();
        let length = archive.length(bytes.len())?;
        bytes.try_reserve(length.saturating_sub(bytes.len())).map_err(no_memory)?;
        bytes.resize(length, 0);
        archive.bytes(&mut bytes)?;
        *self = Self::from_utf8(bytes)
            .map_err(|_| Error::new("a string in the serialized state is not valid UTF-8"))?;
        Ok(())
    }
}

impl<T: Persistent + ?Sized> Persistent for Box<T> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        (**self).persist(archive)
    }
}

impl<T: Persistent + Default> Persistent for Vec<T> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let length = archive.length(self.len())?;
        self.try_reserve(length.saturating_sub(self.len())).map_err(no_memory)?;
        self.resize_with(length, T::default);
        self.as_mut_slice().persist(archive)
    }
}
