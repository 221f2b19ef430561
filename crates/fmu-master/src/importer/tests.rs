//! The importer with FMUs written in C, careless as others are (in `tests/careless`): `careless.c`, `careless3.c` for FMI
//! 3.0, and `exchange.c` for Model Exchange.
//!
//! The first two abort the process when a state is not freed or a call follows a fatal error, the last on calls in a wrong
//! mode.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::thread;

use anyhow::Result;
use fmu_package::{FmuDescription, Function, Linear, Value};
use fmu_record::Record;

use super::{CallFailed, Ended, Fmu, Instance, Interface, Status};
use crate::careless::{self, DESCRIPTION};
use crate::scenario::{Scenario, Tolerance};
use crate::{LoadedFmus, Master};

fn import(description: &str) -> Result<Arc<Fmu>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("careless.fmu");
    careless::write(&path, description, careless::library());
    Fmu::open(&path)
}

fn opened() -> Arc<Fmu> {
    import(DESCRIPTION).expect("the FMU is imported")
}

/// An instance ready to step.
fn started(fmu: &Arc<Fmu>) -> Result<Instance> {
    let mut instance = fmu.instantiate("careless")?;
    instance.set_up(0.0, None)?;
    instance.enter_initialization()?;
    instance.exit_initialization()?;
    Ok(instance)
}

fn fail_with(name: &str) -> (Instance, CallFailed) {
    let mut instance = started(&opened()).unwrap();
    instance.step(0.0, 0.5).unwrap();
    instance.set("fail", name).unwrap();
    let error = instance.step(0.5, 0.5).unwrap_err().downcast().expect("a call failed");
    (instance, error)
}

#[test]
fn values_of_each_type_are_set_by_name() {
    let fmu = opened();
    let mut instance = started(&fmu).unwrap();
    let mut selection = fmu.select(["flag", "input", "fail", "level"]).unwrap();
    let mut values = [0.0; 4];
    instance.set("flag", true).unwrap();
    instance.set("input", 3).unwrap();
    instance.set("level", Value::Real(2.0, Some("kPa".to_owned()))).unwrap();
    instance.set("note", "Größe").unwrap();
    instance.read(&mut selection, &mut values).unwrap();
    assert_eq!(values.map(f64::to_bits), [1.0_f64, 3.0, 0.0, 2000.0].map(f64::to_bits));
    instance.write(&mut selection, &[0.0, 5.0, 0.0, 7.0]).unwrap();
    instance.read(&mut selection, &mut values).unwrap();
    assert_eq!(values.map(f64::to_bits), [0.0_f64, 5.0, 0.0, 7.0].map(f64::to_bits));
    assert!(instance.set("note", "size").is_err());
}

#[test]
fn a_translated_fmu_has_other_names_and_values() {
    let own = opened();
    let description = DESCRIPTION.replace("name=\"level\"", "name=\"pressure\"");
    // pressure = 2 level + 1; the flag is exchanged.
    let conversions = [
        ("pressure".to_owned(), Linear { factor: 2.0, offset: 1.0 }.into()),
        ("flag".to_owned(), Function::Table(vec![(0.0, 1.0), (1.0, 0.0)])),
    ];
    let description = FmuDescription::parse(&description).unwrap();
    let seen = own.translated(description, conversions.into(), [].into());
    let mut instance = started(&seen).unwrap();
    let mut selections =
        [own.select(["input", "level"]).unwrap(), seen.select(["input", "pressure"]).unwrap()];
    let mut values = |instance: &mut Instance| {
        selections.each_mut().map(|selection| {
            let mut values = [0.0; 2];
            instance.read(selection, &mut values).unwrap();
            values.map(f64::to_bits)
        })
    };
    let expected = |input: f64, level: f64, pressure: f64| {
        [[input.to_bits(), level.to_bits()], [input.to_bits(), pressure.to_bits()]]
    };
    instance.set("pressure", 7.0).unwrap();
    assert_eq!(values(&mut instance), expected(1.0, 3.0, 7.0));
    instance.write(&mut seen.select(["pressure", "input"]).unwrap(), &[9.0, 2.0]).unwrap();
    assert_eq!(values(&mut instance), expected(2.0, 4.0, 9.0));
    assert!(seen.variable("level").is_err());
    let [mut of_own, mut of_seen] = [&own, &seen].map(|fmu| fmu.select(["flag"]).unwrap());
    for number in [0.0, 1.0] {
        instance.write(&mut of_seen, &[number]).unwrap();
        let mut both = [f64::NAN; 2];
        instance.read(&mut of_own, &mut both[..1]).unwrap();
        instance.read(&mut of_seen, &mut both[1..]).unwrap();
        assert_eq!(both.map(f64::to_bits), [1.0 - number, number].map(f64::to_bits));
    }
    let refused = instance.write(&mut of_seen, &[2.0]).unwrap_err().to_string();
    assert!(refused.starts_with("flag: 2 is neither 0 nor 1"), "{refused}");
}

/// As a connection in a run: each whole number stays one, whatever the rounding of the inverse.
#[test]
fn a_translated_integer_takes_what_its_conversion_makes() {
    let own = opened();
    let mut instance = started(&own).unwrap();
    let mut of_own = own.select(["input"]).unwrap();
    for (factor, offset) in (1..=120).flat_map(|factor| (-30..=30).map(move |offset| (factor, offset))) {
        let [factor, offset] = [factor, offset].map(f64::from);
        let conversions = [("input".to_owned(), Linear { factor, offset }.into())];
        let seen = own.translated(own.description().clone(), conversions.into(), [].into());
        let mut of_seen = seen.select(["input"]).unwrap();
        for number in [0.0, 1.0, 7.0] {
            instance.write(&mut of_seen, &[number]).unwrap();
            let mut taken = [f64::NAN];
            instance.read(&mut of_own, &mut taken).unwrap();
            assert_eq!(
                taken[0].to_bits(),
                (factor * number + offset).to_bits(),
                "{factor} {offset} {number}"
            );
        }
    }
}

