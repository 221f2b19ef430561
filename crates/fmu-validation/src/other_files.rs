//! Rules on an FMU's other standard files: sources, build descriptions, terminals and icons.

use std::collections::BTreeSet;

use fmu_package::archive::Files;
use fmu_package::xml::{Element, named};
use fmu_terms::Version;

use crate::model::Model;
use crate::report::{Place, Report};
use crate::rules::{SOURCES, TERMINALS};
use crate::schema;
use crate::xml::Xml;

pub(crate) fn check(model: &Model<'_>, files: &mut Files, report: &mut Report) {
    for file in model
        .interfaces
        .iter()
        .flat_map(|interface| named(*interface, "SourceFiles"))
        .flat_map(|list| named(list, "File"))
    {
        source(model.xml, file, files, report);
    }
    with_xml(files, "sources/buildDescription.xml", report, |xml, files, report| {
        build(model, xml, files, report);
    });
    with_xml(files, "terminalsAndIcons/terminalsAndIcons.xml", report, |xml, files, report| {
        terminals(model, xml, files, report);
    });
}

/// Reads an optional file and checks it against its schema, that of FMI 3 even in FMI 2.
fn with_xml(
    files: &mut Files,
    path: &'static str,
    report: &mut Report,
    check: impl FnOnce(&Xml<'_>, &Files, &mut Report),
) {
    let Some(text) = files.text(path, &mut report.refusals()) else { return };
    let Some(xml) = Xml::parse(path, &text, report) else { return };
    schema::check(Version::Three, &xml, report);
    check(&xml, files, report);
}

fn source(xml: &Xml<'_>, element: Element<'_>, files: &Files, report: &mut Report) {
    let Some(name) = element.attribute("name") else { return };
    // OpenModelica writes `./` before folders.
    let path = format!("sources/{}", name.trim_start_matches("./"));
    if !files.contains(&path) {
        report.add(&SOURCES, xml.at(element), format!("there is no {path}"));
    }
}

fn build(model: &Model<'_>, xml: &Xml<'_>, files: &Files, report: &mut Report) {
    for configuration in named(xml.root(), "BuildConfiguration") {
        let identifier = configuration.attribute("modelIdentifier").unwrap_or_default();
        if !model.identifiers().contains(&identifier) {
            report.add(
                &SOURCES,
                xml.at(configuration),
                format!("no interface has the modelIdentifier {identifier}"),
            );
        }
        for file in named(configuration, "SourceFileSet").flat_map(|set| named(set, "SourceFile")) {
            source(xml, file, files, report);
        }
    }
    let version = xml.root().attribute("fmiVersion");
    if model.version == Version::Three && version != model.root.attribute("fmiVersion") {
        let message = format!("its fmiVersion {} is not that of the FMU", version.unwrap_or_default());
        report.add(&SOURCES, xml.at(xml.root()), message);
    }
}

fn terminals(model: &Model<'_>, xml: &Xml<'_>, files: &Files, report: &mut Report) {
    let aliases = model.variables.iter().flat_map(|variable| named(variable.element, "Alias"));
    let names: BTreeSet<_> = model
        .variables
        .iter()
        .map(|variable| variable.name)
        .chain(aliases.filter_map(|alias| alias.attribute("name")))
        .collect();
    for node in xml.root().descendants() {
        let mut wrong = |message: String| report.add(&TERMINALS, xml.at(node), message);
        let attributes = ["variableName", "inStreamVariableName", "outStreamVariableName"];
        for name in
            attributes.iter().filter_map(|key| node.attribute(*key)).filter(|name| !names.contains(name))
        {
            wrong(format!("there is no variable {name}"));
        }
        if let Some(icon) = node.attribute("iconBaseName")
            && !files.contains(&format!("terminalsAndIcons/{icon}.png"))
        {
            wrong(format!("there is no terminalsAndIcons/{icon}.png"));
        }
        let mut seen = BTreeSet::new();
        for name in named(node, "Terminal").filter_map(|terminal| terminal.attribute("name")) {
            if !seen.insert(name) {
                wrong(format!("two terminals are named {name}"));
            }
        }
    }
    if named(xml.root(), "GraphicalRepresentation").any(|picture| named(picture, "Icon").next().is_some())
        && !files.contains("terminalsAndIcons/icon.png")
    {
        report.add(&TERMINALS, Place::file(xml.file), "there is no terminalsAndIcons/icon.png");
    }
}
