// Careless FMUs, written in C.

use std::fs::{self, File};
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use fmu_package::{Fmu, FmuDescription, Platform};

/// The FMU's modelDescription.xml.
pub const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Careless" guid="careless">
  <CoSimulation modelIdentifier="careless" canGetAndSetFMUstate="true"/>
  <UnitDefinitions><Unit name="Pa"><BaseUnit kg="1" m="-1" s="-2"/><DisplayUnit name="kPa" factor="0.001"/></Unit></UnitDefinitions>
  <TypeDefinitions><SimpleType name="Fail"><Enumeration>
    <Item name="no" value="0"/><Item name="discard" value="1"/><Item name="error" value="2"/>
    <Item name="no_status" value="3"/><Item name="fatal" value="4"/>
  </Enumeration></SimpleType></TypeDefinitions>
  <ModelVariables>
    <ScalarVariable name="level" valueReference="0" causality="output"><Real unit="Pa"/></ScalarVariable>
    <ScalarVariable name="input" valueReference="1" causality="input"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="fail" valueReference="2" causality="parameter" variability="tunable">
      <Enumeration declaredType="Fail" start="0"/>
    </ScalarVariable>
    <ScalarVariable name="states" valueReference="3"><Integer/></ScalarVariable>
    <ScalarVariable name="flag" valueReference="4" causality="parameter"><Boolean start="false"/></ScalarVariable>
    <ScalarVariable name="note" valueReference="5" causality="parameter"><String start="none"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="1"/></Outputs></ModelStructure>
</fmiModelDescription>
"#;

/// What `misbehaving.c` does, in the order of its enumerations.
const MISDEEDS: &str = "none exit_in_load exit_in_instantiate exit_in_step exit_in_thread exit_in_terminate exit_in_free \
                        quick_exit_in_step fail_in_step log_one log_null log_own log_in_instantiate log_in_thread \
                        log_in_free log_after_free log_nothing log_latin log_unknown_status log_other huge_derivative \
                        opposite_derivative no_derivative nan_derivative nan_output half_step end abort \
                        dereference_null hang round_up trap handle leave_folder print close_output meet told event_in_step \
                        event_for_ever abort_in_initialization abort_in_unload fork leave_child leave_session \
                        write_anywhere close_any mask_modes set_locale set_environment limit block_signals leak alarm \
                        fail_in_terminate abort_at_exit";
const SYSTEMS: &str = "lags stiff scaled robertson van_der_pol kink rounded noisy diode";

/// The number of a misdeed.
pub fn number_of(misdeed: &str) -> usize {
    MISDEEDS.split_whitespace().position(|known| known == misdeed).expect("a misdeed")
}

/// The modelDescription.xml of the FMU of `misbehaving.c`, of a version of FMI, with a number of states and the misdeed that
/// it begins with.
pub fn misbehaving(version: u8, states: usize, misdeed: &str) -> String {
    let variable = |name: &str, reference: usize, own: &str, kind: &str, more: &str| match kind {
        _ if version == 3 => format!("<{kind} name=\"{name}\" valueReference=\"{reference}\" {own} {more}/>"),
        kind => {
            let kind = if kind == "Float64" { "Real" } else { kind };
            format!(
                "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" {own}><{kind} {more}/></ScalarVariable>"
            )
        }
    };
    let parameter = "causality=\"parameter\" variability=\"tunable\"";
    let (mut variables, mut structure) = (String::new(), String::new());
    for state in 0..states {
        variables += &variable(&format!("x{}", state + 1), state, "causality=\"output\"", "Float64", "");
    }
    for state in 0..states {
        // In FMI 3.0 by the reference, in FMI 2.0 by the position from 1.
        let of = format!("derivative=\"{}\"", if version == 3 { state } else { state + 1 });
        variables += &variable(&format!("der(x{})", state + 1), 100 + state, "", "Float64", &of);
        structure += &if version == 3 {
            format!("<ContinuousStateDerivative valueReference=\"{}\"/>", 100 + state)
        } else {
            format!("<Unknown index=\"{}\"/>", states + state + 1)
        };
    }
    for (position, name) in ["status", "column", "from", "event"].into_iter().enumerate() {
        variables += &variable(name, 200 + position, parameter, "Float64", "start=\"0\"");
    }
    let mut types = String::new();
    for (position, (name, items)) in [("Misdeed", MISDEEDS), ("System", SYSTEMS)].into_iter().enumerate() {
        let numbered = items.split_whitespace().enumerate();
        let items = numbered.map(|(number, item)| format!("<Item name=\"{item}\" value=\"{number}\"/>"));
        let items = items.collect::<Vec<_>>().concat();
        types += &if version == 3 {
            format!("<EnumerationType name=\"{name}\">{items}</EnumerationType>")
        } else {
            format!("<SimpleType name=\"{name}\"><Enumeration>{items}</Enumeration></SimpleType>")
        };
        let declared = format!("declaredType=\"{name}\" start=\"0\"");
        variables += &variable(&name.to_lowercase(), 204 + position, parameter, "Enumeration", &declared);
    }
    variables += &variable("y", 206, "causality=\"output\"", "Float64", "");
    variables += &variable("third", 207, "", "Float64", "");
    variables += &variable("instances", 208, "", "Float64", "");
    let misdeed = number_of(misdeed);
    let (guid, capability, events) = if version == 3 {
        ("instantiationToken", "providesDirectionalDerivatives", " hasEventMode=\"true\"")
    } else {
        structure = format!("<Derivatives>{structure}</Derivatives>");
        ("guid", "providesDirectionalDerivative", "")
    };
    format!(
        "<fmiModelDescription fmiVersion=\"{version}.0\" {guid}=\"{misdeed}\" modelName=\"Misbehaving\">\
         <CoSimulation modelIdentifier=\"careless\"{events}/><ModelExchange modelIdentifier=\"careless\" {capability}=\"true\"/>\
         <TypeDefinitions>{types}</TypeDefinitions><DefaultExperiment stopTime=\"1\" stepSize=\"0.25\"/>\
         <ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )
}

/// The FMU's library, compiled once.
pub fn library() -> &'static [u8] {
    static LIBRARY: OnceLock<Vec<u8>> = OnceLock::new();
    LIBRARY.get_or_init(|| compiled("careless.c"))
}

/// The library of `misbehaving.c`, compiled once.
pub fn misbehaving_library() -> &'static [u8] {
    static LIBRARY: OnceLock<Vec<u8>> = OnceLock::new();
    LIBRARY.get_or_init(|| compiled("misbehaving.c"))
}

/// A library, compiled from a source next to this file.
pub fn compiled(source: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let library = folder.path().join("careless");
    let source = format!("{}/../../crates/fmu-master/tests/careless/{source}", env!("CARGO_MANIFEST_DIR"));
    let arguments = ["-shared", "-fPIC", "-Wall", "-Wextra", "-Werror", "-o"];
    let compiler = Command::new("cc").args(arguments).arg(&library).arg(source).arg("-lm").status();
    assert!(compiler.expect("a C compiler is there").success());
    fs::read(library).expect("the compiler wrote it")
}

/// Writes an FMU with a description and a library.
pub fn write(path: &Path, description: &str, library: &[u8]) {
    let platform = Platform::host().expect("FMI 2.0 knows this platform");
    let fmu = Fmu {
        model_identifier: "careless",
        model_description: description,
        // Some descriptions cannot be read.
        version: FmuDescription::parse(description).map(|content| content.version()).unwrap_or_default(),
        libraries: vec![(platform, library.to_vec())],
        files: vec![],
    };
    fmu.write(File::create(path).expect("a file")).expect("an FMU");
}
