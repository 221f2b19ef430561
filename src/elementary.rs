//! Logarithm, exponential function and powers to base 2, cheaper than the standard library's.
//!
//! The standard library's are correct to the last bit or two, differently on each platform; these are correct to 1e-14
//! (see the tests), in single precision to some roundings, bit-identical on every platform, and can be inlined, so that
//! several run in parallel.

use core::array;
use core::f64::consts::{LN_2, LOG2_E};
use core::ops::{Add, Mul, Sub};

use fmu_export::{Float, Number};

/// The functions for a model's numbers, with their derivatives.
pub trait Elementary: Number {
    /// A power with nonnegative base and exponent.
    #[must_use]
    fn power(self, exponent: Self) -> Self {
        if self > 0.0 {
            let [logarithm] = Self::logarithms([self]);
            Self::powers_of_two([exponent * logarithm])[0]
        } else {
            // The derivative is 0 for exponents above 1, undefined below.
            Self::from(Float::powf(self.value(), exponent.value()))
        }
    }

    /// The logarithms to base 2 of several numbers, in parallel.
    #[must_use]
    fn logarithms<const N: usize>(numbers: [Self; N]) -> [Self; N] {
        let values = log2s(numbers.map(Self::value));
        array::from_fn(|index| numbers[index].mapped(values[index], LOG2_E / numbers[index].value()))
    }

    /// 2 to several powers, in parallel.
    #[must_use]
    fn powers_of_two<const N: usize>(exponents: [Self; N]) -> [Self; N] {
        let values = exp2s(exponents.map(Self::value));
        array::from_fn(|index| exponents[index].mapped(values[index], LN_2 * values[index]))
    }

    /// The exponential function.
    #[must_use]
    fn exponential(self) -> Self {
        let value = exp2(LOG2_E * self.value());
        self.mapped(value, value)
    }
}

impl<T: Number> Elementary for T {}

/// The larger of two numbers, by one comparison; `f64::max` spends four more instructions on NaN.
#[must_use]
#[inline]
pub fn larger<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// The smaller of two numbers, by one comparison.
#[must_use]
#[inline]
pub fn smaller<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

/// Linear interpolation between two numbers by a fraction from 0 to 1; exact at both ends.
#[must_use]
#[inline]
pub fn between<T>(from: T, to: T, share: T) -> T
where
    T: Copy + From<f32> + Add<Output = T> + Sub<Output = T> + Mul<Output = T>,
{
    (T::from(1.0) - share) * from + share * to
}

/// The exponents' bias.
const BIAS: u64 = 1023;
const MANTISSA_BITS: u32 = 52;
const MANTISSA: u64 = (1 << MANTISSA_BITS) - 1;

/// The logarithm to base 2.
#[must_use]
#[inline]
pub fn log2(x: f64) -> f64 {
    log2s([x])[0]
}

/// The logarithms to base 2 of several numbers, computed in parallel.
#[must_use]
#[inline]
pub fn log2s<const N: usize>(numbers: [f64; N]) -> [f64; N] {
    let is_normal = |x: &f64| (f64::MIN_POSITIVE..f64::INFINITY).contains(x);
    if numbers.iter().all(is_normal) {
        numbers.map(log2_of_normal)
    } else {
        numbers.map(|x| if is_normal(&x) { log2_of_normal(x) } else { Float::log2(x) })
    }
}

