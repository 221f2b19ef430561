//! Broken FMUs with the rules that find them.

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::Good::{Fmi2, Fmi3, Library};
use super::{BUILD, DESCRIPTION, Files, Good, TERMINALS, library, zipped};

/// A small edit of a good FMU.
pub enum Edit {
    /// Of a file: the first occurrence of a text, and its replacement.
    Xml(&'static str, &'static str, &'static str),
    Files(fn(&mut Files)),
    /// Of the archive of the files.
    Archive(fn(&Files) -> Vec<u8>),
}
use Edit::{Archive, Xml};

/// The name of the break, the rule, the good FMU and its edit.
type Break = (&'static str, &'static str, Good, Edit);

pub fn all() -> impl Iterator<Item = &'static Break> {
    [ARCHIVES, DESCRIPTIONS, VARIABLES, STRUCTURES, LIBRARIES].into_iter().flatten()
}

const fn xml(text: &'static str, replacement: &'static str) -> Edit {
    Xml(DESCRIPTION, text, replacement)
}

const ARCHIVES: &[Break] = &[
    ("text file", "archive-format", Fmi2, Archive(|_| b"no archive".to_vec())),
    (
        "duplicate path",
        "archive-duplicate",
        Fmi2,
        Archive(|files| replaced(&with_file(files, "sources/pool.c"), b"sources/pool.c", b"sources/tank.c")),
    ),
    (
        "paths differing in case",
        "archive-duplicate",
        Fmi2,
        Archive(|files| with_file(files, "sources/TANK.C")),
    ),
    (
        "entry below a file",
        "archive-file-and-folder",
        Fmi2,
        Archive(|files| with_file(files, "modelDescription.xml/x")),
    ),
    (
        "backslash in path",
        "archive-backslash",
        Fmi2,
        Archive(|files| replaced(&with_file(files, "sources/pool.c"), b"sources/pool.c", b"sources\\pool.c")),
    ),
    (
        "path out of the folder",
        "archive-path",
        Fmi2,
        Archive(|files| with_file(files, "resources/../../pool.c")),
    ),
    (
        "symbolic link",
        "archive-link",
        Fmi2,
        Archive(|files| {
            let mut zip = ZipWriter::new_append(std::io::Cursor::new(zipped(files))).unwrap();
            zip.add_symlink("resources/link", "/etc/passwd", SimpleFileOptions::default()).unwrap();
            zip.finish().unwrap().into_inner()
        }),
    ),
    ("encrypted entry", "archive-encryption", Fmi2, Archive(|files| header(files, 6, 1))),
    ("bzip2 compression", "archive-compression", Fmi2, Archive(|files| header(files, 8, 12))),
    ("wrong checksum", "archive-damaged", Fmi2, Archive(|files| header(files, 14, 1))),
    (
        "stray top-level file",
        "archive-stray",
        Fmi2,
        Edit::Files(|files| {
            files.insert("build.log".to_owned(), vec![]);
        }),
    ),
    (
        "elements nested 101 deep",
        "limit",
        Fmi2,
        Edit::Files(|files| {
            let deep = format!("{}{}", "<a>".repeat(101), "</a>".repeat(101));
            files.insert(DESCRIPTION.to_owned(), deep.into_bytes());
        }),
    ),
    (
        "modelDescription.xml in a folder",
        "description-missing",
        Fmi2,
        Edit::Files(|files| {
            let description = files.remove(DESCRIPTION).unwrap();
            files.insert("resources/modelDescription.xml".to_owned(), description);
        }),
    ),
];

