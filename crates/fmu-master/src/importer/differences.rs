//! Difference quotients of an FMU's equations: for derivatives that it does not give, and to check those it gives.
//!
//! How far a value x moves follows from two errors. With ε for the rounding of a function f, and L for the change of x
//! over which f changes by its own size (f′ ~ f/L, f″ ~ f/L², f‴ ~ f/L³):
//!
//! - A *forward* quotient, (f(x + h) − f(x))/h, errs by h·f″/2 and by rounding, about ε·f/h. Both are about √ε·f/L at
//!   h = √ε·L. Each direction takes one evaluation, since f(x) is known. So precise a Jacobian is as good as exact in the
//!   integrator, which lets one serve several steps: between these it changes by more.
//! - The slope of a *parabola* through three points, in the middle (f(x + h) − f(x − h))/2h, errs by h²·f‴/6 and about
//!   ε·f/h. Both are about ε^(2/3)·f/L at h = ∛ε·L: five digits more, for two evaluations. Linearizations take it, because
//!   they are computed once and read by others.
//!
//! The FMU does not tell L, but the nominal, which is the value's usual magnitude: L is taken to be the larger of this and
//! the present magnitude.
//!
//! Beyond its range a variable need not have derivatives. There a forward difference goes backward, and the three points
//! of the parabola lie on one side, at x, x ± h and x ± 2h, which doubles the error of f‴ and keeps its order. A range too
//! narrow for this is ignored, since otherwise there would be no derivative.

/// The length of a forward difference, relative to the scale of the value.
pub fn forward() -> f64 {
    f64::EPSILON.sqrt()
}

/// A nominal that an FMU gives, or 1 instead of one that it must not give (FMI 2.0.5, section 2.2.3).
pub fn nominal(given: f64) -> f64 {
    if given == 0.0 || !given.is_finite() { 1.0 } else { given.abs() }
}

/// A value about which differences are taken.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    value: f64,
    scale: f64,
    /// Least and greatest value.
    range: (f64, f64),
}

impl Place {
    /// The place of a value, with its [nominal] and its least and greatest value; it may be beyond these.
    pub fn new(value: f64, nominal: f64, (least, most): (f64, f64)) -> Self {
        Self { value, scale: value.abs().max(nominal), range: (least.min(value), most.max(value)) }
    }

    /// The change over which functions of the value change by their own size, as far as is known.
    pub fn scale(self) -> f64 {
        self.scale
    }

    /// Whether the value may change by this much.
    pub fn allows(self, change: f64) -> bool {
        (self.range.0..=self.range.1).contains(&(self.value + change))
    }

    /// The value moved for a forward difference.
    pub fn moved(self) -> f64 {
        let change = forward() * self.scale;
        self.value + if self.allows(change) || !self.allows(-change) { change } else { -change }
    }

    /// The value moved to the two other points of a parabola.
    pub fn around(self) -> [f64; 2] {
        let change = f64::EPSILON.cbrt() * self.scale;
        let [below, above] = [self.value - self.range.0, self.range.1 - self.value];
        let (room, side) = if below > above { (below, -1.0) } else { (above, 1.0) };
        if change <= below.min(above) || room < 2.0 * forward() * self.scale {
            return [-1.0, 1.0].map(|side| self.value + side * change);
        }
        let change = side * change.min(0.5 * room);
        [1.0, 2.0].map(|times| self.value + times * change)
    }

    /// The slope, at the value, of the parabola through what a function is here and at the two values moved.
    pub fn slope(self, moved: [f64; 2], here: f64, there: [f64; 2]) -> f64 {
        let [one, other] = moved.map(|moved| moved - self.value);
        let [by_one, by_other] = [(there[0] - here) / one, (there[1] - here) / other];
        (other * by_one - one * by_other) / (other - one)
    }
}

#[cfg(test)]
mod tests {
    use fmu_solve::{Dual, Number};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    /// A function of its own size F, which changes over the scale L: F·(sin(a·x/L + b) + c·exp(d·x/L)).
    #[derive(Clone, Copy, Debug)]
    struct Function {
        size: f64,
        scale: f64,
        shape: [f64; 4],
    }

    impl Function {
        /// Where the shape is between −1 and 1 and the value within the scale, it and its derivatives are at most 1 + e.
        const MOST: f64 = 1.0 + core::f64::consts::E;

