//! What the chosen interfaces change, and what they do not.

use std::env;
use std::fs;

use fmu_export_build::{Fmi, Generated, Interfaces, Version, generate_into};

use super::{folder, folder_with_model, package, read, sources};

fn generate(interfaces: Interfaces) -> Generated {
    let out_dir = folder(&format!("interfaces {interfaces}"));
    generate_into(&sources().join("vessels.json"), &out_dir, &package(), interfaces)
        .unwrap_or_else(|error| panic!("{error}"))
}

/// The description without the GUID, which is a hash of the rest.
fn description(interfaces: Interfaces) -> String {
    let xml = read(&generate(interfaces).model_description);
    let (before, rest) = xml.split_once(" guid=\"").expect("there is a GUID");
    let (_, after) = rest.split_once('"').expect("it ends");
    format!("{before}{after}")
}

/// Arrays are arrays where their elements have one unit, event indicators are variables, and what depends on parameters
/// says so (FMI 3.0.2, sections 2.4.7 and 2.4.8).
#[test]
fn the_description_of_fmi_3_equals_the_golden_file() {
    let fmi = Fmi { version: Version::Three, interfaces: Interfaces::Both };
    let generated = generate_into(&sources().join("vessels.json"), &folder("fmi 3"), &package(), fmi)
        .unwrap_or_else(|error| panic!("{error}"));
    let (xml, kept) =
        (read(&generated.model_description), sources().join("Vessels/modelDescription.fmi3.xml"));
    if env::var_os("FMU_EXPORT_BLESS").is_some() {
        fs::write(&kept, &xml).expect("the folder is writable");
    }
    assert_eq!(xml, read(&kept));
    assert!(read(&generated.variables).contains("pub use ::fmu_export::fmi3_functions as export_functions;"));
    // Each capability that the page names is an attribute of this version.
    let page = read(&generated.documentation);
    let (_, table) = page.split_once("<table class=\"capabilities\">").expect("there is a table");
    let (table, _) = table.split_once("</table>").expect("it ends");
    let named: Vec<_> =
        table.split("<code>").skip(1).filter_map(|row| Some(row.split_once("</code>")?.0)).collect();
    assert_eq!(named.len(), 7);
    for name in named {
        assert!(xml.contains(&format!(" {name}=\"")), "{name}");
    }
}

/// What is generated for Scheduled Execution of a declaration with a clock or without one, or why not.
fn scheduled(version: Version, clock: Option<&str>) -> Result<Generated, String> {
    let folder = folder_with_model("scheduled execution");
    let file = folder.join("vessels.json");
    if let Some(clock) = clock {
        let declaration = read(&file).replacen('{', &format!("{{\"clock\": {clock},"), 1);
        fs::write(&file, declaration).expect("the folder for tests is writable");
    }
    let fmi = Fmi { version, interfaces: Interfaces::ScheduledExecution };
    generate_into(&file, &folder, &package(), fmi).map_err(|error| error.to_string())
}

