//! Systems as other tools write them, each named after its trait. Its FMUs integrate their input: after a step of 0.125 s
//! the level is higher by an eighth of it.

use std::fs;
use std::iter;

use fmu_package::{Fmu, Platform};
use fmu_terms::Version;

use crate::archives::write_archive;
use crate::careless::{DESCRIPTION, library};
use crate::{Bench, careless, parameter_set};

/// A structure, with other prefixes than usual.
fn structure(version: &str, system: &str, more: &str) -> String {
    format!(
        r#"<D:SystemStructureDescription xmlns:D="http://ssp-standard.org/SSP1/SystemStructureDescription"
        xmlns:C="http://ssp-standard.org/SSP1/SystemStructureCommon" xmlns:V="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
        xmlns:M="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" version="{version}" name="any">
        <D:System name="Root">{system}</D:System>{more}<D:DefaultExperiment stopTime="1"><D:Annotations><C:Annotation>
        <osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="0.125"/></osp:Algorithm></C:Annotation></D:Annotations>
        </D:DefaultExperiment></D:SystemStructureDescription>"#
    )
}

fn connectors(list: &[(&str, &str, &str)]) -> String {
    let connector = |(name, kind, value_type): &(&str, &str, &str)| {
        format!("<D:Connector name=\"{name}\" kind=\"{kind}\">{value_type}</D:Connector>")
    };
    format!("<D:Connectors>{}</D:Connectors>", list.iter().map(connector).collect::<Vec<_>>().concat())
}

/// A parameter set in the structure, in a binding with these attributes and this content.
fn bound(attributes: &str, parameters: &[(&str, &str)], more: &str) -> String {
    let parameter =
        |(name, value): &(&str, &str)| format!("<V:Parameter name=\"{name}\">{value}</V:Parameter>");
    let parameters = parameters.iter().map(parameter).collect::<Vec<_>>().concat();
    format!(
        "<D:ParameterBindings><D:ParameterBinding {attributes}><D:ParameterValues><V:ParameterSet version=\"2.0\" \
         name=\"own\"><V:Parameters>{parameters}</V:Parameters><V:Units><C:Unit name=\"mbar\"><C:BaseUnit kg=\"1\" m=\"-1\" \
         s=\"-2\" factor=\"100\"/></C:Unit></V:Units></V:ParameterSet></D:ParameterValues>{more}</D:ParameterBinding>\
         </D:ParameterBindings>"
    )
}

fn component(name: &str, source: &str, more: &str) -> String {
    format!("<D:Component name=\"{name}\" source=\"{source}\">{more}</D:Component>")
}

/// A connection of two ends, each `element.connector` or a connector of the system.
fn connection(start: &str, end: &str, more: &str) -> String {
    let attributes = |side: &str, end: &str| match end.split_once('.') {
        Some((element, connector)) => format!("{side}Element=\"{element}\" {side}Connector=\"{connector}\""),
        None => format!("{side}Connector=\"{end}\""),
    };
    format!("<D:Connection {} {}>{more}</D:Connection>", attributes("start", start), attributes("end", end))
}

fn elements(list: &[String], connections: &[String]) -> String {
    format!(
        "<D:Elements>{}</D:Elements><D:Connections>{}</D:Connections>",
        list.concat(),
        connections.concat()
    )
}

/// FMUs whose level and input have units, whose flag and failure are an input and an output.
fn bench() -> Bench {
    let bench = Bench::new();
    let flag = "name=\"flag\" valueReference=\"4\" causality=\"parameter\"";
    let giver = DESCRIPTION.replace(
        flag,
        "name=\"flag\" valueReference=\"4\" causality=\"output\" variability=\"discrete\" initial=\"exact\"",
    );
    let taker = DESCRIPTION
        .replace("<Real start=\"1\"/>", "<Real unit=\"kPa\" start=\"1\"/>")
        .replace("<Unit name=\"Pa\">", "<Unit name=\"kPa\"><BaseUnit kg=\"1\" m=\"-1\" s=\"-2\" factor=\"1000\"/></Unit><Unit name=\"Pa\">")
        .replace(flag, "name=\"flag\" valueReference=\"4\" causality=\"input\" variability=\"discrete\"")
        .replace(
            "name=\"fail\" valueReference=\"2\" causality=\"parameter\" variability=\"tunable\"",
            "name=\"fail\" valueReference=\"2\" causality=\"input\" variability=\"discrete\"",
        );
    for (file, description) in [("giver.fmu", giver), ("taker.fmu", taker)] {
        careless::write(&bench.path(file), &description, library());
    }
    bench
}