#[test]
fn values_that_do_not_fit_a_variable_are_refused_by_name() {
    let fmu = opened();
    let mut instance = started(&fmu).unwrap();
    let mut refusal = |name: &str, value: Value| instance.set(name, value).unwrap_err().to_string();
    assert!(refusal("inpt", Value::Integer(1)).ends_with("has no variable inpt; did you mean input?"));
    assert_eq!(
        refusal("flag", Value::Integer(1)),
        "the value 1 of flag cannot be used: it is of the type Integer, not Boolean"
    );
    assert_eq!(
        refusal("fail", Value::String("eror".to_owned())),
        "the value eror of fail cannot be used: it is not one of no, discard, error, no_status, fatal"
    );
    assert_eq!(
        refusal("level", Value::Real(1.0, Some("furlong".to_owned()))),
        "the value 1 furlong of level cannot be used: the unit 'furlong' is not known"
    );
    let texts = fmu.select(["note"]).err().expect("a text is not a number").to_string();
    assert_eq!(texts, "note is of the type String, which is not a number");
}

#[test]
fn a_discarded_step_is_reported_with_its_time_and_messages() {
    let (_, error) = fail_with("discard");
    assert_eq!(error.status, Some(Status::DISCARD));
    assert_eq!(
        error.to_string(),
        "careless: fmi2DoStep returned fmi2Discard at 0.5 s, having reached 0.75 s\n  stiff at 0.5 s: level 0.5, level"
    );
}

#[test]
fn an_error_is_reported_with_its_messages() {
    let (_, error) = fail_with("error");
    assert_eq!(error.to_string(), "careless: fmi2DoStep returned fmi2Error at 0.5 s\n  no way, # 7");
}

#[test]
fn an_invalid_status_is_an_error() {
    let (_, error) = fail_with("no_status");
    let text = error.to_string();
    assert!(text.starts_with("careless: fmi2DoStep returned the unknown status 17 at 0.5 s"), "{text}");
}

#[test]
fn nothing_is_called_after_a_fatal_error() {
    let (mut instance, error) = fail_with("fatal");
    assert_eq!(error.status, Some(Status::FATAL));
    assert!(instance.step(1.0, 0.5).is_err());
    assert!(instance.get("level").is_err());
}

#[test]
fn a_state_is_saved_restored_and_freed() {
    let mut instance = started(&opened()).unwrap();
    instance.step(0.0, 0.5).unwrap();
    let saved = instance.save().unwrap();
    let level = |instance: &mut Instance| instance.get("level").unwrap().to_bits();
    for _ in 0..3 {
        instance.step(0.5, 0.25).unwrap();
        assert_eq!(level(&mut instance), 0.75_f64.to_bits());
        instance.restore(&saved).unwrap();
        assert_eq!(level(&mut instance), 0.5_f64.to_bits());
        assert_eq!(instance.calls.time(), Some(0.5));
    }
    assert_eq!(instance.get("states").unwrap().to_bits(), 1.0_f64.to_bits());
    drop(saved);
    assert_eq!(instance.get("states").unwrap().to_bits(), 0.0_f64.to_bits());
    // A saved state keeps its instance alive.
    let saved = instance.save().unwrap();
    drop(instance);
    drop(saved);
}

#[test]
fn a_state_of_another_instance_is_refused() {
    let fmu = opened();
    let (mut one, mut two) = (started(&fmu).unwrap(), started(&fmu).unwrap());
    let saved = one.save().unwrap();
    assert_eq!(
        two.restore(&saved).unwrap_err().to_string(),
        "careless: the state belongs to another instance"
    );
}

#[test]
fn another_guid_is_refused_with_the_message_of_the_fmu() {
    let fmu = import(&DESCRIPTION.replace("guid=\"careless\"", "guid=\"{another}\"")).unwrap();
    let error = fmu.instantiate("probe").err().expect("it is refused").to_string();
    assert_eq!(error, "probe: fmi2Instantiate returned no instance\n  {another} is not 100% mine");
}

#[test]
fn instances_in_many_threads_are_independent() {
    let fmu = opened();
    thread::scope(|scope| {
        for thread in 0..16 {
            let fmu = &fmu;
            scope.spawn(move || {
                let rate = f64::from(thread);
                for _ in 0..20 {
                    let mut instance = started(fmu).unwrap();
                    instance.set("input", rate).unwrap();
                    let saved = instance.save().unwrap();
                    for step in 0..8 {
                        instance.step(f64::from(step) * 0.125, 0.125).unwrap();
                    }
                    assert_eq!(instance.get("level").unwrap().to_bits(), rate.to_bits());
                    instance.restore(&saved).unwrap();
                    instance.set("fail", "error").unwrap();
                    let error = instance.step(0.0, 0.125).unwrap_err().to_string();
                    assert!(error.ends_with("no way, # 7"), "{error}");
                }
            });
        }
    });
}

/// The message of a refused import.
fn refusal(imported: Result<Arc<Fmu>>) -> String {
    format!("{:#}", imported.err().expect("it is refused"))
}

#[test]
fn a_file_that_is_not_an_fmu_is_refused() {
    let missing = Path::new("missing.fmu");
    assert_eq!(refusal(Fmu::open(missing)), "cannot import missing.fmu: there is no such file");
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("text.fmu");
    fs::write(&text, "no archive").unwrap();
    assert!(refusal(Fmu::open(&text)).contains("it is not a ZIP archive"));
    let cases = [
        (
            "one",
            DESCRIPTION.replace("fmiVersion=\"2.0\"", "fmiVersion=\"1.0\""),
            "it is of FMI 1.0, which is not supported here; use FMPy",
        ),
        (
            "interfaces",
            DESCRIPTION.replace("CoSimulation", "Other"),
            "it is neither for co-simulation nor for Model Exchange",
        ),
        (
            "scheduled",
            DESCRIPTION.replace("CoSimulation", "ScheduledExecution"),
            "it is for Scheduled Execution only, which needs a scheduler for its clocks",
        ),
        (
            "library",
            DESCRIPTION.replace("modelIdentifier=\"careless\"", "modelIdentifier=\"other\""),
            "it has no",
        ),
        ("xml", DESCRIPTION.replace("</ModelVariables>", ""), "its modelDescription.xml cannot be read"),
    ];
    for (name, description, expected) in cases {
        let refusal = refusal(import(&description));
        assert!(refusal.contains(expected), "{name}: {refusal}");
    }
}

