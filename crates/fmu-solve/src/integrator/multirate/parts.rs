//! Both parts in turn: the fast one leads, and the slow one follows.

use core::array;

use super::course::{Course, STAGES, product};
use super::differences::{later, moved, quotient};
use super::fast_step::{BULGE, FastStep, Stages};
use crate::integrator::Trials;
use crate::integrator::system::{Part, StepFailure, TwoParts};

/// The maximum lead of the fast part, in steps. [Chosen](crate::chosen).
pub(super) const MOST_AHEAD: usize = 16;

/// The fast part at work, and what both parts need.
pub(super) struct Parts<'a, S, const FAST: usize> {
    pub(super) system: &'a mut S,
    pub(super) fast: &'a mut Course<FAST>,
    pub(super) drives: &'a [bool; FAST],
    pub(super) ahead: &'a mut Vec<FastStep<FAST>>,
    pub(super) stages: &'a mut Stages<FAST>,
    pub(super) end: f64,
    pub(super) trials: Trials<'a>,
}

impl<S: TwoParts, const FAST: usize> Parts<'_, S, FAST> {
    /// The fast states at a time.
    #[inline]
    fn fast_at(&self, time: f64) -> [f64; FAST] {
        let step = self.ahead.iter().find(|step| time < step.end);
        step.map_or(self.fast.states, |step| step.at(time))
    }

    /// The fast derivatives.
    #[inline]
    fn fast<const SLOW: usize>(
        system: &mut S,
        time: f64,
        states: &[f64; FAST],
        slow: &[f64; SLOW],
    ) -> [f64; FAST] {
        let mut slopes = [0.0; FAST];
        system.part_derivatives(
            Part::Fast,
            time,
            |state| if state < FAST { states[state] } else { slow[state - FAST] },
            split(&mut slopes, &mut [0.0; SLOW]),
        );
        slopes
    }

    /// The slow derivatives.
    #[inline]
    fn slow<const SLOW: usize>(
        system: &mut S,
        time: f64,
        fast: &[f64; FAST],
        states: &[f64; SLOW],
    ) -> [f64; SLOW] {
        let mut slopes = [0.0; SLOW];
        system.part_derivatives(
            Part::Slow,
            time,
            |state| if state < FAST { fast[state] } else { states[state - FAST] },
            split(&mut [0.0; FAST], &mut slopes),
        );
        slopes
    }

    /// Advances the fast part at least to a time, or to its maximum lead.
    #[inline(never)]
    fn lead_to<const SLOW: usize>(&mut self, time: f64, slow: &[f64; SLOW]) -> Result<(), StepFailure> {
        let Self { system, fast, ahead, stages, end, trials, .. } = self;
        while fast.time < time && ahead.len() < chosen!(MOST_AHEAD) {
            let is_last = trials.add();
            let (begin, states, slopes) = (fast.time, fast.states, fast.slopes);
            if fast.serves == 0 {
                fast.linearize(|states| Self::fast(system, begin, states, slow));
            }
            let (length, to) = fast.steps.within(begin, *end);
            let mut drift = [0.0; FAST];
            if !system.is_autonomous() {
                let (later, difference) = later(begin, length);
                drift = quotient(&Self::fast(system, later, &states, slow), &slopes, difference);
            }
            let mut stage = 0;
            let trial = fast.trial(length, &drift, |time, states| {
                let slopes = Self::fast(system, time, states, slow);
                (stages[stage], stage) = ([*states, slopes], stage + 1);
                slopes
            });
            if let Some(trial) = fast.settle(trial, length, (to, *end), is_last)? {
                let mut step =
                    FastStep { begin, end: to, states: [states, trial.states], slopes: [slopes; 2] };
                if to < *end {
                    fast.slopes = Self::fast(system, to, &trial.states, slow);
                    step.slopes[1] = fast.slopes;
                } else {
                    // The slopes of the last stage, which is little from it.
                    let [last, slopes] = &stages[STAGES - 2];
                    let by_states = product(&fast.jacobian, &array::from_fn(|i| trial.states[i] - last[i]));
                    step.slopes[1] = array::from_fn(|i| slopes[i] + by_states[i]);
                }
                // Unless errors like this step's are of no consequence.
                if BULGE * length * fast.stiffness * trial.largest > 1.0 && BULGE * step.bulge(fast) > 1.0 {
                    step.smoothen(fast, stages);
                }
                ahead.push(step);
            }
        }
        Ok(())
    }

    /// Tries a step of the slow part.
    #[inline(never)]
    pub(super) fn step_slow<const SLOW: usize>(
        &mut self,
        slow: &mut Course<SLOW>,
        coupling: &mut [[f64; SLOW]; FAST],
    ) -> Result<(), StepFailure> {
        let is_last = self.trials.add();
        let begin = slow.time;
        if slow.serves == 0 {
            self.linearize(slow, coupling);
        }
        let (mut length, mut to) = slow.steps.within(begin, self.end);
        self.lead_to(to, &slow.states)?;
        if self.fast.time < to {
            to = self.fast.time;
            length = to - begin;
        }
        let (later, difference) = later(begin, length);
        let (fast_now, fast_later) = (self.fast_at(begin), self.fast_at(later));
        let mut drift = [0.0; SLOW];
        if self.system.is_autonomous() {
            for state in (0..FAST).filter(|&state| self.drives[state]) {
                let rate = (fast_later[state] - fast_now[state]) / difference;
                drift = array::from_fn(|i| drift[i] + coupling[state][i] * rate);
            }
        } else {
            let slopes = Self::slow(self.system, later, &fast_later, &slow.states);
            drift = quotient(&slopes, &slow.slopes, difference);
        }
        let trial = slow.trial(length, &drift, |time, states| {
            let fast = self.fast_at(time);
            Self::slow(self.system, time, &fast, states)
        });
        let settled = slow.settle(trial, length, (to, self.end), is_last);
        if settled.map_err(|failure| StepFailure { state: FAST + failure.state, ..failure })?.is_some() {
            if to < self.end {
                slow.slopes = Self::slow(self.system, to, &self.fast_at(to), &slow.states);
            }
            let past = self.ahead.iter().take_while(|step| step.end <= to).count();
            self.ahead.drain(..past);
        }
        Ok(())
    }

    /// Renews the slow part's Jacobian and its coupling to the fast part.
    fn linearize<const SLOW: usize>(&mut self, slow: &mut Course<SLOW>, coupling: &mut [[f64; SLOW]; FAST]) {
        let (time, fast) = (slow.time, self.fast_at(slow.time));
        slow.linearize(|states| Self::slow(self.system, time, &fast, states));
        for state in (0..FAST).filter(|&state| self.drives[state]) {
            let (moved, difference) = moved(&fast, &self.fast.weights, state);
            let slopes = Self::slow(self.system, time, &moved, &slow.states);
            coupling[state] = quotient(&slopes, &slow.slopes, difference);
        }
    }
}

/// Distributes derivatives to both parts.
#[inline]
pub(super) fn split<const FAST: usize, const SLOW: usize>(
    fast: &mut [f64; FAST],
    slow: &mut [f64; SLOW],
) -> impl FnMut(usize, f64) {
    |state, rate| {
        if state < FAST {
            fast[state] = rate;
        } else {
            slow[state - FAST] = rate;
        }
    }
}
