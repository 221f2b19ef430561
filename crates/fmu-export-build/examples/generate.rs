//! Generates what a build script would, to look at it: `cargo run --example generate -- model.json FOLDER`

use std::env;
use std::error::Error;
use std::path::PathBuf;

use fmu_export_build::{Interfaces, Package, generate_into};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args_os().skip(1).map(PathBuf::from);
    let (json, folder) =
        arguments.next().zip(arguments.next()).ok_or("which model.json, and into which folder?")?;
    let package = Package { name: "tank".to_owned(), version: "0.1.0".to_owned(), ..Package::default() };
    let generated = generate_into(&json, &folder, &package, Interfaces::default())?;
    println!("{}", generated.model_description.display());
    println!("{}", generated.variables.display());
    println!("{}", generated.documentation.display());
    Ok(())
}
