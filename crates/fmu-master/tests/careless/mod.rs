// Careless FMUs, written in C.

use std::fs::{self, File};
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use fmu_package::{Fmu, Platform};

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

/// The FMU's library, compiled once.
pub fn library() -> &'static [u8] {
    static LIBRARY: OnceLock<Vec<u8>> = OnceLock::new();
    LIBRARY.get_or_init(|| compiled("careless.c"))
}

/// A library, compiled from a source next to this file.
pub fn compiled(source: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let library = folder.path().join("careless");
    let source = format!("{}/../fmu-master/tests/careless/{source}", env!("CARGO_MANIFEST_DIR"));
    let arguments = ["-shared", "-fPIC", "-Wall", "-Wextra", "-Werror", "-o"];
    let compiler = Command::new("cc").args(arguments).arg(&library).arg(source).status();
    assert!(compiler.expect("a C compiler is there").success());
    fs::read(library).expect("the compiler wrote it")
}

/// Writes an FMU with a description and a library.
pub fn write(path: &Path, description: &str, library: &[u8]) {
    let platform = Platform::host().expect("FMI 2.0 knows this platform");
    let fmu = Fmu {
        model_identifier: "careless",
        model_description: description,
        libraries: vec![(platform, library.to_vec())],
        files: vec![],
    };
    fmu.write(File::create(path).expect("a file")).expect("an FMU");
}
