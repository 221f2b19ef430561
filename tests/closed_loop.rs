//! The closed loop: the paper's figures, and the handover between the stages.
//!
//! Bounds of the plant, of the paper's structure and of the strategy by speed are results of an independent
//! implementation of both models plus 0.02 kPa: 0.01 % of the full scale of 200 kPa, within which two solvers agree. Those
//! of the strategy `split_range` are what it has to hold.

mod boost_steps;
mod day;
#[allow(clippy::float_cmp, reason = "codes and commands at their limits are exact")]
mod faults;
mod noise;
#[path = "support/random.rs"]
mod random;
mod speed_range;

use std::fs;
use std::ops::{Deref, DerefMut, Range};
use std::path::Path;

use boost_fmu::BoostController;
use boost_fmu::controller::variables as controller;
use boost_fmu::plant::BoostPlant;
use boost_fmu::plant::variables as plant;
use boost_steps::BOOST_STEPS;
use fmu_export::description::Causality;
use fmu_export::{Accessed as _, Described as _, Experiment, Fmu, InputSignal, InputsOf, Model, Simulation};
use random::Random;

/// The controller's sample time and the step of most masters here (s).
const STEP: f64 = 0.0125;

const END_OF_FIGURE_13: f64 = 124.0;

/// The tolerance between two solvers (Pa).
const MARGIN: f64 = 20.0;

/// The lowest supply voltage (V) of a sound system: that of `diagnosis.supply_share_min`.
const LOWEST_SUPPLY: f64 = 6.0;

/// A model with its variables.
struct Instance<F: Fmu>(Simulation<F>);

impl<F: Fmu> Deref for Instance<F> {
    type Target = Simulation<F>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl<F: Fmu> DerefMut for Instance<F> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl<F: Fmu> Instance<F> {
    fn new(start_time: f64) -> Self {
        let experiment = Experiment { start_time, ..Experiment::default() };
        Self(Simulation { experiment, ..Simulation::default() })
    }

    fn initialize(&mut self, inputs: &InputsOf<F::Model>) {
        self.variables.inputs_mut().clone_from(inputs);
        self.0.initialize().expect("initialization succeeds");
    }

    /// All outputs, in the order of the description.
    fn outputs(&self) -> Vec<f64> {
        <F::Model as Model>::Variables::described()
            .filter(|(_, variable)| variable.causality == Causality::Output)
            .map(|(reference, _)| self.variables.real(reference))
            .collect()
    }

    fn step(&mut self, start: f64, size: f64, inputs: &InputsOf<F::Model>) {
        self.time = start;
        self.0.step_with(size, &InputSignal::constant(inputs)).expect("the step succeeds");
    }
}

/// The order in which a master steps both.
#[derive(Clone, Copy, PartialEq)]
enum Order {
    /// The controller, then the plant over the same interval.
    ControllerFirst,
    /// Both with the other's previous outputs.
    AtOnce,
}

/// The closed loop.
struct Loop {
    controller: Instance<BoostController>,
    plant: Instance<BoostPlant>,
    demand: controller::Inputs,
    surroundings: plant::Inputs,
    order: Order,
    /// The master's (s).
    step_size: f64,
    steps: u32,
    /// Noise on the measured boost pressure.
    noise: Option<Random>,
    /// Its standard deviation (Pa).
    noise_deviation: f64,
    /// The step of the converter of the measured boost pressure (Pa); 0 for none.
    converter_step: f64,
    /// Standard deviations of the noise of engine speed (rpm) and supply voltage (V), with that of boost pressure.
    speed_deviation: f64,
    supply_deviation: f64,
    /// Whether the controller gets the speed of the high-pressure shaft.
    measures_shaft: bool,
}

impl Loop {
    /// A loop that starts at rest, with both initialized together.
    fn settled(
        demand: controller::Inputs,
        order: Order,
        change: impl FnOnce(&mut controller::Parameters, &mut plant::Parameters),
    ) -> Self {
        let surroundings = plant::Inputs { engine_speed: demand.engine_speed, ..plant::Inputs::default() };
        Self::settled_in(surroundings, demand, order, change)
    }

