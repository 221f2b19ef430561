//! Drives both exported FMUs from Rust: boost pressure over the steps of the paper's Fig. 13.
//!
//! `cargo run --package fmi-master -- target/fmu` takes the FMUs from that folder and writes all their
//! outputs at each communication point as CSV, in numbers that read back as the same doubles.

#[path = "../../boost_steps/mod.rs"]
mod boost_steps;
mod slave;

use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use boost_steps::BOOST_STEPS;
use slave::{Slave, Wires};

/// The size of a step in s: the controller samples at 80 Hz.
const STEP: f64 = 1.0 / 80.0;

/// The number of steps, until 124 s.
const STEPS: u32 = 124 * 80;

fn boost_reference(time: f64) -> f64 {
    // Communication points are computed as multiples of the step, and may be early by rounding.
    let begun = BOOST_STEPS.partition_point(|&(begin, _)| begin <= time + 1e-9);
    BOOST_STEPS[begun.saturating_sub(1)].1
}

fn run(folder: &Path, csv: &mut impl Write) -> Result<()> {
    let mut controller = Slave::instantiate(&folder.join("BoostController.fmu"))?;
    let mut plant = Slave::instantiate(&folder.join("BoostPlant.fmu"))?;
    let reference = [controller.input("boost_reference")?];
    let measurements = Wires::between(&plant, &controller);
    let commands = Wires::between(&controller, &plant);

    plant.enter_initialization(0.0)?;
    controller.enter_initialization(0.0)?;
    controller.set(&reference, &[boost_reference(0.0)])?;
    // Twice, because a plant that settles at the controller's outputs returns a measured supply, which changes
    // these.
    for _ in 0..2 {
        measurements.transfer(&mut plant, &mut controller)?;
        commands.transfer(&mut controller, &mut plant)?;
    }
    controller.exit_initialization()?;
    plant.exit_initialization()?;

    writeln!(csv, "time,{},{}", controller.outputs().join(","), plant.outputs().join(","))?;
    write_row(csv, 0.0, [&mut controller, &mut plant])?;
    for index in 0..STEPS {
        let time = f64::from(index) * STEP;
        controller.set(&reference, &[boost_reference(time)])?;
        // The controller first, so that its outputs act in the plant without delay.
        measurements.transfer(&mut plant, &mut controller)?;
        controller.step(time, STEP)?;
        commands.transfer(&mut controller, &mut plant)?;
        plant.step(time, STEP)?;
        write_row(csv, f64::from(index + 1) * STEP, [&mut controller, &mut plant])?;
    }
    csv.flush()?;
    Ok(())
}

fn write_row(csv: &mut impl Write, time: f64, slaves: [&mut Slave; 2]) -> Result<()> {
    write!(csv, "{time:?}")?;
    for slave in slaves {
        for value in slave.output_values()? {
            write!(csv, ",{value:?}")?;
        }
    }
    writeln!(csv)?;
    Ok(())
}

/// Prints the FMUs' messages.
struct Messages;

impl log::Log for Messages {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &log::Record<'_>) {
        eprintln!("{}: {}", record.target(), record.args());
    }

    fn flush(&self) {}
}

fn main() -> ExitCode {
    let run = || {
        log::set_logger(&Messages).context("another logger is set")?;
        let arguments: Vec<_> = std::env::args_os().skip(1).collect();
        let [folder] = arguments.as_slice() else {
            bail!("usage: fmi-master FOLDER, where both FMUs are");
        };
        run(Path::new(folder), &mut BufWriter::new(io::stdout().lock()))
    };
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
