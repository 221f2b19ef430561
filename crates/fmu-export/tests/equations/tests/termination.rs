//! The end that a model requests (FMI 3.0.2, section 4.2.1), where its description promises whole steps.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr;

use fmu_export::fmi3::c_api;
use fmu_export::fmi3::c_types::Status;
use fmu_export::{Described as _, Integrated};
use fmu_export_equations::{Ending, ending};

type Model = Integrated<Ending>;
type Messages = RefCell<Vec<String>>;

unsafe extern "C" fn log(
    environment: *mut c_void,
    _status: Status,
    _category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: the environment is the test's, and the text ends in NUL.
    let (messages, text) = unsafe { (&*environment.cast::<Messages>(), CStr::from_ptr(text)) };
    messages.borrow_mut().push(text.to_string_lossy().into_owned());
}

/// A first step of this size: its status, `terminateSimulation`, `earlyReturn` and `lastSuccessfulTime`, and the messages.
fn step(size: f64) -> (Status, [u8; 2], f64, Vec<String>) {
    let messages = Messages::default();
    let environment = (&raw const messages).cast_mut().cast();
    let token = CString::new(ending::Variables::DESCRIPTION.guid).unwrap();
    let ([mut needed, mut terminate, mut early], mut reached) = ([9; 3], f64::NAN);
    let (needed, terminate, early) = (&raw mut needed, &raw mut terminate, &raw mut early);
    // SAFETY: the strings outlive the call, messages and results the instance, which is freed last.
    unsafe {
        let (name, nothing) = (c"ending".as_ptr(), ptr::null_mut());
        let instance = c_api::fmi3InstantiateCoSimulation::<Model>(
            name,
            token.as_ptr(),
            nothing,
            0,
            1,
            0,
            1,
            ptr::null(),
            0,
            environment,
            Some(log),
            None,
        );
        let status = c_api::fmi3EnterInitializationMode::<Model>(instance, 0, 0.0, 0.0, 0, 0.0);
        assert_eq!(status, Status::Ok);
        assert_eq!(c_api::fmi3ExitInitializationMode::<Model>(instance), Status::Ok);
        let status =
            c_api::fmi3DoStep::<Model>(instance, 0.0, size, 1, needed, terminate, early, &raw mut reached);
        c_api::fmi3FreeInstance::<Model>(instance);
        (status, [*terminate, *early], reached, messages.into_inner())
    }
}

#[test]
fn an_end_within_a_step_that_is_not_declared_warns() {
    assert!(ending::Variables::MODEL_DESCRIPTION_XML.contains("mightReturnEarlyFromDoStep=\"false\""));
    let (status, flags, reached, messages) = step(1.0);
    assert_eq!((status, flags, reached.to_bits()), (Status::Ok, [1, 1], 0.25_f64.to_bits()));
    assert!(messages.iter().any(|text| text.contains("{\"termination\": true}")), "{messages:?}");
}

#[test]
fn an_end_at_the_end_of_a_step_need_not() {
    let next_beyond = 0.25_f64.next_up();
    for size in [0.25, next_beyond] {
        let (status, flags, reached, messages) = step(size);
        assert_eq!((status, flags, reached.to_bits()), (Status::Ok, [1, 0], size.to_bits()), "{messages:?}");
    }
}
