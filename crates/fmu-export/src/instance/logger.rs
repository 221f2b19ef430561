//! Messages to the importer: through its logger callback, in the declared categories (FMI 2.0.5, section 2.1.5; FMI
//! 3.0.2, section 2.3.1).
//!
//! Errors are always logged, and in FMI 2.0 warnings too; events are logged only while debug logging is on for their
//! category.
//!
//! Messages are logged when a function returns and the instance is no longer in use, so that the importer's logger may
//! call the instance, which the standard does not forbid.

use core::cell::{Cell, RefCell};
use core::ffi::CStr;
use core::fmt;
use std::ffi::CString;
use std::sync::Arc;

use fmu_abi::Status;
use fmu_solve::Error;
use fmu_solve::persistence::{Archive, Persistent};

use crate::checksum::checksum;
use crate::model::context::{ERROR, EVENT, WARNING};
use crate::model::description::{ModelDescription, Version};

/// An instance's messages.
#[derive(Debug, Default)]
pub(crate) struct Logger {
    recipient: Option<Arc<dyn Recipient>>,
    categories: &'static [&'static str],
    /// For each category, whether debug logging is on.
    enabled: Vec<bool>,
    /// Whether warnings are logged even if not enabled.
    always_warns: bool,
    /// The status of a call that causes a warning.
    warned: Status,
    /// Messages not yet logged.
    pending: RefCell<Vec<Message>>,
    /// The checksum of the last message, if it is the model's: a model that computes the same instant twice logs it once.
    last: Cell<Option<u64>>,
}

/// The importer's logger, called in each version's own way.
pub(crate) trait Recipient: fmt::Debug {
    /// Receives a message in a category.
    fn receive(&self, status: Status, category: &CStr, text: &CStr);
}

/// The source of a message. A message of the exporter names the called function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Exporter,
    Model,
}

#[derive(Debug)]
struct Message {
    source: Source,
    status: Status,
    category: CString,
    text: String,
}

/// Messages to log, independent of the instance.
#[derive(Debug)]
#[must_use]
pub(crate) struct Delivery {
    recipient: Arc<dyn Recipient>,
    messages: Vec<Message>,
}

impl Logger {
    /// A logger for a model, with debug logging on or off for all categories.
    #[allow(clippy::arc_with_non_send_sync, reason = "an instance may be called by one thread after another")]
    pub(crate) fn new(
        recipient: Option<impl Recipient + 'static>,
        model: &ModelDescription,
        debug_logging: bool,
    ) -> Self {
        let categories = model.log_categories;
        let enabled = vec![debug_logging; categories.len()];
        let recipient = recipient.map(|recipient| Arc::new(recipient) as Arc<dyn Recipient>);
        Self {
            recipient,
            categories,
            enabled,
            // FMI 3.0.2, section 2.3.1: without logging, errors alone.
            always_warns: model.version == Version::Two,
            warned: if model.warns_by_status { Status::Warning } else { Status::Ok },
            pending: RefCell::default(),
            last: Cell::default(),
        }
    }

