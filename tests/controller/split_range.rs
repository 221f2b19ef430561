//! The strategy `split_range`: against an independent implementation, sample by sample, and its allocation.

use boost_fmu::controller::variables::{FeedbackStructure, Inputs, Outputs, Strategy};

use crate::bench::Bench;

/// Inputs of samples, and the outputs that a transcription in Python, `split_range.py` beside it, computes with the same
/// maps.
const SAMPLES: &str = include_str!("../data/split_range.csv");

/// Within 1e-9 relative or 1e-12 absolute: both compute in doubles, and add in another order.
fn assert_close(what: &str, line: &str, actual: f64, expected: f64) {
    let error = (actual - expected).abs();
    assert!(
        error <= 1e-12 || error <= 1e-9 * expected.abs(),
        "{what} is {actual}, not {expected}, in: {line}"
    );
}

#[test]
fn it_agrees_with_an_independent_implementation() {
    let mut lines = SAMPLES.lines();
    let names = "scenario,sample,boost_reference,boost_pressure,supply_voltage_measured,tank_pressure,\
                 engine_speed,hp_wastegate_pwm,lp_wastegate,hp_bypass,vacuum_pump";
    assert_eq!(lines.next(), Some(names));
    let mut bench = None;
    let mut scenarios = 0;
    for line in lines {
        let fields: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
        let [_, sample, boost_reference, boost_pressure, supply_voltage_measured, tank_pressure, ..] =
            fields[..]
        else {
            panic!("{line}")
        };
        let inputs = Inputs {
            boost_reference,
            boost_pressure,
            supply_voltage_measured,
            tank_pressure,
            engine_speed: fields[6],
            ..Inputs::default()
        };
        if sample == 0.0 {
            bench = Some((Bench::new(&inputs, |_| {}), 0));
            scenarios += 1;
        }
        let (bench, number) = bench.as_mut().expect("a first sample");
        let outputs = bench.sample(*number, &inputs);
        *number += 1;
        assert_close("hp_wastegate_pwm", line, outputs.hp_wastegate_pwm, fields[7]);
        assert_close("lp_wastegate", line, outputs.lp_wastegate, fields[8]);
        assert_close("hp_bypass", line, outputs.hp_bypass, fields[9]);
        assert_eq!(outputs.vacuum_pump, fields[10], "{line}");
    }
    assert_eq!(scenarios, 6);
}

/// The valves at rest at a virtual duty (%): those of initialization with a map of this duty.
fn valves(virtual_duty: f64, engine_speed: f64) -> [f64; 3] {
    let inputs = Inputs { engine_speed, ..Inputs::default() };
    let bench = Bench::new(&inputs, |parameters| {
        parameters.range_schedule.virtual_duty = [[virtual_duty; 12]; 16];
    });
    let Outputs { hp_wastegate_pwm, lp_wastegate, hp_bypass, .. } = bench.variables.outputs;
    [hp_wastegate_pwm, lp_wastegate, hp_bypass]
}

/// The largest slopes by calculus: of the duty 1; of the low-pressure wastegate (1+c)²/(c·X) = 0.0939 per % where it
/// is fully open, and 1/500 per rpm; of the bypass 1/20 per % and 1/1000 per rpm.
#[test]
fn the_allocation_is_continuous() {
    let (percent, rpm) = (0.5, 25.0);
    let steps = [[percent, 0.0], [0.0, rpm]];
    let most = [[1.0, 1.69 / 18.0, 0.05], [0.0, 1.0 / 500.0, 1.0 / 1000.0]];
    for speed in (0..180).map(|k| 1000.0 + rpm * f64::from(k)) {
        for duty in (0..160).map(|k| 24.0 + percent * f64::from(k)) {
            let here = valves(duty, speed);
            for (step, most) in steps.iter().zip(most) {
                let there = valves(duty + step[0], speed + step[1]);
                let size = step[0] + step[1];
                for ((here, there), most) in here.into_iter().zip(there).zip(most) {
                    // Rounding of duties up to 75 %.
                    assert!((there - here).abs() <= most * size + 1e-13, "{duty} %, {speed} rpm by {step:?}");
                }
            }
        }
    }
}

#[test]
fn the_allocation_by_hand() {
    // Half of the share of speed, and 0.3 · 15 / (60 - 15) of the hyperbola.
    assert_eq!(valves(71.0, 2250.0), [71.0, 0.5 * 0.3 * 15.0 / 45.0, 0.0]);
    assert_eq!(valves(72.0, 3500.0), [72.0, 0.3 * 16.0 / 44.0, 0.5 * 0.5]);
    assert_eq!(valves(56.0, 5500.0), [56.0, 0.0, 0.0]);
    // Fully open at 56 + 60/1.3 = 102.15 %, beyond which the virtual duty is limited.
    let [duty, low_pressure, bypass] = valves(300.0, 4000.0);
    assert_eq!((duty, bypass), (75.0, 1.0));
    assert!((1.0 - low_pressure).abs() <= 1e-15, "{low_pressure}");
}