#[test]
fn scheduled_execution_is_for_clocks_of_fmi_3_without_states() {
    const CLOCK: &str = r#"{"name": "ticks"}"#;
    for (version, clock, reason) in [
        (Version::Two, CLOCK, "Scheduled Execution exists in FMI 3.0 only"),
        (Version::Three, r#"{"name": "time"}"#, "clock.name: time: another variable has this name"),
        (Version::Three, r#"{"name": "a b"}"#, "clock.name: 'a b'"),
        (Version::Three, r#"{"name": "ticks", "description": "two\u0007lines"}"#, "clock.description: "),
        (Version::Three, CLOCK, "Scheduled Execution is for models without continuous states"),
    ] {
        let refused = scheduled(version, Some(clock)).expect_err(reason);
        assert!(refused.contains(reason), "{refused}");
    }
    // A package may have further models, which are not exported: only `export_functions` would fail.
    scheduled(Version::Three, None).expect("it has no clock");
}

/// FMI 3.0.2, section 4.2; in FMI 2.0 there is no such mode.
#[test]
fn event_mode_is_declared_where_the_model_has_it() {
    let with_event_mode = read(&sources().join("vessels.json")).replacen(
        "\"capabilities\": {",
        "\"capabilities\": {\"event_mode\": true, ",
        1,
    );
    for (version, interfaces) in [
        (Version::Three, Interfaces::CoSimulation),
        (Version::Three, Interfaces::Both),
        (Version::Three, Interfaces::ModelExchange),
        (Version::Two, Interfaces::CoSimulation),
    ] {
        let folder = folder_with_model(&format!("event mode {version} {interfaces}"));
        let file = folder.join("vessels.json");
        fs::write(&file, &with_event_mode).expect("the folder for tests is writable");
        let generated = generate_into(&file, &folder, &package(), Fmi { version, interfaces })
            .unwrap_or_else(|error| panic!("{error}"));
        let declares = version == Version::Three && interfaces.co_simulation();
        let xml = read(&generated.model_description);
        assert_eq!(xml.contains("hasEventMode=\"true\""), declares, "{version} {interfaces}");
    }
}

/// FMI 3.0.2, section 4.4: elsewhere importers rely on whole steps. Event Mode brings intermediate updates, too.
#[test]
fn early_return_is_announced_where_a_step_can_end_early() {
    for (capabilities, [early_return, has_updates]) in [
        ("", [false, false]),
        ("\"termination\": true, ", [true, false]),
        ("\"event_mode\": true, ", [true, true]),
        ("\"termination\": true, \"event_mode\": true, ", [true, true]),
    ] {
        let declared = format!("\"capabilities\": {{{capabilities}");
        let edit = ("\"capabilities\": {", &declared[..]);
        let generated =
            edited("early return", Version::Three, &[edit]).unwrap_or_else(|error| panic!("{error}"));
        let (xml, rust) = (read(&generated.model_description), read(&generated.variables));
        let expected = format!(
            "mightReturnEarlyFromDoStep=\"{early_return}\" providesIntermediateUpdate=\"{has_updates}\" \
             canReturnEarlyAfterIntermediateUpdate=\"{has_updates}\" hasEventMode=\"{has_updates}\""
        );
        assert!(xml.contains(&expected), "{expected} in {xml}");
        assert!(rust.contains(&format!("early_return: {early_return},")));
    }
}

/// FMI 2.0.5, sections 2.2.1, 2.2.7, 3.3.1 and the schemas' order of elements and attributes.
#[test]
fn model_exchange_is_declared_with_what_belongs_to_it_and_nothing_else_changes() {
    let model_exchange = "  <ModelExchange modelIdentifier=\"Vessels\" needsExecutionTool=\"false\" \
        completedIntegratorStepNotNeeded=\"true\" canBeInstantiatedOnlyOncePerProcess=\"false\" \
        canNotUseMemoryManagementFunctions=\"true\" canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\" \
        providesDirectionalDerivative=\"false\"/>\n";
    let both = description(Interfaces::Both);
    let is_co_simulation = |line: &&str| line.trim_start().starts_with("<CoSimulation ");
    let co_simulation: Vec<_> = both.lines().filter(is_co_simulation).collect();
    assert_eq!(co_simulation.len(), 1);
    let co_simulation = format!("{}\n", co_simulation[0]);
    assert!(both.contains(&format!("{model_exchange}{co_simulation}")), "{both}");
    assert!(
        both.contains("variableNamingConvention=\"structured\" numberOfEventIndicators=\"2\">"),
        "{both}"
    );
    assert_eq!(both.matches("start=\"1e-5\" reinit=\"true\"/>").count(), 2, "{both}");
    assert_eq!(both.matches("reinit").count(), 2, "{both}");

    assert_eq!(description(Interfaces::ModelExchange), both.replace(&co_simulation, ""));
    let alone = both.replace(model_exchange, "").replace(" numberOfEventIndicators=\"2\"", "");
    assert_eq!(description(Interfaces::CoSimulation), alone.replace(" reinit=\"true\"", ""));
}

/// The types that FMI 3.0 alone has, as numbers, arrays and texts.
#[test]
fn types_of_fmi_3_are_described_and_typed() {
    let folder = folder("types");
    let file = folder.join("types.json");
    let declaration = r#"{"model_identifier": "types", "variables": [
        {"name": "tiny", "causality": "parameter", "type": "Int8", "dimensions": [2], "start": [-128, 5], "min": -128},
        {"name": "long", "causality": "parameter", "type": "UInt64", "start": 18446744073709551615},
        {"name": "single", "causality": "input", "type": "Float32", "unit": "m", "start": 0.5, "max": 2},
        {"name": "data", "causality": "output", "type": "Binary", "initial": "exact", "dimensions": [2], "start": ["0aFF", ""]}
    ]}"#;
    fs::write(&file, declaration).expect("the folder is writable");
    let fmi = Fmi { version: Version::Three, interfaces: Interfaces::CoSimulation };
    let generated = generate_into(&file, &folder, &package(), fmi).unwrap_or_else(|error| panic!("{error}"));
    let (xml, rust) = (read(&generated.model_description), read(&generated.variables));
    for text in [
        r#"initial="exact" min="-128" start="-128 5">"#,
        r#"<UInt64 name="long" valueReference="3""#,
        r#"start="18446744073709551615"/>"#,
        r#"variability="continuous" unit="m" max="2.0" start="0.5"/>"#,
        r#"<Start value="0aff"/>"#,
        r#"<Start value=""/>"#,
    ] {
        assert!(xml.contains(text), "{text} in {xml}");
    }
    for text in
        ["tiny: [i8; 2]", "long: u64", "single: f32", "data: [Vec<u8>; 2]", "data_type: fmi::DataType::Int8"]
    {
        assert!(rust.contains(text), "{text} in {rust}");
    }
    let error = generate_into(&file, &folder, &package(), Interfaces::CoSimulation).unwrap_err().to_string();
    assert_eq!(error.lines().count(), 4, "{error}");
    assert!(error.contains("tiny[1]: FMI 2.0 has no type Int8; FMI 3.0 has it (--fmi 3)"), "{error}");
}

/// FMI 2.0.5, sections 2.2.3 and 2.2.7: what a variable leaves out is that of its type, for the build as for importers.
#[test]
fn types_of_reals_are_defaults_of_variables() {
    let folder = folder("real types");
    let file = folder.join("types.json");
    let declaration = r#"{"model_identifier": "types", "real_types": [
        {"name": "SI.Pressure", "description": "Absolute", "quantity": "Pressure", "unit": "Pa", "display_unit": "bar",
         "min": 0, "max": 1e7, "nominal": 1e5},
        {"name": "Warming", "unit": "K", "display_unit": "degC", "relative_quantity": true, "unbounded": true}
    ], "variables": [
        {"name": "p", "causality": "output", "type": "SI.Pressure", "start": 2e5, "derivative": true},
        {"name": "q", "causality": "input", "type": "SI.Pressure", "display_unit": "kPa", "min": 1, "max": 1e7, "start": 1},
        {"name": "w", "causality": "parameter", "type": "Warming", "unit": "degC", "dimensions": [2], "start": 10},
        {"name": "d", "causality": "parameter", "type": "Warming", "start": 10},
        {"name": "e", "causality": "parameter", "unit": "K", "relative_quantity": true, "start": 10}
    ]}"#;
    fs::write(&file, declaration).expect("the folder is writable");
    let generate = |version| {
        let fmi = Fmi { version, interfaces: Interfaces::CoSimulation };
        generate_into(&file, &folder, &package(), fmi).unwrap_or_else(|error| panic!("{error}"))
    };
    let lines = |version, wanted: &[&str]| {
        let xml = read(&generate(version).model_description);
        let lines = xml.lines().map(str::trim).filter(|line| wanted.iter().any(|name| line.contains(name)));
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    let inherited = r#"unit="Pa" displayUnit="bar" min="0.0" max="10000000.0" nominal="100000.0"/>"#;
    let warming = r#"unit="K" displayUnit="degC" relativeQuantity="true" unbounded="true"/>"#;
    assert_eq!(
        lines(Version::Two, &["<SimpleType", "<Real "]),
        [
            r#"<SimpleType name="SI.Pressure" description="Absolute">"#,
            &format!(r#"<Real quantity="Pressure" {inherited}"#),
            r#"<SimpleType name="Warming">"#,
            &format!("<Real {warming}"),
            r#"<Real unit="s"/>"#,
            r#"<Real declaredType="SI.Pressure" start="200000.0"/>"#,
            r#"<Real unit="Pa/s" derivative="2"/>"#,
            r#"<Real declaredType="SI.Pressure" displayUnit="kPa" min="1.0" start="1.0"/>"#,
            r#"<Real declaredType="Warming" unit="degC" start="10.0"/>"#,
            r#"<Real declaredType="Warming" unit="degC" start="10.0"/>"#,
            r#"<Real declaredType="Warming" start="10.0"/>"#,
            r#"<Real unit="K" relativeQuantity="true" start="10.0"/>"#,
        ]
    );
    let xml = lines(Version::Three, &["Float64Type", "declaredType"]);
    assert_eq!(
        xml[0],
        format!(r#"<Float64Type name="SI.Pressure" description="Absolute" quantity="Pressure" {inherited}"#)
    );
    assert_eq!(xml[1], format!(r#"<Float64Type name="Warming" {warming}"#));
    for (line, own) in xml[2..].iter().zip([r#"e" start"#, r#"e" displayUnit="kPa" min="1.0" start"#]) {
        assert!(line.contains(&format!(r#" declaredType="SI.Pressur{own}"#)), "{line}");
    }
    // The display unit of one that has another unit is defined under that.
    let degrees = r#"<DisplayUnit name="degC""#;
    assert_eq!(lines(Version::Two, &[degrees]).len(), 2);
    let generated = generate(Version::Two);
    let (rust, page) = (read(&generated.variables), read(&generated.documentation));
    assert!(rust.contains("RealInput { min: 1.0, max: 10000000.0 }"), "{rust}");
    assert!(rust.contains("const STATE_NOMINALS: &'static [f64] = &[100000.0];"), "{rust}");
    // A difference of 10 K is one of 10 degC.
    assert!(page.contains("10 <small>10 degC</small>"), "{page}");
}

/// FMI 3.0.2, section 2.4.9. In FMI 2.0 it has none.
#[test]
fn an_icon_has_its_place_in_fmi_3() {
    let folder = folder("icons");
    let [file, picture, drawing] = ["pump.json", "pump.png", "pump.svg"].map(|name| folder.join(name));
    let declaration = r#"{"model_identifier": "pump", "icon": "pump.png",
        "variables": [{"name": "flow", "causality": "output", "unit": "1"}]}"#;
    fs::write(&file, declaration).expect("the folder is writable");
    for (name, copy) in [("vessels.png", &picture), ("vessels.svg", &drawing)] {
        fs::copy(sources().join(name), copy).expect("the folder is writable");
    }
    let generate = |version| {
        let fmi = Fmi { version, interfaces: Interfaces::CoSimulation };
        generate_into(&file, &folder, &package(), fmi).unwrap_or_else(|error| panic!("{error}"))
    };
    let generated = generate(Version::Three);
    assert_eq!(read(&generated.drawing.expect("there is a drawing")), read(&drawing));
    assert_eq!(generated.sources, [picture, drawing.clone()]);
    let xml = read(&generated.terminals.expect("there is an icon"));
    let expected = r#"<fmiTerminalsAndIcons fmiVersion="3.0">
  <GraphicalRepresentation>
    <Icon x1="-100" y1="-100" x2="100" y2="100"/>
  </GraphicalRepresentation>
</fmiTerminalsAndIcons>
"#;
    assert!(xml.ends_with(expected), "{xml}");
    fs::remove_file(&drawing).expect("it is there");
    let generated = generate(Version::Two);
    assert_eq!((generated.terminals, generated.drawing), (None, None));
    // What the build before has left is gone.
    for name in ["terminalsAndIcons.xml", "model.svg"] {
        assert!(!folder.join("pump").join(name).exists());
    }
}

/// In FMI 3.0 they are variables.
#[test]
fn an_event_indicator_has_no_name_of_another_variable() {
    let folder = folder("event indicators");
    let file = folder.join("indicators.json");
    let declaration = r#"{"model_identifier": "indicators", "event_indicators": ["empty"], "components": [
        {"name": "event_indicators", "variables": [{"name": "empty", "causality": "output", "unit": "1"}]}
    ]}"#;
    fs::write(&file, declaration).expect("the folder is writable");
    let generate =
        |fmi: Fmi| generate_into(&file, &folder, &package(), fmi).map_err(|error| error.to_string());
    generate(Interfaces::ModelExchange.into()).expect("FMI 2.0 has no such variables");
    let fmi = Fmi { version: Version::Three, interfaces: Interfaces::ModelExchange };
    let refused = generate(fmi).expect_err("there are two variables of a name");
    let expected = "event_indicators[0]: event_indicators.empty: another variable has this name";
    assert!(refused.contains(expected), "{refused}");
}

/// Clocks with their attributes, and what belongs to them (FMI 3.0.2, sections 2.2.8 and 2.4.8).
#[test]
fn clocks_are_described_and_typed() {
    let folder = folder("clocks");
    let file = folder.join("clocks.json");
    let generate = |more: &str, interfaces| {
        let declaration = format!(
            r#"{{"model_identifier": "clocks", "variables": [
                {{"name": "slow", "type": "Clock", "causality": "input", "interval_variability": "constant",
                  "interval_counter": 3, "shift_counter": 1, "resolution": 4, "priority": 1}},
                {{"name": "fast", "type": "Clock", "causality": "input", "interval_variability": "triggered",
                  "can_be_deactivated": true, "priority": 0}},
                {{"name": "count", "type": "Integer", "causality": "output", "clocks": ["slow", "fast"], "reads": []}},
                {{"name": "done", "type": "Clock", "causality": "output", "reads": ["slow"]}},
                {{"name": "last_sum", "variability": "discrete", "clocks": ["slow"], "initial": "exact", "start": 0, "unit": "1"}},
                {{"name": "sum", "variability": "discrete", "clocks": ["slow"], "previous": "last_sum", "reads": ["last_sum"], "unit": "1"}}{more}
            ]}}"#
        );
        fs::write(&file, declaration).expect("the folder is writable");
        let fmi = Fmi { version: Version::Three, interfaces };
        generate_into(&file, &folder, &package(), fmi).map_err(|error| error.to_string())
    };
    let generated = generate("", Interfaces::Both).unwrap_or_else(|error| panic!("{error}"));
    let (xml, rust) = (read(&generated.model_description), read(&generated.variables));
    for text in [
        r#"causality="input" variability="discrete" intervalVariability="constant" intervalDecimal="0.75" shiftDecimal="0.25" supportsFraction="true" resolution="4" intervalCounter="3" shiftCounter="1"/>"#,
        r#"canBeDeactivated="true" intervalVariability="triggered"/>"#,
        r#"causality="output" variability="discrete" intervalVariability="triggered"/>"#,
        r#"initial="calculated" clocks="1 2"/>"#,
        r#"<Output valueReference="3" dependencies="1 2"/>"#,
        r#"<Output valueReference="4" dependencies="1"/>"#,
        r#"clocks="1" previous="5"/>"#,
        "<ClockedState valueReference=\"6\" dependencies=\"1 5\"/>\n    <InitialUnknown valueReference=\"4\" dependencies=\"\"/>\n  </ModelStructure>",
        r#"mightReturnEarlyFromDoStep="false" providesIntermediateUpdate="false" canReturnEarlyAfterIntermediateUpdate="false" hasEventMode="true""#,
    ] {
        assert!(xml.contains(text), "{text} in {xml}");
    }
    // Section 2.4.4: priorities are for Scheduled Execution, and ignored elsewhere.
    let scheduled = generate("", Interfaces::ScheduledExecution).unwrap_or_else(|error| panic!("{error}"));
    let scheduled = read(&scheduled.model_description);
    for text in [
        r#"priority="1" intervalVariability="constant""#,
        r#"canBeDeactivated="true" priority="0" intervalVariability="triggered"/>"#,
    ] {
        assert!(scheduled.contains(text), "{text} in {scheduled}");
    }
    assert!(!xml.contains("priority="), "{xml}");
    // Inputs come first, by their priority.
    for text in [
        "slow: ::fmu_export::Clock::periodic(0.75, 0.25)",
        "0 => ::core::option::Option::Some(&self.clocks.fast)",
        "2 => ::core::option::Option::Some(&self.clocks.done)",
        "(3, &[1, 2])",
    ] {
        assert!(rust.contains(text), "{text} in {rust}");
    }
    let error = generate_into(&file, &folder, &package(), Interfaces::CoSimulation).unwrap_err().to_string();
    for clock in ["fast", "done"] {
        let reason = "in FMI 2.0 only 'constant' and 'fixed' Clocks tick, by time events";
        assert!(error.contains(&format!("{clock}: {reason}; FMI 3.0 has it (--fmi 3)")), "{error}");
    }
    assert!(!error.contains("slow:"), "{error}");

    let local = r#", {"name": "own", "type": "Clock"}"#;
    let of_local = r#", {"name": "own", "type": "Clock"},
        {"name": "bad", "causality": "output", "type": "Integer", "clocks": ["own"]}"#;
    let aimless = r#", {"name": "aimless", "type": "Clock", "causality": "input", "interval_variability": "triggered"}"#;
    let both = r#"], "clock": {"name": "sample"}, "log_categories": ["#;
    for (more, interfaces, reason) in [
        (local, Interfaces::ScheduledExecution, "own: Scheduled Execution has no local clocks"),
        (
            of_local,
            Interfaces::Both,
            "bad: the clock 'own' is local, so only local variables can belong to it",
        ),
        (aimless, Interfaces::ScheduledExecution, "aimless: in Scheduled Execution an input clock needs a"),
        (both, Interfaces::ScheduledExecution, "sample: there is another clock, 'slow'"),
    ] {
        let refused = generate(more, interfaces).expect_err(reason);
        assert!(refused.contains(reason), "{refused}");
    }
    for (more, interfaces) in
        [(local, Interfaces::Both), (aimless, Interfaces::Both), ("", Interfaces::ScheduledExecution)]
    {
        generate(more, interfaces).unwrap_or_else(|error| panic!("{error}"));
    }
}

/// Importers see neither clocks nor references to them; the model has the clocks.
#[test]
fn in_fmi_2_clocks_are_time_events() {
    let folder = folder("clocks of fmi 2");
    let file = folder.join("clocks.json");
    let declaration = r#"{"model_identifier": "clocks", "terminals": [{"name": "all", "variables": ["slow", "level", "sum"]}],
        "variables": [
        {"name": "slow", "type": "Clock", "causality": "input", "interval_variability": "constant", "interval_decimal": 0.5},
        {"name": "level", "causality": "input", "clocks": ["slow"], "variability": "discrete", "unit": "1", "start": 0},
        {"name": "last_sum", "variability": "discrete", "clocks": ["slow"], "initial": "exact", "start": 0, "unit": "1"},
        {"name": "sum", "causality": "output", "variability": "discrete", "clocks": ["slow"], "previous": "last_sum",
         "reads": ["last_sum", "level", "slow"], "unit": "1"}
    ]}"#;
    fs::write(&file, declaration).expect("the folder is writable");
    let generated = generate_into(&file, &folder, &package(), Interfaces::Both);
    let generated = generated.unwrap_or_else(|error| panic!("{error}"));
    let (xml, rust) = (read(&generated.model_description), read(&generated.variables));
    assert!(!["slow", "clocks=", "previous"].iter().any(|word| xml.contains(word)), "{xml}");
    for text in [
        "<!-- index 4 -->\n    <ScalarVariable name=\"sum\" valueReference=\"4\"",
        "<Outputs>\n      <Unknown index=\"4\" dependencies=\"2\"/>",
        "<InitialUnknowns>\n      <Unknown index=\"4\" dependencies=\"2 3\"/>",
    ] {
        assert!(xml.contains(text), "{text} in {xml}");
    }
    assert!(rust.contains("slow: ::fmu_export::Clock::periodic(0.5, 0.0)"), "{rust}");
    let terminals = read(&generated.terminals.expect("there is a terminal"));
    assert!(terminals.contains("\"level\"") && !terminals.contains("slow"), "{terminals}");
    let page = read(&generated.documentation);
    assert!(page.contains("1 inputs") && page.contains("<tr id=\"slow\">"), "{page}");
}

#[test]
fn the_typed_interface_has_the_functions_and_the_table_of_the_interfaces() {
    let of_co_simulation = read(&generate(Interfaces::CoSimulation).variables);
    for (interfaces, functions) in [
        (Interfaces::CoSimulation, "fmi2_co_simulation"),
        (Interfaces::ModelExchange, "fmi2_model_exchange"),
        (Interfaces::Both, "fmi2_both"),
    ] {
        let generated = generate(interfaces);
        let text = read(&generated.variables);
        assert!(
            text.contains(&format!("pub use ::fmu_export::{functions} as export_functions;\n")),
            "{text}"
        );
        assert!(text.contains(&format!("    interfaces: fmi::Interfaces::{interfaces:?},\n")), "{text}");
        let differs = |line: &&str| !of_co_simulation.lines().any(|other| other == *line);
        let different = text.lines().filter(differs).count();
        // The macro, the GUID and the interfaces.
        assert_eq!(different, if interfaces == Interfaces::CoSimulation { 0 } else { 3 });
    }
}

#[test]
fn the_page_names_the_interfaces_and_what_they_can_do() {
    for (interfaces, names) in [
        (Interfaces::CoSimulation, "co-simulation"),
        (Interfaces::ModelExchange, "Model Exchange"),
        (Interfaces::Both, "co-simulation and Model Exchange"),
    ] {
        let page = read(&generate(interfaces).documentation);
        for text in [format!("<p>FMU for {names}</p>"), format!("<dd>FMI 2.0 for {names}</dd>")] {
            assert!(page.contains(&text), "{text}");
        }
        let indicators = "<dt>Event indicators</dt><dd>first_is_empty, second.is_empty</dd>";
        assert_eq!(page.contains(indicators), interfaces.model_exchange(), "{interfaces}");
        for of_steps in ["canHandleVariableCommunicationStepSize", "canInterpolateInputs"] {
            assert_eq!(page.contains(of_steps), interfaces.co_simulation(), "{interfaces}: {of_steps}");
        }
    }
}

#[test]
fn interfaces_are_written_as_they_are_read() {
    for interfaces in Interfaces::ALL {
        assert_eq!(interfaces.to_string().parse(), Ok(interfaces));
    }
    assert_eq!("me,cs".parse(), Ok(Interfaces::Both));
    for text in ["", "CS", "cs,cs", "cs, me", "cs,se", "cs,"] {
        assert_eq!(text.parse::<Interfaces>(), Err(format!("'{text}' is not one of cs, me, cs,me and se")));
    }
}

#[test]
fn resources_are_those_that_the_folder_has_now() {
    let folder = folder_with_model("resources");
    let write = |file: &str, text: &str| {
        fs::write(folder.join(file), text).expect("the folder for tests is writable");
    };
    fs::create_dir_all(folder.join("tables/curves")).expect("the folder for tests is writable");
    write("tables/curves/area.csv", "level,area\n0,0.5\n");
    write("tables/notes.txt", "made up");
    let model = read(&folder.join("vessels.json"));
    write("vessels.json", &model.replacen('{', "{\"resources\": \"tables\",", 1));
    let again = || {
        let file = folder.join("vessels.json");
        generate_into(&file, &folder, &package(), Interfaces::CoSimulation)
            .unwrap_or_else(|error| panic!("{error}"))
    };
    let generated = again();
    assert!(generated.sources.contains(&folder.join("tables")));
    let resources = generated.resources.expect("the JSON names a folder");
    assert_eq!(resources, folder.join("Vessels/resources"));
    assert_eq!(read(&resources.join("curves/area.csv")), "level,area\n0,0.5\n");
    assert_eq!(read(&resources.join("notes.txt")), "made up");

    fs::remove_file(folder.join("tables/notes.txt")).expect("it is there");
    assert_eq!(again().resources.as_ref(), Some(&resources));
    assert!(resources.join("curves/area.csv").is_file() && !resources.join("notes.txt").exists());

    write("vessels.json", &model);
    assert_eq!(again().resources, None);
    assert!(!resources.exists());
}

/// What the small model becomes after its JSON was edited as text, or why not.
fn edited(name: &str, version: Version, edits: &[(&str, &str)]) -> Result<Generated, String> {
    let folder = folder_with_model(name);
    let file = folder.join("vessels.json");
    let mut text = read(&file);
    for (from, to) in edits {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    fs::write(&file, text).expect("the folder for tests is writable");
    let fmi = Fmi { version, interfaces: Interfaces::Both };
    generate_into(&file, &folder, &package(), fmi).map_err(|error| error.to_string())
}

#[test]
fn an_item_needs_no_description() {
    let description = r#", "description": "Half \"full\"""#;
    let generated = edited("item", Version::Three, &[(description, "")]).expect("it is optional");
    let [xml, page] = [&generated.model_description, &generated.documentation].map(|file| read(file));
    assert!(xml.contains(r#"<Item name="half_full" value="2"/>"#), "{xml}");
    assert!(page.contains("<code>half_full</code></th><td></td>"), "{page}");
}

/// FMI 2.0.5, section 4.3.1: who can serialize a state can get and set it.
#[test]
fn a_state_that_cannot_be_saved_is_not_serialized() {
    for version in Version::ALL {
        let both = "\"get_and_set_state\": true, \"serialize_state\": true";
        let capabilities = (both, "\"get_and_set_state\": false");
        let generated = edited("no states", version, &[capabilities]).expect("one follows from the other");
        let (xml, rust) = (read(&generated.model_description), read(&generated.variables));
        assert_eq!(
            xml.matches("State=\"false\"").count() + xml.matches("state=\"false\"").count(),
            4,
            "{xml}"
        );
        assert!(rust.contains("serialize_state: false,"));
    }
}

/// The names in a terminal are those of the variables in the description, in which an array of FMI 3.0 is one variable.
#[test]
fn members_of_terminals_are_variables_of_the_version() {
    let with = |name: &str, version, member: &str| {
        let members = format!("\"variables\": [\"{member}\", ");
        let generated =
            edited(name, version, &[("\"variables\": [\"inflow\"", &format!("{members}\"inflow\""))])?;
        Ok::<_, String>(read(&generated.terminals.expect("the model has some")))
    };
    for (version, members) in [
        (
            Version::Two,
            &["settings.table[1,1]", "settings.table[1,2]", "settings.table[2,1]", "settings.table[2,2]"][..],
        ),
        (Version::Three, &["settings.table"][..]),
    ] {
        let terminals = with("array in a terminal", version, "settings.table").expect("it may be in one");
        for member in members {
            assert!(
                terminals.contains(&format!("variableName=\"{member}\" memberName=\"{member}\"")),
                "{terminals}"
            );
        }
        assert_eq!(terminals.matches("settings.table").count(), 2 * members.len());
    }
    with("element of FMI 2.0", Version::Two, "settings.table[2,1]").expect("it is a variable");
    let refused = with("element of FMI 3.0", Version::Three, "settings.table[2,1]").expect_err("it is none");
    let reason = "in FMI 3.0 the array of 'settings.table[2,1]' is one variable; name the array";
    assert!(refused.contains(".variables[0]: ") && refused.ends_with(reason), "{refused}");
}

/// Event indicators follow all other variables.
#[test]
fn the_largest_value_reference_leaves_room_for_others() {
    let largest = ("\"name\": \"inflow\",", "\"name\": \"inflow\", \"value_reference\": 2147483647,");
    let generated = edited("largest reference", Version::Three, &[largest]).expect("it is allowed");
    let xml = read(&generated.model_description);
    assert!(
        xml.contains("valueReference=\"2147483647\"") && xml.contains("valueReference=\"2147483648\""),
        "{xml}"
    );
}

/// Each variable reads the next one and the one before it reads; a test runs on a small stack.
#[test]
fn long_chains_and_large_arrays_are_models_like_others() {
    let chain: Vec<_> = (0..30_000)
        .map(|number| {
            let read = if number == 0 { "u".to_owned() } else { format!("v{}", number - 1) };
            let causality = if number % 2 == 0 { "output" } else { "local" };
            format!(
                r#"{{"name": "v{number}", "causality": "{causality}", "unit": "m", "reads": ["{read}"]}}"#
            )
        })
        .collect();
    let array = r#"{"name": "w", "unit": "m", "dimensions": [60000], "reads": ["u"]}"#;
    let input = r#"{"name": "u", "causality": "input", "unit": "m", "start": 0}"#;
    let folder = folder("chain");
    let file = folder.join("chain.json");
    let declaration = format!(r#"{{"variables": [{input}, {array}, {}]}}"#, chain.join(",\n"));
    fs::write(&file, declaration).expect("the folder is writable");
    let generated = generate_into(&file, &folder, &package(), Interfaces::CoSimulation);
    let xml = read(&generated.unwrap_or_else(|error| panic!("{error}")).model_description);
    // The input is the second variable.
    let outputs = xml.split_once("<Outputs>").and_then(|(_, rest)| rest.split_once("</Outputs>"));
    assert_eq!(outputs.map(|(outputs, _)| outputs.matches("dependencies=\"2\"/>").count()), Some(15_000));
}

/// All elements of an array may depend on all of one that is as large; only dependencies that differ in each are too many.
/// Where a list would have too many, what elements share is left out: they may then depend on everything.
#[test]
fn too_many_dependencies_are_refused() {
    let folder = folder("dependencies of arrays");
    let file = folder.join("arrays.json");
    let of = |version: Version, size: usize, reads: &str| {
        let declaration = format!(
            r#"{{"variables": [
                {{"name": "u", "causality": "input", "unit": "m", "dimensions": [{size}], "start": 0}},
                {{"name": "x", "unit": "m", "dimensions": [{size}], "start": 0, "derivative": {{"reads": ["x"]}}}},
                {{"name": "y", "causality": "output", "unit": "m", "dimensions": [{size}], "reads": {reads}}}
            ]}}"#
        );
        fs::write(&file, declaration).expect("the folder is writable");
        let fmi = Fmi { version, interfaces: Interfaces::Both };
        let generated = generate_into(&file, &folder, &package(), fmi).map_err(|error| error.to_string())?;
        let xml = read(&generated.model_description);
        let structure = xml.split_once("<ModelStructure").expect("it has one").1;
        let lists = structure.split("dependencies=\"").skip(1);
        let lists = lists.map(|rest| rest.split_once('"').expect("it ends").0.split_whitespace().count());
        Ok::<_, String>((lists.sum::<usize>(), structure.matches("<Unknown ").count()))
    };
    // Each element of `y` and each derivative, in a list of its own and in that of initialization.
    assert_eq!(of(Version::Two, 300, "[\"u\"]"), Ok((4 * 300 * 300, 4 * 300)));
    assert_eq!(of(Version::Two, 1600, "[\"u\"]"), Ok((0, 4 * 1600)));
    assert_eq!(of(Version::Three, 1600, "[\"u\"]"), Ok((4, 0)));
    let refused = of(Version::Two, 1500, "[\"u\", \"x[i]\"]").expect_err("that would be 2.25 million");
    let reason = "arrays.json:4: variables[2].reads: y[1333]: following all reads up to here takes more than";
    assert!(refused.contains(reason), "{refused}");
}

/// Whether the generated tables say that the equations depend on time, of a state with an equation that reads it.
fn depends_on_time(read: &str, capability: Option<(&str, bool)>) -> bool {
    let folder = folder("depends on time");
    let capabilities = capability.map(|(name, value)| format!("\"capabilities\": {{\"{name}\": {value}}},"));
    let declaration = format!(
        "{{\"model_identifier\": \"forced\", {} \"variables\": [
             {{\"name\": \"x\", \"causality\": \"output\", \"unit\": \"1\", \"start\": 0, \"derivative\": {{\"reads\": [\"{read}\"]}}}}]}}",
        capabilities.unwrap_or_default()
    );
    let file = folder.join("forced.json");
    fs::write(&file, declaration).expect("the folder for tests is writable");
    let generated =
        generate_into(&file, &folder, &package(), Interfaces::Both).unwrap_or_else(|error| panic!("{error}"));
    crate::read(&generated.variables).contains("const DEPENDS_ON_TIME: bool = true;")
}

/// What integrates the equations must know, whatever the importer is told.
#[test]
fn equations_depend_on_time_whatever_the_capabilities() {
    let names = [
        "variable_communication_step_size",
        "interpolate_inputs",
        "get_and_set_state",
        "serialize_state",
        "directional_derivatives",
        "adjoint_derivatives",
        "event_mode",
    ];
    let each = names.iter().flat_map(|&name| [Some((name, false)), Some((name, true))]);
    for capability in each.chain([None]) {
        assert!(depends_on_time("time", capability), "{capability:?}");
        assert!(!depends_on_time("x", capability), "{capability:?}");
    }
}