/// The modelDescription.xml of the FMU of FMI 3.0.
const DESCRIPTION_3: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Careless" instantiationToken="careless">
  <CoSimulation modelIdentifier="careless" canGetAndSetFMUState="true"/>
  <UnitDefinitions><Unit name="Pa"><BaseUnit kg="1" m="-1" s="-2"/><DisplayUnit name="kPa" factor="0.001"/></Unit></UnitDefinitions>
  <TypeDefinitions><EnumerationType name="Fail">
    <Item name="no" value="0"/><Item name="discard" value="1"/><Item name="error" value="2"/><Item name="fatal" value="3"/>
  </EnumerationType></TypeDefinitions>
  <ModelVariables>
    <Float64 name="level" valueReference="0" causality="output" unit="Pa"><Alias name="height"/></Float64>
    <Float64 name="input" valueReference="1" causality="input" start="1"/>
    <Enumeration name="fail" valueReference="2" causality="parameter" variability="tunable" declaredType="Fail" start="0"/>
    <Int64 name="count" valueReference="3"/>
    <Boolean name="flag" valueReference="4" causality="parameter" start="false"/>
    <String name="note" valueReference="5" causality="parameter"><Start value="none"/></String>
    <Float64 name="table" valueReference="6" causality="parameter" start="0 0 0 0 0 0">
      <Dimension start="2"/><Dimension valueReference="9"/></Float64>
    <Float32 name="small" valueReference="7" causality="parameter" start="0"/>
    <Float64 name="stop" valueReference="8" causality="parameter" start="1e9"/>
    <UInt64 name="columns" valueReference="9" causality="structuralParameter" start="3"/>
  </ModelVariables>
</fmiModelDescription>
"#;

fn opened_3() -> Result<Arc<Fmu>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("careless.fmu");
    careless::write(&path, DESCRIPTION_3, &careless::compiled("careless3.c"));
    Fmu::open(&path)
}

/// The bits of numbers, by name.
fn bits(instance: &mut Instance, names: &[&str]) -> Vec<u64> {
    let mut selection = instance.calls.fmu.select(names.iter().copied()).unwrap();
    let mut values = vec![0.0; names.len()];
    instance.read(&mut selection, &mut values).unwrap();
    values.into_iter().map(f64::to_bits).collect()
}

#[test]
fn values_of_fmi_3_are_set_by_name() {
    let fmu = opened_3().unwrap();
    let mut instance = started(&fmu).unwrap();
    instance.set("flag", true).unwrap();
    instance.set("input", 3).unwrap();
    instance.set("level", Value::Real(2.0, Some("kPa".to_owned()))).unwrap();
    instance.set("note", "Größe").unwrap();
    instance.set("small", 0.1).unwrap();
    let names = ["flag", "input", "fail", "height", "small"];
    let expected = [1.0, 3.0, 0.0, 2000.0, f64::from(0.1_f32)];
    assert_eq!(bits(&mut instance, &names), expected.map(f64::to_bits));
    assert!(instance.set("note", "size").is_err());
    let refused = instance.set("table", 1.0).unwrap_err().to_string();
    assert!(refused.contains("has no variable table"), "{refused}");
}

#[test]
fn elements_of_arrays_are_variables() {
    let mut instance = started(&opened_3().unwrap()).unwrap();
    for (name, value) in [("table[1,2]", 12.0), ("table[2,1]", 21.0), ("table[2,3]", 23.0)] {
        instance.set(name, value).unwrap();
    }
    let names = [
        "table[2,3]",
        "level",
        "table[1,1]",
        "table[1,2]",
        "input",
        "table[1,3]",
        "table[2,1]",
        "table[2,2]",
    ];
    let expected = [23.0_f64, 0.0, 0.0, 12.0, 1.0, 0.0, 21.0, 0.0];
    assert_eq!(bits(&mut instance, &names), expected.map(f64::to_bits));
    assert!(instance.calls.fmu.variable("table[2,4]").is_err());
}

