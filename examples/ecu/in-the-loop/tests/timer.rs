//! The firmware when its timer releases the samples: it takes the measurements that arrive, limps home without, and is reset
//! when it hangs.

use std::env;
use std::fmt::Arguments;
use std::fs;
use std::path::Path;
use std::process::{self, Command};

use BoostControllerInTheLoop::ecu::{Ecu, IMAGE};
use BoostControllerInTheLoop::variables::{Inputs, Outputs, Variables};
use fmu_export::calibration;
use fmu_export::frames::Kind;
use fmu_export::persistence::Archive;
use fmu_export::{Context, Error, Experiment, Persistent as _};

/// An ECU with the variables that it has sent last.
struct Running {
    ecu: Ecu,
    variables: Variables,
}

impl Running {
    fn start(arguments: &[&str]) -> Self {
        let mut variables = Variables::default();
        variables.inputs = Inputs {
            boost_reference: 150e3,
            boost_pressure: 140e3,
            tank_pressure: 30e3,
            supply_voltage_measured: 13.0,
            engine_speed: 2500.0,
            ..variables.inputs
        };
        Self { ecu: Ecu::start_with(IMAGE, 0, arguments).unwrap(), variables }
    }

    /// Sends the measurements.
    fn measure(&mut self) {
        let cells: Vec<_> = calibration::inputs(&self.variables).collect();
        self.ecu.send(Kind::Measurements, &cells).unwrap();
    }

    /// Waits for the results of a sample.
    fn answer(&mut self) -> Result<(), Error> {
        let mut log = |_: &'static str, _: Arguments<'_>| {};
        let results = self.ecu.answer(&mut Context::new(Experiment::default(), &mut log))?;
        let mut archive = Archive::reading(&results);
        self.variables.outputs.persist(&mut archive)?;
        self.variables.locals.persist(&mut archive)
    }

    /// Waits for results of which something is true, with measurements before each if `is_measured`.
    fn until(&mut self, is_measured: bool, is_true: impl Fn(&Variables) -> bool) {
        // Some seconds, in which whatever is tested here has long happened.
        for _ in 0..1000 {
            if is_measured {
                self.measure();
            }
            self.answer().unwrap();
            if is_true(&self.variables) {
                return;
            }
        }
        panic!("it is never true: {:?}", self.variables.outputs);
    }
}

/// The commands without measurements: as in `limp_home` of the controller.
fn limps_home(Variables { parameters, outputs, .. }: &Variables) -> bool {
    *outputs
        == Outputs {
            hp_wastegate_pwm: parameters.pwm_max,
            vacuum_pump: 1.0,
            lp_wastegate: 1.0,
            hp_bypass: 0.0,
            surge_valve: 1.0,
            ..Outputs::default()
        }
}

#[test]
fn without_measurements_it_limps_home_until_they_are_back() {
    let mut running = Running::start(&[]);
    running.until(true, |variables| variables.locals.sample_count > 20);
    assert!(!limps_home(&running.variables));
    running.until(false, limps_home);
    running.until(true, |variables| variables.locals.sample_count == 5 && !limps_home(variables));
    // What is not finite is no measurement.
    running.variables.inputs.boost_pressure = f64::NAN;
    running.until(true, limps_home);
    // Nor do they end the way home, or its commands: what is refused is told, and what is commanded stays.
    for _ in 0..100 {
        running.measure();
        if running.answer().is_ok() {
            assert!(limps_home(&running.variables), "{:?}", running.variables.outputs);
        }
    }
}

/// A firmware that hangs is reset, and limps home until there are measurements.
#[test]
fn a_firmware_that_hangs_is_reset() {
    let socket = env::temp_dir().join(format!("ecu-gdb-{}", process::id()));
    let server = format!("unix:{},server=on,wait=off", socket.display());
    let mut running = Running::start(&["-gdb", &server]);
    running.until(true, |variables| variables.locals.sample_count > 20);
    let image = env::temp_dir().join(format!("ecu-symbols-{}.elf", process::id()));
    fs::write(&image, IMAGE).unwrap();
    hang(&image, &socket);
    running.until(false, limps_home);
    running.until(true, |variables| variables.locals.sample_count == 1);
    fs::remove_file(image).unwrap();
}

/// Lets the processor run where nothing goes on.
fn hang(image: &Path, socket: &Path) {
    let done = Command::new("gdb-multiarch")
        .args(["-batch", "-nx", "-ex"])
        .arg(format!("target remote {}", socket.display()))
        .args(["-ex", "set $pc = stop", "-ex", "detach"])
        .arg(image)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success() && !text.contains("No symbol") && !text.contains("rror"), "{text}");
}
