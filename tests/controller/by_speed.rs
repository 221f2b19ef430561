//! The strategy `by_speed`, bit for bit.

use boost_fmu::controller::variables::{FeedbackStructure, Inputs};

use crate::bench::Bench;

/// Inputs and outputs of the controller at each sample of closed loops with `BoostPlant`, whose engine runs from 1500
/// to 4200 rpm and back at 400 rpm/s. Recorded before the other strategy existed, since users rely on unchanged results
/// of this one.
const SAMPLES: &str = include_str!("../data/by_speed.csv");

#[test]
fn results_match_the_recording() {
    let mut lines = SAMPLES.lines();
    let names = "structure,boost_reference,boost_pressure,tank_pressure,supply_voltage_measured,engine_speed,\
                 hp_wastegate_pwm,vacuum_pump,lp_wastegate,hp_bypass,unsaturated_pwm";
    assert_eq!(lines.next(), Some(names));
    let lines: Vec<&str> = lines.collect();
    for (name, structure) in
        [("model_reference", FeedbackStructure::ModelReference), ("paper", FeedbackStructure::Paper)]
    {
        let samples = lines.iter().filter_map(|line| line.strip_prefix(name)?.strip_prefix(','));
        let mut bench = None;
        for (number, line) in (0..).zip(samples) {
            let fields: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
            let (inputs, expected) = fields.split_at(5);
            let inputs = Inputs {
                boost_reference: inputs[0],
                boost_pressure: inputs[1],
                tank_pressure: inputs[2],
                supply_voltage_measured: inputs[3],
                engine_speed: inputs[4],
                ..Inputs::default()
            };
            let bench = bench.get_or_insert_with(|| {
                Bench::by_speed(&inputs, |parameters| parameters.structure = structure)
            });
            let outputs = bench.sample(number, &inputs);
            let actual = [
                outputs.hp_wastegate_pwm,
                outputs.vacuum_pump,
                outputs.lp_wastegate,
                outputs.hp_bypass,
                bench.variables.locals.unsaturated_pwm,
            ];
            assert_eq!(
                actual.map(f64::to_bits)[..],
                expected.iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
                "{name}, sample {number}"
            );
        }
        assert_eq!(bench.expect("samples").variables.locals.sample_count, 1240);
    }
}
