//! The generated XML as a parser reads it, of a model that was made to be awkward.

use std::collections::BTreeMap;
use std::fs;

use fmu_export_build::{Interfaces, generate_into};
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};
use serde_json::{Value, json};

use super::{folder_with_model, package, read, sources};

/// An element with its attributes.
struct Element {
    name: String,
    attributes: BTreeMap<String, String>,
}

impl Element {
    fn new(start: &BytesStart<'_>) -> Self {
        let attributes = start.attributes().map(|attribute| {
            let attribute = attribute.expect("each attribute occurs once");
            let value = attribute.normalized_value(XmlVersion::Explicit1_0).expect("it is escaped");
            (attribute.key.as_ref().to_owned(), value.into_owned())
        });
        Self { name: start.name().as_ref().to_owned(), attributes: attributes.collect() }
    }

    fn get(&self, attribute: &str) -> &str {
        self.attributes.get(attribute).map_or("", String::as_str)
    }

    /// The indices in an attribute.
    fn indices(&self, attribute: &str) -> Vec<usize> {
        self.get(attribute).split_whitespace().map(|index| index.parse().expect("it is an index")).collect()
    }
}

/// The elements in their order.
fn elements(xml: &str) -> Vec<Element> {
    let mut reader = Reader::from_str(xml);
    let mut elements = Vec::new();
    loop {
        match reader.read_event().expect("the XML is well-formed") {
            Event::Start(start) | Event::Empty(start) => elements.push(Element::new(&start)),
            Event::Eof => return elements,
            _ => {}
        }
    }
}

/// The elements of what is generated for the small model after an edit of it and its units.
fn generated(name: &str, edit: impl FnOnce(&mut Value, &mut Value)) -> Vec<Element> {
    let folder = folder_with_model(name);
    let json = |file| serde_json::from_str(&read(&sources().join(file))).expect("it is JSON");
    let (mut model, mut units): (Value, Value) = (json("vessels.json"), json("units.json"));
    edit(&mut model, &mut units);
    for (file, value) in [("vessels.json", &model), ("units.json", &units)] {
        fs::write(folder.join(file), value.to_string()).expect("the folder for tests is writable");
    }
    let generated =
        generate_into(&folder.join("vessels.json"), &folder, &package(), Interfaces::CoSimulation);
    elements(&read(&generated.unwrap_or_else(|error| panic!("{error}")).model_description))
}

/// Turns round the order of everything whose order means nothing, and says twice what may be said twice.
fn make_awkward(value: &mut Value) {
    match value {
        Value::Array(values) => values.iter_mut().for_each(make_awkward),
        Value::Object(fields) => {
            for (key, value) in fields {
                make_awkward(value);
                if let (true, Value::Array(values)) = (
                    ["variables", "components", "component_types", "reads", "initial_reads"]
                        .contains(&key.as_str()),
                    value,
                ) {
                    values.reverse();
                    if key.ends_with("reads") {
                        values.extend(values.clone());
                    }
                }
            }
        }
        _ => {}
    }
}

