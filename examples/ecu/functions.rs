//! Every function of `Number`, for the firmware and for the computer that compares it.

use fmu_export::Number;

/// Calls each function of two numbers.
macro_rules! functions {
    (
        one: $($one:ident)*;
        two: $($two:ident)*;
        other: $($other:ident: |$x:ident, $y:ident| $result:expr;)*
    ) => {
        /// The functions' names.
        #[allow(dead_code, reason = "the firmware does not name them")]
        pub const NAMES: &[&str] = &[$(stringify!($one),)* $(stringify!($two),)* $(stringify!($other),)*];

        /// The number of functions.
        pub const COUNT: usize = [$(stringify!($one),)* $(stringify!($two),)* $(stringify!($other),)*].len();

        /// The functions' results at two numbers, the first of which is that of functions of one.
        pub fn all<T: Number>(x: T, y: T) -> [T; COUNT] {
            [
                $(Number::$one(x),)*
                $(Number::$two(x, y),)*
                $({ let ($x, $y) = (x, y); $result },)*
            ]
        }
    };
}

functions! {
    one: recip exp ln exp_m1 exp2 ln_1p log2 log10 sqrt cbrt sin cos tan asin acos atan to_degrees to_radians sinh cosh tanh
        asinh acosh atanh floor ceil round trunc signum abs;
    two: hypot powf atan2 rem_euclid copysign max min;
    other:
        value: |x, _y| T::from(x.value());
        mapped: |x, y| x.mapped(y.value(), 3.0);
        is_constant: |x, y| T::from(f64::from(u8::from(x.is_constant(0.5)) + 2 * u8::from(y.is_constant(0.5))));
        powi: |x, y| Number::powi(x, 7) + Number::powi(y, -3);
        sin_cos: |x, y| { let (sine, cosine) = Number::sin_cos(x); sine * y + cosine };
        mul_add: |x, y| Number::mul_add(x, y, 0.125);
        clamp: |x, y| Number::clamp(x, -0.25, y);
}
