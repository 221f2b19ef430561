use std::fs;

use fmu_package::{FmuDescription, Linear};

use super::*;

/// The least that a scenario needs, with lines after it.
fn with(more: &str) -> String {
    format!("step = 0.1\nstop_time = 1.0\n[[fmu]]\nname = \"plant\"\nfile = \"Plant.fmu\"\n{more}")
}

fn parse(text: &str) -> Result<Scenario> {
    Scenario::parse("test.toml", text, Path::new("data"), Path::new("fmus"))
}

fn refusal(text: &str) -> String {
    format!("{:#}", parse(text).unwrap_err())
}

#[test]
fn missing_keys_have_their_defaults() {
    let scenario = parse(&with("")).unwrap();
    assert_eq!(scenario.start_time.to_bits(), 0.0_f64.to_bits());
    assert_eq!(scenario.stepping, Stepping::InTurn);
    assert_eq!(scenario.fmus[0].file, Path::new("fmus/Plant.fmu"));
    assert!(scenario.record.is_none());
    assert!(scenario.inputs.is_empty() && scenario.noise.is_empty());
}

#[test]
fn everything_is_read() {
    let scenario = parse(
        r#"
        title = "all"
        step = 0.5
        start_time = 1
        stop_time = 3
        stepping = "at_once"
        record = ["a", "plant:b"]
        [[fmu]]
        name = "controller"
        file = "C.fmu"
        values = { mode = "open", gain = 2.5, count = 3, "air.on" = true }
        [[fmu]]
        name = "plant"
        file = "P.fmu"
        run_in = { duration = 20, during = { x = 1 }, after = { x = 2 } }
        inputs = { valve = 0 }
        [inputs]
        a = 1
        b = { steps = [[0, 1], [2.5, 3]] }
        c = { points = [[0, 1], [2, 3]] }
        d = { ramp = { from = 1, to = 2, begin = 3, end = 4 } }
        e = { sine = { mean = 1, amplitude = 2, frequency = 3, phase = 90 } }
        [noise]
        y = { standard_deviation = 0.5, seed = 4 }
        "#,
    )
    .unwrap();
    assert_eq!(scenario.stepping, Stepping::AtOnce);
    let signals: Vec<_> = scenario.inputs.iter().map(|input| input.course.plain().unwrap()).collect();
    assert_eq!(
        signals,
        [
            Signal::Constant(1.0),
            Signal::Steps(vec![(0.0, 1.0), (2.5, 3.0)]),
            Signal::Lines(vec![(0.0, 1.0), (2.0, 3.0)]),
            Signal::Lines(vec![(3.0, 1.0), (4.0, 2.0)]),
            Signal::Sine { mean: 1.0, amplitude: 2.0, frequency: 3.0, phase: 90.0 },
        ]
    );
    let values: Vec<_> =
        scenario.fmus[0].values.iter().map(|value| (value.name.as_str(), &value.value)).collect();
    assert_eq!(
        values,
        [
            ("mode", &Value::String("open".to_owned())),
            ("gain", &Value::Real(2.5, None)),
            ("count", &Value::Integer(3)),
            ("air.on", &Value::Boolean(true)),
        ]
    );
    let run_in = scenario.fmus[1].run_in.as_ref().unwrap();
    assert_eq!((run_in.duration.to_bits(), run_in.after.len()), (20.0_f64.to_bits(), 1));
    assert_eq!(scenario.fmus[1].inputs[0].name, "valve");
    assert_eq!(scenario.noise[0].seed, 4);
    assert_eq!(scenario.record.unwrap()[1].name, "plant:b");
}