/// A package with files of the bench, by their paths in it.
fn pack(bench: &Bench, package: &str, structure: &str, files: &[(&str, &str)]) {
    let files: Vec<_> =
        files.iter().map(|(path, file)| (*path, fs::read(bench.path(file)).unwrap())).collect();
    let files = files.iter().map(|(path, content)| (*path, content.as_slice()));
    let all: Vec<_> = iter::once(("SystemStructure.ssd", structure.as_bytes())).chain(files).collect();
    write_archive(&bench.path(package), &all);
}

const FMUS: &[(&str, &str)] = &[("resources/giver.fmu", "giver.fmu"), ("resources/taker.fmu", "taker.fmu")];

/// The last values of some variables, and what the run prints on standard error.
fn run(bench: &Bench, system: &str, record: &str) -> (Vec<f64>, String) {
    let printed = bench.succeeds(&["simulate", system, "--record", record, "--out", "out.csv"]);
    let table = bench.read("out.csv");
    let cells = table.lines().last().unwrap().split(',').skip(1);
    (cells.map(|cell| cell.parse().unwrap()).collect(), printed)
}

/// The system's parameters have hierarchical names, and override those of its elements; its input leads through the
/// inner system, whose connector has no unit, to an input in kPa.
#[test]
fn nested_systems_have_hierarchical_names_and_pass_values_through() {
    let bench = bench();
    let real = |unit: &str| format!("<C:Real unit=\"{unit}\"/>");
    let inner = format!(
        "<D:System name=\"inner\">{}{}{}</D:System>",
        connectors(&[
            ("p", "input", "<C:Real/>"),
            ("sum", "output", ""),
            ("on", "parameter", "<C:Boolean/>")
        ]),
        bound("", &[("a.level", "<V:Real value=\"5\"/>"), ("on", "<V:Boolean value=\"true\"/>")], ""),
        elements(
            &[component("a", "resources/taker.fmu", "")],
            // The second one is written the other way round.
            &[
                connection("p", "a.input", ""),
                connection("sum", "a.level", ""),
                connection("on", "a.flag", "")
            ],
        )
    );
    let level = "name=\"level\" valueReference=\"0\" causality=\"output\"";
    let taker = format!("{level} initial=\"exact\"");
    let description =
        DESCRIPTION.replace(level, &taker).replace("<Real unit=\"Pa\"/>", "<Real unit=\"Pa\" start=\"0\"/>");
    let description = description.replace("<Real start=\"1\"/>", "<Real unit=\"kPa\" start=\"1\"/>");
    careless::write(&bench.path("taker.fmu"), &description, library());
    let system = format!(
        "{}{}{}",
        connectors(&[("drive", "input", &real("bar"))]),
        bound(
            "",
            &[
                ("drive", "<V:Float64 value=\"250\" unit=\"mbar\"/>"),
                ("inner.a.level", "<V:Real value=\"2\" unit=\"mbar\"/>"),
                ("inner.b.level", "<V:Real value=\"7\"/>"),
            ],
            "",
        ),
        elements(
            &[inner, component("last", "resources/taker.fmu", "")],
            &[connection("drive", "inner.p", ""), connection("inner.sum", "last.input", "")]
        )
    );
    let units = "<D:Units><C:Unit name=\"bar\"><C:BaseUnit kg=\"1\" m=\"-1\" s=\"-2\" factor=\"1e5\"/></C:Unit></D:Units>";
    for version in ["1.0", "2.0"] {
        pack(&bench, "nested.ssp", &structure(version, &system, units), FMUS);
        let (values, printed) =
            run(&bench, "nested.ssp", "drive,inner.a:input,inner.a:level,inner.a:flag,last:level");
        // 250 mbar are 25 kPa, and 2 mbar 200 Pa. The last one gets (200 + 25 · k / 8) Pa in kPa.
        let last = 0.125e-3 * (8.0 * 200.0 + 25.0 * 36.0 / 8.0);
        let expected = [0.25, 25.0, 200.0 + 25.0, 1.0, last];
        assert_eq!(values.len(), expected.len());
        // Conversions of units round a few times.
        for (value, wanted) in values.iter().zip(expected) {
            assert!((value - wanted).abs() < 1e-12 * wanted, "{values:?}");
        }
        let note = "note: the parameter set 'own' of the system Root: nothing that can be set is named inner.b.level\n";
        assert_eq!(printed, note);
    }
}

