//! The controller with its parameters and what it answers.

use fmu_export::calibration::{self, Cells, Follower};
use fmu_export::display::Text;
use fmu_export::frames::{self, Kind};
use fmu_export::persistence::Archive;
use fmu_export::{Error, Persistent as _, Task};

use crate::board::{SerialLine, Stopwatch};
use crate::stack;
use boost_fmu::controller::variables::Real;
use boost_fmu::controller::variables::calibration::{MEASUREMENTS, PARAMETERS, START_PAGE};
use boost_fmu::controller::{ControlLaw, limp_home};

/// The parameters with which the firmware starts, in the flash.
static REFERENCE_PAGE: [u64; PARAMETERS] = reference_page();

/// The start values, with those of the parameter set.
const fn reference_page() -> [u64; PARAMETERS] {
    let (start, _) = START_PAGE.as_chunks::<8>();
    let set: &[(usize, u64)] = include!(concat!(env!("OUT_DIR"), "/parameters.rs"));
    let mut page = [0; PARAMETERS];
    let mut cell = 0;
    while cell < PARAMETERS {
        page[cell] = u64::from_le_bytes(start[cell]);
        cell += 1;
    }
    let mut number = 0;
    while number < set.len() {
        page[set[number].0] = set[number].1;
        number += 1;
    }
    page
}

/// The bytes of the results, at most: eight for each measurement.
const MOST_RESULTS: usize = 8 * MEASUREMENTS;

/// The instructions, in ticks of the stopwatch, of the samples.
#[derive(Clone, Copy, Default)]
struct Statistics {
    samples: u64,
    ticks: u64,
    most: u64,
}

pub struct Controller {
    task: Task<ControlLaw>,
    /// Whether the commands are those for the way home, until there are measurements.
    limps_home: bool,
    page: &'static Cells<PARAMETERS>,
    follower: Follower<PARAMETERS>,
    measurements: &'static Cells<MEASUREMENTS>,
    line: SerialLine,
    statistics: Statistics,
    /// The samples since the last measurements.
    missing: u32,
}

impl Controller {
    pub fn new(
        page: &'static Cells<PARAMETERS>,
        measurements: &'static Cells<MEASUREMENTS>,
        line: SerialLine,
    ) -> Self {
        page.set(0, REFERENCE_PAGE.iter().copied());
        Self {
            task: Task::default(),
            limps_home: false,
            page,
            follower: Follower::new(),
            measurements,
            line,
            statistics: Statistics::default(),
            missing: 0,
        }
    }

    /// The sample period in s.
    pub fn period(&self) -> f64 {
        self.task.period()
    }

    /// Writes cells to the calibration page, after the number of the first one.
    pub fn write_page(&mut self, mut cells: impl Iterator<Item = u64>) {
        let first = cells.next().and_then(|first| usize::try_from(first).ok());
        self.page.set(first.unwrap_or(PARAMETERS), cells);
    }

    /// Starts anew with inputs and the parameters of the calibration page, and answers.
    pub fn initialize(&mut self, inputs: impl Iterator<Item = u64>) {
        let done = self.start(inputs);
        self.answer(done);
    }

    fn start(&mut self, inputs: impl Iterator<Item = u64>) -> Result<(), Error> {
        self.task = Task::default();
        self.follower = Follower::new();
        if let Some(page) = self.follower.changed(self.page) {
            self.task.take_page(page)?;
        }
        calibration::set_inputs(&mut self.task.variables, inputs)?;
        self.task.initialize(&mut log(self.line))
    }

    /// Executes a sample with inputs, and answers.
    pub fn sample(&mut self, inputs: impl Iterator<Item = u64>) {
        let done = calibration::set_inputs(&mut self.task.variables, inputs).and_then(|()| self.execute());
        self.answer(done);
    }

    /// Takes measurements for the next samples, with which it starts anew if it does not run. Returns whether it has just
    /// started.
    pub fn take_measurements(&mut self, inputs: impl Iterator<Item = u64>) -> bool {
        if self.task.is_initialized() && !self.limps_home {
            if calibration::set_inputs(&mut self.task.variables, inputs).is_ok() {
                self.missing = 0;
            }
            return false;
        }
        let done = self.start(inputs);
        let has_started = done.is_ok();
        if has_started {
            (self.limps_home, self.missing) = (false, 0);
        }
        self.answer(done);
        has_started
    }

    /// Executes a sample with the latest measurements, or limps home without.
    pub fn release(&mut self) {
        self.missing = self.missing.saturating_add(1);
        let parameters = &self.task.variables.parameters;
        // As long as a measurement must be implausible to count as a fault.
        let most = parameters.diagnosis.confirmation_time;
        self.limps_home |= self.missing as Real * parameters.sample_time > most;
        let done = if self.limps_home { Ok(()) } else { self.execute() };
        self.limps_home |= done.is_err();
        if self.limps_home {
            let variables = &mut self.task.variables;
            variables.outputs = limp_home(&variables.parameters);
        }
        self.answer(done);
    }

    /// Limps home until there are measurements.
    pub fn limp_home(&mut self) {
        self.limps_home = true;
    }

    /// Executes a sample, with a changed page if the controller takes it.
    fn execute(&mut self) -> Result<(), Error> {
        if let Some(page) = self.follower.changed(self.page)
            && let Err(error) = self.task.take_page(page)
        {
            let text = Text::<200>::of(format_args!("the parameters stay as they were: {error}"));
            frames::send(Kind::Warning, text.bytes(), |byte| self.line.send(byte));
        }
        let stopwatch = Stopwatch::start();
        let done = execute_sample(&mut self.task, self.line);
        let ticks = stopwatch.stop().into();
        let Statistics { samples, ticks: all, most } = self.statistics;
        self.statistics = Statistics { samples: samples + 1, ticks: all + ticks, most: most.max(ticks) };
        done
    }

    /// Shows the variables to calibration tools, and sends them, or an error.
    fn answer(&mut self, done: Result<(), Error>) {
        let variables = &mut self.task.variables;
        self.measurements.set(0, calibration::measurements(variables));
        let mut results = [0; MOST_RESULTS];
        let mut archive = Archive::filling(&mut results);
        let archived = done
            .and_then(|()| variables.outputs.persist(&mut archive))
            .and_then(|()| variables.locals.persist(&mut archive));
        let length = MOST_RESULTS - archive.left();
        let send = |byte| self.line.send(byte);
        match archived {
            Ok(()) => frames::send(Kind::Answer, results.iter().copied().take(length), send),
            Err(error) => frames::send(Kind::Error, Text::<200>::of(error).bytes(), send),
        }
    }

    /// Sends what samples and stack have cost since it was asked last.
    pub fn send_statistics(&mut self) {
        let Statistics { samples, ticks, most } = core::mem::take(&mut self.statistics);
        let cells = [samples, ticks, most, stack::used() as u64];
        stack::paint();
        frames::send(Kind::Statistics, frames::bytes(cells.into_iter()), |byte| self.line.send(byte));
    }
}

/// Executes a sample: what the budgets are of.
#[inline(never)]
fn execute_sample(task: &mut Task<ControlLaw>, line: SerialLine) -> Result<(), Error> {
    task.sample(&mut log(line))
}

/// Sends messages over the line.
fn log(line: SerialLine) -> impl FnMut(&'static str, core::fmt::Arguments<'_>) {
    move |category, message| {
        frames::send(Kind::of_message(category), Text::<200>::of(message).bytes(), |byte| line.send(byte));
    }
}
