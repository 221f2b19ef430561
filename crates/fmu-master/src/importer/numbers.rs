//! Numbers in the types that FMUs read and write.

use std::ffi::c_void;

use fmu_terms::DataType;

/// Declares a type of numbers for each kind of memory that an FMU reads and writes.
macro_rules! numbers {
    ($($memory:ident($number:ty)),*) => {
        /// Numbers of one type, as an FMU reads and writes them.
        pub enum Numbers {
            $($memory(Vec<$number>)),*
        }

        /// The type of [`Numbers`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Memory {
            $($memory),*
        }

        impl Numbers {
            pub fn new(memory: Memory) -> Self {
                match memory {
                    $(Memory::$memory => Self::$memory(vec![])),*
                }
            }

            pub fn memory(&self) -> Memory {
                match self {
                    $(Self::$memory(_) => Memory::$memory),*
                }
            }

            pub fn len(&self) -> usize {
                match self {
                    $(Self::$memory(values) => values.len()),*
                }
            }

            /// Appends zeros.
            pub fn extend(&mut self, count: usize) {
                match self {
                    $(Self::$memory(values) => values.resize(values.len() + count, <$number>::default())),*
                }
            }

            pub fn get(&self, index: usize) -> f64 {
                match self {
                    $(Self::$memory(values) => values[index].to_real()),*
                }
            }

            pub fn set(&mut self, index: usize, value: f64) {
                match self {
                    $(Self::$memory(values) => values[index] = <$number>::of_real(value)),*
                }
            }

            /// Refuses to be memory of another type, or of fewer values than there are references.
            ///
            /// # Panics
            /// If it is.
            pub fn refuse_other(&self, memory: Memory, references: usize) {
                assert_eq!(self.memory(), memory, "values of this type");
                assert!(references <= self.len(), "each reference has its value");
            }

            pub fn address(&self) -> *const c_void {
                match self {
                    $(Self::$memory(values) => values.as_ptr().cast()),*
                }
            }

            pub fn address_to_write(&mut self) -> *mut c_void {
                match self {
                    $(Self::$memory(values) => values.as_mut_ptr().cast()),*
                }
            }
        }
    };
}

numbers! {
    F64(f64), F32(f32), I8(i8), U8(u8), I16(i16), U16(u16), I32(i32), U32(u32), I64(i64), U64(u64)
}

/// A type of numbers that a version of FMI has functions for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NumberType {
    /// The place among the types of the version.
    pub place: usize,
    pub data_type: DataType,
    /// The memory of the type's values.
    pub memory: Memory,
}

/// A number that is exchanged as a Real; a whole one becomes the nearest that the type has.
trait Number {
    fn to_real(self) -> f64;
    fn of_real(value: f64) -> Self;
}

impl Number for f64 {
    fn to_real(self) -> f64 {
        self
    }

    fn of_real(value: f64) -> Self {
        value
    }
}

/// Implements [`Number`] by casts, after rounding for whole numbers. Casts saturate.
macro_rules! number_by_cast {
    ($round:expr, $($number:ty),*) => {
        $(
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
            #[allow(clippy::cast_lossless)]
            impl Number for $number {
                fn to_real(self) -> f64 {
                    self as f64
                }

                fn of_real(value: f64) -> Self {
                    let round: fn(f64) -> f64 = $round;
                    round(value) as Self
                }
            }
        )*
    };
}

number_by_cast!(|value| value, f32);
number_by_cast!(f64::round, i8, u8, i16, u16, i32, u32, i64, u64);