/// A mapping in the structure leaves other parameters out, and one as a file is of any version.
#[test]
fn mapped_parameters_are_transformed_and_renamed() {
    let bench = bench();
    let mapping = |version: &str| {
        format!(
            "<M:ParameterMapping xmlns:M=\"m\" xmlns:C=\"c\" version=\"{version}\"><M:MappingEntry source=\"all.p\" target=\"a.input\">\
             <C:LinearTransformation factor=\"2\" offset=\"3\"/></M:MappingEntry>\
             <M:MappingEntry source=\"all.p\" target=\"b.input\" suppressUnitConversion=\"true\"/>\
             <M:MappingEntry source=\"all.is\" target=\"b.flag\"><C:BooleanMappingTransformation>\
             <C:MapEntry source=\"true\" target=\"false\"/><C:MapEntry source=\"false\" target=\"true\"/>\
             </C:BooleanMappingTransformation></M:MappingEntry>\
             <M:MappingEntry source=\"all.mode\" target=\"b.fail\"><C:EnumerationMappingTransformation>\
             <C:MapEntry source=\"good\" target=\"no\"/></C:EnumerationMappingTransformation></M:MappingEntry>\
             </M:ParameterMapping>"
        )
    };
    bench.write("map.ssm", &mapping("2.0"));
    let parameters = [
        ("p", "<V:Real value=\"40\" unit=\"mbar\"/>"),
        ("is", "<V:Boolean value=\"false\"/>"),
        ("mode", "<V:Enumeration value=\"good\"/>"),
        ("b.input", "<V:Real value=\"1e9\"/>"),
    ];
    let fmus = ["a", "b"].map(|name| component(name, "resources/taker.fmu", ""));
    let files = [FMUS, &[("extra/map.ssm", "map.ssm")]].concat();
    for map in [
        format!("<D:ParameterMapping>{}</D:ParameterMapping>", mapping("1.0")),
        "<D:ParameterMapping source=\"extra/map.ssm\"/>".to_owned(),
    ] {
        let system = format!("{}{}", bound("prefix=\"all.\"", &parameters, &map), elements(&fmus, &[]));
        pack(&bench, "mapped.ssp", &structure("1.0", &system, ""), &files);
        let (values, printed) = run(&bench, "mapped.ssp", "a:input,b:input,b:flag,b:fail");
        // 40 mbar are 4 kPa.
        assert_eq!((values, printed.as_str()), (vec![11.0, 40.0, 1.0, 0.0], ""));
    }
}

