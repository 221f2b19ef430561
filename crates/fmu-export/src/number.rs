//! The numbers that a model's equations are written in: with `f64` they give values, with [`Dual`] their exact
//! derivatives, too.

use core::cmp::Ordering;
use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A real number of a model's equations.
///
/// Numbers are compared by value. Where a function has a kink, such as [`Number::abs`] at 0, its derivative is that of
/// the branch which gives the value.
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
{
    /// The value alone.
    #[must_use]
    fn value(self) -> f64;

    /// A function of this number, from the function's value and its derivative at this number's value. For functions
    /// that this trait does not have, such as interpolation in a table.
    #[must_use]
    fn mapped(self, value: f64, derivative: f64) -> Self;

    /// 1 divided by the number.
    #[must_use]
    fn recip(self) -> Self {
        let value = self.value().recip();
        self.mapped(value, -value * value)
    }

    /// The exponential function.
    #[must_use]
    fn exp(self) -> Self {
        let value = self.value().exp();
        self.mapped(value, value)
    }

    /// The natural logarithm.
    #[must_use]
    fn ln(self) -> Self {
        self.mapped(self.value().ln(), self.value().recip())
    }

    /// The square root.
    #[must_use]
    fn sqrt(self) -> Self {
        let value = self.value().sqrt();
        self.mapped(value, 0.5 / value)
    }

    /// The number to a constant integer power.
    #[must_use]
    fn powi(self, exponent: i32) -> Self {
        let derivative =
            if exponent == 0 { 0.0 } else { f64::from(exponent) * self.value().powi(exponent - 1) };
        self.mapped(self.value().powi(exponent), derivative)
    }

    /// The number to a constant power.
    #[must_use]
    fn powf(self, exponent: f64) -> Self {
        let derivative = if exponent == 0.0 { 0.0 } else { exponent * self.value().powf(exponent - 1.0) };
        self.mapped(self.value().powf(exponent), derivative)
    }

    /// The sine of an angle in radians.
    #[must_use]
    fn sin(self) -> Self {
        let (sine, cosine) = self.value().sin_cos();
        self.mapped(sine, cosine)
    }

    /// The cosine of an angle in radians.
    #[must_use]
    fn cos(self) -> Self {
        let (sine, cosine) = self.value().sin_cos();
        self.mapped(cosine, -sine)
    }

    /// The tangent of an angle in radians.
    #[must_use]
    fn tan(self) -> Self {
        let value = self.value().tan();
        self.mapped(value, 1.0 + value * value)
    }

    /// The arcsine, in radians.
    #[must_use]
    fn asin(self) -> Self {
        let value = self.value();
        self.mapped(value.asin(), (1.0 - value * value).sqrt().recip())
    }

    /// The arccosine, in radians.
    #[must_use]
    fn acos(self) -> Self {
        let value = self.value();
        self.mapped(value.acos(), -(1.0 - value * value).sqrt().recip())
    }

    /// The arctangent, in radians.
    #[must_use]
    fn atan(self) -> Self {
        let value = self.value();
        self.mapped(value.atan(), (1.0 + value * value).recip())
    }

    /// The angle in radians of the point whose ordinate is this number, and whose abscissa is another.
    #[must_use]
    fn atan2(self, x: Self) -> Self {
        let square = self.value() * self.value() + x.value() * x.value();
        let value = self.value().atan2(x.value());
        self.mapped(value, x.value() / square) + x.mapped(0.0, -self.value() / square)
    }

    /// The hyperbolic sine.
    #[must_use]
    fn sinh(self) -> Self {
        self.mapped(self.value().sinh(), self.value().cosh())
    }

    /// The hyperbolic cosine.
    #[must_use]
    fn cosh(self) -> Self {
        self.mapped(self.value().cosh(), self.value().sinh())
    }

    /// The hyperbolic tangent.
    #[must_use]
    fn tanh(self) -> Self {
        let value = self.value().tanh();
        self.mapped(value, 1.0 - value * value)
    }

    /// The absolute value.
    #[must_use]
    fn abs(self) -> Self {
        if self < 0.0 { -self } else { self }
    }

    /// The larger of two numbers; this one where they are equal.
    #[must_use]
    fn max(self, other: impl Into<Self>) -> Self {
        let other = other.into();
        if other > self { other } else { self }
    }

    /// The smaller of two numbers; this one where they are equal.
    #[must_use]
    fn min(self, other: impl Into<Self>) -> Self {
        let other = other.into();
        if other < self { other } else { self }
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
}

/// A number with its derivative along a direction (a dual number).
#[derive(Clone, Copy, Debug, Default)]
pub struct Dual {
    /// The value.
    pub value: f64,
    /// Its derivative.
    pub derivative: f64,
}

impl Dual {
    /// A value that changes with a derivative.
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
        // What does not change has the derivative 0 where the function's is infinite, as that of the root at 0.
        let derivative = if self.derivative == 0.0 { 0.0 } else { derivative * self.derivative };
        Self { value, derivative }
    }
}

impl From<f64> for Dual {
    #[inline]
    fn from(value: f64) -> Self {
        Self { value, derivative: 0.0 }
    }
}

impl PartialEq for Dual {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl PartialEq<f64> for Dual {
    #[inline]
    fn eq(&self, other: &f64) -> bool {
        self.value == *other
    }
}

impl PartialOrd for Dual {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl PartialOrd<f64> for Dual {
    #[inline]
    fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
        self.value.partial_cmp(other)
    }
}

impl Neg for Dual {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self { value: -self.value, derivative: -self.derivative }
    }
}

/// An operation on two dual numbers, on a dual number and `f64`, and in place.
macro_rules! operation {
    ($operation:ident $function:ident $assign:ident $assign_function:ident: |$a:ident, $b:ident| $derivative:expr) => {
        impl $operation for Dual {
            type Output = Self;

            #[inline]
            fn $function(self, other: Self) -> Self {
                let ($a, $b) = (self, other);
                Self { value: self.value.$function(other.value), derivative: $derivative }
            }
        }

        impl $operation<f64> for Dual {
            type Output = Self;

            #[inline]
            fn $function(self, other: f64) -> Self {
                self.$function(Self::from(other))
            }
        }

        impl $assign for Dual {
            #[inline]
            fn $assign_function(&mut self, other: Self) {
                *self = self.$function(other);
            }
        }
    };
}

operation!(Add add AddAssign add_assign: |a, b| a.derivative + b.derivative);
operation!(Sub sub SubAssign sub_assign: |a, b| a.derivative - b.derivative);
operation!(Mul mul MulAssign mul_assign: |a, b| a.derivative * b.value + a.value * b.derivative);
operation!(Div div DivAssign div_assign: |a, b| (a.derivative - a.value / b.value * b.derivative) / b.value);

#[cfg(test)]
mod tests {
    use super::*;

    /// A function with its derivative by central differences, at a point, and by dual numbers.
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
        );
        check!(-1.3: x => Number::abs(x), x => Number::powi(x, 3), x => Number::tanh(x));
    }

    #[test]
    fn what_does_not_change_has_no_derivative_where_the_slope_is_infinite() {
        assert_eq!(Number::sqrt(Dual::from(0.0)).derivative.to_bits(), 0.0_f64.to_bits());
        assert!(Number::sqrt(Dual::new(0.0, 1.0)).derivative.is_infinite());
    }
}