    fn settled_in(
        surroundings: plant::Inputs,
        demand: controller::Inputs,
        order: Order,
        change: impl FnOnce(&mut controller::Parameters, &mut plant::Parameters),
    ) -> Self {
        let controller = Instance::<BoostController>::new(0.0);
        let plant = Instance::<BoostPlant>::new(0.0);
        let (step_size, steps, noise) = (STEP, 0, None);
        let mut this = Self {
            controller,
            plant,
            demand,
            surroundings,
            order,
            step_size,
            steps,
            noise,
            noise_deviation: 100.0,
            converter_step: 0.0,
            speed_deviation: 0.0,
            supply_deviation: 0.0,
            measures_shaft: false,
        };
        change(&mut this.controller.variables.parameters, &mut this.plant.variables.parameters);
        // The supply is known; the pressures settle at the controller's outputs, which do not depend on them.
        this.demand.supply_voltage_measured = surroundings.supply_voltage;
        this.controller.initialize(&this.demand);
        this.plant.initialize(&this.plant_inputs());
        this.controller.initialize(&this.measurements());
        this
    }

    /// A loop that starts as on the test bench.
    fn new(
        demand: controller::Inputs,
        order: Order,
        change: impl FnOnce(&mut controller::Parameters, &mut plant::Parameters),
    ) -> Self {
        Self::settled(demand, order, change).run_in()
    }

    /// The engine has run for 20 s at the duty of the map, with a frozen vacuum tank.
    fn run_in(mut self) -> Self {
        self.plant.experiment.start_time = -20.0;
        self.plant.variables.parameters.initialization.mode = plant::InitializationMode::Running;
        self.plant.variables.parameters.tank.frozen = true;
        let inputs = self.plant_inputs();
        self.plant.initialize(&inputs);
        for step in 0..1600 {
            self.plant.step(-20.0 + f64::from(step) * STEP, STEP, &inputs);
        }
        self.plant.variables.parameters.tank.frozen = false;
        let Simulation { model, variables, .. } = &mut *self.plant;
        model.refresh(0.0, variables);
        self
    }

    fn time(&self) -> f64 {
        f64::from(self.steps) * self.step_size
    }

    fn boost_pressure(&self) -> f64 {
        self.plant.variables.outputs.boost_pressure
    }

    /// The wastegate's position in points (percent of the stroke).
    fn position(&self) -> f64 {
        100.0 * self.plant.variables.outputs.hp_wastegate_position
    }

    fn plant_inputs(&self) -> plant::Inputs {
        let outputs = self.controller.variables.outputs;
        plant::Inputs {
            hp_wastegate_pwm: outputs.hp_wastegate_pwm,
            vacuum_pump: outputs.vacuum_pump,
            lp_wastegate: outputs.lp_wastegate,
            hp_bypass: outputs.hp_bypass,
            surge_valve: outputs.surge_valve,
            ..self.surroundings
        }
    }

    fn measurements(&self) -> controller::Inputs {
        let measured = self.plant.variables.outputs;
        controller::Inputs {
            boost_pressure: measured.boost_pressure,
            tank_pressure: measured.tank_pressure,
            supply_voltage_measured: measured.supply_voltage_measured,
            engine_speed: self.surroundings.engine_speed,
            hp_turbo_speed: if self.measures_shaft { measured.hp_turbo_speed } else { 0.0 },
            ..self.demand
        }
    }

    /// Steps to a time; calls `look` after each step.
    fn run(&mut self, end: f64, mut look: impl FnMut(&Self)) {
        while self.time() < end - 0.5 * self.step_size {
            self.step();
            look(self);
        }
    }

    fn step(&mut self) {
        self.step_with_findings();
        // No false alarm in any of these experiments.
        let is_sound = self.plant.variables.parameters.fault == plant::Parameters::default().fault
            && self.surroundings.supply_voltage >= LOWEST_SUPPLY;
        let found = self.controller.variables.locals.diagnosis;
        assert!(
            !is_sound || self.controller.variables.outputs.fault_code == 0.0,
            "at {} s: {found:?} on a sound plant, with {:?}",
            self.time(),
            self.plant_inputs()
        );
    }

