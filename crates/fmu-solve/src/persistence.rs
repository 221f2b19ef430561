//! Serialization: writes and reads a model, its variables and the runtime's data of an instance, so that a saved state
//! outlives its process (FMI 2.0.5, section 2.1.8).
//!
//! One function serves both directions: [`Persistent::persist`] names each part of a value once, and the [`Archive`]
//! takes or replaces its bits. `#[derive(Persistent)]` writes that function for a struct or enum.

use crate::error::Error;

#[cfg(not(target_os = "none"))]
mod allocated;

#[cfg(feature = "serde")]
pub use allocated::persist_by_serde;

/// Bytes being written, or read back.
///
/// Numbers are little-endian.
#[derive(Debug)]
pub struct Archive<'a>(Direction<'a>);

#[derive(Debug)]
enum Direction<'a> {
    #[cfg(not(target_os = "none"))]
    Writing(Vec<u8>),
    /// The bytes that are not yet written.
    Filling(&'a mut [u8]),
    /// The remaining bytes.
    Reading(&'a [u8]),
}

impl<'a> Archive<'a> {
    /// An archive that fills bytes.
    #[must_use]
    pub fn filling(bytes: &'a mut [u8]) -> Self {
        Self(Direction::Filling(bytes))
    }

    /// An archive for reading.
    #[must_use]
    pub fn reading(bytes: &'a [u8]) -> Self {
        Self(Direction::Reading(bytes))
    }

    /// How many bytes are left to read or to fill; none when writing.
    #[must_use]
    pub fn left(&self) -> usize {
        match &self.0 {
            #[cfg(not(target_os = "none"))]
            Direction::Writing(_) => 0,
            Direction::Filling(left) => left.len(),
            Direction::Reading(left) => left.len(),
        }
    }

    /// Whether everything was read, or all bytes are filled.
    #[must_use]
    pub fn is_exhausted(&self) -> bool {
        self.left() == 0
    }

    /// Whether values are read and replaced; else they are written.
    #[must_use]
    pub fn is_reading(&self) -> bool {
        matches!(self.0, Direction::Reading(_))
    }

    /// Writes bytes, or replaces them by the next ones read.
    ///
    /// # Errors
    /// When fewer are left to fill or to read.
    pub fn bytes(&mut self, bytes: &mut [u8]) -> Result<(), Error> {
        match &mut self.0 {
            #[cfg(not(target_os = "none"))]
            Direction::Writing(written) => allocated::append(written, bytes)?,
            Direction::Filling(left) => {
                let (next, rest) =
                    core::mem::take(left).split_at_mut_checked(bytes.len()).ok_or_else(too_short)?;
                next.copy_from_slice(bytes);
                *left = rest;
            }
            Direction::Reading(left) => {
                let (next, rest) = left.split_at_checked(bytes.len()).ok_or_else(too_short)?;
                bytes.copy_from_slice(next);
                *left = rest;
            }
        }
        Ok(())
    }
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
            Error::new(format_args!("{number} in the serialized state is too large for this platform"))
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
            other => {
                return Err(Error::new(format_args!("{other} in the serialized state is not a Boolean")));
            }
        };
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