#[test]
fn up_to_2000_rpm_the_high_pressure_wastegate_works_alone() {
    for speed in [0.0, 1000.0, 1500.0, 1999.0, 2000.0] {
        for duty in [0.0, 25.0, 56.0, 75.0, 100.0, 300.0] {
            assert_eq!(valves(duty, speed), [duty.clamp(25.0, 75.0), 0.0, 0.0], "{duty} % at {speed} rpm");
        }
    }
}

/// At constant speed up to 2000 rpm both strategies are the same in the structure of the paper.
#[test]
fn up_to_2000_rpm_it_is_the_strategy_by_speed() {
    for engine_speed in [1000.0, 1500.0, 1860.0, 2000.0] {
        let mut inputs = Inputs { engine_speed, ..Inputs::default() };
        let [mut one, mut other] = [Strategy::SplitRange, Strategy::BySpeed].map(|strategy| {
            Bench::new(&inputs, |parameters| {
                (parameters.strategy, parameters.structure) = (strategy, FeedbackStructure::Paper);
            })
        });
        for number in 0..2000 {
            let time = 0.0125 * f64::from(number);
            inputs.boost_reference = if time < 10.0 { 150e3 } else { 115e3 };
            inputs.boost_pressure = 140e3 + 3e4 * (0.7 * time).sin();
            inputs.supply_voltage_measured = 12.0 + 5.0 * (0.3 * time).sin();
            let expected = other.sample(number, &inputs);
            let outputs = one.sample(number, &inputs);
            // The maps' columns have other neighbours, so that weights round differently.
            let error = (outputs.hp_wastegate_pwm - expected.hp_wastegate_pwm).abs();
            assert!(error <= 1e-9, "{engine_speed} rpm, sample {number}: {error}");
            assert_eq!((outputs.lp_wastegate, outputs.hp_bypass), (0.0, 0.0));
        }
    }
}

/// The bypass starts at its target; for a smaller one, it shuts with 0.3 s while the low-pressure wastegate is shut.
#[test]
fn the_bypass_lags() {
    let wide =
        Inputs { boost_reference: 110e3, boost_pressure: 110e3, engine_speed: 4500.0, ..Inputs::default() };
    let mut bench = Bench::new(&wide, |parameters| parameters.structure = FeedbackStructure::Paper);
    assert_eq!(bench.variables.outputs.hp_bypass, 1.0);
    assert_eq!(bench.sample(0, &wide).hp_bypass, 1.0);
    // The map demands a small duty at once.
    let shut = Inputs { boost_reference: 200e3, ..wide };
    let mut expected = 1.0;
    for number in 1..20 {
        expected -= 0.0125 / 0.3 * expected;
        let bypass = bench.sample(number, &shut).hp_bypass;
        assert!((bypass - expected).abs() <= 1e-15, "{bypass} instead of {expected}");
    }
}

/// 240 kPa at 5500 rpm would run the shaft too fast: the reference is 174.069 kPa there.
#[test]
fn the_reference_is_limited_over_engine_speed() {
    let at = |boost_reference, engine_speed| {
        let inputs = Inputs { boost_reference, engine_speed, ..Inputs::default() };
        let mut bench = Bench::new(&inputs, |parameters| parameters.structure = FeedbackStructure::Paper);
        let initial = bench.variables.outputs;
        (initial, bench.sample(0, &inputs), bench.variables.locals.reference_model_pressure)
    };
    let (initial, outputs, limited) = at(240e3, 5500.0);
    assert_eq!(limited, 174_069.0);
    assert_eq!((initial, outputs, limited), at(174_069.0, 5500.0));
    // Halfway between 195842 Pa and 174069 Pa.
    assert_eq!(at(240e3, 5125.0).2, 184_955.5);
}

/// The maps of the other strategy have no effect, which is logged once.
#[test]
fn a_schedule_for_the_other_strategy_is_warned_of() {
    let warnings = |strategy| {
        let bench = Bench::new(&Inputs::default(), |parameters| {
            parameters.strategy = strategy;
            parameters.schedule.feedforward[3][2] += 1.0;
        });
        bench.messages.iter().filter(|(_, message)| message.contains("schedule is ignored")).count()
    };
    assert_eq!((warnings(Strategy::SplitRange), warnings(Strategy::BySpeed)), (1, 0));
    assert!(Bench::new(&Inputs::default(), |_| {}).messages.is_empty());
}
