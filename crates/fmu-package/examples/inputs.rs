//! Lists the inputs of an FMU of any maker, with their units: `cargo run --example inputs -- FILE.fmu`

use std::env;
use std::io;
use std::path::Path;

use fmu_package::{Causality, FmuDescription};

fn main() -> io::Result<()> {
    let file = env::args_os().nth(1).ok_or_else(|| io::Error::other("which FMU?"))?;
    for input in FmuDescription::read(Path::new(&file))?.of_causality(Causality::Input) {
        println!("{} in {}: {}", input.name, input.unit, input.description);
    }
    Ok(())
}
