//! A library for FMI 2 whose functions do nothing, compiled for Linux on this machine.

use std::path::Path;
use std::process::Command;
use std::{env, fs};

/// The path in the FMU.
pub const PATH: &str =
    if cfg!(target_arch = "aarch64") { "binaries/aarch64-linux/tank.so" } else { "binaries/linux64/tank.so" };

/// All functions of both interfaces, as `fmi2Functions.h` of the standard lists them.
const FUNCTIONS: &str = "GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment
    EnterInitializationMode ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean GetString SetReal
    SetInteger SetBoolean SetString GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize SerializeFMUstate
    DeSerializeFMUstate GetDirectionalDerivative EnterEventMode NewDiscreteStates EnterContinuousTimeMode
    CompletedIntegratorStep SetTime SetContinuousStates GetDerivatives GetEventIndicators GetContinuousStates
    GetNominalsOfContinuousStates SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus
    GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus";

/// Compiles the library, with an import and a dependency that the tests rename.
pub fn build() -> Vec<u8> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    // Tests run in parallel.
    let file = folder.join(format!("tank-{:?}.so", std::thread::current().id()));
    let source = file.with_extension("c");
    let define = |code, name| {
        format!(
            "{code}int fmi2{name}(void) {{ return 0; }}
"
        )
    };
    let functions = FUNCTIONS.split_whitespace().fold(String::new(), define);
    let code = format!(
        "const char guid[] = \"{{a-guid}}\";\nextern int Qy_Import(void);\nint (*use)(void) = Qy_Import;\n{functions}"
    );
    fs::write(&source, code).unwrap();
    let compiler = env::var_os("CC").unwrap_or_else(|| "cc".into());
    let done = Command::new(compiler)
        .args(["-shared", "-fPIC", "-Wl,--no-as-needed", "-lm", "-Wl,-z,noexecstack", "-o"])
        .args([&file, &source])
        .status();
    assert!(done.unwrap().success());
    fs::read(&file).unwrap()
}
