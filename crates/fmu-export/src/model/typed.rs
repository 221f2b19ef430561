//! Macros for the generated structs of a model's variables, to keep the generated code small.

/// A large array of a generated struct. It is on the heap, because an importer's thread may have a stack of only 1 MB.
///
/// # Panics
/// With another number of elements.
#[cfg(not(target_os = "none"))]
#[doc(hidden)]
#[must_use]
pub fn boxed<T, const N: usize>(elements: Vec<T>) -> Box<[T; N]> {
    elements.into_boxed_slice().try_into().ok().expect("there are as many elements as the type says")
}

/// A type that is the same over all number types, for an alias that names one. The alias passes its number type `T` as
/// `fn(T)`, which leaves it open in patterns, where no value determines it.
#[doc(hidden)]
pub trait OverAny<N> {
    /// The type.
    type Type;
}

impl<S, N> OverAny<N> for S {
    type Type = S;
}

/// A table of which some elements are equal: each run's length and element.
#[doc(hidden)]
#[must_use]
pub const fn repeated<T: Copy, const N: usize>(runs: &[(usize, T)]) -> [T; N] {
    let mut table = [runs[0].1; N];
    let (mut run, mut end, mut position) = (0, runs[0].0, 0);
    while position < N {
        while position == end {
            run += 1;
            end += runs[run].0;
        }
        table[position] = runs[run].1;
        position += 1;
    }
    table
}

/// The sum of magnitudes, in four parts that do not wait for each other.
#[doc(hidden)]
#[must_use]
pub fn sum_of_magnitudes<T: Copy + Into<f64>>(numbers: &[T]) -> f64 {
    let magnitude = |&number: &T| number.into().abs();
    let (fours, rest) = numbers.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for four in fours {
        for (sum, number) in sums.iter_mut().zip(four) {
            *sum += magnitude(number);
        }
    }
    sums.into_iter().chain(rest.iter().map(magnitude)).sum()
}

/// Maps generated structs, generic over their number type, number by number. Each field is a `number` (with an array's
/// sizes), `boxed` (a large array of them), `nested` (another such struct, or an array of these) or `other`.
#[doc(hidden)]
#[macro_export]
macro_rules! numbers {
    ($name:ident { $($kind:ident $field:ident $([$size:literal])*),* $(,)? }) => {
        impl<T: Copy> $name<T> {
            /// Maps each number with the other struct's.
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

            /// Calls a function with each number.
            pub fn for_each(&self, function: &mut impl FnMut(T)) {
                $($crate::numbers!(@each $kind self.$field, function $(, $size)*);)*
            }

            /// Calls a function with each number to change it.
            pub fn for_each_mut(&mut self, function: &mut impl FnMut(&mut T)) {
                $($crate::numbers!(@each_mut $kind self.$field, function $(, $size)*);)*
            }
        }
    };
    (@number $one:expr, $other:expr, $function:ident) => { $function($one, $other) };
    (@number $one:expr, $other:expr, $function:ident, $size:literal $(, $inner:literal)*) => {
        ::core::array::from_fn::<_, $size, _>(|index| {
            $crate::numbers!(@number $one[index], $other[index], $function $(, $inner)*)
        })
    };
    (@boxed $one:expr, $other:expr, $function:ident, $size:literal $(, $inner:literal)*) => {
        $crate::typed::boxed::<_, $size>(
            (0..$size)
                .map(|index| $crate::numbers!(@number $one[index], $other[index], $function $(, $inner)*))
                .collect()
        )
    };
    (@nested $one:expr, $other:expr, $function:ident) => { $one.combine(&$other, $function) };
    (@nested $one:expr, $other:expr, $function:ident, $size:literal) => {
        ::core::array::from_fn::<_, $size, _>(|index| $one[index].combine(&$other[index], $function))
    };
    (@other $one:expr, $other:expr, $function:ident) => { $one.clone() };
    (@each nested $value:expr, $function:ident) => { $value.for_each($function) };
    (@each other $value:expr, $function:ident) => {};
    (@each $kind:ident $value:expr, $function:ident) => { $function($value) };
    (@each $kind:ident $value:expr, $function:ident, $size:literal $(, $inner:literal)*) => {
        for element in $value.iter() {
            $crate::numbers!(@each $kind *element, $function $(, $inner)*);
        }
    };
    (@each_mut nested $value:expr, $function:ident) => { $value.for_each_mut($function) };
    (@each_mut other $value:expr, $function:ident) => {};
    (@each_mut $kind:ident $value:expr, $function:ident) => { $function(&mut $value) };
    (@each_mut $kind:ident $value:expr, $function:ident, $size:literal $(, $inner:literal)*) => {
        for element in $value.iter_mut() {
            $crate::numbers!(@each_mut $kind *element, $function $(, $inner)*);
        }
    };
}

/// Clones a generated struct field by field, so that `clone_from` reuses its memory.
#[doc(hidden)]
#[macro_export]
macro_rules! cloned {
    ($name:ident $(<$parameter:ident>)? { $($field:ident),* $(,)? }) => {
        impl$(<$parameter: ::core::clone::Clone>)? ::core::clone::Clone for $name$(<$parameter>)? {
            fn clone(&self) -> Self {
                Self { $($field: self.$field.clone(),)* }
            }

            fn clone_from(&mut self, source: &Self) {
                $(self.$field.clone_from(&source.$field);)*
            }
        }
    };
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
                    $crate::Error::new(::core::format_args!(
                        "{value} is not an item of {}",
                        ::core::stringify!($name)
                    ))
                })?;
                ::core::result::Result::Ok(())
            }
        }
    };
}
