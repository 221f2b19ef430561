//! Generates the interface of the controller in the loop: that of `BoostController`, without what an ECU cannot do.

use std::env;
use std::error::Error;
use std::fs;
use std::path::{Path, absolute};

use serde_json::{Value, json};

/// The controller's declaration.
const CONTROLLER: &str = "../../../modelDescription/controller.json";
/// The folder of the firmware, unless the environment variable `ECU_FIRMWARE` names another one.
const FIRMWARE: &str = "../firmware/target/thumbv7em-none-eabihf/release";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={CONTROLLER}");
    println!("cargo::rerun-if-env-changed=ECU_FIRMWARE");
    let firmware = absolute(env::var_os("ECU_FIRMWARE").unwrap_or_else(|| FIRMWARE.into()))?;
    let image = firmware.join("ecu");
    println!("cargo::rerun-if-changed={}", image.display());
    println!("cargo::rustc-env=ECU_IMAGE={}", image.display());
    println!("cargo::rustc-env=FUNCTIONS_IMAGE={}", firmware.join("functions").display());
    if !image.exists() {
        println!(
            "cargo::error=there is no firmware: compile it by `cargo build --release` in examples/ecu/firmware first"
        );
        return Ok(());
    }
    let mut declaration: Value = serde_json::from_str(&fs::read_to_string(CONTROLLER)?)?;
    let keys = declaration.as_object_mut().ok_or("the declaration is no object")?;
    keys.insert("model_identifier".to_owned(), json!("BoostControllerInTheLoop"));
    // An ECU cannot go back.
    keys.insert("capabilities".to_owned(), json!({"variable_communication_step_size": true}));
    keys.remove("documentation");
    for file in ["units", "icon"] {
        if let Some(Value::String(name)) = keys.get_mut(file) {
            *name = absolute(Path::new(CONTROLLER).with_file_name(&*name))?.display().to_string();
        }
    }
    let file = Path::new(&env::var("OUT_DIR")?).join("controller.json");
    fs::write(&file, declaration.to_string())?;
    fmu_export_build::generate(&file);
    Ok(())
}
