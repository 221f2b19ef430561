//! Statuses and messages of FMUs, and the error of a failed call.

use std::ffi::c_int;
use std::fmt;

use anyhow::Error;
use fmu_package::{FmuDescription, FmuVariable};
use fmu_solve::display::Seconds;
use fmu_terms::{DataType, Version};

/// A status, as the FMU returned it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status(pub c_int);

impl Status {
    /// The call succeeded.
    pub const OK: Self = Self(0);
    /// The call succeeded with a warning.
    pub const WARNING: Self = Self(1);
    /// The FMU refused the call, or completed only part of a step; the instance stays usable.
    pub const DISCARD: Self = Self(2);
    /// The instance is no longer usable.
    pub const FATAL: Self = Self(4);

    /// Whether the call succeeded, with a warning or without.
    #[must_use]
    pub fn succeeded(self) -> bool {
        matches!(self, Self::OK | Self::WARNING)
    }

    /// The standard's name, which begins with `fmi2` or `fmi3`.
    fn name(self, prefix: &str) -> String {
        let known = ["OK", "Warning", "Discard", "Error", "Fatal", "Pending"];
        match usize::try_from(self.0).ok().and_then(|status| known.get(status)) {
            Some(name) => format!("{prefix}{name}"),
            None => format!("the unknown status {}", self.0),
        }
    }
}

/// What an FMU's library lacks: a function, by its name, or several.
#[derive(Clone, Copy, Debug)]
pub struct Missing(pub &'static str);

impl fmt::Display for Missing {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "its library has no {}", self.0)
    }
}

impl std::error::Error for Missing {}

/// A called function and its status.
#[derive(Clone, Copy, Debug)]
pub struct Called {
    pub function: &'static str,
    pub status: Status,
}

impl fmt::Display for Called {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} returned {}", self.function, self.status.name(prefix_of(self.function)))
    }
}

/// The prefix of a function's name, `fmi2` or `fmi3`.
fn prefix_of(function: &str) -> &str {
    function.get(..4).unwrap_or_default()
}

/// A logged message.
#[derive(Clone, Debug)]
pub struct Message {
    /// The status that the FMU gave the message.
    pub status: Status,
    /// The text, as the FMU formatted it.
    pub text: String,
    /// The time that the FMU had reached before the call that logged it (s), if any.
    pub time: Option<f64>,
}

impl Message {
    /// The message of an FMU or instance, with its time: that of the text, if it begins with one as the messages of
    /// `fmu-export` do, since an event may be within the step.
    #[must_use]
    pub fn of(&self, name: &str) -> String {
        match self.time {
            _ if begins_with_time(&self.text) => format!("{name} {}", self.text),
            Some(time) => format!("{name} at {} s: {}", Seconds(time), self.text),
            None => format!("{name}: {}", self.text),
        }
    }
}

/// Whether a text begins as in `at 0.5 s: `.
fn begins_with_time(text: &str) -> bool {
    let time = text.strip_prefix("at ").and_then(|rest| rest.split_once(" s: "));
    time.is_some_and(|(time, _)| time.parse::<f64>().is_ok())
}

/// The messages that explain a failed call: warnings and errors, else the last messages.
pub(super) fn telling(mut messages: Vec<Message>, description: &FmuDescription) -> Vec<Message> {
    const LAST: usize = 3;
    if messages.iter().any(|message| message.status.0 > Status::WARNING.0) {
        messages.retain(|message| message.status.0 > Status::WARNING.0);
    } else {
        messages.drain(..messages.len().saturating_sub(LAST));
    }
    messages.into_iter().map(|message| with_names(message, description)).collect()
}