#[test]
fn each_refusal_names_line_and_key_and_what_was_expected() {
    let cases = [
        ("step = 0.1", "line 1, the file: stop_time is missing: a time in s"),
        ("step = = 1", "line 1: "),
        ("step = 0\nstop_time = 1", "line 1, step: expected a time above 0 in s, found 0"),
        ("step = true\nstop_time = 1", "line 1, step: expected a time above 0 in s, found true"),
        ("step = 0.1\nstop_time = nan", "line 2, stop_time: expected a time in s, found nan"),
        ("step = 0.1\nstop_time = -1", "line 2, stop_time: expected a time after start_time, 0 s, found -1"),
        ("step = 0.1\nstop_time = 1", "line 1, the file: fmu is missing"),
        (
            "stop_time = 1e308\nstep = 1e-3",
            "line 1, stop_time: inf communication steps of 0.001 s: expected at most 4294967295",
        ),
        (
            "stop_time = 4294967296\nstep = 1",
            "line 1, stop_time: 4294967296 communication steps of 1 s: expected at most 4294967295",
        ),
        ("step = 0.1\nstop_time = 1\nfmu = 3", "line 3, fmu: expected a table [[fmu]] for each FMU"),
        (
            "step = 0.1\nstop_time = 1\n[[fmu]]\nname = \"a\"",
            "line 3, fmu[1]: file is missing: the FMU's path",
        ),
        ("step = 0.1\nstoptime = 1", "line 2, stoptime: this key is not known; did you mean stop_time?"),
        ("Stop-Time = 1\nstep = 0.1", "line 1, Stop-Time: this key is not known; did you mean stop_time?"),
        ("stop_time = 1\nsteps = 0.1", "line 2, steps: this key is not known; did you mean step?"),
        (
            "step = 0.1\nstop_time = 1\n[[fmu]]\nnaem = \"a\"",
            "line 4, fmu[1].naem: this key is not known; did you mean name?",
        ),
    ];
    for (text, expected) in cases {
        let refusal = refusal(text);
        assert!(refusal.starts_with(&format!("test.toml, {expected}")), "{text}\n{refusal}");
    }
    let cases = [
        ("valus = {}", "line 6, fmu[1].valus: this key is not known; did you mean values?"),
        (
            "values = { a = [1] }",
            "line 6, fmu[1].values.a: expected a number, true, false or a text, found a list of 1",
        ),
        ("values = { \"a b\" = [1] }", "line 6, fmu[1].values.\"a b\": expected a number"),
        ("parameters = [\"none.ssv\"]", "line 6, fmu[1].parameters[1]: cannot read data/none.ssv: "),
        (
            "run_in = { duration = -1 }",
            "line 6, fmu[1].run_in.duration: expected a time above 0 in s, found -1",
        ),
        (
            "run_in = { duration = 1e300 }",
            "line 6, fmu[1].run_in.duration: 1e301 communication steps of 0.1 s: expected at most 4294967295",
        ),
        ("run_in = { begin = 1 }", "line 6, fmu[1].run_in: duration is missing: a time in s"),
        (
            "[[fmu]]\nname = \"plant\"\nfile = \"a\"",
            "line 7, fmu[2].name: duplicate FMU: plant is already the name of another, in line 5",
        ),
        (
            "[inputs]\na = \"1\"",
            "line 7, inputs.a: expected a number, or a table with one of steps, points, ramp",
        ),
        ("[inputs]\na = { step = [] }", "line 7, inputs.a: expected a number, or a table"),
        ("[inputs]\na = { steps = [] }", "line 7, inputs.a.steps: expected at least one pair"),
        (
            "[inputs]\na = { steps = [[1]] }",
            "line 7, inputs.a.steps[1]: expected a pair [time in s, value] of numbers",
        ),
        (
            "[inputs]\na.steps = [\n[0, 1],\n[0, 2],\n]",
            "line 9, inputs.a.steps[2]: expected a time after the previous one, 0 s, found a list of 2",
        ),
        ("[inputs]\na = { steps = [[0, inf]] }", "line 7, inputs.a.steps[1][2]: expected a pair"),
        ("[inputs]\na = { steps = [[0, 1]], hold = true }", "line 7, inputs.a.hold: this key is not known"),
        (
            "[inputs]\na = { ramp = { from = 1, to = 2, begin = 3, end = 3 } }",
            "line 7, inputs.a.ramp: expected an end after the begin, found 3 s to 3 s",
        ),
        (
            "[inputs]\na = { sine = { mean = 1 } }",
            "line 7, inputs.a.sine: amplitude is missing: the amplitude",
        ),
        ("[inputs]\na = { csv = \"a.csv\" }", "line 7, inputs.a: column is missing: the name of the column"),
        (
            "[inputs]\na = { csv = \"a.csv\", column = \"b\" }",
            "line 7, inputs.a.csv: cannot read data/a.csv: ",
        ),
        (
            "[noise]\na = { standard_deviation = 0 }",
            "line 7, noise.a.standard_deviation: expected a number above 0",
        ),
        (
            "[noise]\na = { standard_deviation = 1, seed = -1 }",
            "line 7, noise.a.seed: expected a whole number, 0 or more",
        ),
    ];
    for (more, expected) in cases {
        let refusal = refusal(&with(more));
        assert!(refusal.starts_with(&format!("test.toml, {expected}")), "{more}\n{refusal}");
    }
}