#[rustfmt::skip]
const DESCRIPTIONS: &[Break] = &[
    ("wrong encoding", "xml-encoding", Fmi2, xml("UTF-8", "ISO-8859-1")),
    ("invalid UTF-8", "xml-encoding", Fmi2, Edit::Files(|files| { let text = files.get_mut(DESCRIPTION).unwrap(); text.extend(b"<!-- \xe9 -->"); })),
    ("expanding entities", "xml-doctype", Fmi2, xml("<fmiM", r#"<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;">]><fmiM"#)),
    ("unclosed element", "xml-syntax", Fmi2, xml("</ModelVariables>", "")),
    ("nonexistent version", "version", Fmi2, xml(r#"fmiVersion="2.0""#, r#"fmiVersion="2.1""#)),
    ("FMI 1.0", "version", Fmi2, xml(r#"fmiVersion="2.0""#, r#"fmiVersion="1.0""#)),
    ("unknown element", "schema-element", Fmi2, xml("<LogCategories>", "<Extra/><LogCategories>")),
    ("elements out of order", "schema-element", Fmi3, xml("<ClockedState valueReference=\"8\"/>\n    <InitialUnknown valueReference=\"2\"/>", "<InitialUnknown valueReference=\"2\"/>\n    <ClockedState valueReference=\"8\"/>")),
    ("terminals outside their list", "schema-element", Fmi3, Xml(TERMINALS, "<Terminals>", "<Terminals/><Terminals>")),
    ("no model name", "schema-attribute", Fmi2, xml(r#"modelName="Tank""#, "")),
    ("unknown attribute", "schema-attribute", Fmi3, xml(r#"modelName="Tank""#, r#"modelName="Tank" guid="{a-guid}""#)),
    ("nonexistent causality", "schema-value", Fmi2, xml(r#"causality="input""#, r#"causality="entry""#)),
    ("nonnumeric start value", "schema-value", Fmi2, xml(r#"<Real start="0"/>"#, r#"<Real start="0,5"/>"#)),
    ("duplicate interface", "interface", Fmi2, xml(r#"<CoSimulation modelIdentifier="tank"/>"#, r#"<CoSimulation modelIdentifier="tank"/><CoSimulation modelIdentifier="tank"/>"#)),
    ("hyphen in model identifier", "model-identifier", Fmi2, xml(r#"<CoSimulation modelIdentifier="tank""#, r#"<CoSimulation modelIdentifier="a-tank""#)),
    ("empty GUID", "guid", Fmi2, xml("{a-guid}", "")),
    ("no number of event indicators", "event-indicator-count", Fmi2, xml(r#" numberOfEventIndicators="0""#, "")),
    ("date in local time", "generation-date", Fmi2, xml("12:00:00Z", "12:00:00+02:00")),
    ("experiment ending before its start", "default-experiment", Fmi2, xml(r#"stopTime="10""#, r#"stopTime="-10""#)),
    ("experiment step of 0 s", "default-experiment", Fmi2, xml(r#"stepSize="0.1""#, r#"stepSize="0""#)),
    ("states serialized but not saved", "capability", Fmi2, xml(r#"canGetAndSetFMUstate="true""#, "")),
    ("duplicate log category", "log-category", Fmi2, xml("logStatusError", "logEvents")),
    ("duplicate unit", "unit-name", Fmi2, xml(r#"<Unit name="m/s"/>"#, r#"<Unit name="m/s"/><Unit name="m/s"/>"#)),
    ("display unit factor of 0", "unit-factor", Fmi2, xml(r#"factor="1000""#, r#"factor="0""#)),
    ("inverse display unit with offset", "unit-factor", Fmi3, xml(r#"inverse="true""#, r#"inverse="true" offset="1""#)),
    ("undefined unit", "unit-defined", Fmi2, xml(r#"unit="m/s" derivative"#, r#"unit="km/h" derivative"#)),
    ("undefined display unit", "display-unit", Fmi2, xml(r#"displayUnit="mm""#, r#"displayUnit="cm""#)),
    ("type named like a variable", "type-name", Fmi2, xml(r#"<SimpleType name="Mode">"#, r#"<SimpleType name="area"><Boolean/></SimpleType><SimpleType name="Mode">"#)),
    ("undefined type", "type-defined", Fmi2, xml(r#"declaredType="Mode""#, r#"declaredType="Modes""#)),
    ("type of another kind", "type-defined", Fmi3, xml(r#"<Float32 name="matrix""#, r#"<Float32 declaredType="Length" name="matrix""#)),
    ("duplicate enumeration item", "enumeration-item", Fmi2, xml(r#"name="on""#, r#"name="off""#)),
    ("missing source file", "sources", Fmi2, xml(r#"<File name="tank.c"/>"#, r#"<File name="pool.c"/>"#)),
    ("build of another model", "sources", Fmi3, Xml(BUILD, r#"modelIdentifier="tank""#, r#"modelIdentifier="pool""#)),
    ("terminal without variable", "terminals", Fmi3, Xml(TERMINALS, r#"variableName="inflow""#, r#"variableName="outflow""#)),
];

#[rustfmt::skip]
const VARIABLES: &[Break] = &[
    ("duplicate variable name", "variable-name", Fmi2, xml(r#"name="capacity""#, r#"name="count""#)),
    ("variable named like an alias", "variable-name", Fmi3, xml(r#"name="note""#, r#"name="height""#)),
    ("structured name with blank", "name-syntax", Fmi2, xml(r#"name="capacity""#, r#"name="total capacity""#)),
    ("flat name with tab", "name-syntax", Fmi2, Edit::Files(|files| describe(files, &[("\"structured\"", "\"flat\""), ("capacity", "capa&#9;city")]))),
    ("duplicate value reference", "value-reference", Fmi3, xml(r#"valueReference="11""#, r#"valueReference="12""#)),
    ("alias with different start value", "alias", Fmi2, xml(r#"valueReference="1"><Real unit="m"/>"#, r#"valueReference="1" initial="approx"><Real unit="m" start="2"/>"#)),
    ("alias with different unit", "alias", Fmi2, xml(r#"<Real unit="m"/>"#, r#"<Real unit="m/s"/>"#)),
    ("continuous parameter", "causality", Fmi2, xml(r#"variability="fixed"><Real start="2""#, r#"variability="continuous"><Real start="2""#)),
    ("input with initial", "initial", Fmi2, xml(r#"causality="input""#, r#"causality="input" initial="exact""#)),
    ("continuous integer", "continuous-type", Fmi2, xml(r#"variability="discrete""#, "")),
    ("no independent variable", "independent", Fmi3, xml(r#"causality="independent""#, r#"causality="local""#)),
    ("input without start value", "start-missing", Fmi2, xml(r#"<Real start="0"/>"#, "<Real/>")),
    ("calculated variable with start value", "start-forbidden", Fmi2, xml(r#"derivative="2"/>"#, r#"derivative="2" start="0"/>"#)),
    ("start value above max", "start-range", Fmi2, xml(r#"start="2" min="1""#, r#"start="5" min="1""#)),
    ("start value not an item", "start-range", Fmi2, xml(r#"declaredType="Mode" start="1""#, r#"declaredType="Mode" start="7""#)),
    ("three start values for two elements", "start-count", Fmi3, xml(r#"start="1 2""#, r#"start="1 2 3""#)),
    ("min above max", "range", Fmi2, xml(r#"variability="fixed"><Real/>"#, r#"variability="fixed"><Real min="2" max="1"/>"#)),
    ("nominal value of 0", "nominal", Fmi2, xml(r#"<Real start="0"/>"#, r#"<Real start="0" nominal="0"/>"#)),
    ("negative state nominal", "state-nominal", Fmi2, xml(r#"nominal="2""#, r#"nominal="-2""#)),
    ("infinite max", "finite", Fmi2, xml(r#"max="3""#, r#"max="INF""#)),
    ("derivative of nothing", "derivative", Fmi2, xml(r#"<Real start="0"/>"#, r#"<Real start="0" derivative="99"/>"#)),
    ("reinit without Model Exchange", "reinit", Fmi2, xml("<ModelExchange modelIdentifier=\"tank\" canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\">\n    <SourceFiles><File name=\"tank.c\"/></SourceFiles>\n  </ModelExchange>", "")),
    ("reinit on input", "reinit", Fmi2, xml(r#"<Real start="0"/>"#, r#"<Real start="0" reinit="true"/>"#)),
    ("dimension of 0", "dimension", Fmi3, xml(r#"<Dimension start="3"/>"#, r#"<Dimension start="0"/>"#)),
    ("dimension from input", "dimension", Fmi3, xml(r#"<Dimension valueReference="4"/>"#, r#"<Dimension valueReference="3"/>"#)),
    ("Clock without interval", "clock", Fmi3, xml(r#"intervalDecimal="0.1""#, "")),
    ("variable clocked by a number", "clocked", Fmi3, xml(r#"clocks="7""#, r#"clocks="3""#)),
    ("input as previous value", "previous", Fmi3, xml(r#"previous="9""#, r#"previous="3""#)),
    ("intermediate update of parameter", "intermediate-update", Fmi3, xml(r#"<Enumeration name="mode""#, r#"<Enumeration intermediateUpdate="true" name="mode""#)),
];

#[rustfmt::skip]
const STRUCTURES: &[Break] = &[
    ("dependency on no variable", "structure-reference", Fmi2, xml(r#"dependencies="2 4""#, r#"dependencies="2 99""#)),
    ("duplicate dependency", "structure-duplicate", Fmi2, xml(r#"dependencies="4 5""#, r#"dependencies="4 4""#)),
    ("duplicate output", "structure-duplicate", Fmi3, xml("<Output ", r#"<Output valueReference="1"/><Output "#)),
    ("initial unknowns out of order", "structure-order", Fmi2, xml("<Unknown index=\"7\" dependencies=\"\"/>\n      <Unknown index=\"8\" dependencies=\"5\"/>", "<Unknown index=\"8\" dependencies=\"5\"/>\n      <Unknown index=\"7\" dependencies=\"\"/>")),
    ("dependencies out of order", "dependency-order", Fmi2, xml(r#"dependencies="4 5""#, r#"dependencies="5 4""#)),
    ("one kind for two dependencies", "dependency-kind", Fmi2, xml(r#""dependent dependent""#, r#""dependent""#)),
    ("constant factor of integer", "dependency-kind-use", Fmi2, xml(r#""dependent dependent""#, r#""dependent constant""#)),
    ("output depending on parameter", "dependency-known", Fmi2, xml(r#"index="2" dependencies="2""#, r#"index="2" dependencies="5""#)),
    ("unlisted output", "outputs", Fmi2, xml(r#"<Unknown index="2" dependencies="2"/>"#, "")),
    ("local among outputs", "outputs", Fmi3, xml("<Output ", r#"<Output valueReference="10"/><Output "#)),
    ("input among derivatives", "derivatives", Fmi2, xml("<Derivatives>", r#"<Derivatives><Unknown index="4"/>"#)),
    ("two derivatives of one state", "derivatives", Fmi2, Edit::Files(second_derivative)),
    ("unlisted initial unknown", "initial-unknowns", Fmi2, xml(r#"<Unknown index="8" dependencies="5"/>"#, "")),
    ("start value as initial unknown", "initial-unknowns", Fmi3, xml(r#"<InitialUnknown valueReference="2"/>"#, r#"<InitialUnknown valueReference="1"/><InitialUnknown valueReference="2"/>"#)),
    ("unlisted clocked state", "clocked-states", Fmi3, xml(r#"<ClockedState valueReference="8"/>"#, "")),
    ("integer event indicator", "event-indicators", Fmi3, xml(r#"<EventIndicator valueReference="10"/>"#, r#"<EventIndicator valueReference="4"/>"#)),
];

const LIBRARIES: &[Break] = &[
    (
        "neither library nor sources",
        "library-missing",
        Fmi2,
        Edit::Files(|files| {
            files.remove("sources/tank.c");
            describe(files, &[("<SourceFiles><File name=\"tank.c\"/></SourceFiles>", "")]);
        }),
    ),
    ("misnamed library", "library-name", Library, Edit::Files(|files| move_library(files, "tank", "pool"))),
    (
        "folder for no platform",
        "library-platform",
        Library,
        Edit::Files(|files| move_library(files, "binaries/", "binaries/linux/")),
    ),
    // In an ELF header, byte 18 is the processor: that of RISC-V is 0xf3.
    (
        "library for another processor",
        "library-format",
        Library,
        Edit::Files(|files| library_of(files)[18] = 0xf3),
    ),
    (
        "truncated library",
        "library-format",
        Library,
        Edit::Files(|files| {
            let half = library_of(files).len() / 2;
            library_of(files).truncate(half);
        }),
    ),
    (
        "missing function",
        "library-function",
        Library,
        Edit::Files(|files| change(files, b"fmi2DoStep\0", b"fmi2DoLeap\0")),
    ),
    (
        "missing Model Exchange function",
        "library-function",
        Library,
        Edit::Files(|files| change(files, b"fmi2NewDiscreteStates\0", b"fmi2OldDiscreteStates\0")),
    ),
    (
        "no library for second interface",
        "library-name",
        Library,
        xml(r#"<CoSimulation modelIdentifier="tank"/>"#, r#"<CoSimulation modelIdentifier="tank_steps"/>"#),
    ),
    (
        "library from another build",
        "library-guid",
        Library,
        Edit::Files(|files| change(files, b"{a-guid}", b"{b-guid}")),
    ),
    (
        "library needing Python loaded",
        "library-python",
        Library,
        Edit::Files(|files| change(files, b"Qy_Import\0", b"Py_Import\0")),
    ),
    (
        "library needing another",
        "library-dependency",
        Library,
        Edit::Files(|files| change(files, b"libm.so.6\0", b"libx.so.6\0")),
    ),
    // The type of the program header PT_GNU_STACK, and its flags: readable, writable, and now executable.
    (
        "executable stack",
        "library-loading",
        Library,
        Edit::Files(|files| {
            change(files, &[0x51, 0xe5, 0x74, 0x64, 6, 0, 0, 0], &[0x51, 0xe5, 0x74, 0x64, 7, 0, 0, 0]);
        }),
    ),
];

/// Appends a variable that is also a derivative of the tank's level, which is the second variable.
fn second_derivative(files: &mut Files) {
    let variable = r#"<ScalarVariable name="rise" valueReference="9"><Real unit="m/s" derivative="2"/></ScalarVariable>"#;
    let edits = [
        ("</ModelVariables>", &*format!("{variable}</ModelVariables>")),
        ("</Derivatives>", r#"<Unknown index="10" dependencies="4"/></Derivatives>"#),
        ("</InitialUnknowns>", r#"<Unknown index="10" dependencies="4"/></InitialUnknowns>"#),
    ];
    describe(files, &edits);
}

/// Replaces texts in the description.
fn describe(files: &mut Files, edits: &[(&str, &str)]) {
    let mut description = String::from_utf8(files[DESCRIPTION].clone()).unwrap();
    for (text, replacement) in edits {
        assert!(description.contains(text), "{text}");
        description = description.replacen(text, replacement, 1);
    }
    files.insert(DESCRIPTION.to_owned(), description.into_bytes());
}

fn library_of(files: &mut Files) -> &mut Vec<u8> {
    files.get_mut(library::PATH).unwrap()
}

fn change(files: &mut Files, bytes: &[u8], replacement: &[u8]) {
    *library_of(files) = replaced(library_of(files), bytes, replacement);
}

fn move_library(files: &mut Files, text: &str, replacement: &str) {
    let library = files.remove(library::PATH).unwrap();
    files.insert(library::PATH.replace(text, replacement), library);
}

/// A copy with all occurrences of some bytes replaced by others of the same length.
fn replaced(bytes: &[u8], text: &[u8], replacement: &[u8]) -> Vec<u8> {
    assert_eq!(text.len(), replacement.len());
    let mut changed = bytes.to_vec();
    let places: Vec<_> = (0..bytes.len()).filter(|&place| bytes[place..].starts_with(text)).collect();
    assert!(!places.is_empty());
    for place in places {
        changed[place..place + text.len()].copy_from_slice(replacement);
    }
    changed
}

fn with_file(files: &Files, path: &str) -> Vec<u8> {
    let mut files = files.clone();
    files.insert(path.to_owned(), vec![]);
    zipped(&files)
}

/// The archive with a byte of the last file's headers changed: in its local header, which begins with `PK` 3 4, and
/// two bytes later in the central directory, which begins with `PK` 1 2.
fn header(files: &Files, place: usize, value: u8) -> Vec<u8> {
    let mut archive = zipped(files);
    for (signature, place) in [(b"PK\x03\x04", place), (b"PK\x01\x02", place + 2)] {
        let last = (0..archive.len()).rfind(|&start| archive[start..].starts_with(signature)).unwrap();
        archive[last + place] = value;
    }
    archive
}