/// The logarithm of a positive number that is neither infinite nor tiny.
///
/// After splitting off a power of 2, the rest m is within √½ and √2, and ln m = 2·artanh s with
/// s = (m − 1)/(m + 1), |s| ≤ 0.172; nine terms of the series leave 1e-16.
#[inline]
fn log2_of_normal(x: f64) -> f64 {
    /// From here on, a number's lowest bits are an integer.
    const INTEGERS: f64 = (1_u64 << MANTISSA_BITS) as f64;
    let bits = x.to_bits();
    // The exponent of the nearest power of 2 as seen from √½·2ⁿ.
    let shifted = bits.wrapping_add(0x3FF0_0000_0000_0000 - core::f64::consts::FRAC_1_SQRT_2.to_bits());
    let exponent = f64::from_bits(INTEGERS.to_bits() | (shifted >> MANTISSA_BITS)) - (INTEGERS + BIAS as f64);
    let m = f64::from_bits((shifted & MANTISSA).wrapping_add(core::f64::consts::FRAC_1_SQRT_2.to_bits()));
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let z2 = z * z;
    let z4 = z2 * z2;
    let low = (1.0 + z * (1.0 / 3.0)) + z2 * (1.0 / 5.0 + z * (1.0 / 7.0));
    let high = (1.0 / 9.0 + z * (1.0 / 11.0)) + z2 * (1.0 / 13.0 + z * (1.0 / 15.0));
    let sum = low + z4 * (high + z4 * (1.0 / 17.0));
    exponent + 2.0 * LOG2_E * s * sum
}

/// 2 to a power.
#[must_use]
#[inline]
pub fn exp2(x: f64) -> f64 {
    exp2s([x])[0]
}

/// 2 to each of several powers, computed in parallel.
#[must_use]
#[inline]
pub fn exp2s<const N: usize>(exponents: [f64; N]) -> [f64; N] {
    let is_moderate = |&x: &f64| x > -1021.0 && x < 1023.0;
    if exponents.iter().all(is_moderate) {
        exponents.map(exp2_of_moderate)
    } else {
        exponents.map(|x| if is_moderate(&x) { exp2_of_moderate(x) } else { Float::exp2(x) })
    }
}

/// 2 to a power whose result is neither infinite nor tiny.
///
/// After splitting off the nearest integer, the rest r is within ±½, and twelve terms of the series of exp(r·ln 2)
/// leave 1e-14.
#[inline]
fn exp2_of_moderate(x: f64) -> f64 {
    /// Adding and subtracting it rounds to an integer, which is in the lowest bits in between.
    const ROUNDER: f64 = 1.5 * (1_u64 << MANTISSA_BITS) as f64;
    let rounded = x + ROUNDER;
    let r = (x - (rounded - ROUNDER)) * LN_2;
    let r2 = r * r;
    let r4 = r2 * r2;
    let c0 = (1.0 + r) + r2 * (1.0 / 2.0 + r * (1.0 / 6.0));
    let c4 = (1.0 / 24.0 + r * (1.0 / 120.0)) + r2 * (1.0 / 720.0 + r * (1.0 / 5040.0));
    let c8 = (1.0 / 40_320.0 + r * (1.0 / 362_880.0)) + r2 * (1.0 / 3_628_800.0 + r * (1.0 / 39_916_800.0));
    let sum = c0 + r4 * (c4 + r4 * c8);
    // 2ⁿ·sum by its exponent.
    f64::from_bits(sum.to_bits().wrapping_add(rounded.to_bits() << MANTISSA_BITS))
}

/// A positive number to a power.
pub trait Power {
    /// The number to a power.
    #[must_use]
    fn power(self, exponent: Self) -> Self;
}

impl Power for f64 {
    #[inline]
    fn power(self, exponent: Self) -> Self {
        exp2(exponent * log2(self))
    }
}

impl Power for f32 {
    #[inline]
    fn power(self, exponent: Self) -> Self {
        single::exp2(exponent * single::log2(self))
    }
}

/// The functions in single precision, with fewer terms.
mod single {
    use core::f32::consts::{FRAC_1_SQRT_2, LN_2, LOG2_E};

    use fmu_export::Float;

    const MANTISSA_BITS: u32 = 23;
    const MANTISSA: u32 = (1 << MANTISSA_BITS) - 1;

