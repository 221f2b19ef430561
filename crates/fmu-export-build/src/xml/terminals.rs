//! The terminalsAndIcons.xml (FMI 3.0.2, section 2.4.9; in FMI 2.0 since 2.0.4).
//!
//! Without a picture of the terminals: some importers take the first element for that of the terminals.

use super::given;
use crate::declaration::{MatchingRule, TerminalDeclaration};
use fmu_xml::{document, element, empty};

pub(crate) fn write(terminals: &[TerminalDeclaration]) -> String {
    // Of the format, in FMUs of earlier versions, too (FMI 3.0.2, section 2.4.9).
    let version = vec![("fmiVersion", "3.0".to_owned())];
    document(|writer| {
        element(writer, "fmiTerminalsAndIcons", version, |writer| {
            element(writer, "Terminals", vec![], |writer| {
                terminals.iter().try_for_each(|terminal| {
                    let rule = match terminal.matching_rule {
                        MatchingRule::Plug => "plug",
                        MatchingRule::Bus => "bus",
                    };
                    let attributes = given([
                        ("name", Some(terminal.name.clone())),
                        ("matchingRule", Some(rule.to_owned())),
                        ("description", terminal.description.clone()),
                    ]);
                    element(writer, "Terminal", attributes, |writer| {
                        terminal.variables.iter().try_for_each(|name| {
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
