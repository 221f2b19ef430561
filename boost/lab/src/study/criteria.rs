//! The criteria of a study; all bounds are defined here.

use serde::Serialize;

use super::case::{Extremes, Faulty, Measures, Unaided};
use super::fault::FaultKind;
use super::situation::Situation;

/// A deviation too small for a driver to feel: twice the 1 kPa of the paper's Figs. 13 and 14 (Pa).
pub const NEAR: f64 = 2e3;
/// The share of the cases that may be beyond [`FAR`]: extremes of random plants.
const SHARE_FAR: f64 = 0.007;
/// Slightly more than the 5 kPa that the paper allows for the steps of its Fig. 13 (Pa).
const FAR: f64 = 5.5e3;
/// The largest deviation allowed (Pa).
const FARTHEST: f64 = 8e3;
/// Shaft speeds at rest (rpm): 7 krpm above the target of the controller's limits, and the highest allowed; and the share
/// of the cases that may be above the first.
pub const FAST_AT_REST: f64 = 212e3;
const FASTEST_AT_REST: f64 = 214e3;
const SHARE_FAST: f64 = 0.002;
/// The largest movement of boost back on its way (Pa): five times the noise.
const DIP: f64 = 500.0;
/// At rest, noise may cost this much of the vacuum (Pa) and of the pump's time: at 50 kPa the wastegate does not open.
const TANK: f64 = 40e3;
const PUMP: f64 = 0.85;
/// Without vacuum, up to this engine speed (rpm), the other valves hold boost (Pa) and the shaft (rpm) to these; above it
/// the shaft to the last.
const SLOW_ENGINE: f64 = 2500.0;
const UNAIDED_BOOST: f64 = 130e3;
const UNAIDED_SHAFT: f64 = 200e3;
const UNAIDED_SHAFT_FAST: f64 = 290e3;
/// Limp-home may let boost (Pa) and the shaft (rpm) go this much farther than no limp-home: rounding of other courses.
const WORSE_BOOST: f64 = 500.0;
const WORSE_SHAFT: f64 = 1e3;
/// Limp-home may give up boost where boost would exceed the reference by this (Pa), or the shaft [`FAST_AT_REST`].
const HARMFUL: f64 = 20e3;
/// The excess of boost (Pa) by which a boost sensor's fault must have its code, and the largest with one that is dead.
const EXCESS_STUCK: f64 = 20e3;
const EXCESS_DEAD: f64 = 45e3;
const EXCESS_DRIFT: f64 = 60e3;

/// What only a share of the cases may do.
#[derive(Clone, Copy)]
struct Bound {
    name: &'static str,
    share: f64,
    /// Whether a case does; none if the FMUs lack the variable, or the case is of another kind.
    is_beyond: fn(&Measures) -> Option<bool>,
}

/// The bounds in all situations with a sound engine in which the reference can be followed.
const FOLLOWING: &[Bound] = &[
    Bound {
        name: "cases beyond 5.5 kPa",
        share: SHARE_FAR,
        is_beyond: |measures| Some(measures.deviation > FAR),
    },
    Bound {
        name: "cases beyond 8 kPa",
        share: 0.0,
        is_beyond: |measures| Some(measures.deviation > FARTHEST),
    },
    Bound {
        name: "cases with a shaft above 212 krpm at rest",
        share: SHARE_FAST,
        is_beyond: |measures| Some(measures.shaft_at_rest? > FAST_AT_REST),
    },
    Bound {
        name: "cases with a shaft above 214 krpm at rest",
        share: 0.0,
        is_beyond: |measures| Some(measures.shaft_at_rest? > FASTEST_AT_REST),
    },
    Bound {
        name: "cases with a compressor in surge",
        share: 0.0,
        is_beyond: |measures| Some(measures.least_flow? < 0.0),
    },
];

const ALARMS: &[Bound] =
    &[Bound { name: "cases with an alarm", share: 0.0, is_beyond: |measures| Some(measures.alarm? != 0.0) }];

