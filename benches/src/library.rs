//! The exported libraries, called through the C functions of FMI 2.0, as importers do.

use std::env;
use std::ffi::CString;
use std::path::PathBuf;
use std::ptr;

use fmu_export::description::{Causality, VariableDescription};
use fmu_export::fmi2::c_types::{
    CO_SIMULATION, CallbackFunctions, Component, FALSE, FmuState, Status, TRUE, ValueReference, fmi2DoStep,
    fmi2EnterInitializationMode, fmi2ExitInitializationMode, fmi2FreeInstance, fmi2GetFMUstate, fmi2GetReal,
    fmi2Instantiate, fmi2SetFMUstate, fmi2SetInteger, fmi2SetReal, fmi2SetupExperiment,
};
use fmu_export::{Described as _, Model};

/// Declares functions by their names in the standard.
macro_rules! functions {
    ($($name:ident: $function:ident;)*) => {
        /// The library of an FMU.
        #[derive(Debug)]
        pub struct Library {
            $($name: $function,)*
            guid: CString,
            /// The variables by value reference.
            variables: &'static [VariableDescription],
            /// The loaded library; last, so that it is dropped after all pointers into it.
            _loaded: libloading::Library,
        }

        impl Library {
            /// The library of a model, as the export made it.
            ///
            /// # Panics
            /// When it was not exported, or from another version of the models.
            #[must_use]
            pub fn load<M: Model>() -> Self {
                let description = M::Variables::DESCRIPTION;
                let path = path(description.model_identifier);
                // SAFETY: the library is an export of this workspace; loading it runs nothing.
                let loaded = unsafe { libloading::Library::new(&path) };
                let loaded = loaded.unwrap_or_else(|error| {
                    panic!("{}: {error}; export first: cargo run -- export", path.display())
                });
                Self {
                    // SAFETY: the library exports the standard's functions with the standard's types.
                    $($name: *unsafe { loaded.get(stringify!($function)) }.expect("it exports every function"),)*
                    guid: CString::new(description.guid).expect("no NUL in it"),
                    variables: description.variables,
                    _loaded: loaded,
                }
            }
        }
    };
}

functions! {
    instantiate: fmi2Instantiate;
    free_instance: fmi2FreeInstance;
    setup_experiment: fmi2SetupExperiment;
    enter_initialization_mode: fmi2EnterInitializationMode;
    exit_initialization_mode: fmi2ExitInitializationMode;
    get_real: fmi2GetReal;
    set_real: fmi2SetReal;
    set_integer: fmi2SetInteger;
    get_fmu_state: fmi2GetFMUstate;
    set_fmu_state: fmi2SetFMUstate;
    do_step: fmi2DoStep;
}

/// The library in cargo's folder for this program's profile, from which the export packs it.
fn path(model_identifier: &str) -> PathBuf {
    let program = env::current_exe().expect("the program has a path");
    let mut folder = program.parent().expect("it is in a folder");
    // Benchmarks are in a folder below.
    if folder.ends_with("deps") {
        folder = folder.parent().expect("it is below cargo's folder");
    }
    folder.join(format!("{}{model_identifier}{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX))
}

/// Checks a status as masters do.
fn check(status: Status) {
    assert_eq!(status, Status::Ok);
}

impl Library {
    /// The value references of variables.
    ///
    /// # Panics
    /// When there is no such variable.
    #[must_use]
    pub fn references(&self, names: &[&str]) -> Vec<ValueReference> {
        let reference = |name| {
            let found = self.variables.iter().find(|variable| variable.base_name == name);
            found.unwrap_or_else(|| panic!("there is no variable {name}")).value_reference
        };
        names.iter().map(|name| reference(*name)).collect()
    }

    /// The names of the variables of a causality, in their order.
    pub fn named(&self, causality: Causality) -> impl Iterator<Item = &'static str> {
        let variables: &'static [_] = self.variables;
        variables.iter().filter(move |variable| variable.causality == causality).map(|v| v.base_name)
    }

    /// Makes an instance.
    ///
    /// # Panics
    /// When the library refuses.
    #[must_use]
    pub fn instantiate(&self) -> Instance<'_> {
        let callbacks = CallbackFunctions {
            logger: None,
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: ptr::null_mut(),
        };
        // SAFETY: strings and callbacks outlive the call; the model has no resources, and takes null.
        let component = unsafe {
            (self.instantiate)(
                c"benchmark".as_ptr(),
                CO_SIMULATION,
                self.guid.as_ptr(),
                ptr::null(),
                &raw const callbacks,
                FALSE,
                FALSE,
            )
        };
        assert!(!component.is_null());
        Instance { library: self, component, time: 0.0 }
    }
}

