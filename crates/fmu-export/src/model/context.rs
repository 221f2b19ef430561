//! What a model receives besides variables and inputs: the experiment, the importer's logger, and the FMU's files.

use core::fmt;

use fmu_solve::Error;
use fmu_solve::display::{Seconds, Shown};

use crate::model::variables::Variables;

/// The category of errors.
pub const ERROR: &str = "logStatusError";
/// The category of warnings.
pub const WARNING: &str = "logStatusWarning";
/// The category of events.
pub const EVENT: &str = "logEvents";

/// The arguments of `fmi2SetupExperiment`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Experiment {
    /// Start time in seconds.
    pub start_time: f64,
    /// Stop time in seconds, if defined.
    pub stop_time: Option<f64>,
    /// Relative tolerance, if defined and above 0; a model receives that of its JSON if the importer defines none.
    pub tolerance: Option<f64>,
}

impl Experiment {
    /// This experiment with a model's own tolerance if the importer defines none (FMI 2.0.5, section 2.1.5).
    pub(crate) fn of<V: Variables>(self) -> Self {
        Self { tolerance: self.tolerance.or(V::DEFAULT_TOLERANCE), ..self }
    }
}

crate::persistent!(Experiment { start_time, stop_time, tolerance });

impl Experiment {
    /// The length in s, or a second if no end is defined.
    pub(crate) fn length(&self) -> f64 {
        self.stop_time.map_or(1.0, |stop_time| stop_time - self.start_time)
    }
}

/// What a model receives besides variables and inputs: the experiment, the importer's logger, and the FMU's files.
pub struct Context<'a> {
    /// The experiment as set up.
    pub experiment: Experiment,
    log: &'a mut dyn Log,
    #[cfg(not(target_os = "none"))]
    pub(super) resources: Option<&'a super::resources::Resources>,
    /// When the model requested the end, in s.
    pub(crate) end: Option<f64>,
}

impl<'a> Context<'a> {
    /// A context outside any FMU, for calling a model directly.
    pub fn new(experiment: Experiment, log: &'a mut dyn Log) -> Self {
        Self {
            experiment,
            log,
            #[cfg(not(target_os = "none"))]
            resources: None,
            end: None,
        }
    }

    /// This context with another logger.
    pub(crate) fn with_log<'b>(&'b self, log: &'b mut dyn Log) -> Context<'b> {
        Context { log, ..*self }
    }

    /// Requests the end of the simulation at a time (s) in the present step.
    pub fn terminate(&mut self, time: f64) {
        self.end = Some(time);
    }

    /// When the model requested the end, in s.
    ///
    /// # Errors
    /// When that is not finite.
    #[inline]
    pub(crate) fn end(&self) -> Result<Option<f64>, Error> {
        #[cold]
        fn refused(end: f64) -> Error {
            Error::new(format_args!("the model requests the end at {} s", Shown(end)))
        }
        match self.end {
            Some(end) if !end.is_finite() => Err(refused(end)),
            end => Ok(end),
        }
    }

    /// Messages from here on are of a time in s. Events, samples and ticks set it; in a [`Stepper`](crate::Stepper)'s own
    /// step, it is the start, unless the model sets it.
    pub fn at(&mut self, time: f64) {
        self.log.at(time);
    }

    /// Warns the user of something that may affect the results. The time precedes the text; an immediate
    /// repetition is dropped.
    pub fn warn(&mut self, message: fmt::Arguments<'_>) {
        self.log.message(WARNING, message);
    }

    /// Logs an event, if debug logging is on. The time precedes the text; an immediate
    /// repetition is dropped.
    pub fn event(&mut self, message: fmt::Arguments<'_>) {
        self.log.message(EVENT, message);
    }
}

/// Receives a model's messages. Functions of a category and a message do, and ignore the time.
pub trait Log {
    /// The messages that follow are of a time in s.
    fn at(&mut self, time: f64) {
        let _ = time;
    }

    /// Receives a message in a category.
    fn message(&mut self, category: &'static str, message: fmt::Arguments<'_>);
}

impl<F: FnMut(&'static str, fmt::Arguments<'_>)> Log for F {
    fn message(&mut self, category: &'static str, message: fmt::Arguments<'_>) {
        self(category, message);
    }
}

/// Messages that begin with their time, which is not the context's: the compiler would then keep that in memory even in
/// steps without messages, which are short.
pub(crate) struct Timed<F> {
    /// The time of the messages, in s.
    time: f64,
    log: F,
}

impl<F: FnMut(&'static str, fmt::Arguments<'_>)> Timed<F> {
    pub(crate) fn new(time: f64, log: F) -> Self {
        Self { time, log }
    }
}

impl<F: FnMut(&'static str, fmt::Arguments<'_>)> Log for Timed<F> {
    fn at(&mut self, time: f64) {
        self.time = time;
    }

    fn message(&mut self, category: &'static str, message: fmt::Arguments<'_>) {
        (self.log)(category, format_args!("at {} s: {message}", Seconds(self.time)));
    }
}

impl fmt::Debug for Context<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Context").field("experiment", &self.experiment).finish_non_exhaustive()
    }
}