/// A message with references such as `#r12#`, in FMI 3.0 `#12#`, replaced by names, and `##` by `#` (FMI 2.0.5, section
/// 2.1.5; FMI 3.0.2, section 2.3.1).
pub(super) fn with_names(message: Message, description: &FmuDescription) -> Message {
    if !message.text.contains('#') {
        return message;
    }
    let mut text = String::new();
    let mut parts = message.text.split('#');
    text += parts.next().unwrap_or_default();
    // References and text alternate.
    while let Some(reference) = parts.next() {
        let types: &[DataType] = match reference.chars().next() {
            Some('r') => &[DataType::Real],
            Some('i') => &[DataType::Integer, DataType::Enumeration],
            Some('b') => &[DataType::Boolean],
            Some('s') => &[DataType::String],
            _ => &[],
        };
        let named = description.variables.iter().find(|variable| {
            let own = variable.value_reference.text();
            if description.version() == Version::Three {
                return reference == own;
            }
            types.iter().any(|data_type| variable.data_type == *data_type) && reference.get(1..) == Some(own)
        });
        // The reference of an element is the array's.
        let array = |variable: &FmuVariable| {
            let array = variable.element.and_then(|_| variable.array());
            array.unwrap_or(&variable.name).to_owned()
        };
        match (named.map(array), parts.next()) {
            (Some(name), Some(rest)) => text += &format!("{name}{rest}"),
            (None, Some(rest)) if reference.is_empty() => text += &format!("#{rest}"),
            (_, Some(rest)) => text += &format!("#{reference}#{rest}"),
            (_, None) => text += &format!("#{reference}"),
        }
    }
    Message { text, ..message }
}

/// A failed call with the FMU's messages.
#[derive(Debug)]
pub struct CallFailed {
    /// The name of the instance.
    pub instance: String,
    /// The C function of FMI.
    pub function: &'static str,
    /// The variables in the call, if they are few.
    pub variables: Vec<String>,
    /// The time reached by the instance (s); none before the experiment is set up.
    pub time: Option<f64>,
    /// The status that was returned; none if the function to instantiate returned null.
    pub status: Option<Status>,
    /// The time up to which a discarded step succeeded (s), if the FMU gives it.
    pub last_successful_time: Option<f64>,
    /// The messages logged in the call.
    pub messages: Vec<Message>,
}

impl fmt::Display for CallFailed {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.instance, self.function)?;
        if let [variables @ .., last] = self.variables.as_slice()
            && variables.len() < 3
        {
            write!(formatter, " of ")?;
            variables.iter().try_for_each(|variable| write!(formatter, "{variable}, "))?;
            write!(formatter, "{last}")?;
        }
        match self.status {
            Some(status) => {
                write!(formatter, " returned {}", status.name(prefix_of(self.function)))?;
            }
            None => write!(formatter, " returned no instance")?,
        }
        if let Some(time) = self.time {
            write!(formatter, " at {} s", Seconds(time))?;
        }
        if let Some(time) = self.last_successful_time {
            write!(formatter, ", having reached {} s", Seconds(time))?;
        }
        if self.messages.is_empty() {
            return write!(formatter, "; the FMU gives no reason");
        }
        self.messages.iter().try_for_each(|message| write!(formatter, "\n  {}", message.text.trim_end()))
    }
}

impl std::error::Error for CallFailed {}

/// Whether the FMU asks for a shorter step.
pub(super) fn is_discarded(error: &Error) -> bool {
    error.downcast_ref::<CallFailed>().is_some_and(|failed| failed.status == Some(Status::DISCARD))
}

/// An FMU asks for the end of the simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Ended {
    /// The instance's name.
    pub instance: String,
    /// The time at which the simulation ends (s).
    pub time: f64,
}

impl Ended {
    /// Who ended, and when.
    #[must_use]
    pub fn in_brief(&self) -> String {
        format!("{}: ended at {} s", self.instance, Seconds(self.time))
    }
}

impl fmt::Display for Ended {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "{}: the FMU requests the end of the simulation at {} s",
            self.instance,
            Seconds(self.time)
        )
    }
}

impl std::error::Error for Ended {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_has_its_time_once() {
        let of = |text: &str, time| Message { status: Status::WARNING, text: text.to_owned(), time }.of("it");
        assert_eq!(of("low", Some(0.25)), "it at 0.25 s: low");
        assert_eq!(of("low", None), "it: low");
        // The event is within the step.
        assert_eq!(of("at 0.3125 s: low", Some(0.25)), "it at 0.3125 s: low");
        assert_eq!(of("at -1e-3 s: low", None), "it at -1e-3 s: low");
        assert_eq!(of("at last s: low", Some(0.25)), "it at 0.25 s: at last s: low");
    }
}