const DIPS: &[Bound] = &[Bound {
    name: "cases in which boost moves back by more than 0.5 kPa on its way",
    share: 0.0,
    is_beyond: |measures| Some(measures.dip > DIP),
}];

const NOISE: &[Bound] = &[
    Bound {
        name: "cases with a tank above 40 kPa",
        share: 0.0,
        is_beyond: |measures| Some(measures.tank? > TANK),
    },
    Bound {
        name: "cases with the pump on for more than 85 % of the time",
        share: 0.0,
        is_beyond: |measures| Some(measures.pump? > PUMP),
    },
];

const NO_VACUUM: &[Bound] = &[
    Bound {
        name: "cases above 130 kPa without vacuum, up to 2500 rpm",
        share: 0.0,
        is_beyond: |measures| {
            let Unaided { engine_speed, boost, .. } = *measures.unaided.as_ref()?;
            (engine_speed <= SLOW_ENGINE).then_some(boost > UNAIDED_BOOST)
        },
    },
    Bound {
        name: "cases with a shaft above 200 krpm without vacuum, up to 2500 rpm",
        share: 0.0,
        is_beyond: |measures| {
            let Unaided { engine_speed, shaft, .. } = *measures.unaided.as_ref()?;
            if engine_speed <= SLOW_ENGINE { Some(shaft? > UNAIDED_SHAFT) } else { None }
        },
    },
    Bound {
        name: "cases with a shaft above 290 krpm without vacuum, above 2500 rpm",
        share: 0.0,
        is_beyond: |measures| {
            let Unaided { engine_speed, shaft, .. } = *measures.unaided.as_ref()?;
            if engine_speed > SLOW_ENGINE { Some(shaft? > UNAIDED_SHAFT_FAST) } else { None }
        },
    },
];

const FAULTS: &[Bound] = &[
    Bound {
        name: "cases in which limp-home raises the excess of boost",
        share: 0.0,
        is_beyond: |measures| {
            let Faulty { with, without, .. } = measures.faulty.as_ref()?;
            Some(with.excess.max(0.0) > without.as_ref()?.excess.max(0.0) + WORSE_BOOST)
        },
    },
    Bound {
        name: "cases in which limp-home raises the shaft's speed",
        share: 0.0,
        is_beyond: |measures| {
            let Faulty { with, without, .. } = measures.faulty.as_ref()?;
            Some(with.shaft? > without.as_ref()?.shaft? + WORSE_SHAFT)
        },
    },
    Bound {
        name: "cases in which limp-home gives up boost without need",
        share: 0.0,
        is_beyond: |measures| {
            let Faulty { with, without, .. } = measures.faulty.as_ref()?;
            let without = without.as_ref()?;
            let is_harmful =
                without.excess > HARMFUL || without.shaft.is_some_and(|speed| speed > FAST_AT_REST);
            Some(!is_harmful && with.deficit.max(0.0) > without.deficit.max(0.0) + WORSE_BOOST)
        },
    },
    Bound {
        name: "cases with a boost sensor that is stuck or drifts down, and no code before boost is 20 or 60 kPa too high",
        share: 0.0,
        is_beyond: |measures| {
            let faulty = measures.faulty.as_ref()?;
            let most = match faulty.kind {
                FaultKind::BoostSensorStuck => EXCESS_STUCK,
                FaultKind::BoostSensorDriftsDown => EXCESS_DRIFT,
                _ => return None,
            };
            Some(faulty.excess_before_code > most)
        },
    },
    Bound {
        name: "cases with a dead boost sensor, and boost 45 kPa too high",
        share: 0.0,
        is_beyond: |measures| {
            let Faulty { kind, with: Extremes { excess, .. }, .. } = *measures.faulty.as_ref()?;
            (kind == FaultKind::BoostSensorDead).then_some(excess > EXCESS_DEAD)
        },
    },
];

