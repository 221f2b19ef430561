//! Macros for the generated structs of a model's variables, to keep the generated code small.

/// Maps generated structs, generic over their number type, number by number. Each field is a `number` (with an array's
/// sizes), `nested` (another such struct) or `other`.
#[doc(hidden)]
#[macro_export]
macro_rules! numbers {
    ($name:ident { $($kind:ident $field:ident $([$size:literal])*),* $(,)? }) => {
        impl<T: Copy> $name<T> {
            /// Maps each number of both.
            #[must_use]
            pub fn combine<S: Copy, U>(
                &self,
                other: &$name<S>,
                function: &mut impl FnMut(T, S) -> U,
            ) -> $name<U> {
                $name {
                    $($field: $crate::numbers!(@$kind self.$field, other.$field, function $(, $size)*),)*
                }
            }

            /// Maps each number.
            #[must_use]
            pub fn map<U>(&self, mut function: impl FnMut(T) -> U) -> $name<U> {
                self.combine(self, &mut |number, _| function(number))
            }
        }
    };
    (@number $one:expr, $other:expr, $function:ident) => { $function($one, $other) };
    (@number $one:expr, $other:expr, $function:ident, $size:literal $(, $inner:literal)*) => {
        ::core::array::from_fn::<_, $size, _>(|index| {
            $crate::numbers!(@number $one[index], $other[index], $function $(, $inner)*)
        })
    };
    (@nested $one:expr, $other:expr, $function:ident) => { $one.combine(&$other, $function) };
    (@other $one:expr, $other:expr, $function:ident) => { $one.clone() };
}

/// Converts a generated enumeration from and to its FMI values and bytes, so that a model can store one.
#[doc(hidden)]
#[macro_export]
macro_rules! enumeration {
    ($name:ident { $($item:ident = $value:literal),* $(,)? }) => {
        impl $name {
            /// The item with a value.
            #[must_use]
            pub fn from_value(value: i32) -> ::core::option::Option<Self> {
                match value {
                    $($value => ::core::option::Option::Some(Self::$item),)*
                    _ => ::core::option::Option::None,
                }
            }

            /// The item's value.
            #[must_use]
            pub fn value(self) -> i32 {
                self as i32
            }
        }

        /// The first item.
        impl ::core::default::Default for $name {
            fn default() -> Self {
                [$(Self::$item),*][0]
            }
        }

        impl $crate::persistence::Persistent for $name {
            fn persist(
                &mut self,
                archive: &mut $crate::persistence::Archive<'_>,
            ) -> ::core::result::Result<(), $crate::Error> {
                let mut value = self.value();
                value.persist(archive)?;
                *self = Self::from_value(value).ok_or_else(|| {
                    $crate::Error::new(format!("{value} is not an item of {}", stringify!($name)))
                })?;
                ::core::result::Result::Ok(())
            }
        }
    };
}
