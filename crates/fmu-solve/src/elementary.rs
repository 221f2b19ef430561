//! The elementary functions of `f64` that core lacks: those of the standard library, or where there is none of `libm`.
//!
//! [`Number`](crate::Number) computes with these. Were it to call them as methods, it would find itself without the
//! standard library: `Number::exp` in `x.exp()`.

/// Calls a function of the standard library.
#[cfg(not(target_os = "none"))]
macro_rules! library {
    ($function:ident, $of_libm:ident, $x:ident $(, $y:ident)*) => { $x.$function($($y),*) };
}

/// Calls a function of `libm`.
#[cfg(target_os = "none")]
macro_rules! library {
    ($function:ident, $of_libm:ident, $x:ident $(, $y:ident)*) => { libm::$of_libm($x $(, $y)*) };
}

/// Defines functions, each with its name in `libm`.
macro_rules! functions {
    ($($function:ident($($x:ident),*) -> $result:ty = $of_libm:ident;)*) => {$(
        #[inline]
        pub(crate) fn $function($($x: f64),*) -> $result {
            library!($function, $of_libm, $($x),*)
        }
    )*};
}

functions! {
    acos(x) -> f64 = acos;
    acosh(x) -> f64 = acosh;
    asin(x) -> f64 = asin;
    asinh(x) -> f64 = asinh;
    atan(x) -> f64 = atan;
    atan2(y, x) -> f64 = atan2;
    atanh(x) -> f64 = atanh;
    cbrt(x) -> f64 = cbrt;
    ceil(x) -> f64 = ceil;
    cosh(x) -> f64 = cosh;
    exp(x) -> f64 = exp;
    exp2(x) -> f64 = exp2;
    exp_m1(x) -> f64 = expm1;
    floor(x) -> f64 = floor;
    hypot(x, y) -> f64 = hypot;
    ln(x) -> f64 = log;
    ln_1p(x) -> f64 = log1p;
    log10(x) -> f64 = log10;
    log2(x) -> f64 = log2;
    mul_add(x, factor, summand) -> f64 = fma;
    powf(x, exponent) -> f64 = pow;
    round(x) -> f64 = round;
    sin_cos(x) -> (f64, f64) = sincos;
    sinh(x) -> f64 = sinh;
    sqrt(x) -> f64 = sqrt;
    tan(x) -> f64 = tan;
    tanh(x) -> f64 = tanh;
    trunc(x) -> f64 = trunc;
}

/// A number to an integer power.
#[cfg(not(target_os = "none"))]
#[inline]
pub(crate) fn powi(x: f64, exponent: i32) -> f64 {
    x.powi(exponent)
}

/// A number to an integer power, by the products that compilers make of the standard library's.
#[cfg(target_os = "none")]
#[inline]
pub(crate) fn powi(x: f64, exponent: i32) -> f64 {
    let (mut power, mut square, mut left) = (1.0, x, exponent.unsigned_abs());
    while left > 0 {
        if left % 2 == 1 {
            power *= square;
        }
        square *= square;
        left /= 2;
    }
    if exponent < 0 { 1.0 / power } else { power }
}

/// The remainder from 0 up to the divisor's absolute value, as the standard library's.
#[inline]
pub(crate) fn rem_euclid(x: f64, divisor: f64) -> f64 {
    let remainder = x % divisor;
    if remainder < 0.0 { remainder + divisor.abs() } else { remainder }
}

/// The quotient without that remainder.
#[inline]
pub(crate) fn div_euclid(x: f64, divisor: f64) -> f64 {
    let quotient = trunc(x / divisor);
    if x % divisor >= 0.0 || quotient.is_nan() {
        quotient
    } else if divisor > 0.0 {
        quotient - 1.0
    } else {
        quotient + 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotients_and_remainders_are_those_of_the_standard_library() {
        let numbers = [-7.5, -2.0, -0.5, -0.0, 0.0, 0.25, 1.0, 3.0, 7.5, 1e300, f64::INFINITY, f64::NAN];
        for x in numbers {
            for divisor in numbers {
                let found = [rem_euclid(x, divisor), div_euclid(x, divisor)].map(f64::to_bits);
                let expected = [x.rem_euclid(divisor), x.div_euclid(divisor)].map(f64::to_bits);
                assert_eq!(found, expected, "{x} by {divisor}");
            }
        }
    }
}