    /// A step on a plant that may have a fault.
    fn step_with_findings(&mut self) {
        let time = self.time();
        let before = self.plant_inputs();
        let mut inputs = self.measurements();
        if let Some(random) = &mut self.noise {
            // A normal distribution, as the sum of twelve uniform ones.
            let mut draw = || (0..12).map(|_| random.between(-0.5, 0.5)).sum::<f64>();
            inputs.boost_pressure += self.noise_deviation * draw();
            if self.speed_deviation > 0.0 {
                inputs.engine_speed += self.speed_deviation * draw();
                inputs.supply_voltage_measured += self.supply_deviation * draw();
            }
        }
        if self.converter_step > 0.0 {
            inputs.boost_pressure =
                (inputs.boost_pressure / self.converter_step).round() * self.converter_step;
        }
        self.controller.step(time, self.step_size, &inputs);
        let inputs = match self.order {
            Order::ControllerFirst => self.plant_inputs(),
            Order::AtOnce => before,
        };
        self.plant.step(time, self.step_size, &inputs);
        self.steps += 1;
    }
}

/// The quality of the response to one step of the reference (Pa, s).
#[derive(Clone, Copy, Debug)]
struct Answer {
    from: f64,
    to: f64,
    /// Beyond the new reference.
    overshoot: f64,
    /// Until the pressure is within a tenth of the step.
    rise: f64,
    end_error: f64,
}

/// Runs a loop with references (kPa) from given times (s) on.
fn follow(
    control: &mut Loop,
    references: &[(f64, f64)],
    end: f64,
    mut look: impl FnMut(&Loop),
) -> Vec<Answer> {
    let ends = references[1..].iter().map(|&(time, _)| time).chain([end]);
    let mut before = control.demand.boost_reference;
    let mut answers = Vec::new();
    for (&(begin, kilopascal), end) in references.iter().zip(ends) {
        let reference = 1e3 * kilopascal;
        control.demand.boost_reference = reference;
        let height = reference - before;
        let (mut overshoot, mut rise): (f64, f64) = (0.0, f64::INFINITY);
        control.run(end, |control| {
            let beyond = (control.boost_pressure() - reference) * height.signum();
            overshoot = overshoot.max(beyond);
            if beyond >= -0.1 * height.abs() {
                rise = rise.min(control.time() - begin);
            }
            look(control);
        });
        let end_error = (control.boost_pressure() - reference).abs();
        answers.push(Answer { from: before, to: reference, overshoot, rise, end_error });
        before = reference;
    }
    answers
}

fn figure_13(structure: controller::FeedbackStructure, order: Order) -> Vec<Answer> {
    let control = Loop::new(controller::Inputs::default(), order, |parameters, _| {
        parameters.structure = structure;
    });
    figure_13_with(control, |_| {})
}

fn settled() -> Loop {
    Loop::settled(controller::Inputs::default(), Order::ControllerFirst, |_, _| {})
}

fn figure_13_with(mut control: Loop, look: impl FnMut(&Loop)) -> Vec<Answer> {
    let steps: Vec<_> = BOOST_STEPS.iter().map(|&(time, pressure)| (time, 1e-3 * pressure)).collect();
    let mut answers = follow(&mut control, &steps, END_OF_FIGURE_13, look);
    answers.remove(0);
    for answer in &answers {
        println!("{answer:?}");
    }
    answers
}

fn largest(answers: &[Answer], wanted: impl Fn(&Answer) -> bool, value: impl Fn(&Answer) -> f64) -> f64 {
    answers.iter().filter(|answer| wanted(answer)).map(value).fold(0.0, f64::max)
}

fn upward(answer: &Answer) -> bool {
    answer.to > answer.from
}

#[test]
fn figure_13_with_the_reference_model() {
    assert_figure_13(&figure_13(controller::FeedbackStructure::ModelReference, Order::ControllerFirst));
}

#[test]
fn figure_13_from_a_settled_start() {
    let mut record = String::new();
    let answers = figure_13_with(settled(), |control| {
        let outputs = [control.controller.outputs(), control.plant.outputs()].concat();
        record.extend(outputs.iter().map(|value| format!("{:016x}", value.to_bits())));
        record += "\n";
    });
    assert_figure_13(&answers);
    // tests/fmu/test_masters_agree.py compares the FMUs' results with this file.
    fs::write(Path::new(env!("CARGO_TARGET_TMPDIR")).join("figure_13.txt"), record).unwrap();
}

/// Overshoot in Fig. 13 (Pa): a fifteenth of the paper's 5 kPa, and the largest error in Fig. 14, under half of its 1 kPa.
const OVERSHOOT: f64 = 350.0;
const SUPPLY_ERROR: f64 = 450.0;

fn assert_figure_13(answers: &[Answer]) {
    // Twice `reference_lambda` and some: two lags in series of 0.32 s and 0.16 s reach 90 % after 0.98 s, the engine's
    // delay of up to 0.1 s later.
    assert_figure_13_within(answers, 0.98..1.08);
}

fn assert_figure_13_within(answers: &[Answer], rises: Range<f64>) {
    assert!(largest(answers, |_| true, |answer| answer.overshoot) <= OVERSHOOT);
    assert!(largest(answers, |_| true, |answer| answer.end_error) <= 2.0 + MARGIN);
    assert!(answers.iter().all(|answer| rises.contains(&answer.rise)), "{answers:?}");
}

#[test]
fn figure_13_with_the_structure_of_the_paper() {
    let answers = figure_13(controller::FeedbackStructure::Paper, Order::ControllerFirst);
    assert!(largest(&answers, upward, |answer| answer.overshoot) <= 4200.0 + MARGIN);
    assert!(largest(&answers, |answer| !upward(answer), |answer| answer.overshoot) <= 3700.0 + MARGIN);
}

#[test]
fn figure_13_when_both_step_at_once() {
    let answers = figure_13(controller::FeedbackStructure::ModelReference, Order::AtOnce);
    assert!(largest(&answers, |_| true, |answer| answer.overshoot) <= OVERSHOOT);
}

#[test]
fn figure_13_with_measurement_noise() {
    for seed in 1..7 {
        let mut control = settled();
        control.noise = Some(Random(seed));
        let answers = figure_13_with(control, |_| {});
        assert!(largest(&answers, |_| true, |answer| answer.overshoot) <= OVERSHOOT);
        // The noise moves boost by less than its own standard deviation.
        assert!(largest(&answers, |_| true, |answer| answer.end_error) <= 100.0);
    }
}

/// Steps of up to three times the largest of Fig. 13: the wastegate is on its seat for most of the way. Boost rises
/// without a dip and overshoots by less than in the paper's own steps of 20 kPa.
#[test]
fn large_steps_of_the_reference() {
    for (engine_speed, height) in
        [1500.0, 2000.0, 2500.0, 3500.0, 4500.0].into_iter().flat_map(|n| [20e3, 40e3, 60e3].map(|h| (n, h)))
    {
        let mut control = on_reference_day(engine_speed, 125e3);
        control.run(8.0, |_| {});
        let reference = 125e3 + height;
        control.demand.boost_reference = reference;
        let (mut most, mut dip): (f64, f64) = (0.0, 0.0);
        control.run(22.0, |control| {
            most = most.max(control.boost_pressure());
            dip = dip.max(most.min(reference) - control.boost_pressure());
        });
        let overshoot = most - reference;
        println!("{engine_speed} rpm, {height} Pa: overshoot {overshoot:.0} Pa, dip {dip:.0} Pa");
        assert!(overshoot <= 700.0 && dip <= 500.0, "{overshoot} Pa, {dip} Pa at {engine_speed} rpm");
    }
}

/// Throttle and reference at once, by 50 kPa: with all valves shut boost would rise in 1.39, 0.75 and 0.66 s; the rest is
/// `reference_lambda`.
#[test]
fn tip_in() {
    for (engine_speed, from) in [(1500.0, 115e3), (2000.0, 120e3), (3500.0, 125e3)] {
        let mut control = on_reference_day(engine_speed, from);
        control.surroundings.throttle = 0.3;
        control.run(8.0, |_| {});
        (control.surroundings.throttle, control.demand.boost_reference) = (1.0, from + 50e3);
        let begin = control.time();
        while control.boost_pressure() < from + 0.95 * 50e3 {
            control.step();
            assert!(control.time() - begin <= 1.55, "{} Pa at {engine_speed} rpm", control.boost_pressure());
        }
        println!("{engine_speed} rpm: 95 % after {:.2} s", control.time() - begin);
    }
}

/// A loop at rest whose controller measures ambient conditions and the shaft's speed.
fn on_reference_day(engine_speed: f64, boost_reference: f64) -> Loop {
    let plant::Inputs { ambient_pressure, ambient_temperature, .. } = plant::Inputs::default();
    let demand = controller::Inputs {
        boost_reference,
        engine_speed,
        ambient_pressure,
        ambient_temperature,
        ..controller::Inputs::default()
    };
    let mut control = Loop::settled(demand, Order::ControllerFirst, |_, _| {});
    control.measures_shaft = true;
    control
}

/// Within 0.3 kPa in transients (a sample inside a long step acts early), 0.02 kPa at rest.
#[test]
fn figure_13_at_other_communication_rates() {
    let run = |rate: u32| {
        let mut control = settled();
        control.step_size = 1.0 / f64::from(rate);
        let mut common = vec![];
        let answers = figure_13_with(control, |control| {
            // Common instants: multiples of 25 ms.
            if control.steps.is_multiple_of(rate / 40) {
                common.push(control.boost_pressure());
            }
        });
        // A sample of the controller may be a step of the master later or earlier.
        assert_figure_13_within(&answers, 0.9..1.1);
        common
    };
    let [slow, medium, fast] = [80, 200, 1000].map(run);
    let ends: Vec<_> = BOOST_STEPS[1..].iter().map(|step| step.0).chain([END_OF_FIGURE_13]).collect();
    let mut largest = [0.0_f64; 2];
    for (number, ((a, b), c)) in (1..).zip(slow.iter().zip(&medium).zip(&fast)) {
        let time = f64::from(number) / 40.0;
        let spread = a.max(*b).max(*c) - a.min(*b).min(*c);
        let at_rest = usize::from(ends.iter().any(|end| (0.0..=1.0).contains(&(end - time))));
        largest[at_rest] = largest[at_rest].max(spread);
    }
    println!("{largest:?} Pa in transients and at rest");
    assert!(largest[0] <= 300.0 && largest[1] <= 20.0, "{largest:?} Pa in transients and at rest");
}

/// The loop starts near the reference and approaches it without overshoot. The map was identified with friction,
/// which a settled start does not have: up to 1.8 kPa.
#[test]
fn a_settled_loop_goes_to_its_reference() {
    let mut control = settled();
    let error = |control: &Loop| (control.boost_pressure() - control.demand.boost_reference).abs();
    let first = error(&control);
    assert!(first <= 1800.0, "{first} Pa");
    control.run(3.0, |control| assert!(error(control) <= first + MARGIN, "{} Pa", error(control)));
}

/// Position control by the inverse of the plant's actuator, at varying supply.
#[test]
fn position_control_reaches_its_reference() {
    for (reference, voltage) in [0.2, 0.5, 0.8].into_iter().flat_map(|r| [11.0, 12.0, 13.5].map(|u| (r, u))) {
        let demand = controller::Inputs { wastegate_reference: reference, ..controller::Inputs::default() };
        let surroundings = plant::Inputs { supply_voltage: voltage, ..plant::Inputs::default() };
        let mut control = Loop::settled_in(surroundings, demand, Order::ControllerFirst, |controller, _| {
            controller.mode = controller::ControlMode::Position;
        });
        let error = |control: &Loop| (control.position() - 100.0 * reference).abs();
        // The inverse and the settled start are without friction; the latter is accurate to 1e-6.
        assert!(error(&control) <= 0.01, "{} points at the start", error(&control));
        // Later, tank pressure and supply vary without effect on the wastegate.
        control.run(2.0, |_| {});
        assert!(error(&control) <= 0.1, "{} points", error(&control));
    }
}

/// The largest boost error (Pa) from 3 s, under the supply voltage steps of fig. 14.
fn figure_14(sensor: f64, compensate: bool, noise: Option<Random>) -> f64 {
    let voltages = [
        (0.0, 12.0),
        (5.0, 11.1),
        (10.0, 11.9),
        (15.0, 12.6),
        (20.0, 11.5),
        (25.0, 13.5),
        (30.0, 11.1),
        (35.0, 12.0),
    ];
    let mut control =
        Loop::new(controller::Inputs::default(), Order::ControllerFirst, |controller, plant| {
            controller.compensate_voltage = compensate;
            plant.supply_sensor.time_constant = sensor;
        });
    control.noise = noise;
    let mut largest: f64 = 0.0;
    while control.time() < 42.0 {
        let time = control.time() + 0.5 * STEP;
        let &(_, voltage) = voltages.iter().rfind(|(begin, _)| *begin < time).expect("a voltage");
        control.surroundings.supply_voltage = voltage;
        control.step();
        if control.time() > 3.0 {
            largest = largest.max((control.boost_pressure() - control.demand.boost_reference).abs());
        }
    }
    println!("sensor {sensor} s, compensation {compensate}: {largest} Pa");
    largest
}

/// The slower the supply sensor, the longer a step acts: results, rounded up.
#[test]
fn figure_14_with_compensation() {
    for (sensor, most) in [(0.001, 200.0), (0.02, SUPPLY_ERROR), (0.05, 950.0), (0.1, 1550.0), (0.2, 2250.0)]
    {
        let largest = figure_14(sensor, true, None);
        assert!(largest <= most, "{largest} Pa with a sensor of {sensor} s");
    }
}

#[test]
fn figure_14_with_compensation_and_noise() {
    assert!(figure_14(0.02, true, Some(Random(1))) < SUPPLY_ERROR);
}

/// The compensation removes at least seven eighths of the error.
#[test]
fn figure_14_without_compensation() {
    let [without, with] = [false, true].map(|compensate| figure_14(0.02, compensate, None));
    assert!(without > 8.0 * with, "{without} Pa without, {with} Pa with");
}

/// A running engine with the controller in open loop at a duty (%), with a supply (V).
fn open_loop(duty: f64, voltage: f64, compensate: bool) -> Loop {
    let demand = controller::Inputs { pwm_reference: duty, ..controller::Inputs::default() };
    let surroundings = plant::Inputs { supply_voltage: voltage, ..plant::Inputs::default() };
    Loop::settled_in(surroundings, demand, Order::ControllerFirst, |controller, _| {
        controller.mode = controller::ControlMode::OpenLoop;
        controller.compensate_voltage = compensate;
    })
    .run_in()
}

/// Figs. 1 and 10: at a duty of 44 % the supply falls from 11.9 V to 11.1 V and returns.
#[test]
fn figure_1_without_compensation() {
    let mut control = open_loop(44.0, 11.9, false);
    control.run(2.0, |_| {});
    let before = control.plant.variables.outputs;
    control.surroundings.supply_voltage = 11.1;
    control.run(6.0, |_| {});
    let after = control.plant.variables.outputs;
    let pressure = after.actuator_pressure - before.actuator_pressure;
    let points = 100.0 * (after.hp_wastegate_position - before.hp_wastegate_position);
    let boost = after.boost_pressure - before.boost_pressure;
    println!("actuator {pressure} Pa, wastegate {points} points, boost {boost} Pa");
    // 0.01 % of full scale at both ends, and half of the last printed digit.
    assert!((pressure - 2466.0).abs() <= 20.5, "{pressure} Pa");
    assert!((76.75e3..=76.85e3).contains(&before.actuator_pressure), "{before:?}");
    assert!((-9.7 - 0.07..=-9.2 + 0.07).contains(&points), "{points} points");
    assert!((49.5 - 0.06..=50.0 + 0.06).contains(&(100.0 * before.hp_wastegate_position)), "{before:?}");
    assert!((12.3e3 - 90.0..=12.8e3 + 90.0).contains(&boost), "{boost} Pa");
}

/// Fig. 10 through the controller, which samples a lagged voltage: the compensation leaves a short pulse
/// of the wastegate at each edge, and a small error by friction.
#[test]
fn figure_10() {
    let mut control = open_loop(44.0, 11.9, true);
    control.run(2.0, |_| {});
    let rest = control.position();
    for (voltage, end) in [(11.1, 6.0), (11.9, 10.0)] {
        control.surroundings.supply_voltage = voltage;
        let (begin, before) = (control.time(), control.position());
        let (mut pulse, mut later): (f64, Vec<f64>) = (0.0, vec![]);
        control.run(end, |control| {
            pulse = pulse.max((control.position() - before).abs());
            if control.time() > begin + 0.1 {
                later.push(control.position());
            }
        });
        let end = control.position();
        println!("to {voltage} V: a pulse of {pulse} points, {} at rest", end - rest);
        // Half of the last known digit, and 0.01 % of full scale.
        assert!(pulse <= 5.3 + 0.06, "{pulse} points");
        assert!(later.iter().all(|position| (position - end).abs() <= 0.5 + 0.06), "{later:?}");
        assert!((end - rest).abs() <= 0.7 + 0.06, "{end} points");
    }
}

/// Fig. 10: 12/U times the duty is the valve's exact inverse.
#[test]
fn a_compensated_duty_leaves_the_wastegate_alone() {
    let mut control = open_loop(44.0 * 12.0 / 11.9, 11.9, false);
    let rest = control.position();
    for (voltage, end) in [(11.9, 2.0), (11.1, 6.0), (11.9, 10.0)] {
        control.surroundings.supply_voltage = voltage;
        control.demand.pwm_reference = 44.0 * 12.0 / voltage;
        control.run(end, |control| {
            let moved = (control.position() - rest).abs();
            assert!(moved < 0.0005, "{moved} points at {} s", control.time());
        });
    }
}

/// Fig. 7: actuator hysteresis, with a slow duty ramp up and down.
#[test]
fn figure_7() {
    let mut control = open_loop(0.0, 12.0, false);
    let mut branches: [Vec<[f64; 3]>; 2] = [vec![], vec![]];
    for (branch, end) in branches.iter_mut().zip([100.0, 200.0]) {
        while control.time() < end - 0.5 * STEP {
            let time = control.time();
            control.demand.pwm_reference = if time < 100.0 { time } else { 200.0 - time };
            control.step();
            let outputs = control.plant.variables.outputs;
            let duty = control.controller.variables.outputs.hp_wastegate_pwm;
            branch.push([duty, control.position(), outputs.actuator_pressure]);
        }
    }
    let [up, down] = branches;
    // At equal duty, on the reference's grid of 0.25 %.
    let gap = |column: usize, most: f64| {
        up[1..]
            .iter()
            .zip(down.iter().rev())
            .skip(19)
            .step_by(20)
            .map(|(up, down)| {
                assert!((up[0] - down[0]).abs() <= 1e-9, "{up:?} {down:?}");
                if (4.9..most).contains(&up[0]) { (up[column] - down[column]).abs() } else { 0.0 }
            })
            .fold(0.0, f64::max)
    };
    let [points, low, all] = [gap(1, 95.1), gap(2, 84.9), gap(2, 95.1)];
    println!("position {points} points, pressure {low} Pa below 85 %, {all} Pa in all");
    // Half of the last digit, and 0.01 % of full scale twice.
    assert!(points <= 1.3 + 0.05 + 0.02, "{points} points");
    assert!(low <= 100.0 + 20.0, "{low} Pa");
    // Where tank pressure is the lower limit, the relay's band shows.
    assert!(all <= 1900.0 + 50.0 + 20.0, "{all} Pa");
}

/// Fig. 8: the relay runs the pump, whose current costs 0.4 V while it is on.
#[test]
fn figure_8() {
    let demand =
        controller::Inputs { pwm_reference: 50.0, engine_speed: 2000.0, ..controller::Inputs::default() };
    let mut control = Loop::settled(demand, Order::ControllerFirst, |controller, plant| {
        controller.mode = controller::ControlMode::OpenLoop;
        controller.compensate_voltage = false;
        plant.pump.voltage_drop = 0.4;
    });
    control.plant.variables.start.tank.pressure = 30e3;
    let mut control = control.run_in();
    let mut last = (control.position(), control.plant.variables.outputs.actuator_pressure);
    let mut edges = vec![];
    control.run(90.0, |control| {
        let on = control.controller.variables.outputs.vacuum_pump > 0.5;
        if on == edges.len().is_multiple_of(2) {
            edges.push((control.time() - STEP, last));
        }
        last = (control.position(), control.plant.variables.outputs.actuator_pressure);
    });
    println!("{edges:?}, {last:?} in the end");
    let [(begins, before), (ends, during)] = edges[..] else { panic!("the pump runs once: {edges:?}") };
    // Half of the last digit, and one sample: 0.01 % of full scale is 3.5 Pa of the tank, that is 0.05 s of
    // leaking at 5 kPa in 72 s.
    assert!((begins - 71.88).abs() <= 0.07, "{begins} s");
    assert!((ends - 81.54).abs() <= 0.07, "{ends} s");
    // The reference's 4.3 points, minus the initial effect of friction, which starts at its limit.
    assert!((-4.35..=-4.05).contains(&(during.0 - before.0)), "{} points", during.0 - before.0);
    assert!((last.0 - during.0 - 4.3).abs() <= 0.07, "{} points", last.0 - during.0);
    assert!((during.1 - before.1 - 1460.0).abs() <= 25.0, "{} Pa", during.1 - before.1);
}

/// A loop with the strategy by speed.
fn by_speed(demand: controller::Inputs) -> Loop {
    Loop::new(demand, Order::ControllerFirst, |controller, _| {
        controller.strategy = controller::Strategy::BySpeed;
    })
}

/// With the high-pressure stage bypassed, the low-pressure wastegate controls boost.
#[test]
fn the_low_pressure_stage_follows_alone() {
    for engine_speed in [3500.0, 5000.0] {
        let demand =
            controller::Inputs { boost_reference: 130e3, engine_speed, ..controller::Inputs::default() };
        let mut control = by_speed(demand);
        let answers = follow(&mut control, &[(0.0, 130.0), (20.0, 145.0), (40.0, 120.0)], 60.0, |_| {});
        for answer in &answers[1..] {
            println!("{engine_speed} rpm: {answer:?}");
            assert!(answer.end_error <= 10.0 + MARGIN, "{engine_speed} rpm: {answer:?}");
            assert!(answer.overshoot <= MARGIN, "{engine_speed} rpm: {answer:?}");
        }
    }
}

/// An engine speed ramp through the handover by speed at 150 kPa: boost dips by some 30 kPa upwards, varies by -7 to +6
/// kPa downwards, and recovers in both cases.
#[test]
fn the_stages_hand_over() {
    for rate in [100.0, 400.0] {
        let demand = controller::Inputs {
            boost_reference: 150e3,
            engine_speed: 3000.0,
            ..controller::Inputs::default()
        };
        let mut control = by_speed(demand);
        let mut ramp = |to: f64, hand_over: Option<f64>| -> (f64, f64) {
            let (mut least, mut most): (f64, f64) = (0.0, 0.0);
            let (mut errors, mut hand_overs) = (vec![], vec![]);
            let mut bypass = control.controller.variables.outputs.hp_bypass;
            for _ in 0..3200 {
                let speed = &mut control.surroundings.engine_speed;
                let left = to - *speed;
                *speed += left.clamp(-rate * STEP, rate * STEP);
                control.step();
                let now = control.controller.variables.outputs.hp_bypass;
                if now.to_bits() != std::mem::replace(&mut bypass, now).to_bits() {
                    hand_overs.push(control.surroundings.engine_speed);
                }
                let error = control.boost_pressure() - 150e3;
                least = least.min(error);
                most = most.max(error);
                errors.push(error);
            }
            // One in two samples of the ramp.
            let expected = |speed: f64| hand_over.is_some_and(|there| (speed - there).abs() <= rate / 40.0);
            assert_eq!(hand_overs.len(), usize::from(hand_over.is_some()), "{hand_overs:?}");
            assert!(hand_overs.iter().all(|&speed| expected(speed)), "{hand_overs:?}");
            if least < -20e3 {
                let long = errors.iter().filter(|&&error| error < 0.5 * least).count();
                assert!(long as f64 * STEP <= 2.0, "half of the dip lasts for {long} samples");
            }
            let error = control.boost_pressure() - 150e3;
            assert!(error.abs() < 50.0 + MARGIN, "{error} Pa are left at {to} rpm");
            (least, most)
        };
        let settled = ramp(3000.0, None);
        let up = ramp(4000.0, Some(3500.0));
        let down = ramp(3000.0, Some(3400.0));
        println!("{rate} rpm/s: settling {settled:?}, up {up:?}, down {down:?}");
        assert!((-35e3..-20e3).contains(&up.0), "{rate} rpm/s up: {up:?}");
        assert!(down.0 > -8e3 && down.1 < 7e3, "{rate} rpm/s down: {down:?}");
    }
}