/// Before Initialization Mode elements cannot be read: those not set have the start values of the description, which the
/// library's own zeros are not.
#[test]
fn elements_of_arrays_are_set_before_initialization() {
    for (start, expected) in [("7", [7.0; 6]), ("1 2 3 4 5 6", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("careless.fmu");
        let table = DESCRIPTION_3.find("name=\"table\"").unwrap();
        let (before, after) = DESCRIPTION_3.split_at(table);
        let after = after.replacen("start=\"0 0 0 0 0 0\"", &format!("start=\"{start}\""), 1);
        careless::write(&path, &format!("{before}{after}"), &careless::compiled("careless3.c"));
        let mut instance = Fmu::open(&path).unwrap().instantiate("careless").unwrap();
        instance.set("table[1,2]", 12.0).unwrap();
        instance.set("table[2,3]", 23.0).unwrap();
        instance.initialize(0.0, None).unwrap();
        let mut expected = expected;
        (expected[1], expected[5]) = (12.0, 23.0);
        let names = ["table[1,1]", "table[1,2]", "table[1,3]", "table[2,1]", "table[2,2]", "table[2,3]"];
        assert_eq!(bits(&mut instance, &names), expected.map(f64::to_bits), "{start}");
    }
}

/// The columns of a run of the FMU of FMI 3.0, with what its scenario records.
fn recorded(record: &str, description: &str) -> Result<Vec<String>> {
    let folder = tempfile::tempdir()?;
    careless::write(&folder.path().join("it.fmu"), description, &careless::compiled("careless3.c"));
    let text = format!("step = 0.5\nstop_time = 1\n{record}\n[[fmu]]\nname = \"it\"\nfile = \"it.fmu\"");
    let scenario = Scenario::parse("it.toml", &text, folder.path(), folder.path())?;
    let run = Master::new(&scenario, &mut LoadedFmus::default())?.run(|_, _| ())?;
    Ok(run.record.columns().iter().map(|column| column.name.clone()).collect())
}

#[test]
fn arrays_and_patterns_are_recorded() {
    let all = ["table[1,1]", "table[1,2]", "table[1,3]", "table[2,1]", "table[2,2]", "table[2,3]"];
    for (record, columns) in [
        ("table", &all[..]),
        ("table[2,*]", &all[3..]),
        ("t*e[*,3]", &[all[2], all[5]]),
        ("it:table[1,*]", &["it:table[1,1]", "it:table[1,2]", "it:table[1,3]"]),
        ("level\", \"l*l", &["level"]),
    ] {
        assert_eq!(
            recorded(&format!("record = [\"{record}\"]"), DESCRIPTION_3).unwrap(),
            columns,
            "{record}"
        );
    }
    for record in ["tabl", "table[3,*]", "no*", "other:table"] {
        let refused = recorded(&format!("record = [\"{record}\"]"), DESCRIPTION_3).unwrap_err().to_string();
        assert!(refused.starts_with("it.toml, line 3, record[1]: no FMU "), "{refused}");
    }
}

#[test]
fn without_outputs_local_variables_are_recorded() {
    let without = DESCRIPTION_3.replace("causality=\"output\"", "causality=\"local\"");
    let locals = recorded("", &without).unwrap();
    assert!(
        locals.iter().any(|name| name == "level") && locals.iter().all(|name| name != "input"),
        "{locals:?}"
    );
}

#[test]
fn a_state_of_fmi_3_is_saved_restored_and_freed() {
    let mut instance = started(&opened_3().unwrap()).unwrap();
    instance.step(0.0, 0.5).unwrap();
    let saved = instance.save().unwrap();
    instance.step(0.5, 0.25).unwrap();
    assert_eq!(bits(&mut instance, &["level", "count"]), [0.75_f64, 1.0].map(f64::to_bits));
    instance.restore(&saved).unwrap();
    assert_eq!(bits(&mut instance, &["level"]), [0.5_f64.to_bits()]);
    drop(saved);
    assert_eq!(bits(&mut instance, &["count"]), [0.0_f64.to_bits()]);
}

#[test]
fn failures_of_fmi_3_are_reported() {
    let fmu = opened_3().unwrap();
    let failure = |how: &str| {
        let mut instance = started(&fmu).unwrap();
        instance.set("fail", how).unwrap();
        let error = instance.step(0.5, 0.5).unwrap_err().to_string();
        assert_eq!(how == "fatal", instance.get("level").is_err(), "nothing is called after a fatal error");
        error
    };
    assert_eq!(
        failure("discard"),
        "careless: fmi3DoStep returned fmi3Discard at 0 s, having reached 0.75 s\n  stiff: level, 100%, #7, table"
    );
    assert_eq!(failure("error"), "careless: fmi3DoStep returned fmi3Error at 0 s\n  somebody hears this");
    assert!(failure("fatal").contains("returned fmi3Fatal"));

    let mut instance = started(&fmu).unwrap();
    instance.set("stop", 0.75).unwrap();
    instance.step(0.0, 0.5).unwrap();
    let error = instance.step(0.5, 0.5).unwrap_err().to_string();
    assert_eq!(error, "careless: the FMU requests the end of the simulation at 0.75 s");

    let mut instance = fmu.instantiate("late").unwrap();
    instance.set_up(1.0, Some(3.0)).unwrap();
    let error = instance.enter_initialization().unwrap_err().to_string();
    assert!(error.starts_with("late: fmi3EnterInitializationMode returned fmi3Error at 1 s"), "{error}");
}

#[test]
fn times_in_messages_have_no_round_off() {
    let ended = Ended { instance: "ball".to_owned(), time: 6.162_500_000_000_000_5 };
    assert_eq!(ended.to_string(), "ball: the FMU requests the end of the simulation at 6.1625 s");
}

/// The modelDescription.xml of the ball in Model Exchange, whose library is `exchange.c`.
const BALL: &str = include_str!("../../tests/careless/exchange.xml");

/// The ball, at rest 1 m above the ground.
fn ball(description: &str) -> Instance {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.fmu");
    careless::write(&path, description, &careless::compiled("exchange.c"));
    let mut ball = Fmu::open(&path).unwrap().instantiate("ball").unwrap();
    ball.set_tolerance(Some(1e-10));
    ball.initialize(0.0, None).unwrap();
    ball
}

/// Steps 0.05 s each. Returns the largest error of the height after a step.
fn largest_error(ball: &mut Instance, steps: std::ops::Range<u32>, height: impl Fn(f64) -> f64) -> f64 {
    let errors = steps.map(|step| {
        ball.step(0.05 * f64::from(step), 0.05).unwrap();
        (ball.get("h").unwrap() - height(0.05 * f64::from(step + 1))).abs()
    });
    errors.fold(0.0, f64::max)
}

/// The height of a ball that falls from 1 m and keeps half of its speed (m).
fn height(mut time: f64) -> f64 {
    let (mut height, mut speed) = (1.0, 0.0);
    loop {
        let until_ground = (speed + f64::sqrt(speed * speed + 20.0 * height)) / 10.0;
        if time <= until_ground {
            return height + speed * time - 5.0 * time * time;
        }
        (height, speed) = (0.0, -0.5 * (speed - 10.0 * until_ground));
        time -= until_ground;
    }
}

#[test]
fn model_exchange_is_integrated_from_event_to_event() {
    let mut ball = ball(BALL);
    assert_eq!(ball.calls.fmu.interface(), Interface::ModelExchange);
    // It bounces at 0.447, 0.894 and 1.118 s; the tolerance of each step is 1e-10.
    assert!(largest_error(&mut ball, 0..24, height) < 1e-8);
    // Every 0.25 s, at the steps' ends and within.
    assert_eq!(bits(&mut ball, &["time_events", "step_events"]), [4.0_f64, 1.0].map(f64::to_bits));
}

/// The ball has dh/dt = v and dv/dt = g. Without directional derivatives, the FMU is differentiated by differences.
#[test]
fn a_ball_is_linearized_where_it_is_and_falls_on() {
    let mut ball = ball(BALL);
    let falls = ball.linearize(&["g"], &["v"]).unwrap();
    assert_eq!(falls.states, [("h".to_owned(), 1.0), ("v".to_owned(), 0.0)]);
    assert_eq!((falls.derivatives.as_slice(), falls.is_exact), ([0.0, -10.0].as_slice(), false));
    assert_eq!(
        (&falls.inputs, &falls.outputs),
        (&vec![("g".to_owned(), -10.0)], &vec![("v".to_owned(), 0.0)])
    );
    let numbers = [falls.a, falls.b, falls.c, falls.d].concat().concat();
    let expected = [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0];
    assert_eq!(numbers.len(), expected.len());
    // Differences of linear equations have no error but rounding: 10 · 1e-16 over 6e-6.
    let is_near = |(found, expected): (&f64, &f64)| (found - expected).abs() < 1e-9;
    assert!(numbers.iter().zip(&expected).all(is_near), "{numbers:?}");
    // It is where it was, after a changed input, too.
    assert!(largest_error(&mut ball, 0..4, height) < 1e-8);
    ball.set("g", -20.0).unwrap();
    assert_eq!(ball.linearize(&[], &[]).unwrap().derivatives[1].to_bits(), (-20.0_f64).to_bits());
    let error = ball.linearize(&["gg"], &[]).unwrap_err().to_string();
    assert!(error.contains("has no variable gg"), "{error}");
}

#[test]
fn inputs_are_set_in_event_mode_and_held() {
    let mut ball = ball(BALL);
    // Of each step 1e-10; 20 steps.
    assert!(largest_error(&mut ball, 0..4, height) < 20.0 * 1e-10);
    ball.set("g", 5.0).unwrap();
    // At 0.2 s it is at 0.8 m and falls at 2 m/s.
    let rise = |time: f64| 0.8 - 2.0 * (time - 0.2) + 2.5 * (time - 0.2) * (time - 0.2);
    assert!(largest_error(&mut ball, 4..20, rise) < 20.0 * 1e-10);
}

#[test]
fn a_state_is_restored_with_the_solver() {
    let mut ball = ball(BALL);
    largest_error(&mut ball, 0..8, height);
    let saved = ball.save().unwrap();
    let names = ["h", "v", "time_events", "step_events"];
    largest_error(&mut ball, 8..24, height);
    let expected = bits(&mut ball, &names);
    ball.restore(&saved).unwrap();
    largest_error(&mut ball, 8..24, height);
    assert_eq!(bits(&mut ball, &names), expected);
}

#[test]
fn a_call_that_fails_in_a_step_is_reported() {
    let mut ball = ball(BALL);
    ball.step(0.0, 0.05).unwrap();
    ball.set("fail", 1.0).unwrap();
    let error = ball.step(0.05, 0.05).unwrap_err().to_string();
    assert_eq!(error, "ball: fmi2GetDerivatives returned fmi2Error at 0.05 s\n  it fell into a hole");
}

#[test]
fn a_derivative_without_a_state_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.fmu");
    careless::write(&path, &BALL.replace("derivative=\"2\"", "derivative=\"20\""), careless::library());
    let broken = refusal(Fmu::open(&path));
    assert!(broken.ends_with("the derivative 4 in its ModelStructure has no state"), "{broken}");
}

