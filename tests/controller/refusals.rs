//! Parameters that contradict each other are refused with a message that names them and their values.

use boost_fmu::controller::variables::{ControlMode, Parameters, Strategy};

use crate::bench::refusal;

fn assert_refused(change: impl FnOnce(&mut Parameters), named: &[&str]) {
    let message = refusal(change).expect("the parameters are refused").to_string();
    for name in named {
        assert!(message.contains(name), "{name} is missing in: {message}");
    }
}

#[test]
fn the_defaults_are_consistent() {
    assert_eq!(refusal(|_| {}), None);
}

#[test]
fn limits_without_a_band_between_them() {
    assert_refused(
        |parameters| parameters.tank_pressure_on = 29e3,
        &["tank_pressure_on is 29000 Pa", "tank_pressure_off, which is 30000 Pa"],
    );
    assert_refused(
        |parameters| parameters.tank_pressure_off = 35e3,
        &["tank_pressure_on", "tank_pressure_off"],
    );
    assert_refused(|parameters| parameters.pwm_min = 80.0, &["pwm_min is 80 %", "pwm_max, which is 75 %"]);
    assert_refused(|parameters| parameters.pwm_max = 25.0, &["pwm_min is 25 %", "pwm_max, which is 25 %"]);
    assert_refused(
        |parameters| parameters.lp_wastegate_close_below = 3500.0,
        &["lp_wastegate_close_below is 3500 rpm", "lp_wastegate_open_above, which is 3500 rpm"],
    );
}

#[test]
fn parameters_that_just_agree_are_accepted() {
    assert_eq!(refusal(|parameters| parameters.tank_pressure_on = 30e3_f64.next_up()), None);
    assert_eq!(refusal(|parameters| parameters.pwm_min = 75_f64.next_down()), None);
    assert_eq!(refusal(|parameters| parameters.lp_wastegate_close_below = 3500_f64.next_down()), None);
    assert_eq!(refusal(|parameters| parameters.schedule.gain[2][1] = -1e-3), None);
    assert_eq!(refusal(|parameters| parameters.schedule.engine_speed[2] = 1500_f64.next_down()), None);
}

#[test]
fn grids_that_do_not_increase() {
    assert_refused(
        |parameters| parameters.schedule.engine_speed[3] = 1500.0,
        &["schedule.engine_speed[3] is 1500", "schedule.engine_speed[4] is 1500"],
    );
    assert_refused(
        |parameters| parameters.schedule.boost_reference[15] = 1e5,
        &["schedule.boost_reference[15] is 230000", "schedule.boost_reference[16] is 100000"],
    );
}

type Change = fn(&mut Parameters);

/// Each of the strategy `split_range`; the strategy by speed and the other modes do not read them.
#[test]
fn an_allocation_that_contradicts_itself() {
    let cases: [(Change, [&str; 2]); 7] = [
        (
            |parameters| parameters.allocation.low_pressure_shut_below = 2500.0,
            ["low_pressure_shut_below is 2500 rpm", "low_pressure_free_above, which is 2500 rpm"],
        ),
        (
            |parameters| parameters.allocation.bypass_free_above = 2999.0,
            ["bypass_shut_below is 3000 rpm", "bypass_free_above, which is 2999 rpm"],
        ),
        (
            |parameters| parameters.allocation.bypass_start = 56.0,
            ["low_pressure_start is 56 %", "bypass_start, which is 56 %"],
        ),
        (
            |parameters| parameters.allocation.bypass_end = 62.0,
            ["bypass_start is 62 %", "bypass_end, which is 62 %"],
        ),
        (
            |parameters| {
                (parameters.pwm_min, parameters.pwm_max) = (90.0, 95.0);
                parameters.allocation.low_pressure_span = 40.0;
            },
            ["pwm_min is 90 %", "86.7"],
        ),
        (
            |parameters| parameters.allocation.bypass_closing_time = 0.0124,
            ["bypass_closing_time is 0.0124 s", "sample_time, which is 0.0125 s"],
        ),
        (
            |parameters| parameters.range_schedule.gain[15][11] = 1e3,
            ["range_schedule.gain[1,1] is -1140.44", "range_schedule.gain[16,12] is 1000"],
        ),
    ];
    for (change, named) in cases {
        assert_refused(change, &named);
        let elsewhere = |mode, strategy| {
            refusal(|parameters| {
                change(parameters);
                (parameters.mode, parameters.strategy) = (mode, strategy);
            })
        };
        assert_eq!(elsewhere(ControlMode::Boost, Strategy::BySpeed), None);
        assert_eq!(elsewhere(ControlMode::OpenLoop, Strategy::SplitRange), None);
    }
}

#[test]
fn gains_of_zero_or_of_both_signs() {
    assert_refused(|parameters| parameters.schedule.gain[4][2] = 0.0, &["schedule.gain[5,3] is 0 Pa/%"]);
    assert_refused(
        |parameters| parameters.schedule.gain[4][2] = -1e-9,
        &["schedule.gain[5,3]", "-0.000000001"],
    );
    assert_refused(
        |parameters| parameters.schedule.gain[15][6] = 2000.0,
        &["schedule.gain[1,1] is -1140.44 Pa/%", "schedule.gain[16,7] is 2000 Pa/%"],
    );
}

/// An actuator that shuts the wastegate with more duty has positive gains.
#[test]
fn positive_gains_are_as_good() {
    let negate = |parameters: &mut Parameters| {
        for gain in parameters.schedule.gain.iter_mut().flatten() {
            *gain = -*gain;
        }
    };
    assert_eq!(refusal(negate), None);
}
