//! The number types of a model's equations: `f64` gives values, and [`Dual`] also their exact derivatives.

use core::cmp::Ordering;
use core::f64::consts::{LN_2, LN_10};
use core::fmt::Debug;
use core::iter::{Product, Sum};
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::elementary::Float;

/// A summand that changes no value, not even the sign of 0. It carries an operand's contribution to the derivative
/// only.
const NOTHING: f64 = -0.0;

/// A real number in a model's equations, with the functions of `f64` that have derivatives.
///
/// Numbers compare by value. At a kink, such as that of [`Number::abs`] at 0, the derivative is that of the branch
/// that gives the value.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a number of equations",
    label = "not a `Number`",
    note = "equations compute with `f64` and the exporter's own number types; `T::from` makes a number of an `f64`"
)]
pub trait Number:
    Copy
    + Debug
    + From<f64>
    + PartialEq
    + PartialEq<f64>
    + PartialOrd
    + PartialOrd<f64>
    + Neg<Output = Self>
    + Add<Output = Self>
    + Add<f64, Output = Self>
    + Sub<Output = Self>
    + Sub<f64, Output = Self>
    + Mul<Output = Self>
    + Mul<f64, Output = Self>
    + Div<Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + Sum
    + for<'a> Sum<&'a Self>
    + Product
    + for<'a> Product<&'a Self>
{
    /// The value only.
    #[must_use]
    fn value(self) -> f64;

    /// A function of this number, given its value and derivative there, for functions that this trait does not have,
    /// such as an integral; [`table`](crate::table) has interpolation.
    #[must_use]
    fn mapped(self, value: f64, derivative: f64) -> Self;

    /// Whether the number is a constant of this value, without a derivative: for shortcuts that would lose derivatives.
    #[must_use]
    fn is_constant(self, value: f64) -> bool;

    /// 1 divided by the number.
    #[must_use]
    fn recip(self) -> Self {
        let value = self.value().recip();
        self.mapped(value, -value * value)
    }

    /// The exponential function.
    #[must_use]
    fn exp(self) -> Self {
        let value = Float::exp(self.value());
        self.mapped(value, value)
    }

    /// The natural logarithm.
    #[must_use]
    fn ln(self) -> Self {
        self.mapped(Float::ln(self.value()), self.value().recip())
    }

    /// The exponential function minus 1, exact near 0.
    #[must_use]
    fn exp_m1(self) -> Self {
        self.mapped(Float::exp_m1(self.value()), Float::exp(self.value()))
    }

    /// 2 to the power of the number.
    #[must_use]
    fn exp2(self) -> Self {
        let value = Float::exp2(self.value());
        self.mapped(value, value * LN_2)
    }

    /// The natural logarithm of 1 plus the number, exact near 0.
    #[must_use]
    fn ln_1p(self) -> Self {
        self.mapped(Float::ln_1p(self.value()), (1.0 + self.value()).recip())
    }

    /// The logarithm to the base 2.
    #[must_use]
    fn log2(self) -> Self {
        self.mapped(Float::log2(self.value()), (self.value() * LN_2).recip())
    }

    /// The logarithm to the base 10.
    #[must_use]
    fn log10(self) -> Self {
        self.mapped(Float::log10(self.value()), (self.value() * LN_10).recip())
    }

    /// The square root.
    #[must_use]
    fn sqrt(self) -> Self {
        let value = Float::sqrt(self.value());
        self.mapped(value, 0.5 / value)
    }

    /// The cubic root.
    #[must_use]
    fn cbrt(self) -> Self {
        let value = Float::cbrt(self.value());
        self.mapped(value, (3.0 * value * value).recip())
    }

    /// The hypotenuse of a right triangle with these legs; if both are 0, its slope is 0.
    #[must_use]
    fn hypot(self, other: impl Into<Self>) -> Self {
        let other = other.into();
        let value = Float::hypot(self.value(), other.value());
        let slope = |leg: f64| if value == 0.0 { 0.0 } else { leg / value };
        self.mapped(value, slope(self.value())) + other.mapped(NOTHING, slope(other.value()))
    }

    /// The number to a constant integer power.
    #[must_use]
    fn powi(self, exponent: i32) -> Self {
        let derivative =
            if exponent == 0 { 0.0 } else { f64::from(exponent) * Float::powi(self.value(), exponent - 1) };
        self.mapped(Float::powi(self.value(), exponent), derivative)
    }

    /// The number to a power.
    #[must_use]
    fn powf(self, exponent: impl Into<Self>) -> Self {
        let exponent = exponent.into();
        let (base, power) = (self.value(), exponent.value());
        let value = Float::powf(base, power);
        let by_base = if power == 0.0 { 0.0 } else { power * Float::powf(base, power - 1.0) };
        let by_exponent = if base == 0.0 { 0.0 } else { value * Float::ln(base) };
        self.mapped(value, by_base) + exponent.mapped(NOTHING, by_exponent)
    }

    /// The sine of an angle in radians.
    #[must_use]
    fn sin(self) -> Self {
        let (sine, cosine) = Float::sin_cos(self.value());
        self.mapped(sine, cosine)
    }

    /// The cosine of an angle in radians.
    #[must_use]
    fn cos(self) -> Self {
        let (sine, cosine) = Float::sin_cos(self.value());
        self.mapped(cosine, -sine)
    }

    /// Sine and cosine of an angle in radians.
    #[must_use]
    fn sin_cos(self) -> (Self, Self) {
        (self.sin(), self.cos())
    }

    /// The tangent of an angle in radians.
    #[must_use]
    fn tan(self) -> Self {
        let value = Float::tan(self.value());
        self.mapped(value, 1.0 + value * value)
    }

    /// The arcsine, in radians.
    #[must_use]
    fn asin(self) -> Self {
        let value = self.value();
        self.mapped(Float::asin(value), Float::sqrt(1.0 - value * value).recip())
    }

    /// The arccosine, in radians.
    #[must_use]
    fn acos(self) -> Self {
        let value = self.value();
        self.mapped(Float::acos(value), -Float::sqrt(1.0 - value * value).recip())
    }

    /// The arctangent, in radians.
    #[must_use]
    fn atan(self) -> Self {
        let value = self.value();
        self.mapped(Float::atan(value), (1.0 + value * value).recip())
    }

    /// The angle in radians of the point with this ordinate and the given abscissa.
    #[must_use]
    fn atan2(self, x: impl Into<Self>) -> Self {
        let x = x.into();
        let square = self.value() * self.value() + x.value() * x.value();
        let value = Float::atan2(self.value(), x.value());
        self.mapped(value, x.value() / square) + x.mapped(NOTHING, -self.value() / square)
    }

    /// An angle in radians as degrees.
    #[must_use]
    fn to_degrees(self) -> Self {
        self.mapped(self.value().to_degrees(), 1.0_f64.to_degrees())
    }

    /// An angle in degrees as radians.
    #[must_use]
    fn to_radians(self) -> Self {
        self.mapped(self.value().to_radians(), 1.0_f64.to_radians())
    }

    /// The hyperbolic sine.
    #[must_use]
    fn sinh(self) -> Self {
        self.mapped(Float::sinh(self.value()), Float::cosh(self.value()))
    }

    /// The hyperbolic cosine.
    #[must_use]
    fn cosh(self) -> Self {
        self.mapped(Float::cosh(self.value()), Float::sinh(self.value()))
    }

    /// The hyperbolic tangent.
    #[must_use]
    fn tanh(self) -> Self {
        let value = Float::tanh(self.value());
        self.mapped(value, 1.0 - value * value)
    }

    /// The inverse hyperbolic sine.
    #[must_use]
    fn asinh(self) -> Self {
        let value = self.value();
        self.mapped(Float::asinh(value), Float::hypot(value, 1.0).recip())
    }

    /// The inverse hyperbolic cosine.
    #[must_use]
    fn acosh(self) -> Self {
        let value = self.value();
        self.mapped(Float::acosh(value), Float::sqrt(value * value - 1.0).recip())
    }

    /// The inverse hyperbolic tangent.
    #[must_use]
    fn atanh(self) -> Self {
        let value = self.value();
        self.mapped(Float::atanh(value), (1.0 - value * value).recip())
    }

    /// The number times a factor plus a summand, rounded once.
    #[must_use]
    fn mul_add(self, factor: impl Into<Self>, summand: impl Into<Self>) -> Self {
        let (factor, summand) = (factor.into(), summand.into());
        let value = Float::mul_add(self.value(), factor.value(), summand.value());
        self.mapped(value, factor.value())
            + factor.mapped(NOTHING, self.value())
            + summand.mapped(NOTHING, 1.0)
    }

    /// The remainder of the division by another number, from 0 up to its absolute value, for example for an angle
    /// within one turn. It jumps; if the jump matters, make it an event.
    #[must_use]
    fn rem_euclid(self, divisor: impl Into<Self>) -> Self {
        let divisor = divisor.into();
        let quotient = Float::div_euclid(self.value(), divisor.value());
        self.mapped(Float::rem_euclid(self.value(), divisor.value()), 1.0)
            + divisor.mapped(NOTHING, -quotient)
    }

    /// The largest integer that is not larger. It jumps; if the jump matters, make it an event.
    #[must_use]
    fn floor(self) -> Self {
        self.mapped(Float::floor(self.value()), 0.0)
    }

    /// The smallest integer that is not smaller. It jumps; if the jump matters, make it an event.
    #[must_use]
    fn ceil(self) -> Self {
        self.mapped(Float::ceil(self.value()), 0.0)
    }

    /// The nearest integer; of two, that farther from 0. It jumps; if the jump matters, make it an event.
    #[must_use]
    fn round(self) -> Self {
        self.mapped(Float::round(self.value()), 0.0)
    }

    /// The integer part. It jumps; if the jump matters, make it an event.
    #[must_use]
    fn trunc(self) -> Self {
        self.mapped(Float::trunc(self.value()), 0.0)
    }

    /// The sign: 1 or -1, even for 0 and -0. It jumps; if the jump matters, make it an event.
    #[must_use]
    fn signum(self) -> Self {
        self.mapped(self.value().signum(), 0.0)
    }

    /// The number with the sign of another.
    #[must_use]
    fn copysign(self, sign: impl Into<Self>) -> Self {
        let sign = sign.into().value();
        if self.value().is_sign_negative() == sign.is_sign_negative() { self } else { -self }
    }

    /// The absolute value.
    #[must_use]
    fn abs(self) -> Self {
        self.copysign(1.0)
    }

    /// The larger of two numbers; this one if equal.
    #[must_use]
    fn max(self, other: impl Into<Self>) -> Self {
        let other = other.into();
        if other > self { other } else { self }
    }

    /// The smaller of two numbers; this one if equal.
    #[must_use]
    fn min(self, other: impl Into<Self>) -> Self {
        let other = other.into();
        if other < self { other } else { self }
    }

    /// The number, limited to a range. Unlike `f64::clamp` it does not panic when trial values cross the bounds: it
    /// then returns the upper one.
    #[must_use]
    fn clamp(self, min: impl Into<Self>, max: impl Into<Self>) -> Self {
        self.max(min).min(max)
    }
}

