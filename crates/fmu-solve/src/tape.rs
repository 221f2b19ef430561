//! Derivatives by reverse accumulation: a tape records a function's operations, and is then traversed backwards. One
//! pass gives the derivatives of a result with respect to everything; [`Dual`] needs one for each number that changes.
//!
//! [`Dual`]: crate::Dual

use core::cell::RefCell;
use core::cmp::Ordering;
use core::fmt;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::integrator::Pattern;
use crate::number::{Number, arithmetic};

/// A recorded operation: the result changes by the operands' changes times the slopes.
#[derive(Clone, Copy, Debug, Default)]
struct Operation {
    /// The operands' places on the tape; 0 for constants.
    operands: [u32; 2],
    slopes: [f64; 2],
    /// How much the weighted sum of the results changes with this operation's result.
    adjoint: f64,
}

/// The operations from variables to results. It reuses its memory for the next recording.
#[derive(Default)]
pub struct Tape {
    /// The recorded operations; the first one represents all constants.
    operations: RefCell<Vec<Operation>>,
}

impl Tape {
    /// A tape without memory, which the first recording allocates.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Erases the recording.
    pub fn clear(&mut self) {
        let operations = self.operations.get_mut();
        operations.clear();
        operations.push(Operation::default());
    }

    /// A number to differentiate by.
    #[inline(never)]
    pub fn variable(&self, value: f64) -> Recorded<'_> {
        self.record(value, [0, 0], [0.0, 0.0])
    }

    fn record(&self, value: f64, operands: [u32; 2], slopes: [f64; 2]) -> Recorded<'_> {
        let mut operations = self.operations.borrow_mut();
        let place = u32::try_from(operations.len()).expect("a model has fewer operations than 4294967296");
        operations.push(Operation { operands, slopes, adjoint: 0.0 });
        Recorded { value, tape: Some(self), place }
    }

    /// Adds a weighted result to the sum to differentiate.
    #[inline(never)]
    pub fn weigh(&self, result: Recorded<'_>, weight: f64) {
        if result.tape.is_some() {
            self.operations.borrow_mut()[result.place as usize].adjoint += weight;
        }
    }

    /// Computes the derivatives of the weighted sum of results.
    pub fn go_back(&self) {
        let mut operations = self.operations.borrow_mut();
        for place in (1..operations.len()).rev() {
            let Operation { operands, slopes, adjoint } = operations[place];
            // An operation without effect contributes nothing, even where its slope is infinite, like that of the root
            // at 0.
            if adjoint == 0.0 {
                continue;
            }
            for (operand, slope) in operands.into_iter().zip(slopes) {
                if slope != 0.0 {
                    operations[operand as usize].adjoint += slope * adjoint;
                }
            }
        }
    }

    /// The derivatives with respect to the numbers on the tape, in their order: first those of variables created
    /// before any operation.
    pub fn derivatives_in_order(&self) -> impl Iterator<Item = f64> {
        (1..).map_while(|place| {
            self.operations.borrow().get(place).map(|operation: &Operation| operation.adjoint)
        })
    }

    /// Computes the derivatives of one result with respect to so many variables, the first numbers on the tape, which
    /// holds no weights. It goes back as far as the result rests on operations.
    pub fn differentiate(&self, result: Recorded<'_>, variables: usize) {
        let mut operations = self.operations.borrow_mut();
        for variable in &mut operations[1..=variables] {
            variable.adjoint = 0.0;
        }
        let mut place = result.place as usize;
        let mut first = place;
        operations[place].adjoint = 1.0;
        while place > variables && place >= first {
            let Operation { operands, slopes, adjoint } = operations[place];
            if adjoint != 0.0 {
                // For the next result.
                operations[place].adjoint = 0.0;
                for (operand, slope) in operands.into_iter().zip(slopes) {
                    if slope != 0.0 {
                        let operand = operand as usize;
                        operations[operand].adjoint += slope * adjoint;
                        if operand > variables {
                            first = first.min(operand);
                        }
                    }
                }
            }
            place -= 1;
        }
    }

    /// Where the matrix of the results' derivatives with respect to as many variables has elements. These are the first
    /// numbers on the tape.
    pub fn pattern(&self, results: &[Recorded<'_>]) -> Pattern {
        let (operations, variables) = (self.operations.borrow(), results.len());
        // The result from which each number was last reached.
        let mut reached = vec![usize::MAX; operations.len()];
        let (mut next, mut traversed) = (vec![], 0_usize);
        let pattern = Pattern::of_rows(variables, |row, columns| {
            let place = results[row].place as usize;
            let mut first = place;
            next.push(place);
            while let Some(place) = next.pop() {
                if place == 0 || reached[place] == row {
                    continue;
                }
                reached[place] = row;
                if place <= variables {
                    columns.push(place - 1);
                } else {
                    first = first.min(place);
                    next.extend(operations[place].operands.map(|operand| operand as usize));
                }
            }
            traversed = traversed.saturating_add(place - first);
        });
        pattern.with_operations(operations.len(), traversed)
    }

    /// The derivative of the weighted sum with respect to a number.
    #[must_use]
    #[inline(never)]
    pub fn derivative(&self, number: Recorded<'_>) -> f64 {
        if number.tape.is_some() { self.operations.borrow()[number.place as usize].adjoint } else { 0.0 }
    }
}

impl fmt::Debug for Tape {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Tape").field("operations", &self.operations.borrow().len()).finish()
    }
}

/// A number whose operations are recorded on a [`Tape`], unless it is a constant.
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'t> {
    value: f64,
    tape: Option<&'t Tape>,
    /// The number's place on the tape; 0 for a constant.
    place: u32,
}

