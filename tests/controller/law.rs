//! The formulas, against hand calculations, and the modes without feedback.

use boost_fmu::controller::actuator_inverse;
use boost_fmu::controller::feedback::FeedbackSettings;
use boost_fmu::controller::schedule::OperatingPoint;
use boost_fmu::controller::variables::{ActiveLimit, ControlMode, FeedbackStructure, Inputs, Parameters};

use crate::bench::Bench;

/// Hand calculations have all digits of a double; both round a few times.
fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() <= 1e-14 * expected.abs(), "{actual} instead of {expected}");
}

#[test]
fn tables_are_exact_at_their_points() {
    let schedule = &Parameters::default().schedule;
    for (i, &pressure) in schedule.boost_reference.iter().enumerate() {
        for (j, &speed) in schedule.engine_speed.iter().enumerate() {
            let here = OperatingPoint::new(schedule, pressure, speed);
            let local = here.local_model();
            assert_eq!(here.feedforward(), schedule.feedforward[i][j]);
            assert_eq!(local.gain, schedule.gain[i][j]);
            assert_eq!(local.time_constant, schedule.time_constant[i][j]);
            assert_eq!(local.delay, schedule.delay[i][j]);
        }
    }
}

#[test]
fn tables_of_the_whole_range_are_exact_at_their_points() {
    let schedule = &Parameters::default().range_schedule;
    for (i, &pressure) in schedule.boost_reference.iter().enumerate() {
        for (j, &speed) in schedule.engine_speed.iter().enumerate() {
            let here = OperatingPoint::new(schedule, pressure, speed);
            let local = here.local_model();
            assert_eq!(here.feedforward(), schedule.virtual_duty[i][j]);
            assert_eq!(here.interpolate(&schedule.speed_sensitivity), schedule.speed_sensitivity[i][j]);
            assert_eq!(
                (local.gain, local.time_constant, local.delay),
                (schedule.gain[i][j], schedule.time_constant[i][j], schedule.delay[i][j])
            );
        }
    }
}

#[test]
fn tables_are_bilinear_between_points_and_clamped_outside() {
    let schedule = &Parameters::default().schedule;
    let feedforward = |pressure, speed| OperatingPoint::new(schedule, pressure, speed).feedforward();
    // In the middle: (43.9864 + 47.5779 + 42.6568 + 45.8364) / 4.
    assert_close(feedforward(127_500.0, 1625.0), 45.014_375);
    // A quarter of the interval from 43.9864 to 42.6568.
    assert_close(feedforward(126_250.0, 1500.0), 43.654);
    assert_eq!(feedforward(5e4, 500.0), 42.8864);
    assert_eq!(feedforward(3e5, 500.0), 26.0);
    assert_eq!(feedforward(3e5, 6000.0), 41.2238);
    assert_eq!(feedforward(125e3, 0.0), 34.8001);
}

/// Eq. (12) for `K_p` = -3209.5 Pa/%, T = 1.04121 s, L = 0.0766921 s and λ = 0.3 s, in exact fractions.
#[test]
fn lambda_tuning_is_equation_12() {
    let local = OperatingPoint::new(&Parameters::default().schedule, 125e3, 1500.0).local_model();
    let tuning = FeedbackSettings::new(&local, 0.3);
    assert_close(tuning.gain, -0.000_994_138_069_270_65);
    assert_close(tuning.integral_gain, -0.000_920_876_752_319_298_4);
    assert_close(tuning.integral_time, 1.079_556_05);
    assert_close(tuning.derivative_time, 0.036_983_990_521_381_45);
}

