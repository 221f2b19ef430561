//! Intermediate Update Mode (FMI 3.0.2, section 4.2.2): an importer that exchanges values between two internal steps.

use std::ffi::{CString, c_void};
use std::ptr;

use fmu_export::fmi3::c_api;
use fmu_export::fmi3::c_types::{Instance, Status, ValueReference};
use fmu_export::{Described as _, Integrated};
use fmu_export_equations::{Decay, decay};

type Model = Integrated<Decay>;

/// The tolerance of the integrator. Of a step's error in x, relative to 1, some remain over the internal steps.
const TOLERANCE: f64 = 1e-8;
const ACCUMULATED: f64 = 100.0;

/// What the importer does in an intermediate update.
#[derive(Default)]
struct Importer {
    instance: Option<Instance>,
    /// When and with which `x`.
    updates: Vec<(f64, f64)>,
    /// The input's value at a time.
    target: Option<fn(f64) -> f64>,
    /// When it asks for early return, and from which time on.
    returns: Option<(f64, f64)>,
    /// Another call that it makes, and how that ends.
    call: Option<fn(Instance) -> Status>,
    answer: Option<Status>,
}

fn reference(name: &str) -> ValueReference {
    let mut described = decay::Variables::described();
    described.find(|(_, variable)| variable.name() == name).expect("there is such a variable").0
}

fn get(instance: Instance, name: &str) -> (Status, f64) {
    let (reference, mut value) = (reference(name), f64::NAN);
    let (references, values) = (&raw const reference, &raw mut value);
    // SAFETY: the instance is alive; both arrays have an element.
    let status = unsafe { c_api::fmi3GetFloat64::<Model>(instance, references, 1, values, 1) };
    (status, value)
}

fn set(instance: Instance, name: &str, value: f64) -> Status {
    let reference = reference(name);
    let (references, values) = (&raw const reference, &raw const value);
    // SAFETY: as above.
    unsafe { c_api::fmi3SetFloat64::<Model>(instance, references, 1, values, 1) }
}

unsafe extern "C" fn update(
    environment: *mut c_void,
    time: f64,
    is_set_requested: u8,
    is_get_allowed: u8,
    is_finished: u8,
    can_return_early: u8,
    is_asked: *mut u8,
    return_time: *mut f64,
) {
    assert_eq!([is_set_requested, is_get_allowed, is_finished], [1; 3]);
    // SAFETY: the environment is the test's importer, to which no other reference exists during a step.
    let importer = unsafe { &mut *environment.cast::<Importer>() };
    let instance = importer.instance.expect("it is instantiated");
    let (status, x) = get(instance, "x");
    assert_eq!(status, Status::Ok);
    importer.updates.push((time, x));
    if let Some(target) = importer.target {
        assert_eq!(set(instance, "target", target(time)), Status::Ok);
    }
    if let Some((from, to)) = importer.returns
        && time >= from
        && can_return_early == 1
    {
        // SAFETY: both are the FMU's results.
        unsafe {
            is_asked.write(1);
            return_time.write(to);
        }
    }
    if let Some(call) = importer.call.take() {
        importer.answer = Some(call(instance));
    }
}

/// An instance in Step Mode, which exchanges `x` and `target`.
fn instantiate(importer: *mut Importer, early_return_allowed: bool, event_mode_used: bool) -> Instance {
    let token = CString::new(decay::Variables::DESCRIPTION.guid).unwrap();
    let registered = [reference("x"), reference("target")];
    // SAFETY: the strings and the array outlive the call; the importer outlives the instance.
    unsafe {
        let instance = c_api::fmi3InstantiateCoSimulation::<Model>(
            c"updates".as_ptr(),
            token.as_ptr(),
            ptr::null(),
            0,
            0,
            event_mode_used.into(),
            early_return_allowed.into(),
            registered.as_ptr(),
            registered.len(),
            importer.cast(),
            None,
            Some(update),
        );
        assert!(!instance.is_null());
        (*importer).instance = Some(instance);
        let status = c_api::fmi3EnterInitializationMode::<Model>(instance, 1, TOLERANCE, 0.0, 0, 0.0);
        assert_eq!(status, Status::Ok);
        assert_eq!(c_api::fmi3ExitInitializationMode::<Model>(instance), Status::Ok);
        if event_mode_used {
            assert_eq!(c_api::fmi3EnterStepMode::<Model>(instance), Status::Ok);
        }
        instance
    }
}

