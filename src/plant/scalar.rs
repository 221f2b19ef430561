//! The numbers that the plant's equations are written in: with `f64` they give the values, with dual numbers their
//! exact derivatives, too.
//!
//! Where an equation has a kink, the derivative is that of the branch that the value is on; at the kink
//! itself that of the branch stated there.

use std::array;
use std::f64::consts::{LN_2, LOG2_E};

use num_dual::DualNum;

use crate::elementary;

/// A number of the plant's equations.
pub trait Scalar: DualNum<Primitive = f64> + Copy {
    /// The larger of two; this one where they are equal.
    #[must_use]
    fn at_least(self, bound: impl Into<Self>) -> Self {
        let bound = bound.into();
        if self >= bound { self } else { bound }
    }

    /// The smaller of two; this one where they are equal.
    #[must_use]
    fn at_most(self, bound: impl Into<Self>) -> Self {
        let bound = bound.into();
        if self <= bound { self } else { bound }
    }

    /// This power of a number that is not negative; the exponent is not negative either.
    #[must_use]
    fn power(self, exponent: Self) -> Self {
        if self > 0.0 {
            let [logarithm] = Self::logarithms([self]);
            Self::powers_of_two([exponent * logarithm])[0]
        } else {
            // The derivative is 0 for exponents above 1, and not defined below.
            Self::from(self.re().powf(exponent.re()))
        }
    }

    /// The logarithms to base 2 of several numbers, side by side.
    #[must_use]
    fn logarithms<const N: usize>(numbers: [Self; N]) -> [Self; N] {
        let values = elementary::log2s(numbers.map(|number| number.re()));
        array::from_fn(|index| numbers[index].mapped(values[index], LOG2_E / numbers[index].re()))
    }

    /// 2 to several powers, side by side.
    #[must_use]
    fn powers_of_two<const N: usize>(exponents: [Self; N]) -> [Self; N] {
        let values = elementary::exp2s(exponents.map(|exponent| exponent.re()));
        array::from_fn(|index| exponents[index].mapped(values[index], LN_2 * values[index]))
    }

    /// The exponential function.
    #[must_use]
    fn exponential(self) -> Self {
        let value = elementary::exp2(LOG2_E * self.re());
        self.mapped(value, value)
    }

    /// A function of this number, from its value and its slope, which gives the first derivatives.
    ///
    /// So the derivatives, too, use our own elementary functions, which are the same on every platform.
    #[must_use]
    fn mapped(self, value: f64, slope: f64) -> Self {
        const { assert!(Self::NDERIV <= 1, "a slope gives first derivatives only") };
        if Self::NDERIV == 0 { Self::from(value) } else { (self - self.re()) * slope + value }
    }

    /// Whether the number is zero and carries no derivatives.
    #[must_use]
    fn vanishes(self) -> bool {
        Self::NDERIV == 0 && self == 0.0
    }
}

impl<D: DualNum<Primitive = f64> + Copy> Scalar for D {}
