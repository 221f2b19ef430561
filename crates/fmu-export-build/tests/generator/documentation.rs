//! The page for people: what it says, what it takes in, and what is refused of a fragment.

use std::collections::BTreeSet;
use std::fs;

use fmu_export_build::{Generated, Interfaces, generate_into};
use quick_xml::escape::escape;
use quick_xml::events::Event;
use quick_xml::{Reader, XmlVersion};
use serde_json::Value;

use super::{folder, folder_with_model, generate, package, read};

/// The values of an attribute in a page, which is read as XML: so every element is closed.
fn values(page: &str, wanted: &str) -> Vec<String> {
    let mut reader = Reader::from_str(page);
    let mut values = vec![];
    loop {
        match reader.read_event().expect("the page is XML") {
            Event::Start(element) | Event::Empty(element) => {
                for attribute in element.attributes() {
                    let attribute = attribute.expect("attributes are XML");
                    if attribute.key.as_ref() == wanted {
                        let value = attribute.normalized_value(XmlVersion::Implicit1_0).expect("it is XML");
                        values.push(value.into_owned());
                    }
                }
            }
            Event::Eof => return values,
            _ => {}
        }
    }
}

#[test]
fn every_variable_has_a_row_and_every_link_a_target() {
    let page = read(&generate(&folder("page")).documentation);
    let ids = values(&page, "id");
    let unique: BTreeSet<_> = ids.iter().map(String::as_str).collect();
    assert_eq!(unique.len(), ids.len());
    // One by one, as they are declared.
    let declared = "time inflow enabled level drain fills first.area first.mass der(first.mass) first.outflow second.area \
                    second.mass der(second.mass) second.outflow settings.mode settings.label settings.table settings.gain settings.reserve der(settings.reserve)";
    for name in declared.split(' ') {
        assert!(unique.contains(name), "{name}");
    }
    let links: Vec<_> = values(&page, "href");
    let within: Vec<_> = links.iter().filter_map(|link| link.strip_prefix('#')).collect();
    assert!(within.len() > 20, "{within:?}");
    for target in &within {
        assert!(unique.contains(target), "{target}");
    }
    // From the fragment: variables, an array's element, a picture's link.
    for target in ["level", "der(first.mass)", "settings.table", "FillMode", "first.mass"] {
        assert!(within.contains(&target), "{target}");
    }
}

#[test]
fn the_page_says_what_the_json_says() {
    let page = read(&generate(&folder("page says")).documentation);
    let text = |text: &str| assert!(page.contains(text), "{text}");
    text("<dd>A. N. Author &amp; Co.</dd>");
    text("<td class=\"start\">0.5 <small>500 g/s</small></td><td class=\"range\">0 … 10</td>");
    text("<td class=\"start\">“a &lt;b&gt;”</td>");
    text("<td class=\"start\">half_full (2)</td>");
    text("<a href=\"#FillMode\">Fill<wbr/>Mode</a>");
    text("Half &quot;full&quot;");
    text("<tr><th scope=\"row\">2</th><td>3</td><td>4</td></tr>");
    text(
        "depends instantaneously on <a href=\"#enabled\"><code>enabled</code></a>, <a href=\"#second.mass\">",
    );
    text("depends instantaneously on no input or state");
    text("\"time\",\"inflow\",\"enabled\"\n0,0.5,1</pre>");
    text("fmpy simulate Vessels.fmu --start-values first.area 0.5 --output-file result.csv");
    text("<li><a href=\"#balance\">Balance of first.<wbr/>mass</a></li>");
    // The picture is in the page, with what it shows.
    text("viewBox=\"0 0 60 30\" role=\"img\" aria-label=\"Two vessels &amp; a &quot;pipe&quot;\">");
    assert!(!page.contains("<?xml") && !page.contains("<img"));
    let description = read(&generate(&folder("page guid")).model_description);
    let guid = description.split('"').find(|part| part.starts_with('{')).expect("the GUID is there");
    text(guid);
}