/// Boost 1 kPa above the reference at 125 kPa and 1500 rpm, then another 1 kPa above.
#[test]
fn the_terms_of_the_paper_structure_by_hand() {
    let mut inputs = Inputs { boost_pressure: 126e3, ..Inputs::default() };
    let mut bench = Bench::new(&inputs, |parameters| parameters.structure = FeedbackStructure::Paper);
    bench.sample(0, &inputs);
    let locals = bench.variables.locals;
    assert_eq!((locals.feedforward_pwm, locals.integral_term, locals.derivative_term), (43.9864, 0.0, 0.0));
    assert_close(locals.proportional_term, 0.994_138_069_270_65);
    assert_close(locals.unsaturated_pwm, 44.980_538_069_270_65);
    assert_close(bench.variables.outputs.hp_wastegate_pwm, 44.980_538_069_270_65);
    assert!(!locals.saturated);

    inputs.boost_pressure = 127e3;
    bench.sample(1, &inputs);
    let locals = bench.variables.locals;
    assert_close(locals.proportional_term, 1.988_276_138_541_3);
    // K Ts/Ti e = 0.99413806927065 · 0.0125 / 1.07955605.
    assert_close(locals.integral_term, 0.994_138_069_270_65 * 0.0125 / 1.079_556_05);
    // -K N a Δy with a = Td / (Td + 8 · 0.0125) = 0.2699876852807024.
    assert_close(locals.derivative_term, 0.994_138_069_270_65 * 8.0 * 0.269_987_685_280_702_4);
}

/// The reference model starts at the measurement, so the first sample has no error, and the feedforward moves the
/// model towards the reference with twice the actuator's lag.
#[test]
fn the_first_sample_of_the_reference_model_by_hand() {
    let inputs = Inputs { boost_reference: 126e3, boost_pressure: 125e3, ..Inputs::default() };
    let mut bench = Bench::new(&inputs, |_| {});
    bench.sample(0, &inputs);
    let locals = bench.variables.locals;
    assert_eq!((locals.proportional_term, locals.integral_term, locals.derivative_term), (0.0, 0.0, 0.0));
    // 43.9864 + 1.04121 / -3209.5 · 1000 / 0.146.
    assert_close(locals.feedforward_pwm, 43.9864 - 1041.21 / 3209.5 / 0.146);
    assert_eq!(locals.reference_model_pressure, 125e3);
    bench.sample(1, &inputs);
    // One Euler step of 1000 Pa / 0.146 s.
    assert_close(bench.variables.locals.reference_model_pressure, 125e3 + 1000.0 / 0.146 * 0.0125);
}

#[test]
fn the_reference_is_limited() {
    let limited = Inputs { boost_reference: 240e3, engine_speed: 2000.0, ..Inputs::default() };
    let beyond = Inputs { boost_reference: 900e3, ..limited };
    let [limited, mut beyond] = [limited, beyond].map(|inputs| {
        let mut bench = Bench::new(&inputs, |_| {});
        let initial = bench.variables.outputs;
        (initial, bench.sample(0, &inputs), bench.variables.locals)
    });
    assert_eq!(limited.2.active_limit, ActiveLimit::None);
    assert_eq!(beyond.2.active_limit, ActiveLimit::BoostLimit);
    beyond.2.active_limit = ActiveLimit::None;
    assert_eq!(limited, beyond);
}

/// Twelve volts over the measured ones, down to six; never more than full duty. Below three nothing is measured.
#[test]
fn the_duty_is_compensated_for_the_supply_voltage() {
    let open_loop = |duty, voltage, compensate| {
        let inputs = Inputs { pwm_reference: duty, supply_voltage_measured: voltage, ..Inputs::default() };
        let mut bench = Bench::new(&inputs, |parameters| {
            parameters.mode = ControlMode::OpenLoop;
            parameters.compensate_voltage = compensate;
        });
        let initial = bench.variables.outputs;
        assert_eq!(bench.sample(0, &inputs), initial, "open loop needs no measurement");
        let locals = bench.variables.locals;
        (initial.hp_wastegate_pwm, locals.voltage_compensation, locals.saturated)
    };
    assert_eq!(open_loop(44.0, 12.0, true), (44.0, 1.0, false));
    assert_eq!(open_loop(44.0, 16.0, true), (33.0, 0.75, false));
    assert_eq!(open_loop(44.0, 8.0, true), (66.0, 1.5, false));
    assert_eq!(open_loop(44.0, 6.0, true), (88.0, 2.0, false));
    assert_eq!(open_loop(44.0, 3.0, true), (88.0, 2.0, false));
    assert_eq!(open_loop(44.0, 0.0, true), (44.0, 1.0, false));
    assert_eq!(open_loop(80.0, 6.0, true), (100.0, 2.0, true));
    assert_eq!(open_loop(100.0, 12.0, true), (100.0, 1.0, false));
    assert_eq!(open_loop(0.0, 9.0, true), (0.0, 12.0 / 9.0, false));
    assert_eq!(open_loop(44.0, 8.0, false), (44.0, 1.0, false));
}