/// What is required of the cases of a situation.
#[derive(Clone, Copy)]
pub struct Criteria {
    /// The share of the cases that must stay within [`NEAR`] of the reachable reference.
    share_near: Option<f64>,
    bounds: &'static [&'static [Bound]],
}

/// A criterion and its result.
#[derive(Clone, Debug, Serialize)]
pub struct Criterion {
    pub name: &'static str,
    pub required: String,
    /// What was found; none if the FMUs lack the variable.
    pub found: Option<String>,
    pub met: bool,
}

impl Bound {
    fn required(&self) -> String {
        if self.share > 0.0 { format!("at most {:.1} %", 100.0 * self.share) } else { "none".to_owned() }
    }

    fn judge(&self, cases: &[&Measures]) -> Criterion {
        let known: Vec<_> = cases.iter().filter_map(|measures| (self.is_beyond)(measures)).collect();
        let beyond = known.iter().filter(|is_beyond| **is_beyond).count();
        Criterion {
            name: self.name,
            required: self.required(),
            found: (!known.is_empty()).then(|| format!("{beyond} of {}", known.len())),
            met: beyond as f64 <= self.share * known.len() as f64,
        }
    }
}

impl Criteria {
    pub fn of(situation: Situation) -> Self {
        let (share_near, bounds): (_, &[&[Bound]]) = match situation {
            // At tip-in boost falls first, as the throttle opens: that is no dip.
            Situation::Ramps | Situation::TipIn => (Some(0.93), &[FOLLOWING, ALARMS]),
            Situation::NoisyRamps => (Some(0.9), &[FOLLOWING, ALARMS]),
            Situation::Steps => (Some(0.93), &[FOLLOWING, ALARMS, DIPS]),
            Situation::Rest => (Some(0.93), &[FOLLOWING, ALARMS, NOISE]),
            Situation::EmptyTank => (None, &[ALARMS, NO_VACUUM]),
            Situation::Faults => (None, &[FAULTS]),
        };
        Self { share_near, bounds }
    }

    fn bounds(&self) -> impl Iterator<Item = &'static Bound> {
        self.bounds.iter().copied().flatten()
    }

    /// Judges the cases of a study.
    pub fn judge(&self, cases: &[Option<&Measures>]) -> Vec<Criterion> {
        let run: Vec<&Measures> = cases.iter().copied().flatten().collect();
        let mut criteria = vec![Criterion {
            name: "cases that ran",
            required: "all".to_owned(),
            found: Some(format!("{} of {}", run.len(), cases.len())),
            met: run.len() == cases.len(),
        }];
        if let Some(least) = self.share_near {
            // A case that failed to run is not near.
            let near = run.iter().filter(|measures| measures.deviation <= NEAR).count();
            let share = near as f64 / cases.len().max(1) as f64;
            let worst = greatest(run.iter().map(|measures| Some(measures.deviation))).unwrap_or(f64::NAN);
            criteria.push(Criterion {
                name: "cases within 2 kPa of the reachable reference",
                required: format!("at least {:.0} %", 100.0 * least),
                found: Some(format!("{:.1} %; worst deviation {:.2} kPa", 100.0 * share, 1e-3 * worst)),
                met: share >= least,
            });
        }
        criteria.extend(self.bounds().map(|bound| bound.judge(&run)));
        criteria
    }

    /// Whether a case is reported individually: it violates a bound, or is beyond [`NEAR`] where cases must be within.
    pub fn is_outside(&self, measures: &Measures) -> bool {
        self.share_near.is_some() && measures.deviation > NEAR || self.is_failed(measures)
    }

    /// Whether a case violates a bound.
    pub fn is_failed(&self, measures: &Measures) -> bool {
        self.violated(measures).next().is_some()
    }

    /// The bounds that a case violates.
    pub fn violated(&self, measures: &Measures) -> impl Iterator<Item = &'static str> {
        let is_beyond = |bound: &&Bound| (bound.is_beyond)(measures) == Some(true);
        self.bounds().filter(is_beyond).map(|bound| bound.name)
    }

    /// What the cases may do, as a sentence.
    pub fn sentence(&self) -> String {
        let near =
            self.share_near.map(|share| format!("{:.0} % must be within {} kPa", 100.0 * share, 1e-3 * NEAR));
        let bounds = self.bounds().map(|bound| format!("{}: {}", bound.name, bound.required()));
        near.into_iter().chain(bounds).collect::<Vec<_>>().join("; ")
    }
}

