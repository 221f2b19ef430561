//! Serialization: writes and reads a model, its variables and the runtime's data of an instance, so that a saved state
//! outlives its process (FMI 2.0.5, section 2.1.8).
//!
//! One function serves both directions: [`Persistent::persist`] names each part of a value once, and the [`Archive`]
//! takes or replaces its bits. `#[derive(Persistent)]` writes that function for a struct or enum.

use std::collections::TryReserveError;

use crate::error::Error;

/// Bytes being written, or read back.
///
/// Numbers are little-endian.
#[derive(Debug)]
pub struct Archive<'a>(Direction<'a>);

#[derive(Debug)]
enum Direction<'a> {
    Writing(Vec<u8>),
    /// The remaining bytes.
    Reading(&'a [u8]),
}

impl<'a> Archive<'a> {
    /// An archive for writing.
    #[must_use]
    pub fn writing() -> Self {
        Self(Direction::Writing(Vec::new()))
    }

    /// An archive for reading.
    #[must_use]
    pub fn reading(bytes: &'a [u8]) -> Self {
        Self(Direction::Reading(bytes))
    }

    /// The written bytes; none when reading.
    #[must_use]
    pub fn into_bytes(self) -> Vec<u8> {
        match self.0 {
            Direction::Writing(bytes) => bytes,
            Direction::Reading(_) => Vec::new(),
        }
    }

    /// Whether everything was read.
    #[must_use]
    pub fn is_exhausted(&self) -> bool {
        matches!(self.0, Direction::Reading([]) | Direction::Writing(_))
    }

    /// Whether values are read and replaced; else they are written.
    #[must_use]
    pub fn is_reading(&self) -> bool {
        matches!(self.0, Direction::Reading(_))
    }

    /// Writes bytes, or replaces them by the next ones read.
    ///
    /// # Errors
    /// When fewer are left to read.
    pub fn bytes(&mut self, bytes: &mut [u8]) -> Result<(), Error> {
        match &mut self.0 {
            Direction::Writing(written) => {
                written.try_reserve(bytes.len()).map_err(no_memory)?;
                written.extend_from_slice(bytes);
            }
            Direction::Reading(left) => {
                let (next, rest) = left.split_at_checked(bytes.len()).ok_or_else(too_short)?;
                bytes.copy_from_slice(next);
                *left = rest;
            }
        }
        Ok(())
    }

    /// Writes a number of elements, or reads one, at most the number of remaining bytes.
    fn length(&mut self, length: usize) -> Result<usize, Error> {
        let mut number = length as u64;
        number.persist(self)?;
        match &self.0 {
            Direction::Writing(_) => Ok(length),
            Direction::Reading(left) => {
                usize::try_from(number).ok().filter(|&number| number <= left.len()).ok_or_else(too_short)
            }
        }
    }
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
    let failed = |error| Error::new(format!("{name} in the serialized state: {error}"));
    if !archive.is_reading() {
        let mut bytes = postcard::to_allocvec(value).map_err(failed)?;
        archive.length(bytes.len())?;
        return archive.bytes(&mut bytes);
    }
    let mut bytes = vec![0; archive.length(0)?];
    archive.bytes(&mut bytes)?;
    let (read, rest) = postcard::take_from_bytes(&bytes).map_err(failed)?;
    if !rest.is_empty() {
        return Err(Error::new(format!("{name} in the serialized state ends too early")));
    }
    *value = read;
    Ok(())
}

fn no_memory(_: TryReserveError) -> Error {
    Error::new("out of memory: the state does not fit")
}

fn too_short() -> Error {
    Error::new("the serialized state ends too early")
}

/// A value whose bits can be written and read back. The value read equals the one written, bit for bit.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be saved with a model's state: write `#[derive(Clone, Debug, Default, Persistent)]` above it",
    label = "not `Persistent`",
    note = "numbers, strings, tuples, arrays, `Vec` and `Option` are `Persistent`; a field that follows from others can have \
            `#[persistent(skip)]`"
)]
pub trait Persistent {
    /// Passes every part of the value to the archive, always in the same order.
    ///
    /// # Errors
    /// When the bytes are not such a value.
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error>;
}

/// Like `#[derive(Persistent)]`, for generated code and this crate, which avoid procedural macros. A missing field is
/// a compile error; those after `without` are left out.
#[doc(hidden)]
#[macro_export]
macro_rules! persistent {
    (<$($parameter:ident: $bound:path),*> $type:ty { $($field:ident),* $(,)? } $(without $($left:ident),*)?) => {
        impl<$($parameter: $bound),*> $crate::Persistent for $type {
            #[allow(unused_variables)]
            fn persist(
                &mut self,
                archive: &mut $crate::persistence::Archive<'_>,
            ) -> ::core::result::Result<(), $crate::Error> {
                let Self { $($field,)* $($($left: _,)*)? } = self;
                $($crate::Persistent::persist($field, archive)?;)*
                ::core::result::Result::Ok(())
            }
        }
    };
    ($type:ty { $($field:ident),* $(,)? }) => {
        $crate::persistent! { <> $type { $($field),* } }
    };
}

macro_rules! numbers {
    ($($number:ty),*) => {$(
        impl Persistent for $number {
            fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
                let mut bytes = self.to_le_bytes();
                archive.bytes(&mut bytes)?;
                *self = Self::from_le_bytes(bytes);
                Ok(())
            }
        }
    )*};
}

numbers!(u8, u16, u32, u64, i8, i16, i32, i64, f32, f64);

/// Saved as a `u64`, so that the bytes are the same on every platform.
impl Persistent for usize {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let mut number = *self as u64;
        number.persist(archive)?;
        *self = Self::try_from(number).map_err(|_| {
            Error::new(format!("{number} in the serialized state is too large for this platform"))
        })?;
        Ok(())
    }
}

macro_rules! tuples {
    ($(($($part:ident),*))*) => {$(
        impl<$($part: Persistent),*> Persistent for ($($part,)*) {
            #[allow(non_snake_case)]
            fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
                let ($($part,)*) = self;
                $($part.persist(archive)?;)*
                Ok(())
            }
        }
    )*};
}

tuples! { (A) (A, B) (A, B, C) (A, B, C, D) }

impl Persistent for bool {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let mut byte = u8::from(*self);
        byte.persist(archive)?;
        *self = match byte {
            0 => false,
            1 => true,
            other => return Err(Error::new(format!("{other} in the serialized state is not a Boolean"))),
        };
        Ok(())
    }
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

impl<T: Persistent + Default> Persistent for Option<T> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let mut is_some = self.is_some();
        is_some.persist(archive)?;
        if is_some {
            self.get_or_insert_default().persist(archive)
        } else {
            *self = None;
            Ok(())
        }
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

/// The elements only: their number is not part of the value.
impl<T: Persistent> Persistent for [T] {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        self.iter_mut().try_for_each(|element| element.persist(archive))
    }
}

impl<T: Persistent, const N: usize> Persistent for [T; N] {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        self.as_mut_slice().persist(archive)
    }
}