/// A Boolean passes between two FMUs; an item of the system's enumeration passes to that of an FMU, in which no item has
/// its number, 7.
#[test]
fn connections_map_booleans_and_items() {
    let bench = bench();
    let system = format!(
        "{}{}{}",
        connectors(&[
            ("mode", "input", "<C:Enumeration name=\"Mode\"/>"),
            ("on", "parameter", "<C:Boolean/>"),
            ("text", "parameter", "<C:String/>")
        ]),
        bound(
            "",
            &[
                ("mode", "<V:Enumeration value=\"calm\"/>"),
                ("on", "<V:Boolean value=\"true\"/>"),
                ("text", "<V:String value=\"Größe\"/>"),
            ],
            "",
        ),
        elements(
            &[component("a", "resources/giver.fmu", ""), component("b", "resources/taker.fmu", "")],
            &[
                connection(
                    "on",
                    "a.fail",
                    "<C:IntegerMappingTransformation><C:MapEntry source=\"1\" target=\"0\"/>\
                     </C:IntegerMappingTransformation>"
                ),
                connection("text", "a.note", ""),
                connection(
                    "a.flag",
                    "b.flag",
                    "<C:BooleanMappingTransformation><C:MapEntry source=\"0\" target=\"1\"/>\
                     </C:BooleanMappingTransformation>"
                ),
                connection(
                    "mode",
                    "b.fail",
                    "<C:EnumerationMappingTransformation><C:MapEntry source=\"calm\" \
                     target=\"no\"/><C:MapEntry source=\"other\" target=\"none\"/></C:EnumerationMappingTransformation>"
                ),
            ],
        )
    );
    let modes = "<D:Enumerations><C:Enumeration name=\"Mode\"><C:Item name=\"calm\" value=\"7\"/></C:Enumeration></D:Enumerations>";
    pack(&bench, "tables.ssp", &structure("1.0", &system, modes), FMUS);
    let (values, printed) = run(&bench, "tables.ssp", "mode,b:fail,a:fail,a:flag,b:flag");
    assert_eq!((values, printed.as_str()), (vec![7.0, 0.0, 0.0, 0.0, 1.0], ""));
    let refused = structure(
        "1.0",
        &system.replace("\"other\"", "\"calm\"").replace("target=\"no\"", "target=\"nil\""),
        modes,
    );
    pack(&bench, "tables.ssp", &refused, FMUS);
    let message = bench.refusal(&["simulate", "tables.ssp"]);
    assert!(message.contains("the connections of Root: mode to b.fail: there is no item nil"), "{message}");
}

/// Both references stand for the same signal.
#[test]
fn signals_of_a_dictionary_connect_systems() {
    let bench = bench();
    let reference = "<D:SignalDictionaryReference name=\"bus\" dictionary=\"signals\"><D:Connectors><D:Connector name=\"s\" \
                     kind=\"inout\"/></D:Connectors></D:SignalDictionaryReference>";
    let inner = |name: &str, connection: String| {
        let elements =
            elements(&[component("a", "resources/giver.fmu", ""), reference.to_owned()], &[connection]);
        format!("<D:System name=\"{name}\">{elements}</D:System>")
    };
    let systems =
        [inner("one", connection("a.level", "bus.s", "")), inner("two", connection("bus.s", "a.input", ""))];
    let dictionary = "<D:SignalDictionaries><D:SignalDictionary name=\"signals\" source=\"none.ssb\"/></D:SignalDictionaries>";
    let system = format!("{}{dictionary}", elements(&systems, &[]));
    pack(&bench, "bus.ssp", &structure("1.0", &system, ""), FMUS);
    let (values, _) = run(&bench, "bus.ssp", "one.a:level,two.a:level");
    // The first level is k / 8 after k steps of input 1.
    assert_eq!(values, [1.0, 0.125 * 36.0 / 8.0]);
    pack(
        &bench,
        "bus.ssp",
        &structure("1.0", &system.replace("name=\"signals\"", "name=\"signal\""), ""),
        FMUS,
    );
    let message = bench.refusal(&["simulate", "bus.ssp"]);
    assert!(message.contains("one.bus: there is no signal dictionary signals"), "{message}");
}

