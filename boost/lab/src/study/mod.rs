//! A pass/fail study of a controller on random plants, ambient conditions and manoeuvres.
//!
//! - [`situation`] has what the cases may go through, [`fault`] the faults.
//! - [`draw`] draws the cases from a Latin hypercube.
//! - [`names`] are the variables of a study.
//! - [`reach`] finds what a case's plant can reach.
//! - [`case`] runs a case in closed loop and measures its deviation from that.
//! - [`criteria`] judges the measures.
//! - [`optimum`] searches for the best control of a case around its worst moment.
//! - [`report`] writes the results.
//!
//! Each finished case is written to the [journal](fmu_run::journal) at once; an interrupted study resumes from it.

pub mod case;
pub mod criteria;
pub mod draw;
mod fault;
pub mod names;
mod optimum;
pub mod reach;
mod report;
pub mod situation;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use self::case::{Measures, Rig, Simulated};
use self::criteria::Criteria;
use self::draw::{Case, Cases};
use self::optimum::Optimum;
use self::reach::Reach;
use fmu_io::threads::each;
use fmu_run::journal::{Journal, Part};
use fmu_run::workers::Workers;

pub use self::report::{StudyReport, csv};

/// The number of cases explained individually: more mean that something is fundamentally wrong.
const MOST_EXPLAINED: usize = 40;

/// A study: its FMUs, cases and controller strategies.
pub struct Study {
    pub rig: Rig,
    pub cases: Cases,
    /// The strategies, of which the first is judged; none means the controller's default.
    pub strategies: Vec<Option<String>>,
}

/// A finished case.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Outcome {
    pub case: usize,
    /// The runs, one for each strategy.
    pub runs: Vec<Run>,
}

/// A case with a strategy.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Run {
    /// The error message of a failed run.
    pub error: Option<String>,
    pub measures: Option<Measures>,
}

/// A case outside the criteria, with its traces and the best control found.
pub struct Explained {
    pub case: Case,
    pub measures: Measures,
    pub simulated: Simulated,
    /// The best control; none where the plant cannot save its state, or a better control is not searched.
    pub optimum: Option<Optimum>,
}

impl Part for Outcome {
    type Key = usize;

    fn key(&self) -> usize {
        self.case
    }
}

impl Study {
    /// Has the cases run that are not in the journal, by workers that call [`Study::run_one`]; `progress` is called after
    /// each.
    pub fn run(
        &self,
        journal: &Journal<Outcome>,
        workers: &Workers<'_>,
        progress: impl Fn() + Sync,
    ) -> Result<Vec<Outcome>> {
        let jobs: Vec<_> = (0..self.cases.len()).map(|number| (number, number)).collect();
        let failed = |number: &usize, reason| {
            let run = Run { error: Some(reason), measures: None };
            Ok(Outcome { case: *number, runs: vec![run; self.strategies.len()] })
        };
        workers.finish(journal, &jobs, failed, |_| progress())
    }

    /// Runs a case.
    pub fn run_one(&self, number: usize) -> Outcome {
        let case = self.cases.case(number);
        let reach = Reach::of(&case, &self.rig.plant);
        let run = |strategy: &Option<String>| {
            let reach = reach.as_ref().map_err(|error| anyhow::anyhow!("{error:#}"))?;
            self.rig.measure(&case, reach, self.rig.variant(strategy.as_deref()))
        };
        let runs = self.strategies.iter().map(|strategy| match run(strategy) {
            Ok(measures) => Run { error: None, measures: Some(measures) },
            Err(error) => Run { error: Some(format!("{error:#}")), measures: None },
        });
        Outcome { case: number, runs: runs.collect() }
    }

    /// Explains the cases outside the criteria, worst first.
    pub fn explain(
        &self,
        outcomes: &[Outcome],
        threads: usize,
        progress: impl Fn() + Sync,
    ) -> Result<Vec<Explained>> {
        let mut outside = self.outside(outcomes);
        outside.truncate(MOST_EXPLAINED);
        each(threads, outside, |(number, measures)| {
            let case = self.cases.case(number);
            let strategy = self.strategies[0].as_deref();
            let reach = Reach::of(&case, &self.rig.plant)?;
            let variant = self.rig.variant(strategy);
            let simulated = self.rig.simulate(&case, &reach, variant)?;
            let search = || optimum::search(&self.rig, &case, variant, &simulated, &measures);
            let is_searched = self.rig.saves_states && case.situation.is_searched();
            let optimum = is_searched.then(search).transpose()?;
            progress();
            Ok(Explained { case, measures, simulated, optimum })
        })
    }

    /// What is required of the cases.
    pub fn required(&self) -> Criteria {
        Criteria::of(self.cases.situation)
    }

    /// The cases outside the criteria with the judged strategy, worst first.
    pub fn outside(&self, outcomes: &[Outcome]) -> Vec<(usize, Measures)> {
        let required = self.required();
        let measures = |outcome: &Outcome| Some((outcome.case, outcome.runs.first()?.measures.clone()?));
        let outside = outcomes.iter().filter_map(measures);
        let mut outside: Vec<_> = outside.filter(|(_, measures)| required.is_outside(measures)).collect();
        outside.sort_by(|(_, a), (_, b)| b.deviation.total_cmp(&a.deviation));
        outside
    }
}
