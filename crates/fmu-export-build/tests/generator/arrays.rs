//! Arrays: what is generated for them follows by rule, whatever their size.

use std::fs;

use fmu_export_build::{Fmi, Generated, Interfaces, Version, generate_into};

use super::{folder, package, read};

/// What is generated for a rod of some cells: each reads its neighbors.
fn rod(cells: usize, version: Version, more: &str) -> Generated {
    let folder = folder("rod");
    let file = folder.join("rod.json");
    let declaration = format!(
        r#"{{"variables": [
            {{"name": "left", "causality": "input", "unit": "K", "start": 0}},
            {{"name": "heat", "causality": "input", "unit": "K/s", "dimensions": [{cells}], "start": 0, "min": 0}},
            {{"name": "T", "unit": "K", "dimensions": [{cells}], "start": 300, "nominal": 300, "min": 0, "strict_min": true,
              "derivative": {{"reads": ["T[i-1]", "T[i]", "T[i+1]", "left", "heat[i]"]}}}},
            {{"name": "mean", "causality": "output", "unit": "K", "reads": ["T"]}},
            {{"name": "slopes", "causality": "output", "unit": "K/s", "dimensions": [{cells}], "reads": ["der(T[i])"]}}
            {more}
        ]}}"#
    );
    fs::write(&file, declaration).expect("the folder for tests is writable");
    let fmi = Fmi { version, interfaces: Interfaces::Both };
    generate_into(&file, &folder, &package(), fmi).unwrap_or_else(|error| panic!("{error}"))
}

/// But for the digits of sizes and value references.
#[test]
fn generated_rust_and_page_do_not_grow_with_the_number_of_elements() {
    let without_digits = |text: String| text.replace(|character: char| character.is_ascii_digit(), "");
    for version in Version::ALL {
        let [few, many] = [300, 3000].map(|cells| rod(cells, version, ""));
        let without_guid = |generated: &Generated| {
            let text = read(&generated.variables);
            let (before, rest) = text.split_once("guid: ").expect("there is a guid");
            without_digits(before.to_owned() + rest.split_once('\n').expect("its line ends").1)
        };
        let [few_text, many_text] = [&few, &many].map(without_guid);
        assert!(
            few_text == many_text,
            "{} bytes for 300 cells, {} for 3000",
            few_text.len(),
            many_text.len()
        );
        let [few, many] = [few, many].map(|generated| read(&generated.documentation).len());
        assert!(many - few < 50, "{few} bytes for 300 cells, {many} for 3000");
    }
}

