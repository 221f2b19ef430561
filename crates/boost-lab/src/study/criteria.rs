//! The criteria of a study; all bounds are defined here.

use serde::Serialize;

use super::case::Measures;

/// This share of the cases must stay within [`NEAR`] of the reachable reference.
pub const SHARE_NEAR: f64 = 0.95;
/// A deviation too small for a driver to feel: twice the 1 kPa of the paper's Figs. 13 and 14 (Pa).
pub const NEAR: f64 = 2e3;
/// The largest deviation allowed; the paper's bound for the steps of its Fig. 13 (Pa).
pub const FAR: f64 = 5e3;
/// The highest shaft speed allowed at rest; 5 krpm above the target of the controller's limits (rpm).
pub const FASTEST_AT_REST: f64 = 210e3;

type IsBad = fn(&Measures) -> Option<bool>;

/// What no case may do, with whether one does; none if the FMUs do not tell.
const BOUNDS: [(&str, IsBad); 3] = [
    ("cases with a shaft above 210 krpm at rest", |measures| {
        measures.shaft_at_rest.map(|speed| speed > FASTEST_AT_REST)
    }),
    ("cases with a compressor in surge", |measures| measures.least_flow.map(|flow| flow < 0.0)),
    ("cases with an alarm", |measures| measures.alarm.map(|code| code != 0.0)),
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

/// Judges the cases of a study. A case that failed to run counts as failed.
pub fn judge(cases: &[Option<&Measures>]) -> Vec<Criterion> {
    let run: Vec<_> = cases.iter().flatten().collect();
    let share = |count: usize| count as f64 / cases.len().max(1) as f64;
    let near = run.iter().filter(|measures| measures.deviation <= NEAR).count();
    let beyond = cases.len() - run.iter().filter(|measures| measures.deviation <= FAR).count();
    let worst = greatest(run.iter().map(|measures| Some(measures.deviation)));
    let criterion = |name, asked, found, holds| Criterion { name, asked, found, holds };
    let count = |(name, is_bad): (_, IsBad)| {
        let known: Vec<_> = run.iter().filter_map(|measures| is_bad(measures)).collect();
        let bad = known.iter().filter(|bad| **bad).count();
        let found = (!known.is_empty()).then(|| format!("{bad} of {}", known.len()));
        criterion(name, "none".to_owned(), found, bad == 0)
    };
    let mut criteria = vec![
        criterion(
            "cases that ran",
            "all".to_owned(),
            Some(format!("{} of {}", run.len(), cases.len())),
            run.len() == cases.len(),
        ),
        criterion(
            "cases within 2 kPa of the reachable reference",
            format!("at least {:.0} %", 100.0 * SHARE_NEAR),
            Some(format!("{:.1} %", 100.0 * share(near))),
            share(near) >= SHARE_NEAR,
        ),
        criterion(
            "cases beyond 5 kPa",
            "none".to_owned(),
            Some(format!("{beyond}; the worst deviates by {:.2} kPa", 1e-3 * worst.unwrap_or(f64::NAN))),
            beyond == 0,
        ),
    ];
    criteria.extend(BOUNDS.map(count));
    criteria
}

/// Whether a case is reported individually: it violates a bound or is beyond [`NEAR`].
pub fn is_outside(measures: &Measures) -> bool {
    measures.deviation > NEAR || is_failed(measures)
}

/// Whether a case makes the study fail.
pub fn is_failed(measures: &Measures) -> bool {
    measures.deviation > FAR || BOUNDS.iter().any(|(_, is_bad)| is_bad(measures) == Some(true))
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
        let mut cases = vec![Some(&good); 20];
        assert!(broken(&cases).is_empty() && !is_outside(&good));
        // One of 20 may be beyond 2 kPa, none beyond 5.
        let near = Measures { deviation: 2.1e3, ..measures() };
        cases[0] = Some(&near);
        assert!(broken(&cases).is_empty() && is_outside(&near) && !is_failed(&near));
        cases[1] = Some(&near);
        assert_eq!(broken(&cases), [1]);
        cases[1] = Some(&good);
        for (bad, criterion) in [
            (Measures { deviation: 5.1e3, ..measures() }, 2),
            (Measures { shaft_at_rest: Some(211e3), ..measures() }, 3),
            (Measures { least_flow: Some(-1e-4), ..measures() }, 4),
            (Measures { alarm: Some(2.0), ..measures() }, 5),
        ] {
            assert!(is_failed(&bad));
            let with_bad: Vec<_> = [Some(&bad)].into_iter().chain(cases[1..].iter().copied()).collect();
            assert_eq!(broken(&with_bad), [criterion]);
        }
        // The deviation of a case that failed to run is unknown.
        cases[0] = None;
        assert_eq!(broken(&cases), [0, 2]);
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
        assert!(judge(&[Some(&silent)])[3..].iter().all(|criterion| criterion.found.is_none()));
    }
}