/// A step: its status, `earlyReturn` and `lastSuccessfulTime`.
fn step(instance: Instance, time: f64, size: f64) -> (Status, bool, f64) {
    let ([mut needed, mut terminate, mut early], mut reached) = ([9; 3], f64::NAN);
    let results = [&raw mut needed, &raw mut terminate, &raw mut early];
    // SAFETY: the instance is alive; the results outlive the call.
    let status = unsafe {
        let [needed, terminate, early] = results;
        c_api::fmi3DoStep::<Model>(instance, time, size, 1, needed, terminate, early, &raw mut reached)
    };
    assert!(status != Status::Ok || [needed, terminate] == [0; 2]);
    (status, early == 1, reached)
}

fn free(instance: Instance) {
    // SAFETY: this is its last use.
    unsafe { c_api::fmi3FreeInstance::<Model>(instance) }
}

fn assert_near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= ACCUMULATED * TOLERANCE, "{found} instead of {expected}");
}

#[test]
fn at_the_end_of_each_internal_step_values_are_those_there() {
    for event_mode_used in [false, true] {
        let importer = Box::into_raw(Box::<Importer>::default());
        let instance = instantiate(importer, false, event_mode_used);
        assert_eq!(step(instance, 0.0, 3.0), (Status::Ok, false, 3.0));
        let end = get(instance, "x");
        free(instance);
        // SAFETY: it came from a box, and the instance is freed.
        let Importer { updates, .. } = *unsafe { Box::from_raw(importer) };
        assert!(updates.len() > 5, "{updates:?}");
        assert!(updates.is_sorted_by(|before, after| before.0 < after.0), "{updates:?}");
        assert!(updates.iter().all(|(time, _)| 0.0 < *time && *time < 3.0), "{updates:?}");
        for (time, x) in updates.into_iter().chain([(3.0, end.1)]) {
            assert_near(x, (-time).exp());
        }
    }
}

#[test]
fn inputs_hold_from_one_internal_step_to_the_next() {
    let target = |time: f64| time.sin();
    let importer = Box::into_raw(Box::new(Importer { target: Some(target), ..Importer::default() }));
    let instance = instantiate(importer, false, false);
    assert_eq!(step(instance, 0.0, 3.0), (Status::Ok, false, 3.0));
    let end = get(instance, "x");
    free(instance);
    // SAFETY: as above.
    let Importer { updates, .. } = *unsafe { Box::from_raw(importer) };
    let (mut before, mut x, mut input) = (0.0, 1.0, 0.0);
    for (time, found) in updates.into_iter().chain([(3.0, end.1)]) {
        x = input + (x - input) * (before - time).exp();
        assert_near(found, x);
        (before, input) = (time, target(time));
    }
}

#[test]
fn early_return_is_at_the_time_that_is_asked_for() {
    for (allowed, from, to, expected) in [
        (true, 0.5, 1.25, (Status::Ok, true, Some(1.25))),
        (true, 0.5, 0.0, (Status::Ok, true, None)),
        (true, 0.5, 9.0, (Status::Ok, false, Some(3.0))),
        (false, 0.5, 1.25, (Status::Ok, false, Some(3.0))),
    ] {
        let importer = Box::into_raw(Box::new(Importer { returns: Some((from, to)), ..Importer::default() }));
        let instance = instantiate(importer, allowed, false);
        let (status, early, reached) = step(instance, 0.0, 3.0);
        let (_, x) = get(instance, "x");
        // It continues from there.
        assert_eq!(step(instance, reached, 0.125).0, Status::Ok);
        free(instance);
        // SAFETY: as above.
        let Importer { updates, .. } = *unsafe { Box::from_raw(importer) };
        let at_once = updates.iter().map(|(time, _)| *time).find(|time| *time >= from);
        assert_eq!((status, early), (expected.0, expected.1));
        assert_eq!(reached.to_bits(), expected.2.or(at_once).expect("there is an update").to_bits());
        assert_near(x, (-reached).exp());
    }
}

