//! Step size control.

/// The safety factor on the length that would just meet the tolerance: that of Hairer and Wanner's programs (`SAFE` of
/// `dop853.f`).
const SAFETY: f64 = 0.9;
/// The largest growth of the step length from one step to the next, and the largest reduction: those of DOP853 (`FAC2` of
/// `dop853.f`) and of DOPRI5 (`FAC1` of `dopri5.f`).
const GROWTH: f64 = 6.0;
const REDUCTION: f64 = 0.2;
/// How much longer than proposed a step may be, relatively, so that rounding of its end does not split it. The error of a
/// step of order p grows by p millionths; rounding of a time t is less down to steps of 2·10⁻¹⁰·t.
const ROUNDING: f64 = 1e-6;
/// The shortest step, in roundings of the time: as in MATLAB's solvers (Shampine and Reichelt, The MATLAB ODE Suite, SIAM
/// Journal on Scientific Computing 18, 1997), whose `hmin` is `16*eps(t)`.
const SHORTEST: f64 = 16.0 * f64::EPSILON;
/// With a method that takes any matrix, steps share a matrix if their lengths differ by no more than this, relatively.
/// [Chosen](crate::chosen).
pub(super) const SIMILAR: f64 = 0.4;

/// The length of the next step.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepSize {
    /// The proposed length in s; 0 if still to be estimated.
    pub(super) next: f64,
    /// The longest step in s.
    longest: f64,
    /// Whether the last step was rejected.
    was_rejected: bool,
}

impl StepSize {
    pub(super) fn new(next: f64, longest: f64) -> Self {
        Self { next: if next < longest { next } else { longest }, longest, was_rejected: false }
    }

    /// Estimates the length of a first step: that in which the states change by a hundredth at their present derivatives
    /// (Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, section II.4; the first guess of `HINIT` in
    /// `dop853.f`), from the norms of both relative to the allowed errors. The end does not limit it: it would limit the steps after it, too.
    pub(super) fn begin(&mut self, states: f64, slopes: f64) {
        let length = 0.01 * states.max(1.0) / slopes;
        self.next = if length > 0.0 && length < self.longest { length } else { self.longest };
    }

    /// Whether the next step, after a rejected one, is too short for times up to an end.
    pub(super) fn is_too_short(&self, time: f64, end: f64) -> bool {
        self.was_rejected
            && (self.next <= SHORTEST * time.abs().max(end.abs()) || self.next < f64::MIN_POSITIVE)
    }

    /// The length of the next step from a time to an end or before, and when it ends: the longest that reaches the end in
    /// equal steps.
    #[inline]
    pub(super) fn within(&self, time: f64, end: f64) -> (f64, f64) {
        let left = end - time;
        let length = left / (left / (self.next * (1.0 + ROUNDING))).ceil().max(1.0);
        (length, if length >= left { end } else { time + length })
    }

    /// Whether to accept a step of a length with an error relative to its tolerance. A step longer by `factor` would just
    /// meet it.
    #[inline]
    pub(super) fn judge(&mut self, length: f64, error: f64, factor: f64) -> bool {
        let by_error = SAFETY * factor;
        if error <= 1.0 {
            let most = if self.was_rejected { 1.0 } else { GROWTH };
            let allowed = length * by_error.clamp(REDUCTION, most);
            // A step cut short by the end, with hardly any error, says little about longer ones.
            let next = if by_error >= most { allowed.max(self.next) } else { allowed };
            self.next = if next < self.longest { next } else { self.longest };
            self.was_rejected = false;
            true
        } else {
            self.next = length * by_error.clamp(REDUCTION, 1.0);
            self.was_rejected = true;
            false
        }
    }
}
