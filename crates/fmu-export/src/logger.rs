//! Messages to the importer: through its logger callback, under the declared categories (FMI 2.0.5,
//! section 2.1.5).
//!
//! Errors and warnings are always passed on; events only while debug logging is on for their category.
//!
//! Messages are kept while a function runs and passed on as it returns. Nothing of the instance is in use
//! then, so that the importer's logger may call it; the standard does not say that it must not.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::fmt;
use std::mem;
use std::sync::Arc;

use crate::c_types::{CallbackLogger, ComponentEnvironment, Status};
use crate::error::Error;
use crate::persistence::{Archive, Persistent};
use crate::serialized_state::checksum;

/// The category of errors.
pub const ERROR: &str = "logStatusError";
/// The category of warnings.
pub const WARNING: &str = "logStatusWarning";
/// The category of events.
pub const EVENT: &str = "logEvents";

/// The messages of one instance.
#[derive(Debug)]
pub(crate) struct Logger {
    recipient: Option<Arc<Recipient>>,
    categories: &'static [&'static str],
    /// For each category, whether debug messages are wanted.
    enabled: Vec<bool>,
    /// Messages not passed on yet.
    pending: RefCell<Vec<Message>>,
}

/// Where messages go, and from whom.
#[derive(Debug)]
struct Recipient {
    callback: CallbackLogger,
    environment: ComponentEnvironment,
    instance_name: CString,
}

#[derive(Debug)]
struct Message {
    status: Status,
    category: CString,
    text: CString,
}

/// Messages to be passed on; they no longer need the instance.
#[derive(Debug)]
#[must_use]
pub(crate) struct Delivery {
    recipient: Arc<Recipient>,
    messages: Vec<Message>,
}

impl Logger {
    /// A logger for an instance of this name. With debug logging on, all categories are.
    #[allow(
        clippy::arc_with_non_send_sync,
        reason = "several threads may call an instance, one after the other"
    )]
    pub(crate) fn new(
        callback: Option<CallbackLogger>,
        environment: ComponentEnvironment,
        instance_name: CString,
        categories: &'static [&'static str],
        debug_logging: bool,
    ) -> Self {
        let enabled = vec![debug_logging; categories.len()];
        let recipient = callback.map(|callback| Arc::new(Recipient { callback, environment, instance_name }));
        Self { recipient, categories, enabled, pending: RefCell::default() }
    }

    /// Switches debug messages of the named categories, or of all when none is named, on or off.
    ///
    /// # Errors
    /// The name of a category that is not declared; then nothing changes.
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

    /// Logs why a call failed.
    pub(crate) fn error(&self, message: fmt::Arguments<'_>) {
        self.send(Status::Error, ERROR, message);
    }

    /// Logs a message of the model under a category.
    pub(crate) fn message(&self, category: &'static str, message: fmt::Arguments<'_>) {
        if category == WARNING {
            self.send(Status::Warning, category, message);
        } else if self.is_enabled(category) {
            self.send(Status::Ok, category, message);
        }
    }

    /// Logs why a call is discarded, when debug logging is on (section 2.1.3).
    pub(crate) fn discarded(&self, message: fmt::Arguments<'_>) {
        if self.is_enabled(EVENT) {
            self.send(Status::Discard, EVENT, message);
        }
    }

    fn is_enabled(&self, category: &str) -> bool {
        self.categories.iter().zip(&self.enabled).any(|(&name, &on)| on && name == category)
    }

    fn send(&self, status: Status, category: &str, message: fmt::Arguments<'_>) {
        if self.recipient.is_some() {
            let category = CString::new(category).unwrap_or_default();
            let text = printable(&message.to_string());
            self.pending.borrow_mut().push(Message { status, category, text });
        }
    }

    /// What is to be passed on, if anything is.
    pub(crate) fn take(&self) -> Option<Delivery> {
        let mut pending = self.pending.borrow_mut();
        if pending.is_empty() {
            return None;
        }
        let recipient = Arc::clone(self.recipient.as_ref()?);
        Some(Delivery { recipient, messages: mem::take(&mut pending) })
    }
}

impl Delivery {
    /// Passes the messages on.
    pub(crate) fn deliver(self) {
        let Recipient { callback, environment, instance_name } = &*self.recipient;
        let format: *const c_char = c"%s".as_ptr();
        for Message { status, category, text } in &self.messages {
            // SAFETY: the importer gave the callback for this purpose (section 2.1.5); every pointer is to
            // a NUL-terminated string that outlives the call, and the one variadic argument is what "%s"
            // reads. No reference to an instance exists meanwhile.
            unsafe {
                callback(
                    environment.0,
                    instance_name.as_ptr(),
                    *status,
                    category.as_ptr(),
                    format,
                    text.as_ptr(),
                );
            }
        }
    }
}

/// A number as messages show it: all its digits, but no endless zeros.
#[derive(Debug)]
pub(crate) struct Shown(pub(crate) f64);

impl fmt::Display for Shown {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // `{:?}` compares numbers, which is an invalid operation on NaN, and the importer may have enabled its trap.
        if !self.0.is_finite() {
            return write!(formatter, "{}", self.0);
        }
        let text = format!("{:?}", self.0);
        formatter.write_str(text.strip_suffix(".0").unwrap_or(&text))
    }
}

/// A message as the logger takes it: `#` has a meaning there (section 2.1.5) and is doubled.
fn printable(message: &str) -> CString {
    CString::new(message.replace('#', "##").replace('\0', "")).unwrap_or_default()
}

/// The latest distinct messages of initialization, by their checksums, the last one first. It runs anew after
/// every set in initialization mode; what it has to tell, it tells once. So many are remembered that a master
/// which goes to and fro between a few values meets no message twice, and that saved states stay small. An
/// unused place holds a 0.
#[derive(Clone, Debug, Default)]
pub(crate) struct RecentMessages([u64; 16]);

impl RecentMessages {
    /// Whether this message is new; it is not, the next time.
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
