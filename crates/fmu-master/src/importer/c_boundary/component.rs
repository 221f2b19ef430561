//! An instance in its library: what both versions of FMI keep of it, and how it is called.

use std::cell::Cell;
use std::ffi::{CString, c_char, c_int, c_void};
use std::ptr;
use std::sync::Arc;

use fmu_abi::fmi2::c_types::FmuState;
use fmu_terms::Version;

use super::super::messages::{Called, Message, Missing, Status};
use super::library::{Function, Library, Symbols};
use super::live::{Call, Environment, Live};
use super::logger::CallbackFunctions;
use super::types;

/// Declares functions that both versions have alike, with their names in both, and how they are looked up.
macro_rules! functions_of_both {
    ($($(#[$meta:meta])* $table:ident { $($field:ident: $of_fmi2:ident / $of_fmi3:ident),* $(,)? })*) => {$(
        $(#[$meta])*
        #[derive(Clone, Copy)]
        struct $table {
            $($field: Function<types::fmi2::$of_fmi2>),*
        }

        impl $table {
            /// # Safety
            /// The library is one of the version.
            unsafe fn load(symbols: &Symbols, version: Version) -> Result<Self, Missing> {
                // SAFETY: the standard declares these types for these names.
                unsafe {
                    Ok(match version {
                        Version::Two => Self {
                            $($field: symbols.get::<types::fmi2::$of_fmi2>(stringify!($of_fmi2))?),*
                        },
                        Version::Three => Self {
                            $($field: symbols.get::<types::fmi3::$of_fmi3>(stringify!($of_fmi3))?),*
                        },
                    })
                }
            }
        }
    )*};
}

functions_of_both! {
    Life {
        exit_initialization_mode: fmi2ExitInitializationMode / fmi3ExitInitializationMode,
        terminate: fmi2Terminate / fmi3Terminate,
        free_instance: fmi2FreeInstance / fmi3FreeInstance,
    }

    States {
        get: fmi2GetFMUstate / fmi3GetFMUState,
        set: fmi2SetFMUstate / fmi3SetFMUState,
        free: fmi2FreeFMUstate / fmi3FreeFMUState,
    }
}

/// The functions of a library that both versions have alike.
#[derive(Clone, Copy)]
pub struct Shared {
    life: Life,
    states: Result<States, Missing>,
}

impl Shared {
    /// Looks the functions up.
    ///
    /// # Errors
    /// If the library lacks one that every FMU has.
    ///
    /// # Safety
    /// The library is one of the version.
    pub unsafe fn load(symbols: &Symbols, version: Version) -> Result<Self, Missing> {
        // SAFETY: the caller's promise.
        unsafe { Ok(Self { life: Life::load(symbols, version)?, states: States::load(symbols, version) }) }
    }
}

/// An instance in its library, alive until this is dropped. It and its saved states stay in one thread.
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
    functions: Shared,
    library: Arc<Library>,
    // The FMU may keep pointers to these.
    _texts: [CString; 3],
}

/// A state that an FMU saved.
#[derive(Clone, Copy)]
pub struct Saved {
    /// The state's address, of the FMU's own.
    state: FmuState,
    /// Whether the instance had begun to run, so that `Terminate` is due.
    runs: bool,
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
    ///
    /// # Safety
    /// The functions are of the library, and what `instantiate` returns is what the function `by` does, or null.
    pub unsafe fn new<F: Copy>(
        Instantiation { library, texts, .. }: Instantiation,
        functions: Shared,
        by: Function<F>,
        instantiate: impl FnOnce(F, [*const c_char; 3], &CallbackFunctions, Environment) -> *mut c_void,
    ) -> Result<Self, NotMade> {
        let live = Live::new(texts[0].to_string_lossy().into_owned());
        let (callbacks, environment) = (library.callbacks(), live.environment());
        callbacks.set_environment(environment);
        let pointers = texts.each_ref().map(|text| text.as_ptr());
        let make = || instantiate(by.pointer, pointers, &callbacks, environment);
        let address = live.call(Call::Of(by.name, None), make);
        if address.is_null() {
            library.take_back(callbacks);
            return Err(NotMade { function: by.name, messages: live.take() });
        }
        Ok(Self {
            address,
            live,
            time: Cell::default(),
            runs: Cell::new(false),
            saved_states: Cell::new(0),
            is_dead: Cell::new(false),
            callbacks,
            functions,
            library,
            _texts: texts,
        })
    }

    /// The messages since the last call of this function.
    pub fn take_messages(&self) -> Vec<Message> {
        self.live.take()
    }

    /// Calls a function with the instance's address, unless the instance is dead.
    pub fn call<F: Copy>(
        &self,
        Function { name: function, pointer }: Function<F>,
        call: impl FnOnce(F, *mut c_void) -> c_int,
    ) -> Called {
        if self.is_dead.get() {
            return Called { function, status: Status::FATAL };
        }
        let at = Call::Of(function, self.time.get());
        let status = Status(self.live.call(at, || call(pointer, self.address)));
        if status == Status::FATAL {
            self.is_dead.set(true);
        }
        if !status.succeeded() && status != Status::DISCARD {
            self.runs.set(false);
        }
        Called { function, status }
    }

    /// Calls a function after which the instance runs, if it succeeds.
    pub fn run<F: Copy>(&self, function: Function<F>, call: impl FnOnce(F, *mut c_void) -> c_int) -> Called {
        let called = self.call(function, call);
        self.runs.set(called.status.succeeded());
        called
    }

    pub fn exit_initialization_mode(&self) -> Called {
        // SAFETY: the instance is alive, here and below.
        self.run(self.functions.life.exit_initialization_mode, |exit, it| unsafe { exit(it) })
    }

    /// Ends the run, unless none has begun. That it fails is a warning, as all results are there.
    pub fn terminate(&self) {
        if self.runs.replace(false) {
            // SAFETY: see above.
            let called = self.call(self.functions.life.terminate, |terminate, it| unsafe { terminate(it) });
            if !called.status.succeeded() {
                let text = called.to_string();
                self.live.add(Message { status: Status::WARNING, text, time: self.time.get() });
            }
        }
    }

    /// Whether no state before the present point is restored (FMI 2.0.5, section 4.2.2: noSetFMUStatePriorToCurrentPoint).
    pub fn goes_on(&self) -> bool {
        self.saved_states.get() == 0
    }

    /// Saves the state.
    pub fn get_state(&self) -> Result<(Called, Saved), Missing> {
        let mut state = ptr::null_mut();
        // SAFETY: see above; a null state asks for a new one.
        let called = self.call(self.functions.states?.get, |get, it| unsafe { get(it, &raw mut state) });
        if called.status.succeeded() {
            self.saved_states.update(|count| count + 1);
        }
        Ok((called, Saved { state, runs: self.runs.get() }))
    }

    /// Restores a state that the instance saved and that is not freed.
    pub fn set_state(&self, saved: Saved) -> Result<Called, Missing> {
        // SAFETY: see above, and the state is one that it gave and that is not freed.
        let called = self.call(self.functions.states?.set, |set, it| unsafe { set(it, saved.state) });
        // Restoring a state makes possible again what an earlier step made impossible.
        self.runs.set(called.status.succeeded() && saved.runs);
        Ok(called)
    }

    /// Frees a state that the instance saved and that is not used again.
    pub fn free_state(&self, mut saved: Saved) {
        self.saved_states.update(|count| count.saturating_sub(1));
        if let Ok(States { free, .. }) = self.functions.states {
            // SAFETY: see above, and the state is one that it gave and that is not freed.
            self.call(free, |free, it| unsafe { free(it, &raw mut saved.state) });
        }
    }
}

impl Drop for Component {
    fn drop(&mut self) {
        // Nobody takes what it says from here on.
        self.live.take();
        self.terminate();
        if !self.is_dead.get() {
            let Function { name, pointer: free } = self.functions.life.free_instance;
            // SAFETY: the instance is alive, and this is the last call.
            self.live.call(Call::Of(name, self.time.get()), || unsafe { free(self.address) });
        }
        self.live.print();
        self.library.take_back(Arc::clone(&self.callbacks));
    }
}