/// Generates the small model after an edit of its JSON, with further files in its folder.
fn generated(
    name: &str,
    edit: impl FnOnce(&mut Value),
    beside: &[(&str, &str)],
) -> Result<Generated, String> {
    let folder = folder_with_model(name);
    let file = folder.join("vessels.json");
    let mut model: Value = serde_json::from_str(&read(&file)).expect("it is JSON");
    edit(&mut model);
    fs::write(&file, model.to_string()).expect("the folder for tests is writable");
    for (name, content) in beside {
        fs::write(folder.join(name), content).expect("the folder for tests is writable");
    }
    generate_into(&file, &folder, &package(), Interfaces::CoSimulation).map_err(|error| {
        assert!(!folder.join("Vessels").exists(), "{name}: something was written");
        error.to_string().replace(&format!("{}{}", folder.display(), std::path::MAIN_SEPARATOR), "")
    })
}

/// What HTML has other uses for.
#[test]
fn every_text_is_a_text_on_the_page() {
    const TEXT: &str = r#"<a> & "b" 'c' &amp; --> </script> µ°C 熱"#;
    let awkward = |model: &mut Value| {
        for key in ["description", "author", "copyright", "license"] {
            model[key] = TEXT.into();
        }
        model["log_categories"][2]["description"] = TEXT.into();
        model["enumerations"][0]["description"] = TEXT.into();
        model["enumerations"][0]["items"][0]["description"] = TEXT.into();
        let settings = &mut model["components"][2];
        settings["description"] = TEXT.into();
        for key in ["description", "start"] {
            settings["variables"][1][key] = TEXT.into();
        }
    };
    let page = read(&generated("texts on the page", awkward, &[]).expect("any text will do").documentation);
    // Title and head, three facts, a log category, an enumeration and its item, the component in three
    // tables, and a parameter with its start value.
    assert_eq!(page.matches(&*escape(TEXT)).count(), 2 + 3 + 1 + 2 + 3 + 2);
    // Those of the contents and of the search.
    assert_eq!(page.matches("</script>").count(), 2);
    values(&page, "id");
}

#[test]
fn documentation_and_icon_may_be_absent_and_enter_no_guid() {
    let whole = generate(&folder("with documentation"));
    let without = |model: &mut Value| {
        let model = model.as_object_mut().expect("it is an object");
        assert!(model.remove("documentation").is_some() && model.remove("icon").is_some());
    };
    let bare = generated("without documentation", without, &[]).expect("both are optional");
    assert_eq!(read(&bare.model_description), read(&whole.model_description));
    assert_eq!(bare.icon, None);
    let page = read(&bare.documentation);
    assert!(!page.contains("page-model") && page.contains("id=\"first.mass\""));
    assert!(values(&page, "href").iter().any(|link| link == "#page-states"));
}

#[test]
fn an_icon_that_the_json_no_longer_names_is_removed() {
    let folder = folder_with_model("icon");
    let again = || {
        generate_into(&folder.join("vessels.json"), &folder, &package(), Interfaces::CoSimulation)
            .expect("nothing is wrong")
            .icon
    };
    let icon = again().expect("the JSON names one");
    assert!(icon.exists());
    let without = read(&folder.join("vessels.json")).replace("\"icon\": \"vessels.png\",", "");
    fs::write(folder.join("vessels.json"), without).expect("the folder for tests is writable");
    assert_eq!(again(), None);
    assert!(!icon.exists());
}

/// What is said of the small model with another fragment.
fn refusal(fragment: &str) -> String {
    let name: String =
        fragment.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '_' }).collect();
    let name = format!("fragment {}", &name[..name.len().min(60)]);
    match generated(&name, |_| {}, &[("vessels.html", fragment), ("text.svg", "<p>no picture</p>")]) {
        Ok(_) => "nothing was refused".to_owned(),
        Err(refusal) => refusal,
    }
}