/// Of the package, another structure; what the component sets overrides what the structure sets.
#[test]
fn packages_and_structures_are_components() {
    let bench = bench();
    let variant = |value: &str| {
        let set = bound("", &[("u", &format!("<V:Real value=\"{value}\"/>"))], "");
        let fmu = elements(&[component("a", "../fmus/giver.fmu", "")], &[connection("u", "a.input", "")]);
        structure("1.0", &format!("{}{set}{fmu}", connectors(&[("u", "input", "<C:Real/>")])), "")
    };
    bench.write("other.ssd", &variant("3"));
    bench.write("own.ssv", &parameter_set("u", "Real", "4"));
    let inner = [("folder/other.ssd", "other.ssd"), ("fmus/giver.fmu", "giver.fmu")];
    pack(&bench, "inner.ssp", &structure("1.0", "", ""), &inner);
    let binding = "<D:ParameterBindings><D:ParameterBinding source=\"own.ssv\"/></D:ParameterBindings>";
    let components = [
        component("package", "inner%2Essp#folder/other.ssd", ""),
        component("changed", "./inner.ssp#folder/other.ssd", binding),
        component("plain", "folder/other.ssd", binding),
    ];
    let outer = structure("1.0", &elements(&components, &[]), "");
    let all = [&inner[..], &[("inner.ssp", "inner.ssp"), ("own.ssv", "own.ssv")]].concat();
    pack(&bench, "outer.ssp", &outer, &all);
    let record = "package.u,package.a:level,changed.a:level,plain.a:level";
    assert_eq!(run(&bench, "outer.ssp", record).0, [3.0, 3.0, 4.0, 4.0]);
    bench.write("other.ssd", &variant("3").replace("../fmus", "../../fmus"));
    pack(&bench, "outer.ssp", &outer, &all);
    let message = bench.refusal(&["simulate", "outer.ssp"]);
    assert!(
        message.contains("component plain.a: '../../fmus/giver.fmu' is not a file in the package"),
        "{message}"
    );
    // An error in the package within names both.
    bench.write("other.ssd", &variant("3"));
    pack(&bench, "inner.ssp", &structure("1.0", "", ""), &inner[..1]);
    pack(&bench, "outer.ssp", &outer, &[("inner.ssp", "inner.ssp")]);
    let message = bench.refusal(&["simulate", "outer.ssp"]);
    assert!(message.contains("cannot open outer.ssp/inner.ssp/fmus/giver.fmu: "), "{message}");
    // One that contains itself.
    bench.write("self.ssd", &structure("1.0", &elements(&[component("s", "self.ssd", "")], &[]), ""));
    let message = bench.refusal(&["simulate", "self.ssd"]);
    assert!(message.contains("there are more than 10 systems around it"), "{message}");
}

/// What is not packed may be anywhere. An FMU has its parameters in it, and its own output as an input.
#[test]
fn a_structure_runs_where_it_is() {
    let bench = bench();
    fs::create_dir_all(bench.path("a/b")).unwrap();
    let fmu = Fmu {
        model_identifier: "careless",
        model_description: DESCRIPTION,
        version: Version::Two,
        libraries: vec![(Platform::host().unwrap(), library().to_vec())],
        files: vec![("resources/own.ssv".to_owned(), parameter_set("flag", "Boolean", "true").into_bytes())],
    };
    fmu.write(fs::File::create(bench.path("a/own.fmu")).unwrap()).unwrap();
    let binding = "<D:ParameterBindings><D:ParameterBinding source=\"resources/own.ssv\" sourceBase=\"component\"/>\
                   </D:ParameterBindings>";
    let system = elements(&[component("a", "../own.fmu", binding)], &[connection("a.level", "a.input", "")]);
    let text = structure("1.0", &system, "");
    bench.write("a/b/any.ssd", &text);
    // The input is 0, as the level is at first.
    assert_eq!(run(&bench, "a/b/any.ssd", "level,input,flag").0, [0.0, 0.0, 1.0]);
    bench.write("a/b/any.ssd", &text.replace("resources/own.ssv", "modelDescription.xml"));
    let message = bench.refusal(&["simulate", "a/b/any.ssd"]);
    let reason =
        "the component a: modelDescription.xml: the root element is fmiModelDescription, not ParameterSet";
    assert!(message.contains(reason), "{message}");
}

