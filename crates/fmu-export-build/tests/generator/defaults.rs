//! A declaration that leaves out what can be known, with states that are outputs and declared value references: what
//! follows from it, and that the runtime reads and sets it by these references.

use std::ffi::CString;
use std::fs;
use std::ptr;

use fmu_export::fmi2::c_api;
use fmu_export::fmi2::c_types::{CO_SIMULATION, CallbackFunctions, Component, FALSE, Status};
use fmu_export::{
    Accessed as _, Context, Described as _, Dual, Error, Numbered as _, Step, Stepped, Stepper,
};
use fmu_export_build::{Generated, Interfaces, Package, generate_into};

use super::{folder, read, sources};

mod variables {
    include!("mass_oscillator/variables.rs");
}

use variables::{Inputs, Variables};

fn generate(out_dir: &std::path::Path) -> Generated {
    let package = Package {
        name: "mass-oscillator".to_owned(),
        version: "0.3.0".to_owned(),
        description: "A mass on a spring".to_owned(),
        authors: "A. Author <a@example.org>:B. Author".to_owned(),
        license: "MIT".to_owned(),
        ..Package::default()
    };
    generate_into(&sources().join("oscillator.json"), out_dir, &package, Interfaces::CoSimulation)
        .unwrap_or_else(|error| panic!("{error}"))
}

/// What is kept of a generated file: of the page its markup without styles and scripts, which are files of their own, and
/// their hashes.
fn kept(file: &std::path::Path) -> String {
    let mut text = read(file);
    if file.extension().is_some_and(|extension| extension == "html") {
        for element in ["style", "script"] {
            let (begin, end) = (format!("<{element}>"), format!("</{element}>"));
            let parts = text.split(&begin).enumerate().map(|(number, part)| match part.split_once(&end) {
                Some((_, after)) if number > 0 => format!("{begin}{end}{after}"),
                _ => part.to_owned(),
            });
            text = parts.collect();
        }
        let hash = "'sha256-";
        let parts = text.split(hash).enumerate().map(|(number, part)| match part.split_once('\'') {
            Some((_, after)) if number > 0 => format!("{hash}'{after}"),
            _ => part.to_owned(),
        });
        text = parts.collect();
    }
    text
}

#[test]
fn generated_files_equal_the_golden_files() {
    let golden = sources().join("mass_oscillator");
    let generated = generate(&folder("defaults"));
    for file in [&generated.model_description, &generated.variables, &generated.documentation] {
        let golden = golden.join(file.file_name().expect("a file has a name"));
        if std::env::var_os("FMU_EXPORT_BLESS").is_some() {
            fs::write(&golden, kept(file)).expect("the folder of the golden files is writable");
        }
        assert!(kept(file) == read(&golden), "{}", file.display());
    }
}

/// The lists of `ModelStructure` by hand: 1 time,
/// 2 force, 3 position, 4 its derivative, 5 velocity, 6 its derivative, 7 energy, 8 power, 9 loss, 10 stiffness,
/// 11 to 14 wear with its derivatives.
#[test]
fn dependencies_that_are_left_out_may_be_any() {
    let xml = read(&generate(&folder("defaults in XML")).model_description);
    let (_, structure) = xml.split_once("<ModelStructure>").expect("it is there");
    let structure: Vec<_> =
        structure.lines().map(str::trim).filter(|line| line.starts_with("<Unknown")).collect();
    let expected = [
        // Outputs: a state is its own; power may depend on everything, and so does what reads it.
        r#"<Unknown index="3" dependencies="3"/>"#,
        r#"<Unknown index="5" dependencies="5"/>"#,
        r#"<Unknown index="7" dependencies="3 5"/>"#,
        r#"<Unknown index="8"/>"#,
        r#"<Unknown index="9"/>"#,
        // Derivatives.
        r#"<Unknown index="4"/>"#,
        r#"<Unknown index="6" dependencies="2 3"/>"#,
        r#"<Unknown index="12"/>"#,
        r#"<Unknown index="14"/>"#,
        // InitialUnknowns: no state whose start is exact.
        r#"<Unknown index="4"/>"#,
        r#"<Unknown index="6" dependencies="2 3 10"/>"#,
        r#"<Unknown index="7" dependencies="3 5 10"/>"#,
        r#"<Unknown index="8"/>"#,
        r#"<Unknown index="9"/>"#,
        r#"<Unknown index="11"/>"#,
        r#"<Unknown index="12"/>"#,
        r#"<Unknown index="13"/>"#,
        r#"<Unknown index="14"/>"#,
    ];
    assert_eq!(structure, expected);
}