        fn of<T: Number>(self, x: T) -> T {
            let ([a, b, c, d], x) = (self.shape, x / self.scale);
            ((x * a + b).sin() + (x * d).exp() * c) * self.size
        }

        fn derivative(self, x: f64) -> f64 {
            self.of(Dual::new(x, 1.0)).derivative
        }
    }

    /// Functions at values within their scales, and how much the values may change.
    fn functions() -> impl Iterator<Item = (Function, f64, [f64; 2])> {
        let mut random = Pcg64::seed_from_u64(1);
        (0..4000_u32).map(move |number| {
            let mut random = |most: f64| random.random_range(-most..most);
            let scale = 10.0_f64.powf(random(6.0));
            let function = Function {
                size: 10.0_f64.powf(random(6.0)),
                scale,
                shape: std::array::from_fn(|_| random(1.0)),
            };
            let value = if number % 5 == 0 { 0.0 } else { scale * random(1.0) };
            // Less than either difference, or none.
            let little = 1e-9 * scale * f64::from(number % 3);
            let room =
                [[f64::INFINITY; 2], [little, 3.0 * scale], [3.0 * scale, little], [little, 1e-6 * scale]];
            (function, value, room[number as usize % room.len()])
        })
    }

    fn place(function: Function, value: f64, [below, above]: [f64; 2]) -> Place {
        Place::new(value, function.scale, (value - below, value + above))
    }

    /// The rounding of a value: of four operations, each of which may round by half a unit and magnify by at most 2.
    const ROUNDINGS: f64 = 4.0;

    #[test]
    fn forward_differences_are_as_exact_as_the_root_of_rounding() {
        for (function, value, room) in functions() {
            let (place, exact) = (place(function, value, room), function.derivative(value));
            let moved = place.moved();
            assert!(place.allows(moved - value), "{function:?} {value} {room:?}");
            let found = (function.of(moved) - function.of(value)) / (moved - value);
            // Half of the second derivative, and the rounding of two values.
            let most = (0.5 + 2.0 * ROUNDINGS) * Function::MOST * f64::EPSILON.sqrt();
            let error = (found - exact).abs() / (function.size / function.scale);
            assert!(error <= most, "{error:e} of {function:?} at {value}, {room:?}");
        }
    }

    #[test]
    fn parabolas_are_exact_to_the_power_two_thirds_of_rounding_at_bounds_too() {
        let mut of_chords = [0, 0];
        for (function, value, room) in functions() {
            let (place, exact) = (place(function, value, room), function.derivative(value));
            let moved = place.around();
            assert!(moved.iter().all(|moved| place.allows(moved - value)), "{function:?} {value} {room:?}");
            let there = moved.map(|moved| function.of(moved));
            let error = |found: f64| (found - exact).abs() / (function.size / function.scale);
            let found = error(place.slope(moved, function.of(value), there));
            // A third of the third derivative on one side, and the rounding of 2·(two values) + (two values)/2, divided by a
            // length that may be short of room: half of 1e-6 instead of 6e-6.
            let length = (moved[0] - value).abs() / function.scale;
            let most = (length.powi(2) / 3.0 + 5.0 * ROUNDINGS * f64::EPSILON / length) * Function::MOST;
            assert!(found <= most, "{found:e} instead of {most:e} of {function:?} at {value}, {room:?}");
            // What the chord between both points, within the range, errs by.
            let chord = error((there[1] - there[0]) / (moved[1] - moved[0]));
            if room[0] < 1e-6 * function.scale && room[1] > function.scale {
                of_chords[usize::from(chord > 10.0 * most)] += 1;
            }
        }
        // The chord errs by 3/2·h·f″, ten times as much as the parabola may, unless f″ is below a hundredth of its usual size.
        assert!(of_chords[1] > 9 * of_chords[0], "{of_chords:?}");
    }

    #[test]
    fn a_range_without_room_is_ignored() {
        let place = Place::new(2.0, 1.0, (2.0, 2.0));
        assert!(place.moved() > 2.0);
        let [below, above] = place.around();
        assert!(below < 2.0 && above > 2.0);
    }

    #[test]
    fn a_nominal_that_must_not_be_is_one() {
        let found = [0.0, f64::INFINITY, f64::NAN, -2.0, 1e-9].map(nominal);
        assert_eq!(found.map(f64::to_bits), [1.0, 1.0, 1.0, 2.0, 1e-9].map(f64::to_bits));
    }
}
