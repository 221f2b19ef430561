//! The calls that are found in the firmware's image.

use std::collections::{BTreeMap, BTreeSet};

use BoostControllerInTheLoop::ecu::IMAGE;
use BoostControllerInTheLoop::image::Image;

/// Through branches, and through addresses: nothing branches to what shows a number of a message.
#[test]
fn what_is_called_is_found() {
    let image = Image::read(IMAGE).unwrap();
    let [all, of_sample] =
        ["__cortex_m_rt_main", "controller::execute_sample"].map(|name| image.reached_from(name));
    let has =
        |reached: &BTreeMap<&str, BTreeSet<&str>>, part: &str| reached.keys().any(|name| name.contains(part));
    for part in ["execute_sample", "ControlLaw", "core::num::flt2dec"] {
        assert!(has(&all, part) && has(&of_sample, part), "{part}");
    }
    // A changed page is checked before a sample, not in it.
    assert!(has(&all, "check_parameters") && !has(&of_sample, "check_parameters"));
    assert!(
        has(&all, "panic_bounds_check"),
        "what receives frames may panic, for all that the compiler knows"
    );
}