pub fn greatest(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    values.flatten().max_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measures() -> Measures {
        Measures {
            deviation: 1e3,
            deviation_time: 7.0,
            is_above: true,
            overshoot: 500.0,
            shaft_at_rest: Some(200e3),
            shaft_in_transients: Some(230e3),
            least_flow: Some(0.02),
            alarm: Some(0.0),
            dip: 100.0,
            rise: Some(1.0),
            tank: Some(37e3),
            pump: Some(0.7),
            duty_travel: Some(10.0),
            unaided: None,
            faulty: None,
        }
    }

    /// The names of the criteria that are not met.
    fn broken(situation: Situation, cases: &[Option<&Measures>]) -> Vec<&'static str> {
        let criteria = Criteria::of(situation).judge(cases);
        criteria.iter().filter(|criterion| !criterion.met).map(|criterion| criterion.name).collect()
    }

    /// Checks that at most `most` of 1000 cases may be bad, and which criterion more of them break.
    fn judges(situation: Situation, good: &Measures, bad: &Measures, most: usize, name: &str) {
        let required = Criteria::of(situation);
        assert!(required.is_outside(bad) && required.is_failed(bad) && !required.is_outside(good));
        let with = |count: usize| -> Vec<_> {
            (0..1000).map(|index| Some(if index < count { bad } else { good })).collect()
        };
        assert!(broken(situation, &with(most)).is_empty(), "{most} of {bad:?}");
        let found = broken(situation, &with(most + 1));
        assert!(found.len() == 1 && found[0].contains(name), "{found:?} instead of {name}");
    }

    #[test]
    fn each_bound_of_a_sound_engine_is_judged() {
        let good = measures();
        let mut cases = vec![Some(&good); 1000];
        assert!(broken(Situation::Ramps, &cases).is_empty());
        // 70 of 1000 may be beyond 2 kPa, with noise 100.
        let near = Measures { deviation: 2.1e3, ..measures() };
        let required = Criteria::of(Situation::Ramps);
        assert!(required.is_outside(&near) && !required.is_failed(&near));
        for (situation, most) in
            [(Situation::Ramps, 70), (Situation::NoisyRamps, 100), (Situation::Steps, 70)]
        {
            cases.fill(Some(&good));
            cases[..most].fill(Some(&near));
            assert!(broken(situation, &cases).is_empty());
            cases[most] = Some(&near);
            assert_eq!(broken(situation, &cases), ["cases within 2 kPa of the reachable reference"]);
        }
        // The number of cases that may do so, and the criterion.
        for (bad, most, name) in [
            (Measures { deviation: 5.6e3, ..measures() }, 7, "beyond 5.5 kPa"),
            (Measures { deviation: 8.1e3, ..measures() }, 0, "beyond 8 kPa"),
            (Measures { shaft_at_rest: Some(212.1e3), ..measures() }, 2, "above 212 krpm"),
            (Measures { shaft_at_rest: Some(214.1e3), ..measures() }, 0, "above 214 krpm"),
            (Measures { least_flow: Some(-1e-4), ..measures() }, 0, "surge"),
            (Measures { alarm: Some(2.0), ..measures() }, 0, "alarm"),
        ] {
            for situation in [Situation::Ramps, Situation::NoisyRamps, Situation::Steps, Situation::TipIn] {
                judges(situation, &good, &bad, most, name);
            }
        }
        judges(Situation::Steps, &good, &Measures { dip: 501.0, ..measures() }, 0, "moves back");
        judges(
            Situation::Rest,
            &good,
            &Measures { tank: Some(40.1e3), ..measures() },
            0,
            "tank above 40 kPa",
        );
        judges(Situation::Rest, &good, &Measures { pump: Some(0.86), ..measures() }, 0, "pump on");
        // The deviation of a case that failed to run is unknown.
        cases.fill(Some(&good));
        cases[0] = None;
        assert_eq!(broken(Situation::Ramps, &cases), ["cases that ran"]);
    }

    /// Without vacuum other valves hold boost up to 2500 rpm, and the shaft above it as far as they can.
    #[test]
    fn a_start_without_vacuum_is_judged_by_engine_speed() {
        let with = |engine_speed: f64, boost: f64, shaft: f64| Measures {
            deviation: 50e3,
            unaided: Some(Unaided { engine_speed, boost, shaft: Some(shaft) }),
            ..measures()
        };
        let good = with(2500.0, 129e3, 199e3);
        let judge = |bad: &Measures, name: &str| judges(Situation::EmptyTank, &good, bad, 0, name);
        judge(&with(2400.0, 131e3, 199e3), "above 130 kPa");
        judge(&with(2400.0, 129e3, 201e3), "above 200 krpm");
        judge(&with(2600.0, 200e3, 291e3), "above 290 krpm");
        assert!(!Criteria::of(Situation::EmptyTank).is_outside(&with(2600.0, 200e3, 289e3)));
    }

    #[test]
    fn limp_home_must_not_make_a_fault_worse() {
        let extremes =
            |excess: f64, deficit: f64, shaft: f64| Extremes { excess, deficit, shaft: Some(shaft) };
        let with = |kind: FaultKind, with: Extremes, without: Extremes| Measures {
            faulty: Some(Faulty {
                kind,
                with,
                without: Some(without),
                code_after: Some(1.0),
                excess_before_code: with.excess,
            }),
            ..measures()
        };
        let plain = extremes(10e3, 5e3, 200e3);
        let good = with(FaultKind::PumpDead, plain, plain);
        let judge = |bad: &Measures, name: &str| judges(Situation::Faults, &good, bad, 0, name);
        let pump = |limp_home: Extremes, without: Extremes| with(FaultKind::PumpDead, limp_home, without);
        judge(&pump(extremes(10.6e3, 5e3, 200e3), plain), "raises the excess");
        judge(&pump(extremes(10e3, 5e3, 201.1e3), plain), "raises the shaft's speed");
        judge(&pump(extremes(10e3, 5.6e3, 200e3), plain), "gives up boost");
        // Where it would be harmful not to.
        for harmful in [extremes(21e3, 5e3, 200e3), extremes(10e3, 5e3, 213e3)] {
            assert!(!Criteria::of(Situation::Faults).is_outside(&pump(extremes(10e3, 45e3, 200e3), harmful)));
        }
        let of_kind = |kind, excess| with(kind, extremes(excess, 5e3, 200e3), extremes(100e3, 5e3, 250e3));
        judge(&of_kind(FaultKind::BoostSensorStuck, 20.1e3), "no code before");
        judge(&of_kind(FaultKind::BoostSensorDriftsDown, 60.1e3), "no code before");
        judge(&of_kind(FaultKind::BoostSensorDead, 45.1e3), "dead boost sensor");
    }

    #[test]
    fn what_the_fmus_do_not_tell_is_not_judged() {
        let silent = Measures {
            shaft_at_rest: None,
            shaft_in_transients: None,
            least_flow: None,
            alarm: None,
            tank: None,
            pump: None,
            ..measures()
        };
        for situation in [Situation::Ramps, Situation::Rest] {
            assert!(broken(situation, &[Some(&silent)]).is_empty());
            let judged = Criteria::of(situation).judge(&[Some(&silent)]);
            assert!(judged[4..].iter().all(|criterion| criterion.found.is_none()));
        }
    }
}