#[test]
fn a_library_without_the_functions_of_model_exchange_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.fmu");
    careless::write(&path, BALL, careless::library());
    let missing = refusal(Fmu::open(&path));
    assert!(missing.ends_with("its library has no fmi2EnterEventMode"), "{missing}");
}

/// The FMU may read its resources, and code of its library runs, until the last call.
#[test]
fn the_folder_stays_as_long_as_an_instance_or_its_state() {
    let mut ball = ball(BALL);
    let folder = ball.calls.fmu.loaded.folder().to_owned();
    let saved = ball.save().unwrap();
    drop(ball);
    assert!(folder.is_dir());
    drop(saved);
    assert!(!folder.exists());
}

/// `exchange.c` aborts where `fmi2Terminate` is called before initialization.
#[test]
fn a_state_saved_before_initialization_is_not_terminated() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.fmu");
    careless::write(&path, BALL, &careless::compiled("exchange.c"));
    let mut ball = Fmu::open(&path).unwrap().instantiate("ball").unwrap();
    let saved = ball.save().unwrap();
    ball.restore(&saved).unwrap();
}

#[test]
fn an_interface_is_chosen_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("careless.fmu");
    careless::write(&path, DESCRIPTION, careless::library());
    assert_eq!(Fmu::open(&path).unwrap().interface(), Interface::CoSimulation);
    let refusal = refusal(Fmu::open_with(&path, Some(Interface::ModelExchange)));
    assert!(refusal.ends_with("it is not for Model Exchange, only for co-simulation"), "{refusal}");
}

#[test]
fn a_selection_of_another_fmu_is_refused() {
    let mut instance = started(&opened()).unwrap();
    let mut selection = opened().select(["level"]).unwrap();
    for refused in [instance.read(&mut selection, &mut [0.0]), instance.write(&mut selection, &[0.0])] {
        let refused = refused.unwrap_err().to_string();
        assert_eq!(refused, "careless: the variables were selected from another FMU");
    }
}

#[test]
fn members_of_model_exchange_are_coupled() {
    let folder = tempfile::tempdir().unwrap();
    // The second one's acceleration is the first one's speed, held over each step.
    let follower = BALL.replace("\"v\"", "\"w\"").replace("\"h\"", "\"x\"").replace("\"g\"", "\"v\"");
    for (file, description) in [("ball.fmu", BALL), ("follower.fmu", &follower)] {
        careless::write(&folder.path().join(file), description, &careless::compiled("exchange.c"));
    }
    let text = r#"
        step = 0.05
        stop_time = 0.4
        record = ["v", "w"]
        [[fmu]]
        name = "ball"
        file = "ball.fmu"
        interface = "me"
        [[fmu]]
        name = "follower"
        file = "follower.fmu"
    "#;
    let mut scenario = Scenario::parse("balls.toml", text, folder.path(), folder.path()).unwrap();
    let run = Master::new(&scenario, &mut LoadedFmus::default()).unwrap().run(|_, _| ()).unwrap();
    let [v, w] = ["v", "w"].map(|name| run.record.get(name).unwrap());
    let mut expected = 0.0;
    for (row, (v, w)) in v.iter().zip(w).enumerate() {
        let speed = -0.5 * row as f64;
        expected += 0.05 * speed;
        assert!((v - speed).abs() < 1e-9 && (w - expected).abs() < 1e-9, "row {row}: {v} and {w}");
    }
    assert_eq!(v.len(), 9);
    scenario.fmus[1].interface = Some(Interface::CoSimulation);
    let refused =
        Master::new(&scenario, &mut LoadedFmus::default()).err().expect("it is refused").to_string();
    assert!(refused.ends_with("it is not for co-simulation, only for Model Exchange"), "{refused}");
    let refused =
        Scenario::parse("balls.toml", &text.replace("\"me\"", "\"se\""), folder.path(), folder.path());
    let refused = refused.unwrap_err().to_string();
    let expected = "expected \"cs\" for co-simulation or \"me\" for Model Exchange, found the text \"se\"";
    assert!(refused.ends_with(expected), "{refused}");
}

