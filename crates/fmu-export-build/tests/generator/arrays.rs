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