impl Number for f64 {
    #[inline]
    fn value(self) -> f64 {
        self
    }

    #[inline]
    fn mapped(self, value: f64, _derivative: f64) -> f64 {
        value
    }

    #[inline]
    #[allow(clippy::float_cmp, reason = "shortcuts are for exact values")]
    fn is_constant(self, value: f64) -> bool {
        self == value
    }
}

/// A number with its derivative along a direction (a dual number).
#[derive(Clone, Copy, Debug, Default)]
pub struct Dual {
    /// The value.
    pub value: f64,
    /// The derivative along the direction.
    pub derivative: f64,
}

impl Dual {
    /// A value with its derivative.
    #[must_use]
    pub fn new(value: f64, derivative: f64) -> Self {
        Self { value, derivative }
    }
}

impl Number for Dual {
    #[inline]
    fn value(self) -> f64 {
        self.value
    }

    #[inline]
    fn mapped(self, value: f64, derivative: f64) -> Self {
        // A constant has the derivative 0 even where the function's is infinite, like that of the root at 0.
        let derivative = if self.derivative == 0.0 { 0.0 } else { derivative * self.derivative };
        Self { value, derivative }
    }

    #[inline]
    fn is_constant(self, value: f64) -> bool {
        self.value.is_constant(value) && self.derivative == 0.0
    }
}

