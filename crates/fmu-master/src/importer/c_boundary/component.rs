//! An instance in its library: what both versions of FMI keep of it, and how it is called.

use std::cell::Cell;
use std::ffi::{CString, c_char, c_int, c_void};
use std::sync::Arc;

use fmu_abi::fmi2::c_types::FmuState;

use super::super::messages::{Called, Message, Status};
use super::library::Library;
use super::live::{Call, Environment, Live};
use super::logger::CallbackFunctions;

/// An instance in its library. It and its saved states stay in one thread.
pub struct Component {
    address: *mut c_void,
    live: Live,
    /// The time reached (s); none before the experiment is set up.
    pub time: Cell<Option<f64>>,
    /// Whether `Terminate` is due before the instance is freed.
    runs: Cell<bool>,
    /// The saved states that live: none is a promise that nothing goes back before the present point.
    saved_states: Cell<usize>,
    /// Whether a fatal error occurred, after which the standard forbids any call.
    is_dead: Cell<bool>,
    callbacks: Arc<CallbackFunctions>,
    library: Arc<Library>,
    // The FMU may keep pointers to these.
    _texts: [CString; 3],
}

/// A state that an FMU saved.
#[derive(Clone, Copy)]
pub struct Saved {
    /// The state's address, of the FMU's own.
    pub state: FmuState,
    /// Whether the instance had begun to run, so that `Terminate` is due.
    pub runs: bool,
}

/// What an instance is made with.
pub struct Instantiation {
    pub library: Arc<Library>,
    /// The name, the GUID or instantiation token, and where the resources are.
    pub texts: [CString; 3],
    pub events: UseOfEvents,
}

/// What co-simulation of FMI 3.0 does at events.
#[derive(Clone, Copy, Debug)]
pub struct UseOfEvents {
    /// Whether the importer handles them in Event Mode.
    pub in_event_mode: bool,
    /// Whether steps may return early for them.
    pub by_early_return: bool,
}

/// An FMU has refused to make an instance.
pub struct NotMade {
    /// The function that returned none.
    pub function: &'static str,
    pub messages: Vec<Message>,
}

impl Component {
    /// Makes an instance by a function of its library, to which the texts, the callbacks and the environment are passed.
    ///
    /// # Errors
    /// If the function returns none.
    pub fn new(
        Instantiation { library, texts, .. }: Instantiation,
        function: &'static str,
        instantiate: impl FnOnce([*const c_char; 3], &CallbackFunctions, Environment) -> *mut c_void,
    ) -> Result<Self, NotMade> {
        let live = Live::new(texts[0].to_string_lossy().into_owned());
        let (callbacks, environment) = (library.callbacks(), live.environment());
        callbacks.set_environment(environment);
        let pointers = texts.each_ref().map(|text| text.as_ptr());
        let address = live.call(Call::Of(function, None), || instantiate(pointers, &callbacks, environment));
        if address.is_null() {
            library.take_back(callbacks);
            return Err(NotMade { function, messages: live.take() });
        }
        Ok(Self {
            address,
            live,
            time: Cell::default(),
            runs: Cell::new(false),
            saved_states: Cell::new(0),
            is_dead: Cell::new(false),
            callbacks,
            library,
            _texts: texts,
        })
    }

    /// The messages since the last call of this function.
    pub fn take_messages(&self) -> Vec<Message> {
        self.live.take()
    }

    /// Calls a function with the instance's address, unless the instance is dead.
    pub fn call(&self, function: &'static str, call: impl FnOnce(*mut c_void) -> c_int) -> Called {
        if self.is_dead.get() {
            return Called { function, status: Status::FATAL };
        }
        let status = Status(self.live.call(Call::Of(function, self.time.get()), || call(self.address)));
        if status == Status::FATAL {
            self.is_dead.set(true);
        }
        if !status.succeeded() && status != Status::DISCARD {
            self.runs.set(false);
        }
        Called { function, status }
    }

    /// Calls a function after which the instance runs, if it succeeds.
    pub fn run(&self, function: &'static str, call: impl FnOnce(*mut c_void) -> c_int) -> Called {
        let called = self.call(function, call);
        self.runs.set(called.status.succeeded());
        called
    }

    /// Whether no state before the present point is restored (FMI 2.0.5, section 4.2.2: noSetFMUStatePriorToCurrentPoint).
    pub fn goes_on(&self) -> bool {
        self.saved_states.get() == 0
    }

    /// Takes note of a state that a call saved.
    pub fn saved(&self, called: Called, state: FmuState) -> (Called, Saved) {
        if called.status.succeeded() {
            self.saved_states.update(|count| count + 1);
        }
        (called, Saved { state, runs: self.runs.get() })
    }

    /// Takes note that a call restored a state, which makes possible again what an earlier step made impossible.
    pub fn restored(&self, called: Called, saved: Saved) -> Called {
        self.runs.set(called.status.succeeded() && saved.runs);
        called
    }

    /// Takes note that a saved state is to be freed.
    pub fn forget_state(&self) {
        self.saved_states.update(|count| count.saturating_sub(1));
    }

    /// Ends the run by a function, unless none has begun. That it fails is a warning.
    pub fn terminate(&self, function: &'static str, terminate: impl FnOnce(*mut c_void) -> c_int) {
        if self.runs.replace(false) {
            let called = self.call(function, terminate);
            if !called.status.succeeded() {
                let text = called.to_string();
                self.live.add(Message { status: Status::WARNING, text, time: self.time.get() });
            }
        }
    }

    /// Takes what the FMU has said; nobody takes what it says from here on, so that [`Component::free`] prints it.
    pub fn drop_messages(&self) {
        self.live.take();
    }

    /// Frees the instance by a function, unless it is dead; this is the last call.
    pub fn free(&self, function: &'static str, free: impl FnOnce(*mut c_void)) {
        if !self.is_dead.get() {
            self.live.call(Call::Of(function, self.time.get()), || free(self.address));
        }
        self.live.print();
        self.library.take_back(Arc::clone(&self.callbacks));
    }
}