/// An instance of an FMU.
#[derive(Debug)]
pub struct Instance<'a> {
    /// The FMU's library.
    pub library: &'a Library,
    component: Component,
    /// The end of the instance's last step in s.
    pub time: f64,
}

impl Drop for Instance<'_> {
    fn drop(&mut self) {
        // SAFETY: the component comes from this library and was not freed.
        unsafe { (self.library.free_instance)(self.component) }
    }
}

impl Instance<'_> {
    /// Enters the initialization mode for an experiment that starts at 0.
    pub fn enter_initialization(&mut self) {
        // SAFETY: as in `drop`, also for the calls below, whose arrays have the lengths passed.
        unsafe {
            check((self.library.setup_experiment)(self.component, FALSE, 0.0, 0.0, FALSE, 0.0));
            check((self.library.enter_initialization_mode)(self.component));
        }
    }

    /// Leaves the initialization mode.
    pub fn exit_initialization(&mut self) {
        // SAFETY: see above.
        check(unsafe { (self.library.exit_initialization_mode)(self.component) });
    }

    /// Reads Real values.
    ///
    /// # Panics
    /// When there are not as many as references, or the call fails.
    pub fn get(&mut self, references: &[ValueReference], values: &mut [f64]) {
        assert_eq!(references.len(), values.len());
        // SAFETY: see above.
        check(unsafe {
            (self.library.get_real)(
                self.component,
                references.as_ptr(),
                references.len(),
                values.as_mut_ptr(),
            )
        });
    }

    /// Sets Real values.
    ///
    /// # Panics
    /// When there are not as many as references, or the call fails.
    pub fn set(&mut self, references: &[ValueReference], values: &[f64]) {
        assert_eq!(references.len(), values.len());
        // SAFETY: see above.
        check(unsafe {
            (self.library.set_real)(self.component, references.as_ptr(), references.len(), values.as_ptr())
        });
    }

    /// Sets an Integer or Enumeration.
    pub fn set_integer(&mut self, reference: ValueReference, value: i32) {
        // SAFETY: see above.
        check(unsafe {
            (self.library.set_integer)(self.component, &raw const reference, 1, &raw const value)
        });
    }

    /// A step with its size in s.
    pub fn step(&mut self, size: f64) {
        // SAFETY: see above.
        check(unsafe { (self.library.do_step)(self.component, self.time, size, TRUE) });
        self.time += size;
    }

    /// Saves the state, which is freed with the instance.
    pub fn save(&mut self) -> State {
        let mut state = ptr::null_mut();
        // SAFETY: see above; a null state asks for a new one.
        check(unsafe { (self.library.get_fmu_state)(self.component, &raw mut state) });
        State { state, time: self.time }
    }

    /// Restores a saved state.
    pub fn restore(&mut self, saved: &State) {
        // SAFETY: see above; the library checks that the state is one of this instance.
        check(unsafe { (self.library.set_fmu_state)(self.component, saved.state) });
        self.time = saved.time;
    }
}

/// A saved state of an instance.
#[derive(Debug)]
pub struct State {
    state: FmuState,
    time: f64,
}