/// Full duty takes precedence over a larger minimum.
#[test]
fn full_duty_overrides_the_lower_limit() {
    let inputs = Inputs { supply_voltage_measured: 6.0, ..Inputs::default() };
    let mut bench = Bench::new(&inputs, |parameters| {
        parameters.nominal_voltage = 48.0;
        parameters.pwm_min = 40.0;
    });
    assert_eq!(bench.variables.outputs.hp_wastegate_pwm, 100.0);
    assert_eq!(bench.sample(0, &inputs).hp_wastegate_pwm, 100.0);
    assert!(bench.variables.locals.saturated);
}

/// The inverse undoes eqs. (4) and (7) to the rounding of a pressure of 1e5 Pa over a slope of 400 Pa/%.
#[test]
fn the_inverse_actuator_undoes_the_actuator() {
    let inverse = &Parameters::default().actuator_inverse;
    let [k1, k2, k3, k4] = inverse.pressure_coefficient;
    let mut last = 0.0;
    for percent in 0..=100 {
        let opening = f64::from(percent) / 100.0;
        let duty = actuator_inverse::duty(inverse, opening);
        let pressure = k1 * duty.powi(3) + k2 * duty.powi(2) + k3 * duty + k4;
        let x = opening * 0.01;
        let balance = (101_325.0 - pressure) * 0.0015 - (19.0 + 3530.0 * x + 2.0e15 * x.powi(7));
        assert!(balance.abs() < 1e-12 * 101_325.0 * 0.0015, "{opening}: {balance} N");
        assert!(duty > last, "more duty opens further");
        last = duty;
    }
    // Lift-off and full stroke, from an independent bisection.
    assert_close(actuator_inverse::duty(inverse, 0.0), 28.817_807_269_357_402);
    assert_close(actuator_inverse::duty(inverse, 1.0), 71.279_179_227_842_75);
    // In the plant 44 % open the wastegate to 50.722 %, against 0.2 N of friction, that is 133 Pa on the
    // membrane or 0.16 % of duty, which the inverse neglects.
    let neglected = 44.0 - actuator_inverse::duty(inverse, 0.507_22);
    assert!((0.15..0.17).contains(&neglected), "{neglected}");
    // The opening is limited.
    assert_eq!(actuator_inverse::duty(inverse, -1.0), actuator_inverse::duty(inverse, 0.0));
    assert_eq!(actuator_inverse::duty(inverse, 2.0), actuator_inverse::duty(inverse, 1.0));
}

#[test]
fn position_mode_follows_the_inverse_actuator() {
    let inputs = Inputs {
        wastegate_reference: 0.5,
        supply_voltage_measured: 10.0,
        boost_pressure: 0.0,
        ..Inputs::default()
    };
    let mut bench = Bench::new(&inputs, |parameters| parameters.mode = ControlMode::Position);
    let duty = actuator_inverse::duty(&bench.variables.parameters.actuator_inverse, 0.5);
    assert_eq!(bench.variables.outputs.hp_wastegate_pwm, duty * 1.2);
    let shut = Inputs { wastegate_reference: 0.0, ..inputs };
    let duty = actuator_inverse::duty(&bench.variables.parameters.actuator_inverse, 0.0);
    assert_eq!(bench.sample(0, &shut).hp_wastegate_pwm, duty * 1.2);
}

#[test]
fn the_pump_is_a_relay() {
    let mut inputs = Inputs { tank_pressure: 40e3, ..Inputs::default() };
    let mut bench = Bench::new(&inputs, |_| {});
    assert_eq!(bench.variables.outputs.vacuum_pump, 0.0, "off in initialization");
    let pressures = [35e3, 35.001e3, 34e3, 30e3, 29.999e3, 30e3, 35e3, 36e3];
    let expected = [0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    for (number, (pressure, pump)) in (0..).zip(pressures.into_iter().zip(expected)) {
        inputs.tank_pressure = pressure;
        assert_eq!(bench.sample(number, &inputs).vacuum_pump, pump, "at {pressure} Pa");
    }
    assert_eq!(bench.messages.iter().filter(|(_, message)| message.contains("pump")).count(), 3);
}