#[test]
fn a_column_of_a_file_is_what_its_input_makes_of_it() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("a.csv"),
        "Zeit (ms), note, b (bar), on, mode, count\n\
         0, start, 1, TRUE, idle, 1\n500, up, 2, 0, 7, 2\n500, end, 3, false, boost, 2.5\n",
    )
    .unwrap();
    let read = |column: &str, more: &str| {
        let text = with(&format!("[inputs]\na = {{ csv = \"a.csv\", column = \"{column}\"{more} }}"));
        let scenario = Scenario::parse("test.toml", &text, folder.path(), Path::new(""));
        scenario.map(|scenario| scenario.inputs[0].course.clone()).map_err(|error| format!("{error:#}"))
    };
    let fmu = FmuDescription::parse(
        r#"<fmiModelDescription fmiVersion="2.0"><UnitDefinitions>
             <Unit name="Pa"><BaseUnit kg="1" m="-1" s="-2"/></Unit><Unit name="V"><BaseUnit kg="1" m="2" s="-3" A="-1"/></Unit>
           </UnitDefinitions><TypeDefinitions><SimpleType name="Mode"><Enumeration>
             <Item name="idle" value="3"/><Item name="boost" value="7"/></Enumeration></SimpleType></TypeDefinitions>
           <ModelVariables>
             <ScalarVariable name="plain"><Real/></ScalarVariable>
             <ScalarVariable name="pressure"><Real unit="Pa"/></ScalarVariable>
             <ScalarVariable name="voltage"><Real unit="V"/></ScalarVariable>
             <ScalarVariable name="held" variability="discrete"><Real/></ScalarVariable>
             <ScalarVariable name="on"><Boolean/></ScalarVariable>
             <ScalarVariable name="mode"><Enumeration declaredType="Mode"/></ScalarVariable>
             <ScalarVariable name="count"><Integer/></ScalarVariable>
             <ScalarVariable name="text"><String/></ScalarVariable>
           </ModelVariables></fmiModelDescription>"#,
    )
    .unwrap();
    let fit = |column: &str, more: &str, input: &str| {
        let input = fmu.variable(input).unwrap();
        let double = Linear { factor: 2.0, offset: 0.0 };
        let [own, doubled] = [Linear::IDENTITY, double].map(|conversion| {
            read(column, more)?.fit(input, &fmu, conversion).map_err(|error| format!("{error:#}"))
        });
        own.map(|own| (own, doubled.unwrap()))
    };
    let points = |values: [f64; 3]| vec![(0.0, values[0]), (0.5, values[1]), (0.5, values[2])];
    let lines = |values| Signal::Lines(points(values));
    let steps = |values| Signal::Steps(points(values));
    for (column, more, input, expected) in [
        ("b", "", "pressure", (lines([1e5, 2e5, 3e5]), lines([0.5e5, 1e5, 1.5e5]))),
        // A variable without a unit takes values unchanged.
        ("b", "", "plain", (lines([1.0, 2.0, 3.0]), lines([0.5, 1.0, 1.5]))),
        ("b", ", hold = true", "pressure", (steps([1e5, 2e5, 3e5]), steps([0.5e5, 1e5, 1.5e5]))),
        // A column without a unit has that of the connection's signal.
        ("count", "", "held", (steps([1.0, 2.0, 2.5]), steps([1.0, 2.0, 2.5]))),
        ("on", "", "on", (steps([1.0, 0.0, 0.0]), steps([1.0, 0.0, 0.0]))),
        ("mode", "", "mode", (steps([3.0, 7.0, 7.0]), steps([3.0, 7.0, 7.0]))),
    ] {
        assert_eq!(fit(column, more, input), Ok(expected), "{column} {input}");
    }
    for (column, input, expected) in [
        ("note", "plain", "line 2, note: expected a number, found \"start\""),
        ("note", "mode", "line 2, note: expected one of idle (3), boost (7), found \"start\""),
        ("count", "mode", "line 2, count: expected one of idle (3), boost (7), found 1"),
        ("count", "count", "line 4, count: expected a whole number, found 2.5"),
        ("count", "on", "line 3, count: expected 0, 1, true or false, found 2"),
        ("b", "voltage", "b: the unit bar does not convert to V"),
        ("b", "text", "line 2, b: expected no column, as it is a String, found 1"),
        ("nott", "plain", "it has no column nott; did you mean note?; there are note, b, on, mode, count"),
    ] {
        let refusal = fit(column, "", input).unwrap_err();
        let place = format!("cannot read {}: ", folder.path().join("a.csv").display());
        assert!(refusal.ends_with(&format!("{place}{expected}")), "{refusal}");
    }
    assert!(read("nott", "").unwrap_err().starts_with("test.toml, line 7, inputs.a.csv: cannot read "));
}
