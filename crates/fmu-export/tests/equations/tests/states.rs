//! Serialized states of models of equations, taken in the middle of a run.

use std::ffi::{CString, c_char};
use std::marker::PhantomData;
use std::ptr;

use fmu_export::fmi2::c_types::{CO_SIMULATION, CallbackFunctions, Component, FALSE, Status, TRUE};
use fmu_export::{Equations, Integrated, Variables as _, fmi2::c_api};
use fmu_export_equations::{BouncingBall, Robertson, Stairs};

/// An instance of a model's FMU in Step Mode.
struct Slave<E: Equations>(Component, PhantomData<E>);

impl<E: Equations> Drop for Slave<E> {
    fn drop(&mut self) {
        // SAFETY: the component belongs to this slave, and this is its last use.
        unsafe { c_api::free_instance::<Integrated<E>>(self.0) }
    }
}

fn assert_ok(status: Status) {
    assert_eq!(status, Status::Ok);
}

// SAFETY of every call below: the component belongs to this slave and is used by this thread only; arrays have the
// passed lengths; results outlive the call.
impl<E: Equations> Slave<E> {
    fn new() -> Self {
        let callbacks = CallbackFunctions {
            logger: None,
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: ptr::null_mut(),
        };
        let guid = CString::new(E::Variables::DESCRIPTION.guid).unwrap();
        let (name, resources) = (c"states".as_ptr(), ptr::null());
        // SAFETY: see above.
        unsafe {
            let functions = &raw const callbacks;
            let component = c_api::instantiate::<Integrated<E>>(
                name,
                CO_SIMULATION,
                guid.as_ptr(),
                resources,
                functions,
                FALSE,
                FALSE,
            );
            assert!(!component.is_null());
            assert_ok(c_api::setup_experiment::<Integrated<E>>(component, TRUE, 1e-6, 0.0, FALSE, 0.0));
            assert_ok(c_api::enter_initialization_mode::<Integrated<E>>(component));
            assert_ok(c_api::exit_initialization_mode::<Integrated<E>>(component));
            Self(component, PhantomData)
        }
    }

    fn step(&mut self, time: f64, size: f64) {
        // SAFETY: see above.
        assert_ok(unsafe { c_api::do_step::<Integrated<E>>(self.0, time, size, TRUE) });
    }

    fn serialize(&self) -> Vec<u8> {
        let (mut state, mut size) = (ptr::null_mut(), 0);
        // SAFETY: see above.
        unsafe {
            assert_ok(c_api::get_fmu_state::<Integrated<E>>(self.0, &raw mut state));
            assert_ok(c_api::serialized_fmu_state_size::<Integrated<E>>(self.0, state, &raw mut size));
            let mut bytes = vec![0_u8; size];
            let target = bytes.as_mut_ptr().cast::<c_char>();
            assert_ok(c_api::serialize_fmu_state::<Integrated<E>>(self.0, state, target, size));
            assert_ok(c_api::free_fmu_state::<Integrated<E>>(self.0, &raw mut state));
            bytes
        }
    }

    fn deserialize(&mut self, bytes: &[u8]) {
        let mut state = ptr::null_mut();
        let source = bytes.as_ptr().cast::<c_char>();
        // SAFETY: see above.
        unsafe {
            let result = &raw mut state;
            assert_ok(c_api::deserialize_fmu_state::<Integrated<E>>(self.0, source, bytes.len(), result));
            assert_ok(c_api::set_fmu_state::<Integrated<E>>(self.0, state));
            assert_ok(c_api::free_fmu_state::<Integrated<E>>(self.0, result));
        }
    }
}

/// Goes through communication steps, and again from each of the states between them, in another instance.
fn assert_goes_on_to_the_same_bits<E: Equations>(times: &[f64]) {
    let steps: Vec<_> = times.windows(2).map(|pair| (pair[0], pair[1] - pair[0])).collect();
    let mut slave = Slave::<E>::new();
    let mut states = vec![slave.serialize()];
    for &(time, size) in &steps {
        slave.step(time, size);
        states.push(slave.serialize());
    }
    for begin in 0..steps.len() {
        let mut other = Slave::<E>::new();
        other.deserialize(&states[begin]);
        for (step, &(time, size)) in steps.iter().enumerate().skip(begin) {
            other.step(time, size);
            assert!(
                other.serialize() == states[step + 1],
                "from the state at {} s, that at {} s is another",
                times[begin],
                times[step + 1]
            );
        }
    }
}

/// Equally long communication steps; their times are rounded as an importer's.
fn every(size: f64, steps: u32) -> Vec<f64> {
    (0..=steps).map(|step| f64::from(step) * size).collect()
}

#[test]
fn state_events() {
    // It bounces at 0.45 s, 1.08 s, 1.53 s, 1.84 s, 2.05 s and so on.
    assert_goes_on_to_the_same_bits::<BouncingBall>(&every(0.1, 25));
}

#[test]
fn time_events() {
    // There are events at multiples of 0.3 s: at ends of steps, but for rounding, and within steps.
    assert_goes_on_to_the_same_bits::<Stairs>(&every(0.1, 20));
    assert_goes_on_to_the_same_bits::<Stairs>(&every(0.17, 20));
}

#[test]
fn stiff() {
    // The length of the integrator's steps grows by ten decades.
    let times: Vec<_> = (-4..=11).map(|power| 10.0_f64.powi(power)).collect();
    assert_goes_on_to_the_same_bits::<Robertson>(&[&[0.0], times.as_slice()].concat());
}