/// The first derivative of an output over time.
fn get_rate(instance: Instance, name: &str) -> (Status, f64) {
    let (reference, order, mut value) = (reference(name), 1, f64::NAN);
    let (references, orders, values) = (&raw const reference, &raw const order, &raw mut value);
    // SAFETY: the instance is alive; the arrays have an element each.
    let status =
        unsafe { c_api::fmi3GetOutputDerivatives::<Model>(instance, references, 1, orders, values, 1) };
    (status, value)
}

#[test]
fn derivatives_of_registered_outputs_are_got() {
    let call: fn(Instance) -> Status = |instance| get_rate(instance, "x").0;
    let importer = Box::into_raw(Box::new(Importer { call: Some(call), ..Importer::default() }));
    let instance = instantiate(importer, false, false);
    assert_eq!(step(instance, 0.0, 3.0).0, Status::Ok);
    // After the step there is no such restriction.
    let (_, x) = get(instance, "x");
    let (status, rate) = get_rate(instance, "square");
    assert_eq!(status, Status::Ok);
    // x decays at a rate of 1/s.
    assert!((rate + 2.0 * x * x).abs() <= 4.0 * f64::EPSILON * x * x, "{rate}");
    assert_eq!(get_rate(instance, "seconds"), (Status::Ok, 1.0));
    free(instance);
    // SAFETY: as above.
    assert_eq!(unsafe { Box::from_raw(importer) }.answer, Some(Status::Ok));
}

/// FMI 2.0.5, section 2.1.9, and FMI 3.0.2, section 2.4.8: time is a variable, by which there are derivatives, too.
#[test]
fn derivatives_by_time_are_got() {
    let importer = Box::into_raw(Box::<Importer>::default());
    let instance = instantiate(importer, false, false);
    assert_eq!(step(instance, 0.0, 3.0).0, Status::Ok);
    let (unknowns, knowns) = ([reference("seconds"), reference("x")], [reference("time"), reference("x")]);
    for (function, seeds, expected) in [
        // Seconds change as time does, and x as itself.
        (
            c_api::fmi3GetDirectionalDerivative::<Model> as unsafe fn(_, _, _, _, _, _, _, _, _) -> _,
            [4.0, 3.0],
            [4.0, 3.0],
        ),
        (c_api::fmi3GetAdjointDerivative::<Model>, [2.0, 5.0], [2.0, 5.0]),
    ] {
        let mut found = [f64::NAN; 2];
        // SAFETY: the instance is alive; the arrays have two elements each.
        let status = unsafe {
            function(
                instance,
                unknowns.as_ptr(),
                2,
                knowns.as_ptr(),
                2,
                seeds.as_ptr(),
                2,
                found.as_mut_ptr(),
                2,
            )
        };
        assert_eq!((status, found), (Status::Ok, expected));
    }
    free(instance);
    // SAFETY: as above.
    drop(unsafe { Box::from_raw(importer) });
}

#[test]
fn other_calls_than_those_for_registered_variables_end_the_simulation() {
    let calls: [fn(Instance) -> Status; 6] = [
        |instance| get_rate(instance, "square").0,
        |instance| get(instance, "square").0,
        |instance| set(instance, "rate", 1.0),
        |instance| set(instance, "x", 1.0),
        |instance| step(instance, 0.0, 1.0).0,
        |instance| {
            let mut state = ptr::null_mut();
            // SAFETY: the instance is alive, and the state the test's.
            unsafe { c_api::fmi3GetFMUState::<Model>(instance, &raw mut state) }
        },
    ];
    for (number, call) in calls.into_iter().enumerate() {
        let importer = Box::into_raw(Box::new(Importer { call: Some(call), ..Importer::default() }));
        let instance = instantiate(importer, false, false);
        assert_eq!(step(instance, 0.0, 3.0).0, Status::Error, "call {number}");
        free(instance);
        // SAFETY: as above.
        let Importer { updates, answer, .. } = *unsafe { Box::from_raw(importer) };
        assert_eq!((updates.len(), answer), (1, Some(Status::Error)), "call {number}");
    }
}