/// FMI 2.0.5, section 2.2.8: what each list holds, what its entries may depend on, and in which order.
#[test]
fn model_structure_is_the_standards_whatever_the_order_of_declaration() {
    let elements = generated("structure", |model, _| {
        // An output that reads an output, and one in a component, behind that component's states.
        let level = &mut model["variables"][2];
        assert_eq!(level["name"], "level");
        level["reads"].as_array_mut().expect("it reads something").push(json!("drain"));
        let variables = model["component_types"][0]["variables"].as_array_mut().expect("there are variables");
        let spill = json!({"name": "spill", "causality": "output", "unit": "kg/s", "description": "Spill",
            "reads": ["outflow", "level", "time"]});
        variables.push(spill);
        make_awkward(model);
    });

    let mut variables = Vec::new();
    for pair in elements.windows(2) {
        if pair[0].name == "ScalarVariable" {
            variables.push((&pair[0], &pair[1]));
        }
    }
    let name = |index: usize| variables[index - 1].0.get("name");
    let causality = |index: usize| variables[index - 1].0.get("causality");
    let initial = |index: usize| variables[index - 1].0.get("initial");
    let indices = 1..=variables.len();
    let derivatives: Vec<_> = indices
        .clone()
        .filter(|&index| variables[index - 1].1.attributes.contains_key("derivative"))
        .collect();
    let states: Vec<_> =
        derivatives.iter().map(|&index| variables[index - 1].1.indices("derivative")[0]).collect();
    let outputs: Vec<_> = indices.clone().filter(|&index| causality(index) == "output").collect();
    let initial_unknowns: Vec<_> = indices
        .filter(|&index| {
            let state_or_derivative = states.contains(&index) || derivatives.contains(&index);
            let computed = ["output", "calculatedParameter"].contains(&causality(index));
            (state_or_derivative || computed) && ["approx", "calculated"].contains(&initial(index))
        })
        .collect();
    assert_eq!([outputs.len(), derivatives.len()], [5, 3]);

    let mut lists: BTreeMap<&str, Vec<&Element>> = BTreeMap::new();
    let mut list = "";
    for element in elements.iter().skip_while(|element| element.name != "ModelStructure").skip(1) {
        if element.name == "Unknown" {
            lists.entry(list).or_default().push(element);
        } else {
            list = &element.name;
        }
    }
    assert_eq!(lists.keys().copied().collect::<Vec<_>>(), ["Derivatives", "InitialUnknowns", "Outputs"]);
    for (list, expected) in
        [("Outputs", outputs), ("Derivatives", derivatives), ("InitialUnknowns", initial_unknowns)]
    {
        // They are ascending, and each occurs once.
        let entries: Vec<_> = lists[list].iter().flat_map(|unknown| unknown.indices("index")).collect();
        assert_eq!(entries, expected, "{list}");
        for unknown in &lists[list] {
            let dependencies = unknown.indices("dependencies");
            let name_of_unknown = name(unknown.indices("index")[0]);
            assert!(dependencies.is_sorted_by(|before, after| before < after), "{list}: {name_of_unknown}");
            for index in dependencies {
                let known = ["input", "independent"].contains(&causality(index))
                    || if list == "InitialUnknowns" {
                        initial(index) == "exact"
                    } else {
                        states.contains(&index)
                    };
                assert!(known, "{list}: {name_of_unknown} depends on {}", name(index));
            }
        }
    }
    let dependencies_of = |wanted: &str| {
        let unknown = lists["Outputs"].iter().find(|unknown| name(unknown.indices("index")[0]) == wanted);
        let indices = unknown.expect("it is an output").indices("dependencies");
        let mut names: Vec<_> = indices.into_iter().map(name).collect();
        names.sort_unstable();
        names
    };
    // By hand: through the output that it reads, to what that one reads.
    assert_eq!(dependencies_of("level"), ["enabled", "first.mass", "second.mass"]);
    assert_eq!(dependencies_of("second.spill"), ["enabled", "first.mass", "second.mass", "time"]);
}

/// What XML has other uses for, and what some programs would trim, fold or decode wrongly.
#[test]
fn every_text_reaches_a_parser_unchanged() {
    const TEXT: &str = r#" <a> & "b" 'c' &amp; ]]> --  µ°C 熱 🚗 \n %s  "#;
    let elements = generated("texts", |model, units| {
        for key in ["description", "author", "copyright", "license"] {
            model[key] = json!(TEXT);
        }
        let categories = model["log_categories"].as_array_mut().expect("there are categories");
        categories.push(json!({"name": TEXT, "description": TEXT}));
        let enumeration = &mut model["enumerations"][0];
        enumeration["description"] = json!(TEXT);
        enumeration["items"][0]["description"] = json!(TEXT);
        let inflow = &mut model["variables"][0];
        for key in ["description", "unit", "display_unit"] {
            inflow[key] = json!(TEXT);
        }
        let settings = &mut model["components"][2];
        settings["description"] = json!(TEXT);
        for key in ["description", "start"] {
            settings["variables"][1][key] = json!(TEXT);
        }
        let units = units.as_array_mut().expect("units are a list");
        units.push(json!({"name": TEXT, "display_units": [{"name": TEXT, "factor": 2}]}));
    });
    let texts = |element: &str, attribute: &str| {
        let same_name = elements.iter().filter(|known| known.name == element);
        same_name.filter(|known| known.get(attribute) == TEXT).count()
    };
    for attribute in ["description", "author", "copyright", "license"] {
        assert_eq!(texts("fmiModelDescription", attribute), 1, "{attribute}");
    }
    for (element, attribute) in [
        ("Unit", "name"),
        ("DisplayUnit", "name"),
        ("SimpleType", "description"),
        ("Item", "description"),
        ("Category", "name"),
        ("Category", "description"),
        ("ScalarVariable", "description"),
        ("Real", "unit"),
        ("Real", "displayUnit"),
        ("String", "start"),
    ] {
        assert_eq!(texts(element, attribute), 1, "{element} {attribute}");
    }
    let label = elements.iter().find(|element| element.get("name") == "settings.label");
    assert_eq!(label.expect("it is there").get("description"), format!("{TEXT}: {TEXT}"));
}