/// The record of balls in Model Exchange, the second of which only falls, with rows at events or without.
fn record_of_balls(record: &str, has_events: bool) -> Record {
    let folder = tempfile::tempdir().unwrap();
    careless::write(&folder.path().join("ball.fmu"), BALL, &careless::compiled("exchange.c"));
    let text = format!(
        r#"
        step = 0.2
        stop_time = 1.2
        record = {record}
        [[fmu]]
        name = "ball"
        file = "ball.fmu"
        [[fmu]]
        name = "other"
        file = "ball.fmu"
        values = {{ h = 100.0 }}
        "#
    );
    let mut scenario = Scenario::parse("balls.toml", &text, folder.path(), folder.path()).unwrap();
    scenario.tolerance = Tolerance::Given(1e-10);
    let mut loaded = LoadedFmus::default();
    let mut master = Master::new(&scenario, &mut loaded).unwrap();
    if has_events {
        master.record_events();
    }
    assert_eq!(master.without_events().count(), 0);
    master.run(|_, _| ()).unwrap().record
}

fn rows(record: &Record) -> Vec<Vec<u64>> {
    let columns = record.columns().iter().map(|column| column.values.as_slice());
    [record.time()]
        .into_iter()
        .chain(columns)
        .map(|values| values.iter().copied().map(f64::to_bits).collect())
        .collect()
}

/// Each impact halves and reverses the ball's speed. Every 0.25 s it counts a time event; the one at 1 s is at a
/// communication point, too.
#[test]
fn rows_before_and_after_events_are_recorded() {
    let recorded = r#"["ball:h", "ball:v", "ball:time_events"]"#;
    let [record, sampled] = [true, false].map(|has_events| record_of_balls(recorded, has_events));
    let [h, v, count] = [0, 1, 2].map(|column| &record.columns()[column].values);
    let time = record.time();
    let is_same = |values: &[f64], row: usize| values[row].to_bits() == values[row - 1].to_bits();
    let changes = |values: &[f64]| (1..time.len()).filter(|row| !is_same(values, *row)).collect::<Vec<_>>();
    let jumps: Vec<_> = changes(v).into_iter().filter(|row| is_same(time, *row)).collect();
    let impacts = [1.0, 2.0, 2.5].map(|times| times * 0.2_f64.sqrt());
    for (jump, impact) in jumps.iter().zip(impacts) {
        assert!((time[*jump] - impact).abs() < 1e-9 && h[*jump].abs() < 1e-9, "{}", time[*jump]);
        assert_eq!((v[*jump] / v[jump - 1]).to_bits(), (-0.5_f64).to_bits());
    }
    let counted = changes(count);
    assert_eq!((jumps.len(), counted.len()), (3, 4));
    for (row, due) in counted.into_iter().zip([0.25, 0.5, 0.75, 1.0]) {
        // The steps that lead to the fifth communication point add up to a little less or more than 1 s.
        assert!((time[row] - due).abs() <= f64::EPSILON && is_same(time, row) && is_same(v, row), "{due}");
    }
    // Two at each event, one of which is at a communication point, where the second is there without it; there is one more
    // after the third step of the integrator.
    assert_eq!(time.len(), 7 + 2 * (3 + 4 + 1) - 1);
    assert_eq!(rows(&record.without_events()), rows(&sampled));
    assert_eq!(sampled.time().len(), 7);
}

