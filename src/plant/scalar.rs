//! The numbers that the plant's equations are written in: any that carries derivatives along, so that one
//! text gives the values (over `f64`) and their exact derivatives (over dual numbers).
//!
//! Where an equation has a kink, what is differentiated is the branch that the value is on; at the kink
//! itself the one that is named there.

use std::f64::consts::LOG2_E;

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
            self.powers([exponent])[0]
        } else {
            // The derivative is 0 for exponents above 1, and not defined below.
            Self::from(self.re().powf(exponent.re()))
        }
    }

    /// Several powers of a number above 0, which share its logarithm.
    #[must_use]
    fn powers<const N: usize>(self, exponents: [Self; N]) -> [Self; N] {
        if Self::NDERIV == 0 {
            let logarithm = elementary::log2(self.re());
            exponents.map(|exponent| Self::from(elementary::exp2(logarithm * exponent.re())))
        } else {
            exponents.map(|exponent| self.powd(exponent))
        }
    }

    /// The exponential function.
    #[must_use]
    fn exponential(self) -> Self {
        if Self::NDERIV == 0 { Self::from(elementary::exp2(LOG2_E * self.re())) } else { self.exp() }
    }

    /// Whether the number is zero and has no derivative that could tell.
    #[must_use]
    fn vanishes(self) -> bool {
        Self::NDERIV == 0 && self == 0.0
    }
}

impl<D: DualNum<Primitive = f64> + Copy> Scalar for D {}
