//! What the firmware costs: instructions of a sample, stack, flash and memory, and the panics that a sample may reach.
//!
//! Fails if a sample may reach a panic without a reason.

use std::error::Error;
use std::process::ExitCode;

use BoostControllerInTheLoop::ecu::{Ecu, IMAGE};
use BoostControllerInTheLoop::image::Image;
use BoostControllerInTheLoop::variables::{Real, Variables};
use fmu_export::calibration;
use fmu_export::frames::{self, Kind};
use fmu_export::{Context, Experiment};

/// An instruction takes 2^6 ns of the simulated time, and a tick of the board's clock 40 ns.
const SHIFT: u32 = 6;
const TICKS_OF_INSTRUCTION: f64 = 64.0 / 40.0;

/// The samples of a drive: 50 s.
const SAMPLES: u32 = 4000;

/// The processor to which the instructions are compared, and its clock in Hz.
const PROCESSOR: &str = "Cortex-M7 at 200 MHz, at one instruction per cycle";
const CLOCK: f64 = 200e6;

/// The functions with panics that a sample may reach, by the beginnings of their names, and why they do not panic.
const REASONS: [(&str, &str); 5] = [
    ("core::num::flt2dec", "core's own checks when a message shows a number"),
    ("core::num::bignum", "core's own checks when a message shows a number"),
    ("core::num::dec2flt", "core's own checks when a message rounds a number"),
    ("f64 as core::str::traits::FromStr", "core's own checks when a message rounds a number"),
    ("core::fmt", "core's own checks when a message is put together"),
];

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let image = Image::read(IMAGE)?;
    println!("| budget | value |\n|---|---|");
    for (day, ambient) in [("reference day", [0.0; 2]), ("day of 85 kPa, 40 °C", [85e3, 313.15])] {
        let Drive { instructions, most, stack } = drive(ambient)?;
        println!("| instructions of a sample, {day} | {instructions:.0} on average, {most:.0} at most |");
        let share = 100.0 * most * 80.0 / CLOCK;
        println!("| share of 12.5 ms, {PROCESSOR} | {share:.2} % at most |");
        println!("| stack of a sample and its answer, {day} | {stack} bytes |");
    }
    for (place, sections) in ["flash", "memory"].into_iter().zip(image.sections()) {
        let all: u64 = sections.iter().map(|(_, size)| size).sum();
        let each: Vec<_> = sections.iter().map(|(name, size)| format!("{name} {size}")).collect();
        println!("| {place} | {all} bytes: {} |", each.join(", "));
    }
    let reached = image.reached_from("controller::execute_sample");
    if reached.is_empty() {
        return Err("the image has no function execute_sample".into());
    }
    let is_panic = |name: &str| name.contains("panicking") || name.contains("_fail");
    let panics =
        reached.iter().filter(|(name, called)| !is_panic(name) && called.iter().any(|name| is_panic(name)));
    let (mut with_reason, mut without) = (vec![], vec![]);
    for (name, _) in panics {
        let reason = REASONS.iter().find(|(start, _)| name.trim_start_matches('<').starts_with(start));
        match reason {
            Some((_, reason)) => with_reason.push(format!("`{name}`: {reason}")),
            None => without.push(*name),
        }
    }
    println!("| functions that a sample may reach | {} |", reached.len());
    println!("| of these with panics | {} |", with_reason.len() + without.len());
    for panic in &with_reason {
        println!("\n- {panic}");
    }
    for name in &without {
        println!("\n- `{name}`: no reason is known");
    }
    Ok(if without.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// What a drive has cost.
struct Drive {
    instructions: f64,
    most: f64,
    stack: u64,
}

/// Drives the firmware with measurements that jump and drift at random, at an ambient pressure (Pa) and temperature (K);
/// 0 is no measurement, with which the controller works as on the reference day.
fn drive([pressure, temperature]: [Real; 2]) -> Result<Drive, Box<dyn Error>> {
    let mut ecu = Ecu::start_with(IMAGE, SHIFT, &[])?;
    let mut log = |_: &'static str, _: std::fmt::Arguments<'_>| {};
    let mut context = Context::new(Experiment::default(), &mut log);
    // Knuth's MMIX generator (The Art of Computer Programming, volume 2, section 3.3.4).
    let mut random = 1_u64;
    let mut below = |most: Real| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 11) as Real / (1_u64 << 53) as Real * most
    };
    let mut variables = Variables::default();
    (variables.inputs.ambient_pressure, variables.inputs.ambient_temperature) = (pressure, temperature);
    ecu.initialize(&mut calibration::inputs(&variables))?;
    ecu.answer(&mut context)?;
    statistics(&mut ecu)?;
    for number in 0..SAMPLES {
        let inputs = &mut variables.inputs;
        if number % 80 == 0 {
            inputs.engine_speed = 1000.0 + below(4500.0);
            inputs.boost_reference = 110e3 + below(90e3);
            inputs.hp_turbo_speed = below(220e3);
        }
        inputs.engine_speed += below(20.0) - 10.0;
        inputs.boost_pressure +=
            0.01 * (inputs.boost_reference - inputs.boost_pressure) + below(200.0) - 100.0;
        inputs.tank_pressure = 25e3 + below(15e3);
        inputs.supply_voltage_measured = 12.0 + below(2.0);
        ecu.sample(&mut calibration::inputs(&variables))?;
        ecu.answer(&mut context)?;
    }
    let [samples, ticks, most, stack] = statistics(&mut ecu)?;
    let instructions = |ticks: f64| ticks / TICKS_OF_INSTRUCTION;
    Ok(Drive {
        instructions: instructions(ticks as f64 / samples as f64),
        most: instructions(most as f64),
        stack,
    })
}

/// Samples, ticks of all and of the longest, and bytes of stack, since it was asked last.
fn statistics(ecu: &mut Ecu) -> Result<[u64; 4], Box<dyn Error>> {
    ecu.send(Kind::Statistics, &[])?;
    loop {
        if let (Kind::Statistics, content) = ecu.receive()? {
            let cells: Vec<_> = frames::cells(&content).collect();
            return Ok(<[u64; 4]>::try_from(cells).map_err(|_| "the firmware's statistics have other cells")?);
        }
    }
}