/// Events of two at the same time are one pair of rows, and at the events of one the other moves on a line.
#[test]
fn rows_at_events_hold_what_the_other_fmus_do() {
    let record = record_of_balls(r#"["ball:v", "ball:time_events", "other:v", "other:time_events"]"#, true);
    let time = record.time();
    let [v, count, other_v, other_count] = [0, 1, 2, 3].map(|column| &record.columns()[column].values);
    assert_eq!(rows(&record)[2], rows(&record)[4]);
    assert_eq!(count.last(), Some(&4.0));
    // It falls by 10 m/s^2, which is a line.
    assert!(time.iter().zip(other_v).all(|(time, v)| (v + 10.0 * time).abs() < 1e-9));
    assert_eq!((1..time.len()).filter(|row| v[*row] > v[row - 1]).count(), 3);
    // The third steps of their integrators end at different times.
    assert_eq!(other_count.len(), 7 + 2 * (3 + 4 + 2) - 1);
}

/// The noise is that of the run without rows at events, between which it is on a line.
#[test]
fn noise_is_measured_at_communication_points() {
    let noisy = "[\"ball:v\"]\nmeasurement_noise.\"ball:v\".standard_deviation = 0.1";
    let [record, sampled] = [true, false].map(|has_events| record_of_balls(noisy, has_events));
    assert_eq!(rows(&record.without_events()), rows(&sampled));
    let (times, values) = (sampled.time(), &sampled.columns()[0].values);
    assert!(record.time().len() > times.len());
    for (time, value) in record.time().iter().zip(&record.columns()[0].values) {
        let after = times.partition_point(|known| known <= time).min(times.len() - 1);
        let share = (time - times[after - 1]) / (times[after] - times[after - 1]);
        let line = values[after - 1] + share * (values[after] - values[after - 1]);
        // The rounding of a few operations on speeds below 10 m/s.
        assert!((value - line).abs() < 1e-13, "{time}");
    }
}

/// An instance of the FMU of `misbehaving.c`, initialized in Model Exchange, with values of its parameters. `scaled` has states
/// of 1e-9 and 1e9, whose nominal values it gives; all others have 1.
fn integrated(version: u8, states: usize, values: &[(&str, Value)]) -> Instance {
    integrated_with(&careless::misbehaving(version, states, "none"), values)
}

/// An instance as of [`integrated`], with another description.
fn integrated_with(description: &str, values: &[(&str, Value)]) -> Instance {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("misbehaving.fmu");
    careless::write(&path, description, careless::misbehaving_library());
    let fmu = Fmu::open_with(&path, Some(Interface::ModelExchange)).unwrap();
    let mut instance = fmu.instantiate("misbehaving").unwrap();
    instance.set_up(0.0, None).unwrap();
    for (name, value) in values {
        instance.set(name, value.clone()).unwrap();
    }
    instance.enter_initialization().unwrap();
    instance.exit_initialization().unwrap();
    instance
}

/// Steps of 0.125 s to 2 s. Returns the warnings.
fn warnings_of(instance: &mut Instance) -> Vec<String> {
    (0..16).for_each(|step| instance.step(0.125 * f64::from(step), 0.125).unwrap());
    instance.take_warnings().into_iter().map(|message| message.of("it")).collect()
}

fn item(name: &str) -> Value {
    Value::Enumeration(name.to_owned())
}

/// The equation is x' = -x, whose solution at 2 s is exp(-2), within the tolerance of 1e-6 per step, of which fewer
/// than a hundred are taken.
#[test]
fn a_wrong_derivative_is_found_and_replaced() {
    for (version, misdeed, claimed) in [
        (2, "huge_derivative", "1000000000"),
        (3, "huge_derivative", "1000000000"),
        (2, "opposite_derivative", "1"),
        (3, "no_derivative", "0"),
        (2, "nan_derivative", "NaN"),
    ] {
        let mut instance = integrated(version, 1, &[("misdeed", item(misdeed))]);
        let warnings = warnings_of(&mut instance);
        let expected = format!(
            "it at 0 s: the FMU's derivative of der(x1) by x1 is {claimed}, but differences give -1.000e0; from here on, \
             differences replace the FMU's derivatives"
        );
        assert_eq!(warnings, [expected], "{misdeed}");
        let x = instance.get("x1").unwrap();
        assert!((x - (-2.0_f64).exp()).abs() < 1e-4, "{misdeed}: {x}");
    }
}

/// The wrong column is the first of 30, one amid others, or the last.
#[test]
fn one_wrong_column_among_many_is_found() {
    for misdeed in ["huge_derivative", "opposite_derivative", "no_derivative"] {
        for column in [0, 16, 29] {
            let values = [("misdeed", item(misdeed)), ("column", f64::from(column).into())];
            let warnings = warnings_of(&mut integrated(2, 30, &values));
            let by = format!("by x{} is", column + 1);
            assert!(warnings.len() == 1 && warnings[0].contains(&by), "{misdeed}, {column}: {warnings:?}");
        }
    }
}

/// The description of a chain of 30 states, each of which follows the one before, with dependencies of their derivatives.
fn chain(version: u8, dependencies: impl Fn(usize) -> Vec<usize>) -> String {
    let mut description = careless::misbehaving(version, 30, "none");
    for state in 1..=30 {
        let (unknown, first) = if version == 3 {
            (format!("<ContinuousStateDerivative valueReference=\"{}\"", 99 + state), 0)
        } else {
            (format!("<Unknown index=\"{}\"", 30 + state), 1)
        };
        let listed = dependencies(state).into_iter().map(|state| (state + first - 1).to_string());
        let listed = listed.collect::<Vec<_>>().join(" ");
        assert!(description.contains(&unknown));
        description = description.replace(&unknown, &format!("{unknown} dependencies=\"{listed}\""));
    }
    description
}

/// At 2 s, x1 is exp(-2), and each next state 2 / (k - 1) times the one before.
fn assert_followed(instance: &mut Instance, told: &str) {
    let mut expected = (-2.0_f64).exp();
    for state in 1..=30 {
        let x = instance.get(&format!("x{state}")).unwrap();
        assert!((x - expected).abs() < 1e-4, "{told}: x{state} is {x}, not {expected}");
        expected *= 2.0 / f64::from(state);
    }
}

/// Listing more elements than there are does no harm: a state here and there, or all in the last row, whose elements
/// are then computed by themselves.
#[test]
fn the_jacobian_has_elements_where_the_model_structure_says() {
    for version in [2, 3] {
        for more in ["nothing", "the next", "all in the last"] {
            let description = chain(version, |state| match (state, more) {
                (30, "all in the last") => (1..=30).collect(),
                (30, _) | (_, "nothing" | "all in the last") => (state.max(2) - 1..=state).collect(),
                (_, _) => (state.max(2) - 1..=state + 1).collect(),
            });
            for misdeed in ["none", "no_derivative"] {
                let values = [("misdeed", item(misdeed)), ("column", 16.0.into())];
                let mut instance = integrated_with(&description, &values);
                let warnings = warnings_of(&mut instance);
                let is_right = match misdeed {
                    "none" => warnings.is_empty(),
                    _ => {
                        warnings.len() == 1
                            && warnings[0].starts_with("it at 0 s: ")
                            && warnings[0].contains("by x17 is 0")
                    }
                };
                assert!(is_right, "{version}, {more}, {misdeed}: {warnings:?}");
                assert_followed(&mut instance, misdeed);
            }
        }
    }
}

#[test]
fn dependencies_that_the_model_structure_leaves_out_are_found() {
    for version in [2, 3] {
        // One among many, or all: an empty list means none.
        for (left_out, found) in [(17, 17), (0, 2)] {
            let description = chain(version, |state| match state {
                _ if left_out == 0 => vec![],
                1 => vec![1],
                _ if state == left_out => vec![state],
                _ => vec![state - 1, state],
            });
            let mut instance = integrated_with(&description, &[]);
            let expected = format!(
                "it at 0 s: the FMU's ModelStructure does not list x{} among the dependencies of der(x{found}), whose \
                 derivative by it is 1; from here on, all derivatives are taken to depend on all states",
                found - 1
            );
            assert_eq!(warnings_of(&mut instance), [expected]);
            assert_followed(&mut instance, "left out");
        }
    }
}

#[test]
fn a_derivative_that_becomes_wrong_is_found() {
    for event in [0.0, 0.7] {
        for misdeed in ["huge_derivative", "opposite_derivative", "no_derivative", "nan_derivative"] {
            let values = [
                ("misdeed", item(misdeed)),
                ("from", 0.7.into()),
                ("column", 3.0.into()),
                ("event", event.into()),
            ];
            let mut instance = integrated(2, 5, &values);
            let warnings = warnings_of(&mut instance);
            assert!(
                warnings.len() == 1 && warnings[0].contains("by x4 is") && !warnings[0].contains(" 0 s"),
                "{misdeed}, {event}: {warnings:?}"
            );
        }
    }
    // x1' = -x1 from 1 at 0.7 s.
    let values = [("misdeed", item("huge_derivative")), ("from", 0.7.into()), ("event", 0.7.into())];
    let mut instance = integrated(2, 1, &values);
    warnings_of(&mut instance);
    let x = instance.get("x1").unwrap();
    assert!((x - (-1.3_f64).exp()).abs() < 1e-4, "{x}");
}

#[test]
fn an_fmu_with_a_wrong_derivative_is_linearized_by_differences() {
    let mut instance = integrated(2, 1, &[("misdeed", item("huge_derivative"))]);
    assert_eq!(warnings_of(&mut instance).len(), 1);
    let linearized = instance.linearize(&[], &[]).unwrap();
    assert!(!linearized.is_exact && (linearized.a[0][0] + 1.0).abs() < 1e-6, "{:?}", linearized.a);
}

#[test]
fn right_derivatives_are_believed() {
    for (system, states) in [
        ("lags", 1),
        ("lags", 30),
        ("stiff", 2),
        ("scaled", 8),
        ("robertson", 3),
        ("van_der_pol", 2),
        ("kink", 1),
        ("rounded", 1),
        ("noisy", 1),
        ("diode", 1),
    ] {
        let warnings = warnings_of(&mut integrated(2, states, &[("system", item(system))]));
        assert!(warnings.is_empty(), "{system}: {warnings:?}");
    }
}

/// The check works in bad conditions, too.
#[test]
fn wrong_derivatives_of_stiff_and_badly_scaled_systems_are_found() {
    for (system, states, column) in [
        ("stiff", 2, 0),
        ("stiff", 2, 1),
        ("scaled", 8, 0),
        ("scaled", 8, 5),
        ("robertson", 3, 0),
        ("robertson", 3, 1),
        ("van_der_pol", 2, 1),
        ("diode", 1, 0),
    ] {
        let values = [
            ("system", item(system)),
            (
                "misdeed",
                item(if system == "stiff" && column == 0 {
                    "opposite_derivative"
                } else {
                    "huge_derivative"
                }),
            ),
            ("column", f64::from(column).into()),
        ];
        let warnings = warnings_of(&mut integrated(2, states, &values));
        let by = format!("by x{} is", column + 1);
        assert!(warnings.len() == 1 && warnings[0].contains(&by), "{system}, {column}: {warnings:?}");
    }
}

/// Some FMUs keep the callbacks of their last instance for all.
#[test]
fn a_message_is_from_the_instance_that_is_called() {
    for version in [2, 3] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("misbehaving.fmu");
        let description = careless::misbehaving(version, 1, "log_other");
        careless::write(&path, &description, careless::misbehaving_library());
        let fmu = Fmu::open(&path).unwrap();
        let [mut first, mut second] = [started(&fmu).unwrap(), started(&fmu).unwrap()];
        first.step(0.0, 0.5).unwrap();
        let warnings: Vec<_> = first.take_warnings().into_iter().map(|message| message.text).collect();
        assert_eq!(warnings, ["said with another's"]);
        assert!(second.take_warnings().is_empty());
    }
}

