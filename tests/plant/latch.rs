//! The option that updates the duty at the starts of PWM periods.

use boost_fmu::plant::variables::Inputs;

use crate::bench::Bench;

fn latched() -> Bench {
    Bench::new(Inputs::default(), |parameters, _| parameters.valve.duty_latch = true)
}

#[test]
fn a_new_duty_acts_from_the_next_period_on() {
    let mut bench = latched();
    let at_start = bench.variables.states.valve.plunger_duty;
    // Steps of 1 ms; periods start at 0, 3.33, 6.67 ms.
    bench.step(1e-3);
    bench.variables.inputs.hp_wastegate_pwm = 80.0;
    bench.step(1e-3);
    bench.step(1e-3);
    assert!((bench.variables.states.valve.plunger_duty - at_start).abs() < 1e-12);
    assert!((bench.variables.locals.valve.commanded_duty - 40.0).abs() < 1e-12);
    bench.step(1e-3);
    // The lag of 8 ms since 3.33 ms; the method's error is (step/lag)^5.
    let expected = 80.0 - 40.0 * (-(4e-3 - 1.0 / 300.0) / 8e-3_f64).exp();
    assert!((bench.variables.states.valve.plunger_duty - expected).abs() < 1e-5);
    assert!((bench.variables.locals.valve.commanded_duty - 80.0).abs() < 1e-12);
}

#[test]
fn the_voltage_acts_at_once() {
    let mut bench = latched();
    bench.step(1e-3);
    bench.variables.inputs.supply_voltage = 10.0;
    bench.step(1e-3);
    assert!((bench.variables.locals.valve.commanded_duty - 40.0 * 10.0 / 12.0).abs() < 1e-12);
}

#[test]
fn periods_are_counted_from_the_start_of_the_experiment_and_copied_with_the_model() {
    let mut bench = latched();
    bench.experiment.start_time = 100.0;
    bench.time = 100.0;
    bench.initialize();
    bench.run(0.05);
    let mut copy = bench.clone();
    for bench in [&mut bench, &mut copy] {
        bench.variables.inputs.hp_wastegate_pwm = 60.0;
        // 50 ms are 15 periods: the next one starts at once.
        bench.step(1e-3);
        assert!((bench.variables.locals.valve.commanded_duty - 60.0).abs() < 1e-12);
        bench.variables.inputs.hp_wastegate_pwm = 70.0;
        bench.step(2e-3);
        assert!((bench.variables.locals.valve.commanded_duty - 60.0).abs() < 1e-12);
    }
    assert!(bench.variables == copy.variables);
}

#[test]
fn a_duty_that_changes_at_the_starts_of_periods_is_not_delayed() {
    // A duty that changes at the starts of periods only (every 12.5 ms is every fourth at 320 Hz).
    let run = |latch| {
        let mut bench = Bench::new(Inputs::default(), |parameters, _| {
            parameters.valve.duty_latch = latch;
            parameters.valve.pwm_frequency = 320.0;
        });
        for duty in [40.0, 55.0, 30.0, 90.0, 45.0, 45.0, 60.0] {
            bench.variables.inputs.hp_wastegate_pwm = duty;
            bench.step(0.0125);
        }
        bench.variables.states.to_array()
    };
    for (held, direct) in run(true).into_iter().zip(run(false)) {
        // Each period is integrated separately, so that only the method's error differs, 0.01 % at most.
        assert!((held - direct).abs() <= 1e-4 * direct.abs().max(1.0), "{held} and {direct}");
    }
}