/// The content before the first heading; the element that holds the heading belongs to the sections.
#[test]
fn the_page_opens_with_what_stands_before_the_first_section() {
    let opened = |name: &str, fragment: &str| {
        let page = generated(name, |_| {}, &[("vessels.html", fragment)]).expect("nothing is wrong");
        let page = read(&page.documentation);
        values(&page, "id");
        let place = |part: &str| page.find(part).unwrap_or(usize::MAX);
        [
            place("<p>opening</p>"),
            place("id=\"page-overview\""),
            place("<h2>Model</h2>"),
            place("id=\"first\""),
        ]
    };
    let nested =
        "<p>opening</p><div><p>before</p><h3 id=\"first\">First</h3></div><h3 id=\"second\">Second</h3>";
    assert!(opened("with sections", nested).is_sorted());
    let [opening, overview, model, _] = opened("without sections", "<p>opening</p>");
    assert!(opening < overview && model == usize::MAX);
    let [_, overview, model, first] = opened("without an opening", "<h3 id=\"first\">First</h3>");
    assert!(overview < model && model < first);
}

#[test]
fn exponents_of_units_are_raised_in_descriptions() {
    let described = |model: &mut Value| {
        model["components"][2]["variables"][1]["description"] = "of 3 m2, (or m2) & am2, m2x".into();
    };
    let page = generated("units in descriptions", described, &[]).expect("nothing is wrong");
    let text = "of 3 m<sup>2</sup>, (or m<sup>2</sup>) &amp; am2, m2x";
    assert!(read(&page.documentation).contains(text));
}

#[test]
fn identifiers_of_one_letter_are_italic_and_words_are_not() {
    let fragment = "<math><mi>x</mi><mi>clip</mi><mi mathvariant=\"normal\">sgn</mi></math>";
    let page = generated("letters", |_| {}, &[("vessels.html", fragment)]).expect("nothing is wrong");
    let markup = "<math><mi>x</mi><mi class=\"word\">clip</mi><mi mathvariant=\"normal\">sgn</mi></math>";
    assert!(read(&page.documentation).contains(markup));
}

#[test]
fn a_fragment_names_existing_variables() {
    assert_eq!(
        refusal("<p>It\nfollows <var>first.mas</var></p>"),
        "vessels.html:2: the model has no variable 'first.mas'; did you mean 'first.mass'?"
    );
    assert_eq!(
        refusal("<var>settings.table[3,1]</var>"),
        "vessels.html:1: the model has no variable 'settings.table[3,1]'; did you mean 'settings.table[1,1]'?"
    );
    for nameless in ["<var/>", "<var></var>", "<var><b>level</b></var>"] {
        assert_eq!(refusal(nameless), "vessels.html:1: <var> must contain a variable's name");
    }
    assert_eq!(
        refusal("<a href=\"#balance\">there</a>"),
        "vessels.html:1: it links to '#balance', which is not on the page"
    );
    for id in ["level", "page-states", "FillMode"] {
        assert_eq!(
            refusal(&format!("<p id=\"{id}\">twice</p>")),
            format!("vessels.html:1: another element has the id '{id}'")
        );
    }
    assert_eq!(
        refusal("<p id=\"a\"></p>\n<p id=\"a\"></p>"),
        "vessels.html:2: another element has the id 'a'"
    );
    assert_eq!(refusal("<h3>Balance</h3>"), "vessels.html:1: <h3> needs an id, for the page's contents");
}

#[test]
fn a_fragment_brings_its_pictures() {
    for (markup, address) in [
        ("<img src=\"level.png\" alt=\"\"/>", "src=\"level.png\""),
        ("<img src=\"https://example.org/a.png\" alt=\"\"/>", "src=\"https://example.org/a.png\""),
        ("<svg><image href=\"vessels.svg\"/></svg>", "href=\"vessels.svg\""),
        ("<svg><image xlink:href=\"a.png\"/></svg>", "xlink:href=\"a.png\""),
    ] {
        let refused =
            format!("vessels.html:1: {address}: pictures are SVG files in <img>, or begin with data:");
        assert_eq!(refusal(markup), refused);
    }
    assert_eq!(refusal("<img src=\"data:image/png;base64,AA==\" alt=\"\"/>"), "nothing was refused");
    assert_eq!(refusal("<img src=\"vessels.svg\"/>"), "vessels.html:1: <img> needs an alt");
    assert_eq!(refusal("<img src=\"text.svg\" alt=\"\"/>"), "text.svg:1: it is not an SVG");
    let recursive = [
        ("vessels.html", "<img src=\"itself.svg\" alt=\"\"/>"),
        ("itself.svg", "<svg><img src=\"itself.svg\" alt=\"\"/></svg>"),
    ];
    let refused = generated("recursive picture", |_| {}, &recursive).expect_err("it would never end");
    assert!(refused.starts_with("itself.svg:1: src=\"itself.svg\": pictures are"), "{refused}");
}