/// By hand: 1 time, 2 left, 3 to 5 heat, 6 T[1], 7 der(T[1]), … 11 der(T[3]), 12 mean, 13 to 15 slopes.
#[test]
fn elements_depend_on_those_that_they_name() {
    let xml = read(&rod(3, Version::Two, "").model_description);
    for (index, dependencies) in
        [(7, "2 3 6 8"), (9, "2 4 6 8 10"), (11, "2 5 8 10"), (12, "6 8 10"), (13, "2 3 6 8")]
    {
        let entry = format!(r#"<Unknown index="{index}" dependencies="{dependencies}"/>"#);
        assert_eq!(xml.matches(&entry).count(), 2, "{entry} in steps and initialization");
    }
}

/// One variable, with one entry in the model structure, and its own description and value reference.
#[test]
fn an_array_of_fmi_3_is_described_once() {
    let generated = rod(500, Version::Three, "");
    let xml = read(&generated.model_description);
    let starts = vec!["300.0"; 500].join(" ");
    assert_eq!(xml.matches(&format!(" start=\"{starts}\"")).count(), 1);
    assert!(
        xml.contains(r#"name="der(T)" valueReference="503" description="Time derivative of T""#),
        "{xml}"
    );
    for entry in [
        r#"<ContinuousStateDerivative valueReference="503" dependencies="1 2 502"/>"#,
        r#"<Output valueReference="1502" dependencies="502"/>"#,
        r#"<Output valueReference="1503" dependencies="1 2 502"/>"#,
    ] {
        assert_eq!(xml.matches(entry).count(), 1, "{entry}");
    }
    assert!(xml.contains(r#" providesPerElementDependencies="true""#));
    let page = read(&generated.documentation);
    assert!(page.contains("<td class=\"reference\">502<span>503</span></td>"), "{page}");
    assert!(page.contains("<td class=\"start\">each 300</td>"), "{page}");
    let page = read(&rod(500, Version::Two, "").documentation);
    assert!(
        page.contains("<td class=\"reference\">502, 504 … 1500<span>503, 505 … 1501</span></td>"),
        "{page}"
    );
}

/// Its numbers are consecutive: the first gap that holds them all.
#[test]
fn declared_value_references_do_not_split_an_array() {
    let pinned =
        r#", {"name": "pinned", "causality": "parameter", "unit": "1", "start": 1, "value_reference": 3}"#;
    let xml = read(&rod(2, Version::Two, pinned).model_description);
    let reference = |name: &str| {
        let (_, rest) =
            xml.split_once(&format!("name=\"{name}\" valueReference=\"")).expect("it is described");
        rest.split_once('"').expect("it ends").0.parse::<u32>().expect("it is a number")
    };
    let names = [
        "left",
        "heat[1]",
        "heat[2]",
        "pinned",
        "T[1]",
        "der(T[1])",
        "T[2]",
        "der(T[2])",
        "mean",
        "slopes[1]",
    ];
    // Of the gap from 2 on, one number is left for the next scalar.
    assert_eq!(names.map(reference), [1, 4, 5, 3, 6, 7, 8, 9, 2, 10]);
}

/// What is generated for three vessels in a row.
fn vessels(cell: &str) -> Result<Generated, String> {
    let folder = folder("row");
    let file = folder.join("row.json");
    let declaration = format!(
        r#"{{
            "variables": [
                {{"name": "left", "causality": "input", "unit": "K", "start": 0}},
                {{"name": "mean", "causality": "output", "unit": "K", "reads": ["cell[:].T"]}}
            ],
            "component_types": [
                {{"name": "Cell", "variables": [
                    {{"name": "T", "unit": "K", "start": 300, "derivative": {{"reads": ["{{before}}", "T", "{{after}}"]}}}},
                    {{"name": "rates", "unit": "1", "dimensions": [2], "causality": "parameter", "start": [1, 2]}}
                ]}}
            ],
            "components": [{{"name": "cell", "type": "Cell", "dimensions": [3], {cell}}}]
        }}"#
    );
    fs::write(&file, declaration).expect("the folder for tests is writable");
    let fmi = Fmi { version: Version::Two, interfaces: Interfaces::Both };
    generate_into(&file, &folder, &package(), fmi).map_err(|error| error.to_string())
}

const NEIGHBORS: &str = r#""connections": {"before": "cell[i-1].T", "after": "cell[i+1].T"}"#;

/// By hand: 1 time, 2 left, 3 mean, 4 cell[1].T, 5 its derivative, 6 and 7 its rates, … 8 cell[2].T, … 12 cell[3].T, 13
/// its derivative.
#[test]
fn components_of_an_array_are_connected_with_those_beside_them() {
    let generated = vessels(NEIGHBORS).unwrap();
    let xml = read(&generated.model_description);
    for (index, dependencies) in [(3, "4 8 12"), (5, "4 8"), (9, "4 8 12"), (13, "8 12")] {
        let entry = format!(r#"<Unknown index="{index}" dependencies="{dependencies}"/>"#);
        assert_eq!(xml.matches(&entry).count(), 2, "{entry} in steps and initialization");
    }
    assert!(xml.contains(r#"name="der(cell[3].T)""#) && xml.contains(r#"name="cell[3].rates[2]""#));
    assert!(read(&generated.variables).contains("pub cell: [CellStates<T>; 3],"));
    // One for each, the first of which is that of the model.
    let generated = vessels(r#""connections": {"before": ["left", "cell[1].T", "left"], "after": "left"}"#);
    let xml = read(&generated.unwrap().model_description);
    for (index, dependencies) in [(5, "2 4"), (9, "2 4 8"), (13, "2 12")] {
        let entry = format!(r#"<Unknown index="{index}" dependencies="{dependencies}"/>"#);
        assert_eq!(xml.matches(&entry).count(), 2, "{entry} in steps and initialization");
    }
}

/// A list has the values of a scalar in each component, or lists for an array in each; else it is for all.
#[test]
fn components_of_an_array_start_alike_or_each_at_its_own_value() {
    let xml = |start: &str| {
        let generated = vessels(&format!(r#""start": {{{start}}}, {NEIGHBORS}"#));
        read(&generated.unwrap().model_description)
    };
    let starts = |xml: &str, name: &str| -> Vec<String> {
        (1..=3)
            .map(|number| {
                let (_, after) = xml.split_once(&format!(r#"name="cell[{number}].{name}""#)).unwrap();
                let (_, after) = after.split_once("start=\"").unwrap();
                after.split('"').next().unwrap().to_owned()
            })
            .collect()
    };
    assert_eq!(starts(&xml(r#""T": 310"#), "T"), ["310.0"; 3]);
    assert_eq!(starts(&xml(r#""T": [310, 320, 330]"#), "T"), ["310.0", "320.0", "330.0"]);
    assert_eq!(starts(&xml(r#""rates": [5, 6]"#), "rates[2]"), ["6.0"; 3]);
    assert_eq!(starts(&xml(r#""rates": [[5, 6], [7, 8], [9, 9]]"#), "rates[1]"), ["5.0", "7.0", "9.0"]);
}

#[test]
fn what_an_array_of_components_lacks_is_named() {
    for (cell, reason) in [
        (format!(r#""start": {{"T": [1, 2]}}, {NEIGHBORS}"#), "there are 2 values of 'T', but 3 components"),
        (
            r#""connections": {"before": ["left", "left"], "after": "left"}"#.to_owned(),
            "2 variables, but there are 3 components",
        ),
        (
            r#""connections": {"before": "cell[:].T", "after": "left"}"#.to_owned(),
            "is connected to 'cell[:].T', which is more than one variable",
        ),
        (
            r#""connections": {"before": "cell[j].T", "after": "left"}"#.to_owned(),
            "only arrays of 2 dimensions have a subscript j",
        ),
        (
            r#""connections": {"before": "cel[i].T", "after": "left"}"#.to_owned(),
            "'cel.T', which is not a variable; did you mean 'cell.T'?",
        ),
    ] {
        let refusal = vessels(&cell).err().unwrap_or_default();
        assert!(refusal.contains(reason), "{refusal}");
    }
}
