//! The criteria of a study; all bounds are defined here.

use serde::Serialize;

use super::case::Measures;

/// This share of the cases must stay within [`NEAR`] of the reachable reference.
pub const SHARE_NEAR: f64 = 0.93;
/// A deviation too small for a driver to feel: twice the 1 kPa of the paper's Figs. 13 and 14 (Pa).
pub const NEAR: f64 = 2e3;
/// The share of the cases that may be beyond [`FAR`], or above [`FAST_AT_REST`]: extremes of random plants.
pub const SHARE_FAR: f64 = 0.002;
/// Slightly more than the 5 kPa that the paper allows for the steps of its Fig. 13 (Pa).
pub const FAR: f64 = 5.5e3;
/// The largest deviation allowed (Pa).
pub const FARTHEST: f64 = 7e3;
/// Shaft speeds at rest (rpm): 7 krpm above the target of the controller's limits, and the highest allowed.
pub const FAST_AT_REST: f64 = 212e3;
pub const FASTEST_AT_REST: f64 = 214e3;

/// What at most a share of the cases may do.
struct Bound {
    name: &'static str,
    share: f64,
    /// Whether a case does; none if the FMUs do not tell.
    is_beyond: fn(&Measures) -> Option<bool>,
}

const BOUNDS: [Bound; 6] = [
    Bound {
        name: "cases beyond 5.5 kPa",
        share: SHARE_FAR,
        is_beyond: |measures| Some(measures.deviation > FAR),
    },
    Bound {
        name: "cases beyond 7 kPa",
        share: 0.0,
        is_beyond: |measures| Some(measures.deviation > FARTHEST),
    },
    Bound {
        name: "cases with a shaft above 212 krpm at rest",
        share: SHARE_FAR,
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
    Bound { name: "cases with an alarm", share: 0.0, is_beyond: |measures| Some(measures.alarm? != 0.0) },
];

/// A criterion and its result.
#[derive(Clone, Debug, Serialize)]
pub struct Criterion {
    pub name: &'static str,
    /// What is required.
    pub asked: String,
    /// What was found; none if the FMUs do not provide it.
    pub found: Option<String>,
    pub holds: bool,
}

impl Bound {
    fn judge(&self, cases: &[&Measures]) -> Criterion {
        let known: Vec<_> = cases.iter().filter_map(|measures| (self.is_beyond)(measures)).collect();
        let beyond = known.iter().filter(|is_beyond| **is_beyond).count();
        let asked =
            if self.share > 0.0 { format!("at most {} %", 100.0 * self.share) } else { "none".to_owned() };
        Criterion {
            name: self.name,
            asked,
            found: (!known.is_empty()).then(|| format!("{beyond} of {}", known.len())),
            holds: beyond as f64 <= self.share * known.len() as f64,
        }
    }
}

/// Judges the cases of a study.
pub fn judge(cases: &[Option<&Measures>]) -> Vec<Criterion> {
    let run: Vec<&Measures> = cases.iter().copied().flatten().collect();
    // A case that failed to run is not near.
    let near = run.iter().filter(|measures| measures.deviation <= NEAR).count();
    let share_near = near as f64 / cases.len().max(1) as f64;
    let worst = greatest(run.iter().map(|measures| Some(measures.deviation))).unwrap_or(f64::NAN);
    let mut criteria = vec![
        Criterion {
            name: "cases that ran",
            asked: "all".to_owned(),
            found: Some(format!("{} of {}", run.len(), cases.len())),
            holds: run.len() == cases.len(),
        },
        Criterion {
            name: "cases within 2 kPa of the reachable reference",
            asked: format!("at least {:.0} %", 100.0 * SHARE_NEAR),
            found: Some(format!(
                "{:.1} %; the worst deviates by {:.2} kPa",
                100.0 * share_near,
                1e-3 * worst
            )),
            holds: share_near >= SHARE_NEAR,
        },
    ];
    criteria.extend(BOUNDS.iter().map(|bound| bound.judge(&run)));
    criteria
}

/// Whether a case is reported individually: it violates a bound or is beyond [`NEAR`].
pub fn is_outside(measures: &Measures) -> bool {
    measures.deviation > NEAR || is_failed(measures)
}

/// Whether a case violates a bound.
pub fn is_failed(measures: &Measures) -> bool {
    BOUNDS.iter().any(|bound| (bound.is_beyond)(measures) == Some(true))
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
        }
    }

    /// The indices of the criteria that fail.
    fn broken(cases: &[Option<&Measures>]) -> Vec<usize> {
        judge(cases)
            .iter()
            .enumerate()
            .filter(|(_, criterion)| !criterion.holds)
            .map(|(index, _)| index)
            .collect()
    }

    #[test]
    fn each_bound_is_judged() {
        let good = measures();
        let mut cases = vec![Some(&good); 500];
        assert!(broken(&cases).is_empty() && !is_outside(&good));
        // 35 of 500 may be beyond 2 kPa.
        let near = Measures { deviation: 2.1e3, ..measures() };
        cases[..35].fill(Some(&near));
        assert!(broken(&cases).is_empty() && is_outside(&near) && !is_failed(&near));
        cases[35] = Some(&near);
        assert_eq!(broken(&cases), [1]);
        // The number of cases that may do so, and the criterion.
        for (bad, most, criterion) in [
            (Measures { deviation: 5.6e3, ..measures() }, 1, 2),
            (Measures { deviation: 7.1e3, ..measures() }, 0, 3),
            (Measures { shaft_at_rest: Some(212.1e3), ..measures() }, 1, 4),
            (Measures { shaft_at_rest: Some(214.1e3), ..measures() }, 0, 5),
            (Measures { least_flow: Some(-1e-4), ..measures() }, 0, 6),
            (Measures { alarm: Some(2.0), ..measures() }, 0, 7),
        ] {
            assert!(is_failed(&bad));
            let with = |count: usize| -> Vec<_> {
                (0..500).map(|index| Some(if index < count { &bad } else { &good })).collect()
            };
            assert!(broken(&with(most)).is_empty(), "{most} of {bad:?}");
            assert_eq!(broken(&with(most + 1)), [criterion]);
        }
        // The deviation of a case that failed to run is unknown.
        cases.fill(Some(&good));
        cases[0] = None;
        assert_eq!(broken(&cases), [0]);
    }

    #[test]
    fn what_the_fmus_do_not_tell_is_not_judged() {
        let silent = Measures {
            shaft_at_rest: None,
            shaft_in_transients: None,
            least_flow: None,
            alarm: None,
            ..measures()
        };
        assert!(broken(&[Some(&silent)]).is_empty());
        assert!(judge(&[Some(&silent)])[4..].iter().all(|criterion| criterion.found.is_none()));
    }
}
