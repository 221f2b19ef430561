//! The elementary functions that core lacks: those of the standard library, or where there is none of `libm`.
//!
//! [`Number`](crate::Number) computes with these. Were it to call them as methods, it would find itself without the
//! standard library: `Number::exp` in `x.exp()`.

use crate::display::parsed;

/// Calls a function of the standard library.
#[cfg(not(target_os = "none"))]
macro_rules! library {
    ($function:ident, $of_libm:ident, $x:ident $(, $y:ident)*) => { $x.$function($($y),*) };
}

/// Calls a function of `libm`.
#[cfg(target_os = "none")]
macro_rules! library {
    ($function:ident, $of_libm:ident, $x:ident $(, $y:ident)*) => { of_libm::$of_libm($x $(, $y)*) };
}

#[cfg(target_os = "none")]
mod of_libm {
    pub(super) use libm::*;

    /// That of `libm` gives numbers for some below 1, where there are none.
    pub(super) fn acoshf(x: f32) -> f32 {
        if x < 1.0 { f32::NAN } else { libm::acoshf(x) }
    }
}

/// Defines the trait of functions, each with its names in `libm` for `f64` and for `f32`.
macro_rules! float {
    ($($function:ident($self:ident $(, $y:ident)*) -> $result:ty = $double:ident, $single:ident;)*) => {
        /// The functions of `f64` and `f32` that core lacks: for a model that also runs without the standard library, with
        /// numbers of either type, as `Float::sqrt(x)`.
        ///
        /// Where there is a standard library they are its functions.
        pub trait Float: Copy {
            $(
                #[doc = concat!("As [`f64::", stringify!($function), "`].")]
                #[must_use]
                fn $function(self $(, $y: Self)*) -> $result;
            )*

            /// As [`f64::powi`], which need not round alike everywhere.
            #[must_use]
            fn powi(self, exponent: i32) -> Self;

            /// The number with this one's shortest decimal: 0.01 for the `f32` that is nearest to it. For a sample period,
            /// which would otherwise end before or after the steps that it should meet.
            #[must_use]
            fn decimal(self) -> f64;

            /// As [`f64::rem_euclid`].
            #[must_use]
            fn rem_euclid(self, divisor: Self) -> Self;

            /// As [`f64::div_euclid`].
            #[must_use]
            fn div_euclid(self, divisor: Self) -> Self;
        }

        float!(@for f64, |number| number; $($function($self $(, $y)*) -> $result = $double;)*);
        float!(@for f32, |number| parsed(format_args!("{number:?}"), number.into()); $($function($self $(, $y)*) -> $result = $single;)*);
    };
    (
        @for $number:ty, |$of:ident| $decimal:expr;
        $($function:ident($self:ident $(, $y:ident)*) -> $result:ty = $of_libm:ident;)*
    ) => {
        impl Float for $number {
            $(
                #[inline]
                fn $function($self $(, $y: Self)*) -> $result {
                    library!($function, $of_libm, $self $(, $y)*)
                }
            )*

            #[cfg(not(target_os = "none"))]
            #[inline]
            fn powi(self, exponent: i32) -> Self {
                self.powi(exponent)
            }

            /// By the products that compilers make of the standard library's.
            #[cfg(target_os = "none")]
            #[inline]
            fn powi(self, exponent: i32) -> Self {
                let (mut power, mut square, mut left) = (1.0, self, exponent.unsigned_abs());
                while left > 0 {
                    if left % 2 == 1 {
                        power *= square;
                    }
                    square *= square;
                    left /= 2;
                }
                if exponent < 0 { 1.0 / power } else { power }
            }

            #[inline]
            fn decimal(self) -> f64 {
                let $of = self;
                $decimal
            }

            #[inline]
            fn rem_euclid(self, divisor: Self) -> Self {
                let remainder = self % divisor;
                if remainder < 0.0 { remainder + divisor.abs() } else { remainder }
            }

            #[inline]
            fn div_euclid(self, divisor: Self) -> Self {
                let quotient = Float::trunc(self / divisor);
                if self % divisor >= 0.0 || quotient.is_nan() {
                    quotient
                } else if divisor > 0.0 {
                    quotient - 1.0
                } else {
                    quotient + 1.0
                }
            }
        }
    };
}

float! {
    acos(self) -> Self = acos, acosf;
    acosh(self) -> Self = acosh, acoshf;
    asin(self) -> Self = asin, asinf;
    asinh(self) -> Self = asinh, asinhf;
    atan(self) -> Self = atan, atanf;
    atan2(self, x) -> Self = atan2, atan2f;
    atanh(self) -> Self = atanh, atanhf;
    cbrt(self) -> Self = cbrt, cbrtf;
    ceil(self) -> Self = ceil, ceilf;
    cosh(self) -> Self = cosh, coshf;
    exp(self) -> Self = exp, expf;
    exp2(self) -> Self = exp2, exp2f;
    exp_m1(self) -> Self = expm1, expm1f;
    floor(self) -> Self = floor, floorf;
    hypot(self, y) -> Self = hypot, hypotf;
    ln(self) -> Self = log, logf;
    ln_1p(self) -> Self = log1p, log1pf;
    log10(self) -> Self = log10, log10f;
    log2(self) -> Self = log2, log2f;
    mul_add(self, factor, summand) -> Self = fma, fmaf;
    powf(self, exponent) -> Self = pow, powf;
    round(self) -> Self = round, roundf;
    sin_cos(self) -> (Self, Self) = sincos, sincosf;
    sinh(self) -> Self = sinh, sinhf;
    sqrt(self) -> Self = sqrt, sqrtf;
    tan(self) -> Self = tan, tanf;
    tanh(self) -> Self = tanh, tanhf;
    trunc(self) -> Self = trunc, truncf;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decimal_survives_single_precision() {
        // A third has more digits than an `f32` keeps.
        for (single, decimal) in [
            (0.001_f32, 0.001_f64),
            (0.005, 0.005),
            (0.01, 0.01),
            (0.0125, 0.0125),
            (1.0 / 3.0, 0.333_333_34),
            (1e-6, 1e-6),
            (86400.0, 86400.0),
        ] {
            assert_eq!(Float::decimal(single).to_bits(), decimal.to_bits(), "{single}");
            assert_eq!(Float::decimal(decimal).to_bits(), decimal.to_bits());
        }
        assert!(Float::decimal(f32::INFINITY).is_infinite() && Float::decimal(f32::NAN).is_nan());
    }

    #[test]
    fn quotients_and_remainders_are_those_of_the_standard_library() {
        let numbers = [-7.5, -2.0, -0.5, -0.0, 0.0, 0.25, 1.0, 3.0, 7.5, 1e300, f64::INFINITY, f64::NAN];
        for x in numbers {
            for divisor in numbers {
                let found = [Float::rem_euclid(x, divisor), Float::div_euclid(x, divisor)].map(f64::to_bits);
                let expected = [x.rem_euclid(divisor), x.div_euclid(divisor)].map(f64::to_bits);
                assert_eq!(found, expected, "{x} by {divisor}");
            }
        }
    }
}
