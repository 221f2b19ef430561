//! The model as firmware: `cargo run --release` runs it on a Cortex-M7 of QEMU.
#![no_std]
#![no_main]

use core::fmt::Arguments;

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use fmu_export::{Error, Task};
use model::{Type};

/// Executes samples, each with a measurement of its own.
fn run(task: &mut Task<{Type}>) -> Result<(), Error> {
    let mut log = |_: &'static str, message: Arguments<'_>| hprintln!("{}", message);
    task.initialize(&mut log)?;
    for _ in 0..10 {
        // In a product, a timer releases the sample, a sensor measures, and the command goes to an actuator.
        task.variables.inputs.measurement = 0.5 * task.variables.outputs.command;
        task.sample(&mut log)?;
        hprintln!("{}", task.variables.outputs.command);
    }
    Ok(())
}

#[entry]
fn main() -> ! {
    let mut status = debug::EXIT_SUCCESS;
    if let Err(error) = run(&mut Task::default()) {
        hprintln!("{}", error);
        status = debug::EXIT_FAILURE;
    }
    loop {
        debug::exit(status);
    }
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    hprintln!("{}", info);
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}
