//! What follows from tunable parameters alone: variables by `calculate_parameters`, fields by `take_parameters`. It follows
//! at once, in each interface and mode, and with its derivatives.

// They are whole numbers, computed without rounding.
#![allow(clippy::float_cmp)]

use std::ffi::{CString, c_void};
use std::marker::PhantomData;
use std::ptr;

use fmu_export::description::{ValueReference, Version};
use fmu_export::{Integrated, Model, SampledModel, Simulation, Variables as _, fmi2, fmi3};
use fmu_export_equations::{Tuned, Tuned3, TunedSamples, TunedSamples3, TunedTicks};
use fmu_terms::InstanceType;

use crate::instantiate;

/// An instance of a model's FMU.
struct Importer<M: Model>(*mut c_void, InstanceType, PhantomData<M>);

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
    const IS_FMI2: bool = matches!(M::Variables::DESCRIPTION.version, Version::Two);

    fn new(instance_type: InstanceType) -> Self {
        let token = CString::new(M::Variables::DESCRIPTION.guid).unwrap();
        let (name, token, none) = (c"tuned".as_ptr(), token.as_ptr(), ptr::null_mut());
        // SAFETY: see above.
        let instance = unsafe {
            if const { Self::IS_FMI2 } {
                instantiate::<M>(i32::from(instance_type != InstanceType::ModelExchange))
            } else if instance_type == InstanceType::ModelExchange {
                fmi3::c_api::fmi3InstantiateModelExchange::<M>(name, token, ptr::null(), 0, 0, none, None)
            } else {
                fmi3::c_api::fmi3InstantiateCoSimulation::<M>(
                    name,
                    token,
                    ptr::null(),
                    0,
                    0,
                    (instance_type == InstanceType::CoSimulationWithEvents).into(),
                    1,
                    ptr::null(),
                    0,
                    none,
                    None,
                    None,
                )
            }
        };
        assert!(!instance.is_null());
        Self(instance, instance_type, PhantomData)
    }

    fn enter_initialization(&mut self) {
        // SAFETY: see above.
        unsafe {
            if const { Self::IS_FMI2 } {
                fmi2::c_api::fmi2SetupExperiment::<M>(self.0, 0, 0.0, 0.0, 0, 0.0);
                fmi2::c_api::fmi2EnterInitializationMode::<M>(self.0);
            } else {
                fmi3::c_api::fmi3EnterInitializationMode::<M>(self.0, 0, 0.0, 0.0, 0, 0.0);
            }
        }
    }

    /// From a new or reset instance to Step Mode or Event Mode.
    fn initialize(&mut self) {
        self.enter_initialization();
        self.exit_initialization();
    }

    fn reference(name: &str) -> ValueReference {
        let mut described = M::Variables::described();
        described.find(|(_, variable)| variable.name() == name).expect("there is such a variable").0
    }

    fn get<const N: usize>(&mut self, names: [&str; N]) -> [f64; N] {
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

    /// Sets the gain. Returns whether it is accepted.
    fn tune(&mut self, gain: f64) -> bool {
        let reference = Self::reference("gain");
        let (to, from) = (&raw const reference, &raw const gain);
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

    fn step(&mut self, time: f64, size: f64) {
        // SAFETY: see above.
        let status = unsafe {
            if const { Self::IS_FMI2 } {
                fmi2::c_api::fmi2DoStep::<M>(self.0, time, size, 1)
            } else {
                let ([mut needed, mut ends, mut early], mut reached) = ([0; 3], 0.0);
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
    }

    /// One iteration of an event: when the next time event is due.
    fn update(&mut self) -> Option<f64> {
        // SAFETY: see above.
        unsafe {
            if const { Self::IS_FMI2 } {
                let mut info = fmi2::c_types::EventInfo::default();
                let status = fmi2::c_api::fmi2NewDiscreteStates::<M>(self.0, &raw mut info);
                assert_eq!(status as i32, 0);
                return (info.next_event_time_defined == 1).then_some(info.next_event_time);
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
            assert_eq!(status as i32, 0);
            (is_defined == 1).then_some(next)
        }
    }

    fn rates<const N: usize>(&mut self) -> [f64; N] {
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
    fn by_gain<const N: usize>(&mut self, unknowns: [&str; N]) -> Vec<[f64; N]> {
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

    /// Another instance that continues from the bytes of this one's state.
    fn restored(&mut self) -> Self {
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

    fn enter_event_mode(&mut self) {
        call!(self, fmi2EnterEventMode | fmi3EnterEventMode);
    }

    /// From Event Mode to the mode in which time passes.
    fn leave_event_mode(&mut self) {
        if self.1 == InstanceType::ModelExchange {
            call!(self, fmi2EnterContinuousTimeMode | fmi3EnterContinuousTimeMode);
        } else {
            // SAFETY: see above.
            let status = unsafe { fmi3::c_api::fmi3EnterStepMode::<M>(self.0) };
            assert_eq!(status as i32, 0);
        }
    }

    fn exit_initialization(&mut self) {
        call!(self, fmi2ExitInitializationMode | fmi3ExitInitializationMode);
    }

    fn reset(&mut self) {
        call!(self, fmi2Reset | fmi3Reset);
    }

    fn set_time(&mut self, time: f64) {
        call!(self, fmi2SetTime | fmi3SetTime, time);
    }

    fn tick(&mut self, clock: &str) {
        let (reference, ticks) = (Self::reference(clock), 1);
        // SAFETY: see above.
        let status =
            unsafe { fmi3::c_api::fmi3SetClock::<M>(self.0, &raw const reference, 1, &raw const ticks) };
        assert_eq!(status as i32, 0);
    }
}

/// What follows from the gain.
fn follows(gain: f64) -> [f64; 5] {
    let plain = 11.0 * gain;
    [10.0 * gain, plain, 10.0 * gain, if gain > 3.0 { plain } else { -plain }, 10.0 * gain]
}

const FOLLOWING: [&str; 5] = ["scaled", "plain", "y", "z", "of_field"];

/// The relative error of the state: a step's is at most the default tolerance, 1e-6, times 1 + x, and the errors of two
/// steps add up at most.
fn is_close(found: f64, exact: f64) -> bool {
    (found - exact).abs() <= 2e-6 * (1.0 + exact)
}

/// In Step Mode, with a getter before the step and without.
fn follow_in_steps<M: Model>() {
    for reads in [true, false] {
        let mut importer = Importer::<M>::new(InstanceType::CoSimulation);
        importer.initialize();
        assert_eq!(importer.get(FOLLOWING), follows(2.0));
        importer.step(0.0, 0.5);
        assert!(importer.tune(5.0));
        if reads {
            assert_eq!(importer.get(FOLLOWING), follows(5.0));
        }
        // The state has the change, but not its consequences.
        let mut restored = importer.restored();
        let middle = 20.0 * (1.0 - (-0.5_f64).exp());
        let exact = 50.0 + (middle - 50.0) * (-0.5_f64).exp();
        for importer in [&mut importer, &mut restored] {
            importer.step(0.5, 0.5);
            let [x] = importer.get(["x"]);
            assert!(is_close(x, exact), "{x} {exact}");
            assert_eq!(importer.get(FOLLOWING), follows(5.0));
        }
        let mut restored = restored.restored();
        assert_eq!(restored.get(FOLLOWING), follows(5.0));
        // Beyond its range it changes nothing; an FMU of FMI 3.0 needs a saved state then.
        if Importer::<M>::IS_FMI2 {
            assert!(!importer.tune(200.0));
            assert_eq!(importer.get(FOLLOWING), follows(5.0));
        }
        importer.reset();
        importer.initialize();
        assert_eq!(importer.get(FOLLOWING), follows(2.0));
        importer.reset();
        assert!(importer.tune(4.0));
        importer.enter_initialization();
        assert_eq!(importer.get(FOLLOWING), follows(4.0));
        assert!(importer.tune(3.0));
        assert_eq!((importer.get(FOLLOWING), importer.get(["held"])), (follows(3.0), [30.0]));
    }
}

#[test]
fn they_follow_in_co_simulation() {
    follow_in_steps::<Integrated<Tuned>>();
    follow_in_steps::<Integrated<Tuned3>>();
}

/// In Event Mode, in which parameters are tuned, and in the mode that follows.
fn follow_in_events<M: Model>(instance_type: InstanceType) {
    let is_exchange = instance_type == InstanceType::ModelExchange;
    // The time event is due when `scaled` says.
    for reads in [true, false] {
        let mut importer = Importer::<M>::new(instance_type);
        importer.initialize();
        assert_eq!((importer.get(FOLLOWING), importer.update()), (follows(2.0), Some(20.0)));
        assert!(importer.tune(5.0));
        let mut restored = importer.restored();
        for importer in [&mut importer, &mut restored] {
            if reads {
                assert_eq!(importer.get(FOLLOWING), follows(5.0));
                if is_exchange {
                    assert_eq!(importer.rates(), [50.0, 0.0]);
                }
            }
            assert_eq!(importer.update(), Some(50.0));
            importer.leave_event_mode();
            assert_eq!(importer.get(FOLLOWING), follows(5.0));
        }
        if is_exchange {
            // To its own value: no change.
            assert!(importer.tune(5.0));
            assert_eq!(importer.rates(), [50.0, 0.0]);
        }
        // Without an iteration, too.
        importer.enter_event_mode();
        assert!(importer.tune(4.0));
        importer.leave_event_mode();
        if is_exchange {
            assert_eq!(importer.rates(), [40.0, 0.0]);
        } else {
            importer.step(0.0, 0.5);
            let ([x], exact) = (importer.get(["x"]), 40.0 * (1.0 - (-0.5_f64).exp()));
            assert!(is_close(x, exact), "{x} {exact}");
        }
        assert_eq!(importer.get(FOLLOWING), follows(4.0));
        importer.reset();
        importer.initialize();
        assert_eq!((importer.get(FOLLOWING), importer.update()), (follows(2.0), Some(20.0)));
    }
}

#[test]
fn they_follow_in_event_mode() {
    follow_in_events::<Integrated<Tuned>>(InstanceType::ModelExchange);
    follow_in_events::<Integrated<Tuned3>>(InstanceType::ModelExchange);
    follow_in_events::<Integrated<Tuned3>>(InstanceType::CoSimulationWithEvents);
}

/// The outputs' derivatives go through what is calculated, in FMI 3.0 between steps, too, where parameters are knowns.
#[test]
fn they_have_derivatives() {
    fn check<M: Model>() {
        for instance_type in [InstanceType::CoSimulation, InstanceType::ModelExchange] {
            let mut importer = Importer::<M>::new(instance_type);
            importer.enter_initialization();
            for found in importer.by_gain(["scaled", "y", "z", "of_field", "held", "der(x)", "plain"]) {
                assert_eq!(found, [10.0, 10.0, -11.0, 10.0, 10.0, 10.0, 11.0]);
            }
            importer.exit_initialization();
            if Importer::<M>::IS_FMI2 {
                continue;
            }
            assert!(importer.tune(5.0));
            for found in importer.by_gain(["y", "z", "of_field", "der(x)", "plain"]) {
                assert_eq!(found, [10.0, 11.0, 10.0, 10.0, 11.0]);
            }
        }
    }
    check::<Integrated<Tuned>>();
    check::<Integrated<Tuned3>>();
}

/// Calculated parameters of a sampled model follow at once, its outputs at the next sample.
#[test]
fn those_of_sampled_models_follow_before_the_next_sample() {
    fn check<M: Model>(instance_type: InstanceType) {
        let names = ["scaled", "plain", "seen"];
        let mut importer = Importer::<M>::new(instance_type);
        importer.initialize();
        let begin = |importer: &mut Importer<M>| {
            if instance_type == InstanceType::CoSimulation {
                importer.step(0.0, 0.5);
            } else {
                importer.update();
            }
        };
        begin(&mut importer);
        assert_eq!(importer.get(names), [20.0, 22.0, 20.0]);
        assert!(importer.tune(5.0));
        let mut restored = importer.restored();
        for importer in [&mut importer, &mut restored] {
            assert_eq!(importer.get(names), [50.0, 55.0, 20.0]);
            match instance_type {
                // The samples at 0.5 s are those before 1 s; the next one is in the step that begins there.
                InstanceType::CoSimulation => {
                    importer.step(0.5, 0.5);
                    assert_eq!(importer.get(names), [50.0, 55.0, 20.0]);
                    importer.step(1.0, 0.5);
                }
                InstanceType::CoSimulationWithEvents => {
                    importer.leave_event_mode();
                    importer.step(0.0, 1.0);
                    assert_eq!(importer.get(names), [50.0, 55.0, 20.0]);
                    importer.enter_event_mode();
                    importer.update();
                }
                InstanceType::ModelExchange => {
                    importer.leave_event_mode();
                    importer.set_time(1.0);
                    assert_eq!(importer.get(names), [50.0, 55.0, 20.0]);
                    importer.enter_event_mode();
                    importer.update();
                }
                InstanceType::ScheduledExecution => unreachable!("no model of these is for it"),
            }
            assert_eq!(importer.get(names), [50.0, 55.0, 50.0]);
        }
        importer.reset();
        importer.initialize();
        begin(&mut importer);
        assert_eq!(importer.get(names), [20.0, 22.0, 20.0]);
    }
    check::<SampledModel<TunedSamples>>(InstanceType::CoSimulation);
    check::<SampledModel<TunedSamples>>(InstanceType::ModelExchange);
    check::<SampledModel<TunedSamples3>>(InstanceType::CoSimulation);
    check::<SampledModel<TunedSamples3>>(InstanceType::ModelExchange);
    check::<SampledModel<TunedSamples3>>(InstanceType::CoSimulationWithEvents);
}

/// In a model with clocks, calculated parameters change at once and outputs at the next tick.
#[test]
fn those_of_models_with_clocks_follow_before_the_next_tick() {
    for instance_type in [InstanceType::ModelExchange, InstanceType::CoSimulationWithEvents] {
        let mut importer = Importer::<SampledModel<TunedTicks>>::new(instance_type);
        importer.initialize();
        assert_eq!(importer.get(["scaled", "plain"]), [20.0, 22.0]);
        assert!(importer.tune(5.0));
        let mut restored = importer.restored();
        for importer in [&mut importer, &mut restored] {
            assert_eq!(importer.get(["scaled", "plain"]), [50.0, 55.0]);
            importer.tick("sample");
            assert_eq!(importer.get(["scaled", "plain", "seen"]), [50.0, 55.0, 50.0]);
            // A tick is computed from the newest parameters.
            assert!(importer.tune(4.0));
            assert_eq!(importer.get(["scaled", "plain", "seen"]), [40.0, 44.0, 40.0]);
        }
    }
}

/// Models in Rust, without an FMU.
#[test]
fn they_follow_in_simulations() {
    let mut simulation = Simulation::<Integrated<Tuned>>::default();
    simulation.initialize().unwrap();
    simulation.variables.parameters.gain = 5.0;
    simulation.step(0.5).unwrap();
    assert_eq!([simulation.variables.outputs.y, simulation.variables.outputs.of_field], [50.0; 2]);
    let mut simulation = Simulation::<SampledModel<TunedSamples>>::default();
    simulation.initialize().unwrap();
    simulation.variables.parameters.gain = 5.0;
    simulation.step(0.5).unwrap();
    assert_eq!(simulation.variables.outputs.seen, 50.0);
    let mut simulation = Simulation::<SampledModel<TunedTicks>>::default();
    simulation.initialize().unwrap();
    simulation.variables.parameters.gain = 5.0;
    simulation.tick(|variables| &mut variables.clocks.sample).unwrap();
    assert_eq!(simulation.variables.outputs.seen, 50.0);
}
