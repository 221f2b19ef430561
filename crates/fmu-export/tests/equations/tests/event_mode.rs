//! Co-simulation with Event Mode (FMI 3.0.2, section 4.2): an importer that handles the models' state and time events.

use std::ffi::CString;
use std::marker::PhantomData;
use std::ptr;

use fmu_export::fmi3::c_api;
use fmu_export::fmi3::c_types::{Instance, Status};
use fmu_export::{Described as _, Equations, Integrated, Simulation};
use fmu_export_equations::{BouncingBall, Falling, Stairs};

/// The tolerance of the integrator.
const TOLERANCE: f64 = 1e-8;

/// An instance of a model's FMU with Event Mode, in Event Mode at the start.
struct Slave<E: Equations>(Instance, PhantomData<E>);

impl<E: Equations> Drop for Slave<E> {
    fn drop(&mut self) {
        // SAFETY: the instance belongs to this slave, and this is its last use.
        unsafe { c_api::fmi3FreeInstance::<Integrated<E>>(self.0) }
    }
}

/// What `fmi3DoStep` returns.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stepped {
    event_handling_needed: bool,
    early_return: bool,
    last_successful_time: f64,
}

// SAFETY of every call below: the instance belongs to this slave and is used by this thread only; arrays have the passed
// lengths; results outlive the call.
impl<E: Equations> Slave<E> {
    fn new(early_return_allowed: bool) -> Self {
        let token = CString::new(E::Variables::DESCRIPTION.guid).unwrap();
        // SAFETY: see above.
        unsafe {
            let instance = c_api::fmi3InstantiateCoSimulation::<Integrated<E>>(
                c"events".as_ptr(),
                token.as_ptr(),
                ptr::null(),
                0,
                0,
                1,
                early_return_allowed.into(),
                ptr::null(),
                0,
                ptr::null_mut(),
                None,
                None,
            );
            assert!(!instance.is_null());
            let status =
                c_api::fmi3EnterInitializationMode::<Integrated<E>>(instance, 1, TOLERANCE, 0.0, 0, 0.0);
            assert_eq!(status, Status::Ok);
            assert_eq!(c_api::fmi3ExitInitializationMode::<Integrated<E>>(instance), Status::Ok);
            Self(instance, PhantomData)
        }
    }

    fn step(&mut self, time: f64, size: f64) -> Stepped {
        let [mut needed, mut terminate, mut early] = [9; 3];
        let mut reached = f64::NAN;
        // SAFETY: see above.
        let status = unsafe {
            c_api::fmi3DoStep::<Integrated<E>>(
                self.0,
                time,
                size,
                1,
                &raw mut needed,
                &raw mut terminate,
                &raw mut early,
                &raw mut reached,
            )
        };
        assert_eq!((status, terminate), (Status::Ok, 0));
        Stepped {
            event_handling_needed: needed == 1,
            early_return: early == 1,
            last_successful_time: reached,
        }
    }

    /// From Step Mode to Event Mode, through the event, and back.
    fn handle_event(&mut self) -> Option<f64> {
        // SAFETY: see above.
        assert_eq!(unsafe { c_api::fmi3EnterEventMode::<Integrated<E>>(self.0) }, Status::Ok);
        self.leave_event_mode()
    }

    /// Through the event to Step Mode: when the next time event is due.
    fn leave_event_mode(&mut self) -> Option<f64> {
        let mut flags = [1_u8; 5];
        let mut next = f64::NAN;
        while flags[0] == 1 {
            let status = self.update_discrete_states(&mut flags, &mut next);
            assert_eq!((status, flags[1]), (Status::Ok, 0));
        }
        // SAFETY: see above.
        assert_eq!(unsafe { c_api::fmi3EnterStepMode::<Integrated<E>>(self.0) }, Status::Ok);
        (flags[4] == 1).then_some(next)
    }

    fn update_discrete_states(&mut self, flags: &mut [u8; 5], next: &mut f64) -> Status {
        let [again, terminate, nominals, values, is_defined] = flags;
        // SAFETY: see above.
        unsafe {
            c_api::fmi3UpdateDiscreteStates::<Integrated<E>>(
                self.0, again, terminate, nominals, values, is_defined, next,
            )
        }
    }

    fn get<const N: usize>(&mut self, names: [&str; N]) -> [f64; N] {
        let references = names.map(|name| {
            let mut described = E::Variables::described();
            described.find(|(_, variable)| variable.name() == name).expect("there is such a variable").0
        });
        let mut values = [f64::NAN; N];
        // SAFETY: see above.
        let status = unsafe {
            let (references, values) = (references.as_ptr(), values.as_mut_ptr());
            c_api::fmi3GetFloat64::<Integrated<E>>(self.0, references, N, values, N)
        };
        assert_eq!(status, Status::Ok);
        values
    }

