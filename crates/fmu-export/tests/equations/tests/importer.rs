//! An importer of models' FMUs, of both versions.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::marker::PhantomData;
use std::ptr;

use fmu_export::description::{ValueReference, Version};
use fmu_export::{Described as _, Model, fmi2, fmi3};
use fmu_terms::InstanceType;

use crate::instantiate;

/// An instance of a model's FMU.
pub struct Importer<M: Model>(*mut c_void, InstanceType, PhantomData<M>);

thread_local! {
    static HEARD: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// A logger of FMI 3.0.
unsafe extern "C" fn hear(
    _environment: *mut c_void,
    _status: fmi3::c_types::Status,
    _category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: the exporter passes a string.
    let message = unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned();
    HEARD.with_borrow_mut(|heard| heard.push(message));
}

/// The messages of this thread's instances of FMI 3.0 since the last call.
pub fn heard() -> Vec<String> {
    HEARD.take()
}

/// Calls a function that has the same arguments in both versions. It must succeed.
macro_rules! call {
    ($importer:ident, $of_fmi2:ident | $of_fmi3:ident $(, $argument:expr)*) => {{
        // SAFETY: the instance is the importer's, and used by one thread; what is passed outlives the call.
        let ok = unsafe {
            if const { Self::IS_FMI2 } {
                    fmi2::c_api::$of_fmi2::<M>($importer.0 $(, $argument)*) == fmi2::c_types::Status::Ok
                } else {
                    fmi3::c_api::$of_fmi3::<M>($importer.0 $(, $argument)*) == fmi3::c_types::Status::Ok
                }
        };
        assert!(ok, "{} of {:?}", stringify!($of_fmi3), $importer.1);
    }};
}

impl<M: Model> Drop for Importer<M> {
    fn drop(&mut self) {
        // SAFETY: the instance is this importer's, and this its last use.
        unsafe { fmi3::c_api::fmi3FreeInstance::<M>(self.0) }
    }
}

// SAFETY of every call below: as above, and arrays have the passed lengths.
impl<M: Model> Importer<M> {
    /// Known to the compiler, so that it compiles the functions of one version.
    pub const IS_FMI2: bool = matches!(M::Variables::DESCRIPTION.version, Version::Two);

    pub fn new(instance_type: InstanceType) -> Self {
        let token = CString::new(M::Variables::DESCRIPTION.guid).unwrap();
        let (name, token, none) = (c"tuned".as_ptr(), token.as_ptr(), ptr::null_mut());
        // SAFETY: see above.
        let instance = unsafe {
            if const { Self::IS_FMI2 } {
                instantiate::<M>(i32::from(instance_type != InstanceType::ModelExchange))
            } else if instance_type == InstanceType::ModelExchange {
                fmi3::c_api::fmi3InstantiateModelExchange::<M>(
                    name,
                    token,
                    ptr::null(),
                    0,
                    1,
                    none,
                    Some(hear),
                )
            } else {
                fmi3::c_api::fmi3InstantiateCoSimulation::<M>(
                    name,
                    token,
                    ptr::null(),
                    0,
                    1,
                    (instance_type == InstanceType::CoSimulationWithEvents).into(),
                    1,
                    ptr::null(),
                    0,
                    none,
                    Some(hear),
                    None,
                )
            }
        };
        assert!(!instance.is_null());
        Self(instance, instance_type, PhantomData)
    }

    pub fn enter_initialization(&mut self) {
        self.enter_initialization_with(None, 0.0, None);
    }

    /// At a start time, and with a stop time (s).
    pub fn enter_initialization_at(&mut self, start: f64, stop: Option<f64>) {
        self.enter_initialization_with(None, start, stop);
    }

    pub fn enter_initialization_with(&mut self, tolerance: Option<f64>, start: f64, stop: Option<f64>) {
        let (has_tolerance, tolerance) = (u8::from(tolerance.is_some()), tolerance.unwrap_or_default());
        let (has_stop, stop) = (u8::from(stop.is_some()), stop.unwrap_or_default());
        // SAFETY: see above.
        unsafe {
            if const { Self::IS_FMI2 } {
                let [has_tolerance, has_stop] = [has_tolerance, has_stop].map(i32::from);
                fmi2::c_api::fmi2SetupExperiment::<M>(
                    self.0,
                    has_tolerance,
                    tolerance,
                    start,
                    has_stop,
                    stop,
                );
                fmi2::c_api::fmi2EnterInitializationMode::<M>(self.0);
            } else {
                fmi3::c_api::fmi3EnterInitializationMode::<M>(
                    self.0,
                    has_tolerance,
                    tolerance,
                    start,
                    has_stop,
                    stop,
                );
            }
        }
    }

    pub fn set_integer(&mut self, name: &str, value: i32) {
        let (reference, from) = (Self::reference(name), &raw const value);
        // SAFETY: see above.
        let status = unsafe {
            if const { Self::IS_FMI2 } {
                fmi2::c_api::fmi2SetInteger::<M>(self.0, &raw const reference, 1, from) as i32
            } else {
                fmi3::c_api::fmi3SetInt32::<M>(self.0, &raw const reference, 1, from, 1) as i32
            }
        };
        assert_eq!(status, 0, "{name}");
    }

    /// From a new or reset instance to Step Mode or Event Mode.
    pub fn initialize(&mut self) {
        self.enter_initialization();
        self.exit_initialization();
    }

    pub fn reference(name: &str) -> ValueReference {
        let mut described = M::Variables::described();
        described.find(|(_, variable)| variable.name() == name).expect("there is such a variable").0
    }

    pub fn get<const N: usize>(&mut self, names: [&str; N]) -> [f64; N] {
        let (references, mut values) = (names.map(Self::reference), [f64::NAN; N]);
        let (from, to) = (references.as_ptr(), values.as_mut_ptr());
        // SAFETY: see above.
        let status = unsafe {
            if const { Self::IS_FMI2 } {
                fmi2::c_api::fmi2GetReal::<M>(self.0, from, N, to)
            } else {
                fmi3::c_api::fmi3GetFloat64::<M>(self.0, from, N, to, N)
            }
        };
        assert_eq!(status as i32, 0, "{names:?}");
        values
    }

    /// Sets enumerations by the values of their items. Returns whether they are accepted.
    pub fn choose<const N: usize>(&mut self, names: [&str; N], items: [i32; N]) -> bool {
        let (references, wide) = (names.map(Self::reference), items.map(i64::from));
        // SAFETY: see above.
        let status = unsafe {
            if const { Self::IS_FMI2 } {
                fmi2::c_api::fmi2SetInteger::<M>(self.0, references.as_ptr(), N, items.as_ptr()) as i32
            } else {
                fmi3::c_api::fmi3SetInt64::<M>(self.0, references.as_ptr(), N, wide.as_ptr(), N) as i32
            }
        };
        status == 0
    }

    /// The value of an enumeration's item.
    pub fn chosen(&mut self, name: &str) -> i64 {
        let (reference, mut item, mut wide) = (Self::reference(name), i32::MIN, i64::MIN);
        // SAFETY: see above.
        let status = unsafe {
            if const { Self::IS_FMI2 } {
                fmi2::c_api::fmi2GetInteger::<M>(self.0, &raw const reference, 1, &raw mut item) as i32
            } else {
                fmi3::c_api::fmi3GetInt64::<M>(self.0, &raw const reference, 1, &raw mut wide, 1) as i32
            }
        };
        assert_eq!(status, 0, "{name}");
        if const { Self::IS_FMI2 } { item.into() } else { wide }
    }

    /// Sets the gain. Returns whether it is accepted.
    pub fn tune(&mut self, gain: f64) -> bool {
        self.set(Self::reference("gain"), gain)
    }

    /// Sets a variable. Returns whether the value is accepted.
    pub fn set(&mut self, reference: ValueReference, value: f64) -> bool {
        let (to, from) = (&raw const reference, &raw const value);
        // SAFETY: see above.
        let status = unsafe {
            if const { Self::IS_FMI2 } {
                fmi2::c_api::fmi2SetReal::<M>(self.0, to, 1, from)
            } else {
                fmi3::c_api::fmi3SetFloat64::<M>(self.0, to, 1, from, 1)
            }
        };
        status as i32 == 0
    }

    /// Steps from a time by a size (s). Returns whether there is an event, and the time reached.
    pub fn step(&mut self, time: f64, size: f64) -> (bool, f64) {
        let ([needed, _, _], reached) = self.step_with_flags(time, size);
        (needed, reached)
    }

    /// Steps. Returns whether there is an event, whether the model asks for the end, and whether the step ended early, none of
    /// which FMI 2.0 has; and the time reached.
    pub fn step_with_flags(&mut self, time: f64, size: f64) -> ([bool; 3], f64) {
        let ([mut needed, mut ends, mut early], mut reached) = ([0; 3], time + size);
        // SAFETY: see above.
        let status = unsafe {
            if const { Self::IS_FMI2 } {
                fmi2::c_api::fmi2DoStep::<M>(self.0, time, size, 1)
            } else {
                let flags = (&raw mut needed, &raw mut ends, &raw mut early);
                fmi3::c_api::fmi3DoStep::<M>(
                    self.0,
                    time,
                    size,
                    1,
                    flags.0,
                    flags.1,
                    flags.2,
                    &raw mut reached,
                )
            }
        };
        assert_eq!(status as i32, 0);
        ([needed, ends, early].map(|flag| flag == 1), reached)
    }

    /// One iteration of an event: when the next time event is due.
    pub fn update(&mut self) -> Option<f64> {
        self.iterate().1
    }

    /// One iteration of an event: whether another one follows, and when the next time event is due.
    pub fn iterate(&mut self) -> (bool, Option<f64>) {
        self.try_iteration().expect("the model handles the event")
    }

    /// One iteration of an event, as `iterate`, if the model can handle it.
    pub fn try_iteration(&mut self) -> Option<(bool, Option<f64>)> {
        // SAFETY: see above.
        unsafe {
            if const { Self::IS_FMI2 } {
                let mut info = fmi2::c_types::EventInfo::default();
                let status = fmi2::c_api::fmi2NewDiscreteStates::<M>(self.0, &raw mut info);
                let next = (info.next_event_time_defined == 1).then_some(info.next_event_time);
                return (status as i32 == 0).then_some((info.new_discrete_states_needed == 1, next));
            }
            let ([mut again, mut ends, mut nominals, mut values, mut is_defined], mut next) = ([0; 5], 0.0);
            let status = fmi3::c_api::fmi3UpdateDiscreteStates::<M>(
                self.0,
                &raw mut again,
                &raw mut ends,
                &raw mut nominals,
                &raw mut values,
                &raw mut is_defined,
                &raw mut next,
            );
            (status as i32 == 0).then_some((again == 1, (is_defined == 1).then_some(next)))
        }
    }

    /// All iterations of an event: when the next time event is due.
    pub fn update_all(&mut self) -> Option<f64> {
        loop {
            if let (false, next) = self.iterate() {
                return next;
            }
        }
    }

    pub fn rates<const N: usize>(&mut self) -> [f64; N] {
        let mut rates = [f64::NAN; N];
        // SAFETY: see above.
        let status = unsafe {
            if const { Self::IS_FMI2 } {
                fmi2::c_api::fmi2GetDerivatives::<M>(self.0, rates.as_mut_ptr(), N)
            } else {
                fmi3::c_api::fmi3GetContinuousStateDerivatives::<M>(self.0, rates.as_mut_ptr(), N)
            }
        };
        assert_eq!(status as i32, 0);
        rates
    }

    /// The derivatives of unknowns with respect to the gain, and in FMI 3.0 their adjoint ones, one by one.
    pub fn by_gain<const N: usize>(&mut self, unknowns: [&str; N]) -> Vec<[f64; N]> {
        let (rows, column) = (unknowns.map(Self::reference), Self::reference("gain"));
        let (one, mut forward, mut backwards) = (1.0, [f64::NAN; N], [f64::NAN; N]);
        let (known, seed, found) = (&raw const column, &raw const one, forward.as_mut_ptr());
        // SAFETY: see above.
        let status = unsafe {
            if const { Self::IS_FMI2 } {
                fmi2::c_api::fmi2GetDirectionalDerivative::<M>(
                    self.0,
                    rows.as_ptr(),
                    N,
                    known,
                    1,
                    seed,
                    found,
                )
            } else {
                fmi3::c_api::fmi3GetDirectionalDerivative::<M>(
                    self.0,
                    rows.as_ptr(),
                    N,
                    known,
                    1,
                    seed,
                    1,
                    found,
                    N,
                )
            }
        };
        assert_eq!(status as i32, 0, "{unknowns:?}");
        if const { Self::IS_FMI2 } {
            return vec![forward];
        }
        for (row, found) in rows.iter().zip(&mut backwards) {
            // SAFETY: see above.
            let status = unsafe {
                fmi3::c_api::fmi3GetAdjointDerivative::<M>(self.0, row, 1, known, 1, seed, 1, found, 1)
            };
            assert_eq!(status as i32, 0);
        }
        vec![forward, backwards]
    }

    /// The results of an operation that begins twice from the present state, which is kept in memory.
    pub fn twice<R>(&mut self, operation: impl Fn(&mut Self) -> R) -> [R; 2] {
        let mut state = ptr::null_mut();
        call!(self, fmi2GetFMUstate | fmi3GetFMUState, &raw mut state);
        let first = operation(self);
        call!(self, fmi2SetFMUstate | fmi3SetFMUState, state);
        call!(self, fmi2FreeFMUstate | fmi3FreeFMUState, &raw mut state);
        [first, operation(self)]
    }

    /// Another instance that continues from the bytes of this one's state.
    pub fn restored(&mut self) -> Self {
        let other = Self::new(self.1);
        let (mut state, mut copy, mut size) = (ptr::null_mut(), ptr::null_mut(), 0);
        call!(self, fmi2GetFMUstate | fmi3GetFMUState, &raw mut state);
        call!(self, fmi2SerializedFMUstateSize | fmi3SerializedFMUStateSize, state, &raw mut size);
        let mut bytes = vec![0_u8; size];
        call!(self, fmi2SerializeFMUstate | fmi3SerializeFMUState, state, bytes.as_mut_ptr().cast(), size);
        call!(self, fmi2FreeFMUstate | fmi3FreeFMUState, &raw mut state);
        call!(
            other,
            fmi2DeSerializeFMUstate | fmi3DeserializeFMUState,
            bytes.as_ptr().cast(),
            size,
            &raw mut copy
        );
        call!(other, fmi2SetFMUstate | fmi3SetFMUState, copy);
        call!(other, fmi2FreeFMUstate | fmi3FreeFMUState, &raw mut copy);
        other
    }

    pub fn enter_event_mode(&mut self) {
        call!(self, fmi2EnterEventMode | fmi3EnterEventMode);
    }

    /// From Event Mode to the mode in which time passes.
    pub fn leave_event_mode(&mut self) {
        if self.1 == InstanceType::ModelExchange {
            call!(self, fmi2EnterContinuousTimeMode | fmi3EnterContinuousTimeMode);
        } else {
            // SAFETY: see above.
            let status = unsafe { fmi3::c_api::fmi3EnterStepMode::<M>(self.0) };
            assert_eq!(status as i32, 0);
        }
    }

    pub fn exit_initialization(&mut self) {
        call!(self, fmi2ExitInitializationMode | fmi3ExitInitializationMode);
    }

    pub fn reset(&mut self) {
        call!(self, fmi2Reset | fmi3Reset);
    }

    pub fn set_time(&mut self, time: f64) {
        call!(self, fmi2SetTime | fmi3SetTime, time);
    }

    pub fn tick(&mut self, clock: &str) {
        let (reference, ticks) = (Self::reference(clock), 1);
        // SAFETY: see above.
        let status =
            unsafe { fmi3::c_api::fmi3SetClock::<M>(self.0, &raw const reference, 1, &raw const ticks) };
        assert_eq!(status as i32, 0);
    }
}