    /// Switches debug messages of the named categories on or off, or of all if none is named.
    ///
    /// # Errors
    /// The name of an undeclared category; nothing changes then.
    pub(crate) fn set_debug_logging<'a>(&mut self, on: bool, names: &[&'a CStr]) -> Result<(), &'a CStr> {
        let mut positions = Vec::with_capacity(names.len());
        for &name in names {
            let position = self.categories.iter().position(|category| category.as_bytes() == name.to_bytes());
            positions.push(position.ok_or(name)?);
        }
        if names.is_empty() {
            self.enabled.fill(on);
        }
        for position in positions {
            self.enabled[position] = on;
        }
        Ok(())
    }

    /// Logs the error of a failed call.
    pub(crate) fn error(&self, message: fmt::Arguments<'_>) {
        self.send(Source::Exporter, Status::Error, ERROR, message);
    }

    /// Logs a problem with a call. Returns the status that the call has for it.
    pub(crate) fn warning(&self, message: fmt::Arguments<'_>) -> Status {
        if self.warns() {
            self.send(Source::Exporter, Status::Warning, WARNING, message);
        }
        self.warned
    }

    /// Logs why a call is discarded, or its effect, if debug logging is on (section 2.1.3).
    pub(crate) fn event(&self, status: Status, message: fmt::Arguments<'_>) {
        if self.is_enabled(EVENT) {
            self.send(Source::Exporter, status, EVENT, message);
        }
    }

    /// Logs a message of the model in a category. Returns the status that the call has for it.
    pub(crate) fn message(&self, category: &'static str, message: fmt::Arguments<'_>) -> Status {
        if category == WARNING && self.warns() {
            self.send(Source::Model, Status::Warning, category, message);
        } else if category != WARNING && self.is_enabled(category) {
            self.send(Source::Model, Status::Ok, category, message);
        }
        if category == WARNING { self.warned } else { Status::Ok }
    }

    fn warns(&self) -> bool {
        self.always_warns || self.is_enabled(WARNING)
    }

    fn is_enabled(&self, category: &str) -> bool {
        self.categories.iter().zip(&self.enabled).any(|(&name, &on)| on && name == category)
    }

    fn send(&self, source: Source, status: Status, category: &str, message: fmt::Arguments<'_>) {
        if self.recipient.is_none() {
            return;
        }
        let text = message.to_string();
        let this = (source == Source::Model).then(|| checksum(format!("{category} {text}").as_bytes()));
        if self.last.replace(this) == this && this.is_some() {
            return;
        }
        let category = CString::new(category).unwrap_or_default();
        self.pending.borrow_mut().push(Message { source, status, category, text });
    }

    /// Logs the next message even if it is the last one again: the model repeats a part of its run.
    pub(crate) fn begin_again(&self) {
        self.last.set(None);
    }

    /// Takes the messages, if any.
    #[inline]
    pub(crate) fn take(&self) -> Option<Delivery> {
        if self.pending.borrow().is_empty() { None } else { self.take_pending() }
    }

    /// Separate, because `take` is inlined into each function of the library, and messages are rare.
    #[cold]
    #[inline(never)]
    fn take_pending(&self) -> Option<Delivery> {
        let recipient = Arc::clone(self.recipient.as_ref()?);
        Some(Delivery { recipient, messages: self.pending.take() })
    }
}

impl Delivery {
    /// Logs a function's messages.
    pub(crate) fn deliver(self, function: &str) {
        for Message { source, status, category, text } in &self.messages {
            let text = match source {
                Source::Exporter => printable(&format!("{function}: {text}")),
                Source::Model => printable(text),
            };
            self.recipient.receive(*status, category, &text);
        }
    }
}

/// A message for the logger, with `#` doubled (section 2.1.5).
fn printable(message: &str) -> CString {
    CString::new(message.replace('#', "##").replace('\0', "")).unwrap_or_default()
}

/// Checksums of the latest distinct messages of initialization, newest first. Initialization runs again after every set
/// in initialization mode, but logs each message once. The number keeps saved states small and suffices for masters
/// that alternate between a few values. An unused entry is 0.
#[derive(Clone, Debug, Default)]
pub(crate) struct RecentMessages([u64; 16]);

impl RecentMessages {
    /// Whether this message is new; it is remembered.
    pub(crate) fn is_new(&mut self, message: &str) -> bool {
        let checksum = checksum(message.as_bytes());
        let known = self.0.iter().position(|&known| known == checksum);
        let last = self.0.len() - 1;
        self.0[..=known.unwrap_or(last)].rotate_right(1);
        self.0[0] = checksum;
        known.is_none()
    }
}

impl Persistent for RecentMessages {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self(checksums) = self;
        checksums.persist(archive)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[derive(Debug)]
    struct Heard(Arc<Mutex<Vec<String>>>);

    impl Recipient for Heard {
        fn receive(&self, _status: Status, _category: &CStr, text: &CStr) {
            self.0.lock().unwrap().push(text.to_str().unwrap().to_owned());
        }
    }

    #[test]
    fn a_message_of_the_model_is_not_repeated_at_once() {
        let heard = Arc::new(Mutex::new(vec![]));
        let logger = Logger {
            recipient: Some(Arc::new(Heard(heard.clone()))),
            categories: &[EVENT, WARNING],
            enabled: vec![true; 2],
            warned: Status::Warning,
            ..Logger::default()
        };
        let status = |category, text: &str| logger.message(category, format_args!("{text}"));
        // The status is the same as without logging.
        assert_eq!([status(WARNING, "a"), status(WARNING, "a")], [Status::Warning; 2]);
        assert_eq!([status(EVENT, "a"), status(EVENT, "b"), status(EVENT, "a")], [Status::Ok; 3]);
        logger.begin_again();
        status(EVENT, "a");
        for _ in 0..2 {
            logger.error(format_args!("refused"));
        }
        status(EVENT, "a");
        logger.take().unwrap().deliver("f");
        status(EVENT, "a");
        assert!(logger.take().is_none());
        assert_eq!(*heard.lock().unwrap(), ["a", "a", "b", "a", "a", "f: refused", "f: refused", "a"]);
    }
}