    fn set(&mut self, name: &str, value: f64) {
        let mut described = E::Variables::described();
        let (reference, _) =
            described.find(|(_, variable)| variable.name() == name).expect("there is such a variable");
        let (references, values) = (&raw const reference, &raw const value);
        // SAFETY: see above.
        let status = unsafe { c_api::fmi3SetFloat64::<Integrated<E>>(self.0, references, 1, values, 1) };
        assert_eq!(status, Status::Ok);
    }
}

/// The ball as the model steps it by itself.
fn ball(time: f64) -> (f64, [f64; 2]) {
    let mut simulation = Simulation::<Integrated<BouncingBall>>::default();
    simulation.experiment.tolerance = Some(TOLERANCE);
    simulation.initialize().unwrap();
    simulation.step(time).unwrap();
    let variables = simulation.variables;
    (variables.outputs.last_bounce, [variables.states.h, variables.states.v])
}

#[test]
fn a_state_event_ends_the_step_and_is_the_importers() {
    let mut slave = Slave::<BouncingBall>::new(true);
    assert_eq!(slave.leave_event_mode(), None);
    let event = slave.step(0.0, 0.7);
    let bounce = event.last_successful_time;
    // It falls from 1 m; the error of the states is at most the tolerance, and the velocity there more than 1 m/s.
    assert!((bounce - (2.0 / 9.81_f64).sqrt()).abs() < TOLERANCE, "{bounce}");
    assert!(event.event_handling_needed && event.early_return);
    let [h, v] = slave.get(["h", "v"]);
    assert!(h <= 0.0 && h > -1e-12 && v < -1.0, "before the bounce: {h}, {v}");
    assert_eq!(slave.handle_event(), None);
    assert_eq!(slave.get(["h"]).map(f64::to_bits), [0]);
    assert!((slave.get(["v"])[0] + 0.7 * v).abs() < 1e-15);
    // That the ball leaves the ground is another event.
    let leaves = slave.step(bounce, 0.7 - bounce);
    assert!(leaves.event_handling_needed && leaves.last_successful_time > bounce);
    slave.handle_event();
    let time = leaves.last_successful_time;
    assert!(!slave.step(time, 0.7 - time).event_handling_needed);
    let (last_bounce, [h, v]) = ball(0.7);
    assert_eq!(last_bounce.to_bits(), bounce.to_bits());
    // The step ends where the other one does but for the time's rounding.
    for (found, expected) in slave.get(["h", "v"]).into_iter().zip([h, v]) {
        assert!((found - expected).abs() < 1e-14, "{found} instead of {expected}");
    }
}

#[test]
fn an_event_that_leaves_a_limit_exceeded_is_an_error() {
    let mut slave = Slave::<Falling>::new(true);
    slave.leave_event_mode();
    assert!(slave.step(0.0, 0.7).event_handling_needed);
    // SAFETY: see above.
    assert_eq!(unsafe { c_api::fmi3EnterEventMode::<Integrated<Falling>>(slave.0) }, Status::Ok);
    assert_eq!(slave.update_discrete_states(&mut [1; 5], &mut 0.0), Status::Error);
}

#[test]
fn without_early_return_the_model_handles_its_events_within_a_step() {
    let mut slave = Slave::<BouncingBall>::new(false);
    slave.leave_event_mode();
    let stepped = slave.step(0.0, 0.7);
    assert_eq!(
        stepped,
        Stepped { event_handling_needed: false, early_return: false, last_successful_time: 0.7 }
    );
    assert_eq!(slave.get(["last_bounce"])[0].to_bits(), ball(0.7).0.to_bits());
    assert_eq!(slave.get(["h", "v"]).map(f64::to_bits), ball(0.7).1.map(f64::to_bits));
}

#[test]
fn time_events_are_at_their_very_number() {
    let mut slave = Slave::<Stairs>::new(true);
    let mut next = slave.leave_event_mode();
    let mut time = 0.0;
    for step in 1..=20_i32 {
        let due = f64::from(step) * 0.3;
        assert_eq!(next.map(f64::to_bits), Some(due.to_bits()));
        let reached = slave.step(time, 10.0);
        assert!(reached.event_handling_needed && reached.early_return);
        time = reached.last_successful_time;
        assert_eq!(time.to_bits(), due.to_bits());
        next = slave.handle_event();
        assert_eq!(slave.get(["last_step"]).map(f64::to_bits), [due.to_bits()]);
    }
}

#[test]
fn an_input_that_jumps_is_an_event_before_the_step() {
    let mut slave = Slave::<Stairs>::new(true);
    slave.leave_event_mode();
    assert!(!slave.step(0.0, 0.1).event_handling_needed);
    slave.set("signal", 1.0);
    let stepped = slave.step(0.1, 0.1);
    assert_eq!(
        stepped,
        Stepped { event_handling_needed: true, early_return: true, last_successful_time: 0.1 }
    );
    slave.handle_event();
    assert_eq!(slave.get(["last_switch"]).map(f64::to_bits), [0.1_f64.to_bits()]);
    assert_eq!(slave.step(0.1, 0.1).last_successful_time.to_bits(), 0.2_f64.to_bits());
}
