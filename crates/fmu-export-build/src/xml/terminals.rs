//! The terminalsAndIcons.xml (FMI 3.0.2, section 2.4.9; in FMI 2.0 since 2.0.4).
//!
//! Importers take the root's first element for the terminals. So the icon's location, first in the schema, is written
//! only without terminals; it is the default anyway.

use std::collections::BTreeSet;

use fmu_xml::{document, element, empty, given};

use crate::model::Model;

pub(crate) fn write(model: &Model<'_>) -> String {
    let terminals = &model.declaration.terminals;
    // An array that is one variable is one member.
    let arrays: BTreeSet<_> = model.arrays().iter().map(|array| array[0]).collect();
    let members = |name: &String| {
        let positions = &model.names[name];
        if arrays.contains(&positions[0]) {
            return vec![name.clone()];
        }
        let members = positions.iter().map(|&position| &model.scalars[position]);
        members.filter(|scalar| model.exports(scalar.place)).map(|scalar| scalar.name.clone()).collect()
    };
    // The format's version, even in FMUs of earlier FMI versions (FMI 3.0.2, section 2.4.9).
    let version = vec![("fmiVersion", "3.0".to_owned())];
    document(|writer| {
        element(writer, "fmiTerminalsAndIcons", version, |writer| {
            if terminals.is_empty() {
                return element(writer, "GraphicalRepresentation", vec![], |writer| {
                    let place = [("x1", -100), ("y1", -100), ("x2", 100), ("y2", 100)];
                    empty(writer, "Icon", place.map(|(corner, at)| (corner, at.to_string())).into())
                });
            }
            element(writer, "Terminals", vec![], |writer| {
                terminals.iter().try_for_each(|terminal| {
                    let attributes = given([
                        ("name", Some(terminal.name.clone())),
                        ("matchingRule", Some(terminal.matching_rule.to_string())),
                        ("description", terminal.description.clone()),
                    ]);
                    element(writer, "Terminal", attributes, |writer| {
                        terminal.variables.iter().flat_map(members).try_for_each(|name| {
                            let member = ["variableName", "memberName"].map(|key| (key, name.clone()));
                            let kind = ("variableKind", "signal".to_owned());
                            empty(
                                writer,
                                "TerminalMemberVariable",
                                member.into_iter().chain([kind]).collect(),
                            )
                        })
                    })
                })
            })
        })
    })
}