impl From<f64> for Dual {
    #[inline]
    fn from(value: f64) -> Self {
        Self { value, derivative: 0.0 }
    }
}

impl Neg for Dual {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self { value: -self.value, derivative: -self.derivative }
    }
}

/// Implements what a type of numbers with a value needs to be a [`Number`]: comparisons by value, and, from the results
/// of the operations on two numbers, those on a number and `f64` and those in place.
macro_rules! arithmetic {
    (
        $number:ty;
        $($operation:ident $function:ident $assign:ident $assign_function:ident: |$a:ident, $b:ident| $result:expr;)*
    ) => {
        impl PartialEq for $number {
            #[inline]
            fn eq(&self, other: &Self) -> bool {
                self.value == other.value
            }
        }

        impl PartialEq<f64> for $number {
            #[inline]
            fn eq(&self, other: &f64) -> bool {
                self.value == *other
            }
        }

        impl PartialOrd for $number {
            #[inline]
            fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
                self.value.partial_cmp(&other.value)
            }
        }

        impl PartialOrd<f64> for $number {
            #[inline]
            fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
                self.value.partial_cmp(other)
            }
        }

        impl ::core::iter::Sum for $number {
            /// Starts from −0.0, as the sum of `f64` does.
            fn sum<I: Iterator<Item = Self>>(numbers: I) -> Self {
                numbers.fold(Self::from(-0.0), Add::add)
            }
        }

        impl<'a> ::core::iter::Sum<&'a Self> for $number {
            fn sum<I: Iterator<Item = &'a Self>>(numbers: I) -> Self {
                numbers.copied().sum()
            }
        }

        impl ::core::iter::Product for $number {
            fn product<I: Iterator<Item = Self>>(numbers: I) -> Self {
                numbers.fold(Self::from(1.0), Mul::mul)
            }
        }

        impl<'a> ::core::iter::Product<&'a Self> for $number {
            fn product<I: Iterator<Item = &'a Self>>(numbers: I) -> Self {
                numbers.copied().product()
            }
        }

        $(
            impl $operation for $number {
                type Output = Self;

                #[inline]
                fn $function(self, other: Self) -> Self {
                    let ($a, $b) = (self, other);
                    $result
                }
            }

            impl $operation<f64> for $number {
                type Output = Self;

                #[inline]
                fn $function(self, other: f64) -> Self {
                    self.$function(Self::from(other))
                }
            }

            impl $assign for $number {
                #[inline]
                fn $assign_function(&mut self, other: Self) {
                    *self = self.$function(other);
                }
            }
        )*
    };
}

