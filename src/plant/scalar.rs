//! The number types of the plant's equations: `f64` gives values, dual numbers also exact derivatives, and recorded
//! numbers adjoint derivatives.
//!
//! At a kink, the derivative is that of the value's branch; exactly at the kink, of the branch stated there.

use std::array;
use std::f64::consts::{LN_2, LOG2_E};
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use fmu_export::{Number, Recorded};
use num_dual::{Dual64, DualNum};

use crate::elementary;

/// A number of the plant's equations.
pub trait Scalar:
    Copy
    + Debug
    + From<f64>
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
{
    /// Whether the numbers carry derivatives.
    const HAS_DERIVATIVES: bool;

    /// The value without derivatives.
    #[must_use]
    fn re(self) -> f64;

    /// 1 divided by the number.
    #[must_use]
    fn recip(self) -> Self;

    /// The square root.
    #[must_use]
    fn sqrt(self) -> Self;

    /// The number to a constant integer power.
    #[must_use]
    fn powi(self, exponent: i32) -> Self;

    /// A function of this number, from its value and slope, which gives the first derivatives.
    ///
    /// Thus the derivatives also use our elementary functions, which are the same on every platform.
    #[must_use]
    fn mapped(self, value: f64, slope: f64) -> Self;

    /// The larger of two; this one if they are equal.
    #[must_use]
    fn at_least(self, bound: impl Into<Self>) -> Self {
        let bound = bound.into();
        if self >= bound { self } else { bound }
    }

    /// The smaller of two; this one if they are equal.
    #[must_use]
    fn at_most(self, bound: impl Into<Self>) -> Self {
        let bound = bound.into();
        if self <= bound { self } else { bound }
    }

    /// A power with nonnegative base and exponent.
    #[must_use]
    fn power(self, exponent: Self) -> Self {
        if self > 0.0 {
            let [logarithm] = Self::logarithms([self]);
            Self::powers_of_two([exponent * logarithm])[0]
        } else {
            // The derivative is 0 for exponents above 1, undefined below.
            Self::from(self.re().powf(exponent.re()))
        }
    }

    /// The logarithms to base 2 of several numbers, in parallel.
    #[must_use]
    fn logarithms<const N: usize>(numbers: [Self; N]) -> [Self; N] {
        let values = elementary::log2s(numbers.map(Self::re));
        array::from_fn(|index| numbers[index].mapped(values[index], LOG2_E / numbers[index].re()))
    }

    /// 2 to several powers, in parallel.
    #[must_use]
    fn powers_of_two<const N: usize>(exponents: [Self; N]) -> [Self; N] {
        let values = elementary::exp2s(exponents.map(Self::re));
        array::from_fn(|index| exponents[index].mapped(values[index], LN_2 * values[index]))
    }

    /// The exponential function.
    #[must_use]
    fn exponential(self) -> Self {
        let value = elementary::exp2(LOG2_E * self.re());
        self.mapped(value, value)
    }

    /// Whether the number is zero and carries no derivatives.
    #[must_use]
    fn vanishes(self) -> bool {
        !Self::HAS_DERIVATIVES && self == 0.0
    }
}

impl Scalar for f64 {
    const HAS_DERIVATIVES: bool = false;

    #[inline]
    fn re(self) -> f64 {
        self
    }

    #[inline]
    fn recip(self) -> Self {
        self.recip()
    }

    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline]
    fn powi(self, exponent: i32) -> Self {
        self.powi(exponent)
    }

    #[inline]
    fn mapped(self, value: f64, _slope: f64) -> Self {
        value
    }
}

impl Scalar for Dual64 {
    const HAS_DERIVATIVES: bool = true;

    #[inline]
    fn re(self) -> f64 {
        self.re
    }

    #[inline]
    fn recip(self) -> Self {
        DualNum::recip(&self)
    }

    #[inline]
    fn sqrt(self) -> Self {
        DualNum::sqrt(&self)
    }

    #[inline]
    fn powi(self, exponent: i32) -> Self {
        DualNum::powi(&self, exponent)
    }

    #[inline]
    fn mapped(self, value: f64, slope: f64) -> Self {
        (self - self.re) * slope + value
    }
}

impl Scalar for Recorded<'_> {
    const HAS_DERIVATIVES: bool = true;

    #[inline]
    fn re(self) -> f64 {
        self.value()
    }

    #[inline]
    fn recip(self) -> Self {
        Number::recip(self)
    }

    #[inline]
    fn sqrt(self) -> Self {
        Number::sqrt(self)
    }

    #[inline]
    fn powi(self, exponent: i32) -> Self {
        Number::powi(self, exponent)
    }

    #[inline]
    fn mapped(self, value: f64, slope: f64) -> Self {
        Number::mapped(self, value, slope)
    }
}