/// Co-simulation of the FMU of `misbehaving.c`, with a misdeed from a time (s) on.
fn stepped(version: u8, misdeed: &str, from: f64, status: f64) -> Instance {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("misbehaving.fmu");
    careless::write(&path, &careless::misbehaving(version, 1, "none"), careless::misbehaving_library());
    let mut instance = Fmu::open(&path).unwrap().instantiate("it").unwrap();
    for (name, value) in [("misdeed", item(misdeed)), ("from", from.into()), ("status", status.into())] {
        instance.set(name, value).unwrap();
    }
    instance.initialize(0.0, None).unwrap();
    instance
}

#[test]
fn what_is_not_a_number_is_told_once() {
    for version in [2, 3] {
        let mut instance = stepped(version, "nan_output", 0.5, 0.0);
        let mut selection = instance.fmu().select(["y", "x1"]).unwrap();
        let mut values = [0.0; 2];
        for step in 0..8 {
            instance.step(0.25 * f64::from(step), 0.25).unwrap();
            instance.read(&mut selection, &mut values).unwrap();
        }
        let mut taken = instance.fmu().select(["column"]).unwrap();
        instance.write(&mut taken, &[f64::NAN]).unwrap();
        instance.write(&mut taken, &[f64::NAN]).unwrap();
        let warnings: Vec<_> = instance.take_warnings().into_iter().map(|message| message.of("it")).collect();
        let expected = ["it at 0.5 s: y is not a number (NaN)", "it at 2 s: column is not a number (NaN)"];
        assert_eq!(warnings, expected);
    }
}

/// An FMU of FMI 3.0 that returns in the middle of a step steps on; one that stays where it is fails.
#[test]
fn an_early_return_that_nothing_allowed_is_no_whole_step() {
    let mut instance = stepped(3, "half_step", 0.0, 0.0);
    instance.step(0.0, 0.25).unwrap();
    instance.step(0.25, 0.25).unwrap();
    let warnings: Vec<_> = instance.take_warnings().into_iter().map(|message| message.of("it")).collect();
    let expected = "it at 0 s: fmi3DoStep returned early at 0.125 s, though earlyReturnAllowed is false; it is called again";
    assert_eq!(warnings, [expected]);
    // Each return halves the rest, until it is below the rounding of the time.
    assert_eq!(instance.calls.time(), Some(0.5));
    let mut instance = stepped(3, "half_step", 0.0, 1.0);
    let error = instance.step(0.0, 0.25).unwrap_err().to_string();
    assert_eq!(error, "it: the step from 0 s returned early, and has not moved");
}

/// With Event Mode, a step returns early for each event, which changes discrete states; an FMU whose events do not end
/// fails.
#[test]
fn an_early_return_for_an_event_is_handled_at_its_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("misbehaving.fmu");
    careless::write(&path, &careless::misbehaving(3, 1, "none"), careless::misbehaving_library());
    let fmu = Fmu::open(&path).unwrap();
    let mut instance = fmu.instantiate_with_early_return("it").unwrap();
    instance.set("misdeed", item("event_in_step")).unwrap();
    instance.set("from", 0.3).unwrap();
    instance.initialize(0.0, None).unwrap();
    assert!(instance.reports_events());
    instance.watch(fmu.select(["y", "x1"]).unwrap()).unwrap();
    instance.watch_events();
    instance.step(0.0, 0.25).unwrap();
    instance.step(0.25, 0.25).unwrap();
    let rows = instance.take_events().into_iter().map(|row| (row.time, row.is_after, row.values));
    assert_eq!(rows.collect::<Vec<_>>(), [(0.3, false, vec![0.3, 1.0]), (0.3, true, vec![0.3, 7.0])]);
    assert_eq!(instance.calls.time(), Some(0.5));
    assert!(instance.take_warnings().is_empty());
    instance.set("misdeed", item("event_for_ever")).unwrap();
    let error = instance.step(0.5, 0.25).unwrap_err().to_string();
    assert_eq!(error, "it: the step from 0.5 s does not end: it has returned early 1000 times at 0.5 s");
}