/// Values of connectors that drive nothing.
#[test]
fn a_system_without_fmus_records_the_values_of_its_connectors() {
    let bench = bench();
    let inner =
        format!("<D:System name=\"inner\">{}</D:System>", connectors(&[("k", "parameter", "<C:Integer/>")]));
    let own = connectors(&[("z", "input", "<C:Real/>"), ("a", "input", "<C:Real/>"), ("open", "input", "")]);
    let set = bound(
        "",
        &[
            ("z", "<V:Real value=\"-3\"/>"),
            ("a", "<V:Real value=\"2\"/>"),
            ("inner.k", "<V:Integer value=\"7\"/>"),
        ],
        "",
    );
    pack(&bench, "design.ssp", &structure("1.0", &format!("{own}{set}{}", elements(&[inner], &[])), ""), &[]);
    let printed = bench.succeeds(&["simulate", "design.ssp", "--out", "out.csv"]);
    assert_eq!(printed, "note: Root has no FMUs: the values of its connectors are recorded\n");
    let table = bench.read("out.csv");
    assert!(table.starts_with("time,z,a,inner.k\n") && table.ends_with("\n1.0,-3.0,2.0,7.0\n"), "{table}");
}

#[test]
fn what_a_system_has_wrong_is_named() {
    let bench = bench();
    let system = |connections: &[String]| {
        let list = [component("a", "resources/giver.fmu", ""), component("b", "resources/taker.fmu", "")];
        let connectors =
            connectors(&[("u", "input", "<C:Real unit=\"V\"/>"), ("v", "input", ""), ("y", "output", "")]);
        format!("{connectors}{}", elements(&list, connections))
    };
    let volt =
        "<D:Units><C:Unit name=\"V\"><C:BaseUnit kg=\"1\" m=\"2\" s=\"-3\" A=\"-1\"/></C:Unit></D:Units>";
    let inner = "<D:System name=\"s\"><D:Connectors><D:Connector name=\"i\" kind=\"input\"/><D:Connector name=\"o\" \
                 kind=\"output\"/></D:Connectors><D:Connections><D:Connection startConnector=\"i\" endConnector=\"o\"/>\
                 </D:Connections></D:System>";
    let table = "<C:BooleanMappingTransformation><C:MapEntry source=\"0\" target=\"1\"/></C:BooleanMappingTransformation>";
    let linear = "<C:LinearTransformation factor=\"2\"/>";
    for (text, reason) in [
        (system(&[connection("u", "b.input", "")]), "u to b.input: the unit V does not convert to kPa"),
        (system(&[connection("u", "v", "")]), "u and v both give values"),
        (system(&[connection("a.input", "b.input", "")]), "a.input and b.input both take values"),
        (system(&[connection("x", "b.input", "")]), "Root has no connector x"),
        (
            system(&[connection("v", "b.input", ""), connection("a.level", "b.input", "")]),
            "b.input has two sources: v and a.level",
        ),
        (
            system(&[connection("a.level", "b.note", "")]),
            "b.note is a parameter, which cannot have the value of a.level",
        ),
        (
            system(&[connection("s.o", "s.i", ""), connection("s.o", "b.input", "")])
                .replace("<D:Elements>", &format!("<D:Elements>{inner}")),
            "depends on itself",
        ),
        (
            system(&[connection("a.level", "s.i", linear), connection("s.o", "b.input", table)])
                .replace("<D:Elements>", &format!("<D:Elements>{inner}")),
            "s.o to b.input: a table follows a linear transformation",
        ),
    ] {
        pack(&bench, "wrong.ssp", &structure("1.0", &text, volt), FMUS);
        let message = bench.refusal(&["simulate", "wrong.ssp"]);
        assert!(
            message.contains("the system in wrong.ssp: ") && message.contains(reason),
            "{reason}: {message}"
        );
    }
}