    /// The logarithm to base 2; five terms of the series leave 2e-9.
    #[inline]
    pub fn log2(x: f32) -> f32 {
        if !(f32::MIN_POSITIVE..f32::INFINITY).contains(&x) {
            return Float::log2(x);
        }
        let shifted = x.to_bits().wrapping_add(1.0_f32.to_bits() - FRAC_1_SQRT_2.to_bits());
        let exponent = (shifted >> MANTISSA_BITS) as f32 - 127.0;
        let m = f32::from_bits((shifted & MANTISSA).wrapping_add(FRAC_1_SQRT_2.to_bits()));
        let s = (m - 1.0) / (m + 1.0);
        let z = s * s;
        let z2 = z * z;
        let sum = (1.0 + z * (1.0 / 3.0)) + z2 * ((1.0 / 5.0 + z * (1.0 / 7.0)) + z2 * (1.0 / 9.0));
        exponent + 2.0 * LOG2_E * s * sum
    }

    /// 2 to a power; eight terms of the series leave 6e-9.
    #[inline]
    pub fn exp2(x: f32) -> f32 {
        const ROUNDER: f32 = 1.5 * (1_u32 << MANTISSA_BITS) as f32;
        if !(x > -125.0 && x < 127.0) {
            return Float::exp2(x);
        }
        let rounded = x + ROUNDER;
        let r = (x - (rounded - ROUNDER)) * LN_2;
        let r2 = r * r;
        let c0 = (1.0 + r) + r2 * (1.0 / 2.0 + r * (1.0 / 6.0));
        let c4 = (1.0 / 24.0 + r * (1.0 / 120.0)) + r2 * (1.0 / 720.0 + r * (1.0 / 5040.0));
        let sum = c0 + r2 * r2 * c4;
        f32::from_bits(sum.to_bits().wrapping_add(rounded.to_bits() << MANTISSA_BITS))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_as_exact_as_stated() {
        // The standard library's are correct to 1e-15.
        for n in -200_000_i32..=200_000 {
            let x = f64::from(n) * 1.234e-3;
            let error = exp2(x) / x.exp2() - 1.0;
            assert!(error.abs() < 1e-14, "2^{x}: {error}");
        }
        for n in 1..400_000 {
            let x = f64::from(n) * 1.234e-5;
            let error = log2(x) - x.log2();
            assert!(error.abs() <= 2e-15 * x.log2().abs(), "log2 {x}: {error}");
        }
        assert!((log2(core::f64::consts::SQRT_2) - 0.5).abs() < 1e-15 && log2(1.0) == 0.0);
        for n in -2000..2000 {
            let (base, exponent) = ((0.5 * f64::from(n)).exp2(), 0.285_714);
            let error = Power::power(base, exponent) / base.powf(exponent) - 1.0;
            assert!(error.abs() < 1e-13, "{base}: {error}");
        }
    }

    #[test]
    fn powers_in_single_precision_are_exact_to_the_rounding_of_their_logarithms() {
        for n in 1_i16..2000 {
            let base = 0.01 * f32::from(n);
            for exponent in [0.09, 0.285_714, 0.7, 3.5] {
                let power = f64::from(base).powf(f64::from(exponent));
                let error = f64::from(Power::power(base, exponent)) / power - 1.0;
                // The exponential function rounds twice at most, and so does its exponent, the product.
                let bound = f64::from(f32::EPSILON) * (2.0 + 2.0 * power.ln().abs());
                assert!(error.abs() < bound, "{base}^{exponent}: {error:e}");
            }
        }
    }

    #[test]
    fn beyond_their_range_they_are_the_library_s() {
        for x in [0.0, -1.0, f64::INFINITY, f64::NAN, 1e-310] {
            assert_eq!(log2(x).to_bits(), x.log2().to_bits());
        }
        for x in [-1e9, -1060.0, 1024.0, f64::INFINITY, f64::NAN] {
            assert_eq!(exp2(x).to_bits(), x.exp2().to_bits());
        }
    }
}
