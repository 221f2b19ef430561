//! Every function of `Number`, and in single precision of `Float`, for the firmware and for the computer that compares it.

/// Calls each function of two numbers.
macro_rules! functions {
    (
        $module:ident: $trait:ident of $number:ident $(<$any:ident>)?;
        one: $($one:ident)*;
        two: $($two:ident)*;
        other: $($other:ident: |$x:ident, $y:ident| $result:expr;)*
    ) => {
        pub mod $module {
            use fmu_export::$trait;

            /// The functions' names.
            #[allow(dead_code, reason = "the firmware does not name them")]
            pub const NAMES: &[&str] =
                &[$(stringify!($one),)* $(stringify!($two),)* $(stringify!($other),)*];

            /// The number of functions.
            pub const COUNT: usize =
                [$(stringify!($one),)* $(stringify!($two),)* $(stringify!($other),)*].len();

            /// The functions' results at two numbers, the first of which is that of functions of one.
            pub fn all$(<$any: $trait>)?(x: $number, y: $number) -> [$number; COUNT] {
                [
                    $($trait::$one(x),)*
                    $($trait::$two(x, y),)*
                    $({ let ($x, $y) = (x, y); $result },)*
                ]
            }
        }
    };
}

functions! {
    number: Number of T<T>;
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

functions! {
    float: Float of f32;
    one: acos acosh asin asinh atan atanh cbrt ceil cosh exp exp2 exp_m1 floor ln ln_1p log10 log2 round sinh sqrt tan tanh
        trunc;
    two: atan2 hypot powf rem_euclid div_euclid;
    other:
        powi: |x, y| Float::powi(x, 7) + Float::powi(y, -3);
        sin_cos: |x, y| { let (sine, cosine) = Float::sin_cos(x); sine * y + cosine };
        mul_add: |x, y| Float::mul_add(x, y, 0.125);
        decimal: |x, y| (Float::decimal(x) + Float::decimal(y)) as f32;
}