impl Recorded<'_> {
    /// The result of an operation on two numbers.
    #[inline]
    fn with(self, other: Self, value: f64, slopes: [f64; 2]) -> Self {
        match self.tape.or(other.tape) {
            Some(tape) => tape.record(value, [self.place, other.place], slopes),
            None => value.into(),
        }
    }
}

impl Number for Recorded<'_> {
    #[inline]
    fn value(self) -> f64 {
        self.value
    }

    #[inline]
    fn mapped(self, value: f64, derivative: f64) -> Self {
        self.with(value.into(), value, [derivative, 0.0])
    }

    #[inline]
    fn is_constant(self, value: f64) -> bool {
        self.value.is_constant(value) && self.tape.is_none()
    }
}

impl From<f64> for Recorded<'_> {
    #[inline]
    fn from(value: f64) -> Self {
        Self { value, tape: None, place: 0 }
    }
}

impl Neg for Recorded<'_> {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        self.mapped(-self.value, -1.0)
    }
}

arithmetic! {
    Recorded<'_>;
    Add add AddAssign add_assign: |a, b| a.with(b, a.value + b.value, [1.0, 1.0]);
    Sub sub SubAssign sub_assign: |a, b| a.with(b, a.value - b.value, [1.0, -1.0]);
    Mul mul MulAssign mul_assign: |a, b| a.with(b, a.value * b.value, [b.value, a.value]);
    Div div DivAssign div_assign: |a, b| {
        let quotient = a.value / b.value;
        a.with(b, quotient, [b.value.recip(), -quotient / b.value])
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::Dual;

    /// Two functions of three numbers that use every operation. At 0 the numbers are where slopes are infinite.
    fn functions<T: Number>([x, y, z]: [T; 3]) -> [T; 2] {
        let mut sum = x * y - z / x + (y * 0.5).sin() * z.exp();
        sum += x.sqrt() * 3.0;
        sum -= y.powi(3);
        sum *= z.atan2(x);
        sum /= x + 2.0;
        let other = (x.max(y) - z.min(1.5)).tanh() + T::from(2.0).ln() * -z.recip();
        let more =
            x.powf(y) + y.hypot(z) + x.mul_add(y, z) + x.rem_euclid(y) + z.clamp(y, 1.5) + x.copysign(z);
        [sum, other.abs() + x * x + more]
    }

    #[test]
    fn derivatives_are_those_of_dual_numbers() {
        let mut tape = Tape::new();
        for point in [[0.7, 0.3, 0.9], [2.0, -1.5, 0.25], [1.25, 4.0, -3.0]] {
            for weights in [[1.0, 0.0], [0.0, 1.0], [-2.0, 0.75]] {
                tape.clear();
                let numbers = point.map(|value| tape.variable(value));
                let results = functions(numbers);
                let values = functions(point);
                for ((result, value), weight) in results.into_iter().zip(values).zip(weights) {
                    assert_eq!(result.value().to_bits(), value.to_bits(), "another value");
                    tape.weigh(result, weight);
                }
                tape.go_back();
                for (changing, number) in numbers.into_iter().enumerate() {
                    let mut duals = point.map(Dual::from);
                    duals[changing].derivative = 1.0;
                    let by_duals = functions(duals);
                    let expected = weights[0] * by_duals[0].derivative + weights[1] * by_duals[1].derivative;
                    let found = tape.derivative(number);
                    // Rounding errors of about twenty operations on numbers of order 10.
                    assert!((found - expected).abs() < 1e-13, "{found} instead of {expected}");
                }
            }
        }
    }

    #[test]
    fn one_result_after_the_other() {
        let mut tape = Tape::new();
        tape.clear();
        let numbers = [0.7, 0.3, 0.9].map(|value| tape.variable(value));
        let results = functions(numbers);
        // A variable and a constant are results, too.
        let all = [results[0], results[1], numbers[1], Recorded::from(2.0)];
        let derivatives = |result: usize| {
            tape.differentiate(all[result], numbers.len());
            numbers.map(|number| tape.derivative(number))
        };
        let found = [0, 1, 2, 3].map(derivatives);
        // Whichever came before.
        assert_eq!([3, 2, 1, 0].map(derivatives), [found[3], found[2], found[1], found[0]]);
        assert_eq!([found[2], found[3]], [[0.0, 1.0, 0.0], [0.0; 3]]);
        for (changing, derivatives) in (0..3).map(|number| (number, found.map(|found| found[number]))) {
            let mut duals = numbers.map(|number| Dual::from(number.value()));
            duals[changing].derivative = 1.0;
            for (expected, found) in functions(duals).into_iter().zip(derivatives) {
                // As above.
                assert!((found - expected.derivative).abs() < 1e-13, "{found} instead of {expected:?}");
            }
        }
    }

    #[test]
    fn what_has_no_effect_has_no_derivative_where_the_slope_is_infinite() {
        let mut tape = Tape::new();
        tape.clear();
        let (zero, one) = (tape.variable(0.0), tape.variable(1.0));
        let unused = zero.sqrt();
        let square = zero * zero;
        tape.weigh(square.sqrt() + one, 1.0);
        tape.go_back();
        assert_eq!(tape.derivative(zero).to_bits(), 0.0_f64.to_bits());
        assert_eq!(tape.derivative(one).to_bits(), 1.0_f64.to_bits());
        tape.weigh(unused, 1.0);
        tape.go_back();
        assert!(tape.derivative(zero).is_infinite());
    }
}