#[cfg(not(target_os = "none"))]
pub(crate) use arithmetic;

arithmetic! {
    Dual;
    Add add AddAssign add_assign:
        |a, b| Self { value: a.value + b.value, derivative: a.derivative + b.derivative };
    Sub sub SubAssign sub_assign:
        |a, b| Self { value: a.value - b.value, derivative: a.derivative - b.derivative };
    Mul mul MulAssign mul_assign:
        |a, b| Self { value: a.value * b.value, derivative: a.derivative * b.value + a.value * b.derivative };
    Div div DivAssign div_assign: |a, b| {
        let value = a.value / b.value;
        Self { value, derivative: (a.derivative - value * b.derivative) / b.value }
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tape::Tape;

    /// Compares a function's derivative at a point by central differences and by dual numbers.
    fn check(name: &str, function: impl Fn(f64) -> f64, dual: impl Fn(Dual) -> Dual, at: f64) {
        let found = dual(Dual::new(at, 3.0));
        assert_eq!(found.value.to_bits(), function(at).to_bits(), "{name}: another value");
        let step = 1e-5;
        let expected = 3.0 * (function(at + step) - function(at - step)) / (2.0 * step);
        // The differences' error: step²/6 of the third derivative, and rounding divided by the step; both below 1e-9
        // for functions, and derivatives, of order 10.
        assert!(
            (found.derivative - expected).abs() < 3e-8,
            "{name}: {} instead of {expected}",
            found.derivative
        );
    }

    macro_rules! check {
        ($at:literal: $($number:ident => $function:expr),* $(,)?) => {
            $(check(stringify!($function), |$number: f64| $function, |$number: Dual| $function, $at);)*
        };
    }

    #[test]
    fn derivatives_agree_with_differences() {
        check!(0.7:
            x => Number::recip(x), x => Number::exp(x), x => Number::ln(x), x => Number::sqrt(x),
            x => Number::powi(x, 3), x => Number::powi(x, -2), x => Number::powi(x, 0), x => Number::powf(x, 1.7),
            x => Number::sin(x), x => Number::cos(x), x => Number::tan(x), x => Number::asin(x),
            x => Number::acos(x), x => Number::atan(x), x => Number::sinh(x), x => Number::cosh(x),
            x => Number::tanh(x), x => Number::abs(x), x => Number::max(x, 0.5), x => Number::max(x, 0.9),
            x => Number::min(x, 0.5), x => Number::min(x, 0.9), x => Number::atan2(x, x * x + 1.0),
            x => x * x - x / (x + 2.0), x => -(x - 1.5) / x * 2.0 / 3.0,
            x => Number::powf(x, x + 1.0), x => Number::exp_m1(x), x => Number::exp2(x), x => Number::ln_1p(x),
            x => Number::log2(x), x => Number::log10(x), x => Number::cbrt(x), x => Number::hypot(x, x * x),
            x => Number::to_radians(x), x => Number::asinh(x), x => Number::acosh(x + 1.0), x => Number::atanh(x),
            x => Number::sin_cos(x).0, x => Number::sin_cos(x).1, x => Number::mul_add(x, x + 2.0, x * x),
            x => Number::rem_euclid(x * 4.0, x + 0.3), x => Number::signum(x), x => Number::copysign(x, -1.0),
            x => Number::clamp(x, 0.1, 0.9), x => Number::clamp(x, x * 2.0, 5.0), x => Number::clamp(x, 0.1, 0.5),
            x => Number::to_degrees(x * 0.1),
        );
        check!(-1.3:
            x => Number::abs(x), x => Number::powi(x, 3), x => Number::tanh(x), x => Number::cbrt(x),
            x => Number::hypot(x, 0.5), x => Number::rem_euclid(x, 0.5), x => Number::rem_euclid(x, -0.5),
            x => Number::signum(x), x => Number::copysign(x, 2.0), x => Number::clamp(x, -1.0, 1.0), x => Number::asinh(x),
        );
    }

    /// Each function's value is that of `f64`, to the last bit, even for special values.
    #[test]
    fn values_are_those_of_f64() {
        macro_rules! same {
            ($($function:ident($($argument:expr),*)),* $(,)?) => {$(
                for x in [0.7, -1.3, 0.0, -0.0, 2.5, 1e300, f64::INFINITY, f64::NAN] {
                    let (own, number) = (f64::$function(x, $($argument),*), Number::$function(x, $($argument),*));
                    let dual = Number::$function(Dual::new(x, 1.0), $($argument),*).value;
                    let tape = Tape::new();
                    let recorded = Number::$function(tape.variable(x), $($argument),*).value();
                    for found in [number, dual, recorded] {
                        let is_same = found.to_bits() == own.to_bits() || found.is_nan() && own.is_nan();
                        assert!(is_same, "{} of {x}: {found} instead of {own}", stringify!($function));
                    }
                }
            )*};
        }
        same!(
            recip(),
            exp(),
            exp_m1(),
            exp2(),
            ln(),
            ln_1p(),
            log2(),
            log10(),
            sqrt(),
            cbrt(),
            powi(3),
            powf(1.7),
            hypot(0.5),
            sin(),
            cos(),
            tan(),
            asin(),
            acos(),
            atan(),
            atan2(0.5),
            to_degrees(),
            to_radians(),
            sinh(),
            cosh(),
            tanh(),
            asinh(),
            acosh(),
            atanh(),
            mul_add(3.0, -1.0),
            rem_euclid(0.5),
            signum(),
            copysign(-1.0),
            abs(),
            clamp(-1.0, 1.0),
        );
    }

    #[test]
    fn sums_and_products_are_those_of_f64() {
        let numbers = [0.1, 0.7, -1.3, 1e-17];
        let duals = numbers.map(|number| Dual::new(number, 1.0));
        let (sum, product): (Dual, Dual) = (duals.iter().sum(), duals.into_iter().product());
        assert_eq!(sum.value.to_bits(), numbers.iter().sum::<f64>().to_bits());
        assert_eq!(product.value.to_bits(), numbers.iter().product::<f64>().to_bits());
        assert_eq!(sum.derivative.to_bits(), 4.0_f64.to_bits());
        let none: [Dual; 0] = [];
        assert_eq!(none.iter().sum::<Dual>().value.to_bits(), [0.0; 0].iter().sum::<f64>().to_bits());
    }

    #[test]
    fn bounds_that_cross_and_legs_of_length_zero_are_no_failure() {
        assert_eq!(Number::clamp(Dual::new(0.5, 1.0), 1.0, -1.0), -1.0);
        assert_eq!(Number::hypot(Dual::new(0.0, 1.0), 0.0).derivative.to_bits(), 0.0_f64.to_bits());
        assert_eq!(
            Number::powf(Dual::from(0.0), Dual::new(2.0, 1.0)).derivative.to_bits(),
            0.0_f64.to_bits()
        );
    }

    #[test]
    fn only_numbers_without_a_derivative_are_constants() {
        let tape = Tape::new();
        assert!(Number::is_constant(0.0, -0.0) && !Number::is_constant(0.0, 1.0));
        assert!(Dual::from(2.0).is_constant(2.0) && !Dual::new(2.0, 1.0).is_constant(2.0));
        assert!(crate::Recorded::from(2.0).is_constant(2.0) && !tape.variable(2.0).is_constant(2.0));
    }

    #[test]
    fn what_does_not_change_has_no_derivative_where_the_slope_is_infinite() {
        assert_eq!(Number::sqrt(Dual::from(0.0)).derivative.to_bits(), 0.0_f64.to_bits());
        assert!(Number::sqrt(Dual::new(0.0, 1.0)).derivative.is_infinite());
    }
}