#[test]
fn value_references_are_the_declared_ones_and_the_free_ones_between() {
    let expected = [
        (0, "time"),
        (1, "velocity"),
        (2, "energy"),
        (3, "position"),
        (4, "der(position)"),
        (5, "power"),
        (6, "loss"),
        (7, "stiffness"),
        (10, "wear[1]"),
        (11, "wear[2]"),
        (20, "der(wear[1])"),
        (21, "der(wear[2])"),
        (50, "der(velocity)"),
        (100, "force"),
    ];
    let described =
        Variables::described().map(|(reference, variable)| (reference, variable.name().to_string()));
    assert!(described.eq(expected.map(|(reference, name)| (reference, name.to_owned()))));
    for (reference, name) in expected {
        assert_eq!(Variables::description(reference).expect("it is described").name(), name);
        let text = format!(r#"<ScalarVariable name="{name}" valueReference="{reference}""#);
        assert!(Variables::MODEL_DESCRIPTION_XML.contains(&text), "{text}");
    }
    for reference in [8, 12, 99, 101, u32::MAX] {
        assert!(Variables::description(reference).is_none(), "{reference}");
    }
}

/// The oscillator as an FMU, which moves by one explicit Euler step for each communication step.
#[derive(Clone, Default)]
struct Oscillator {}

fmu_export::persistent!(Oscillator {});

impl Oscillator {
    fn evaluate(variables: &mut Variables) {
        variables.derivatives.position = variables.states.velocity;
        variables.derivatives.velocity =
            variables.inputs.force - variables.parameters.stiffness * variables.states.position;
        variables.outputs.energy = variables.states.velocity.powi(2) / 2.0;
    }
}

impl Stepper for Oscillator {
    type Variables = Variables;

    fn initialize(&mut self, variables: &mut Variables, _context: &mut Context<'_>) -> Result<(), Error> {
        variables.states_from_start();
        Self::evaluate(variables);
        Ok(())
    }

    fn step(
        &mut self,
        variables: &mut Variables,
        step: &Step<'_, Inputs>,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        variables.states =
            variables.states.combine(&variables.derivatives, &mut |state, rate| state + step.size * rate);
        step.inputs.move_to(step.size, &mut variables.inputs);
        Self::evaluate(variables);
        Ok(())
    }

    fn differentiate(
        &self,
        _time: Dual,
        variables: &Variables,
        direction: &Variables,
    ) -> Result<Variables, Error> {
        let mut derivatives = Variables::zero();
        derivatives.derivatives.position = direction.start.velocity;
        derivatives.derivatives.velocity =
            direction.inputs().force - variables.parameters.stiffness * direction.start.position;
        Ok(derivatives)
    }
}

const OK: Status = Status::Ok;

/// An instance that is freed when it is dropped.
struct Fmu(Component);

impl Drop for Fmu {
    fn drop(&mut self) {
        // SAFETY: the component is this importer's and used no more.
        unsafe { c_api::fmi2FreeInstance::<Stepped<Oscillator>>(self.0) }
    }
}

#[test]
fn the_runtime_knows_a_state_that_is_an_output_by_its_value_reference() {
    let callbacks = CallbackFunctions {
        logger: None,
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: ptr::null_mut(),
    };
    let text = |text: &str| CString::new(text).expect("there is no NUL in it");
    let (name, guid) = (text("oscillator"), text(Variables::DESCRIPTION.guid));
    // SAFETY: all arguments are valid during the call.
    let fmu = Fmu(unsafe {
        let (name, guid, callbacks) = (name.as_ptr(), guid.as_ptr(), &raw const callbacks);
        c_api::fmi2Instantiate::<Stepped<Oscillator>>(
            name,
            CO_SIMULATION,
            guid,
            ptr::null(),
            callbacks,
            FALSE,
            FALSE,
        )
    });
    assert!(!fmu.0.is_null());
    let get = |reference: u32| {
        let mut value = f64::NAN;
        // SAFETY: one reference and room for one value.
        let status = unsafe {
            c_api::fmi2GetReal::<Stepped<Oscillator>>(fmu.0, &raw const reference, 1, &raw mut value)
        };
        (status, value)
    };
    let set = |reference: u32, value: f64| -> Status {
        // SAFETY: one reference and one value.
        unsafe { c_api::fmi2SetReal::<Stepped<Oscillator>>(fmu.0, &raw const reference, 1, &raw const value) }
    };
    // SAFETY: the component is valid.
    let call = |function: unsafe fn(Component) -> Status| unsafe { function(fmu.0) };
    // SAFETY: the component is valid.
    let status =
        unsafe { c_api::fmi2SetupExperiment::<Stepped<Oscillator>>(fmu.0, FALSE, 0.0, 0.0, FALSE, 0.0) };
    assert_eq!(status, OK);
    // The start value of the position, by its value reference; 8 is nobody's.
    assert_eq!((set(3, 2.0), set(100, 1.0)), (OK, OK));
    assert_ne!(set(8, 1.0), OK);
    assert_eq!(call(c_api::fmi2EnterInitializationMode::<Stepped<Oscillator>>), OK);
    assert_eq!(call(c_api::fmi2ExitInitializationMode::<Stepped<Oscillator>>), OK);
    assert_eq!([get(3), get(1), get(4), get(50)], [(OK, 2.0), (OK, 0.0), (OK, 0.0), (OK, 1.0 - 4.0 * 2.0)]);
    // SAFETY: the component is valid.
    assert_eq!(unsafe { c_api::fmi2DoStep::<Stepped<Oscillator>>(fmu.0, 0.0, 0.5, FALSE) }, OK);
    assert_eq!([get(3), get(1), get(2)], [(OK, 2.0), (OK, -3.5), (OK, 3.5 * 3.5 / 2.0)]);
    // The position changes as it is told, and by its derivative over time; the other's derivative by the stiffness.
    let along = |unknown: u32, known: u32| {
        let (seed, mut derivative) = (2.0, f64::NAN);
        let (unknown, known) = (&raw const unknown, &raw const known);
        let (seed, value) = (&raw const seed, &raw mut derivative);
        // SAFETY: one unknown, one known and one seed, and room for one value.
        let status = unsafe {
            c_api::fmi2GetDirectionalDerivative::<Stepped<Oscillator>>(
                fmu.0, unknown, 1, known, 1, seed, value,
            )
        };
        (status, derivative)
    };
    assert_eq!([along(3, 3), along(3, 1), along(50, 3)], [(OK, 2.0), (OK, 0.0), (OK, -8.0)]);
    let (position, order, mut rate) = (3, 1, f64::NAN);
    let (position, order) = (&raw const position, &raw const order);
    // SAFETY: one reference, one order and room for one value.
    let status = unsafe {
        c_api::fmi2GetRealOutputDerivatives::<Stepped<Oscillator>>(fmu.0, position, 1, order, &raw mut rate)
    };
    assert_eq!((status, rate), (OK, -3.5));
    // An output is not set between steps, though it is a state.
    assert_ne!(set(3, 1.0), OK);
}