/// As the source of a component names one.
#[test]
fn another_structure_of_a_package_runs() {
    let bench = bench();
    let variant = |value: &str| {
        let connector = connectors(&[("u", "input", "<C:Real/>")]);
        let set = bound("", &[("u", &format!("<V:Real value=\"{value}\"/>"))], "");
        let connection = connection("u", "giver.input", "");
        let giver = component("giver", "../resources/giver.fmu", "");
        structure("1.0", &format!("{connector}{set}{}", elements(&[giver], &[connection])), "")
    };
    bench.write("variant.ssd", &variant("3"));
    pack(
        &bench,
        "v.ssp",
        &variant("2").replace("../resources", "resources"),
        &[FMUS, &[("other/Variant.ssd", "variant.ssd")]].concat(),
    );
    assert_eq!(run(&bench, "v.ssp", "giver:level").0, [2.0]);
    assert_eq!(run(&bench, "v.ssp#other/Variant.ssd", "giver:level").0, [3.0]);
    for (subject, reason) in [
        ("v.ssp#None.ssd", "v.ssp/None.ssd"),
        ("v.ssp#../None.ssd", "'../None.ssd' is not a file in the package"),
        ("w.ssp#Variant.ssd", "w.ssp#Variant.ssd"),
    ] {
        let message = bench.refusal(&["simulate", subject]);
        assert!(message.contains(reason), "{message}");
    }
    let message = bench.refusal(&["simulate", "v.ssp#other/Variant.ssd", "--out", "v.ssp/out.csv"]);
    assert!(message.contains("v.ssp"), "{message}");
}

#[test]
fn names_that_tell_no_element_are_refused() {
    let bench = bench();
    let giver = |name: &str| component(name, "resources/giver.fmu", "");
    let inner = "<D:System name=\"a\"><D:Elements/></D:System>".to_owned();
    for (list, reason) in [
        (vec![giver("a"), giver("b"), giver("a")], "the system Root: two elements are named a"),
        (vec![giver("a"), inner], "the system Root: two elements are named a"),
        (
            vec![giver("a:b")],
            "the component a:b: the name a:b has a colon, which ends an FMU's name, as in FMU:variable",
        ),
    ] {
        pack(&bench, "names.ssp", &structure("1.0", &elements(&list, &[]), ""), FMUS);
        let message = bench.refusal(&["simulate", "names.ssp"]);
        assert!(message.contains(reason), "{message}");
    }
    bench.scenario(1.0, "");
    let scenario = bench.read("scenario.toml").replace("\"alone\"", "\"al:one\"");
    bench.write("scenario.toml", &scenario);
    let message = bench.refusal(&["simulate", "scenario.toml"]);
    let reason = "scenario.toml, line 4, fmu[1].name: the name al:one has a colon, which ends an FMU's name";
    assert!(message.contains(reason), "{message}");
}

/// Each structure names the next forty times, so that there would be millions.
#[test]
fn a_system_has_a_bounded_number_of_elements() {
    let bench = bench();
    for level in 0..4 {
        let next = format!("level{}.ssd", level + 1);
        let list: Vec<_> = (0..40).map(|index| component(&format!("e{index}"), &next, "")).collect();
        bench.write(&format!("level{level}.ssd"), &structure("1.0", &elements(&list, &[]), ""));
    }
    bench.write("level4.ssd", &structure("1.0", &elements(&[], &[]), ""));
    let message = bench.refusal(&["simulate", "level0.ssd"]);
    assert!(message.contains("there are more than 10000 elements"), "{message}");
    // A few of them are few.
    bench.succeeds(&["simulate", "level3.ssd"]);
}

#[test]
fn attributes_that_ssp_does_not_have_are_ignored_with_a_note() {
    let bench = bench();
    let giver = |name: &str| {
        component(name, "resources/giver.fmu", "")
            .replace("<D:Component", "<D:Component color=\"red\" description=\"of it\" id=\"1\"")
    };
    pack(&bench, "red.ssp", &structure("1.0", &elements(&[giver("a"), giver("b")], &[]), ""), FMUS);
    let (_, printed) = run(&bench, "red.ssp", "a:level");
    let note = "a Component of SSP has no attribute color, which is ignored";
    assert_eq!(printed.matches(note).count(), 1, "{printed}");
    assert!(printed.contains("note: SystemStructure.ssd: line "), "{printed}");
}