/// The page's policy stops scripts and external content (`tests/fmu/pages`), but no refresh.
#[test]
fn a_fragment_does_not_lead_to_another_page() {
    for name in ["meta", "META"] {
        let refresh =
            format!("<p>a</p>\n<{name} http-equiv=\"refresh\" content=\"0; url=https://example.org\"/>");
        assert_eq!(refusal(&refresh), "vessels.html:2: <meta> is not allowed in a fragment");
    }
}

#[test]
fn a_fragment_is_xml() {
    assert_eq!(refusal("<p>a&nbsp;b</p>"), "vessels.html:1: write the character itself, not &nbsp;");
    assert_eq!(refusal("<p>\n<b>open</p>").split(": ").next(), Some("vessels.html:2"));
    assert!(refusal("<p>\n<b>open</p>").contains("vessels.html:2: "), "{}", refusal("<p>\n<b>open</p>"));
    assert_eq!(refusal("<p>\nopen"), "vessels.html:2: it ends within <p>");
    assert_eq!(refusal("<p title=\"</p><script>\">a</p>"), "vessels.html:1: write &lt; in an attribute");
    assert_eq!(refusal("<![CDATA[x]]>"), "vessels.html:1: HTML has no CDATA");
    assert!(refusal("<p class=a></p>").starts_with("vessels.html:1: "));
}

#[test]
fn missing_files_are_refused_by_name() {
    let missing = |key: &'static str, file: &'static str| {
        generated(&format!("missing {key}"), move |model| model[key] = file.into(), &[])
            .expect_err("the file is not there")
    };
    for (key, file) in [("documentation", "nowhere.html"), ("icon", "nowhere.png")] {
        let refusal = missing(key, file);
        assert_eq!(refusal, format!("vessels.json:1: {key}: there is no file {file}"));
    }
    assert_eq!(missing("icon", "vessels.svg"), "vessels.svg: it is not a PNG");
    let refusal = refusal("<img src=\"nowhere.svg\" alt=\"nothing\"/>");
    assert!(refusal.starts_with("nowhere.svg: "), "{refusal}");
}

/// In a column they would be as high as several screens.
#[test]
fn the_page_folds_long_lists_of_start_values() {
    let folder = folder("long list");
    let file = folder.join("list.json");
    let page = |size: usize| {
        let starts: Vec<_> = (0..size).map(|number| format!("{number}e-9")).collect();
        let starts = starts.join(", ");
        let declaration = format!(
            r#"{{"variables": [{{"name": "list", "causality": "parameter", "unit": "m", "dimensions": [{size}], "start": [{starts}]}}, {{"name": "y", "causality": "output", "unit": "m", "reads": ["list"]}}]}}"#
        );
        fs::write(&file, declaration).expect("the folder is writable");
        let generated = generate_into(&file, &folder, &package(), Interfaces::CoSimulation);
        read(&generated.unwrap_or_else(|error| panic!("{error}")).documentation)
    };
    let last = "<span class=\"number\">9e-9</span>";
    assert!(page(10).contains(&format!("{last}</td>")));
    let long = page(100);
    assert!(long.contains("<td class=\"start\">below</td>"));
    let folded = "<details><summary>Start values of <code>list</code></summary><p>0, <span";
    assert!(long.contains(folded), "{long}");
}
