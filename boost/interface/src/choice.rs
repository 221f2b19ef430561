//! The variables that connections choose for the ports of an FMU.

use std::collections::BTreeMap;

use anyhow::Result;
use fmu_package::Kind;
use fmu_package::connection::{Connection, Conversion};

use crate::{Interface, Port, Role};

/// An FMU's variable for a port.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The variable's name.
    pub name: String,
    /// The conversion from the interface's values to those of an input, from those of an output to the interface's.
    pub conversion: Conversion,
    /// The value from which on a Boolean is true.
    pub threshold: Option<f64>,
    /// The connection that names the variable.
    pub connection: Connection,
}

/// The choices of connections for an FMU in a role, by the ports' names.
///
/// One end of each connection has a name of the interface, the other the FMU's. If both ends are of the interface, the
/// FMU has its name, unless another connection says otherwise: so the files of two FMUs go together.
///
/// # Errors
/// When a connection names another FMU, has no end or two different ones of the interface, or a port has two variables.
pub fn choices(
    interface: &Interface,
    role: Role,
    connections: &[Connection],
) -> Result<BTreeMap<String, Choice>> {
    let mut choices: BTreeMap<String, Choice> = BTreeMap::new();
    for connection in connections {
        let Connection { source, output, target, input, location, .. } = connection;
        for fmu in source.iter().chain([target]) {
            if ![role, role.other()].iter().any(|role| role.name() == fmu) {
                return Err(location.error(format!("{fmu} is neither plant nor controller")));
            }
        }
        let (kind, own, other) = if target == role.name() {
            (Kind::Input, input, output)
        } else if source.as_deref() == Some(role.name()) {
            (Kind::Output, output, input)
        } else {
            continue;
        };
        // A signal may drive any input.
        let port = |name: &String| {
            let is_meant = |port: &Port<'_>| {
                port.kind == kind && port.name() == name && (source.is_none() || port.couples())
            };
            interface.ports(role).find(is_meant).map(|port| port.name())
        };
        let [from, to] = [connection.from(), connection.to()];
        let refused = |reason: &str| Err(location.error(format!("{reason}: {from} and {to}")));
        let (name, has_others_name) = match (port(other), port(own)) {
            (Some(theirs), Some(ours)) if theirs != ours => {
                return refused("two different variables of the interface");
            }
            (Some(name), _) => (name, true),
            (None, Some(name)) => (name, false),
            (None, None) => {
                return refused("no variable of the interface");
            }
        };
        let choice = Choice {
            name: own.clone(),
            conversion: at_port(&connection.conversion, kind, has_others_name),
            threshold: connection.threshold.filter(|_| kind == Kind::Input),
            connection: connection.clone(),
        };
        match choices.get(name) {
            Some(known) if known.name == *own || own == name => {}
            Some(known) if known.name != name => {
                let [one, two] = [&known.name, own];
                return Err(location.error(format!("{name} is connected with both {one} and {two}")));
            }
            _ => {
                choices.insert(name.to_owned(), choice);
            }
        }
    }
    Ok(choices)
}

/// The conversion between interface and FMU. If the other end does not have the interface's name, its units are not those
/// of the interface.
fn at_port(conversion: &Conversion, kind: Kind, has_others_name: bool) -> Conversion {
    match (conversion.clone(), kind) {
        (whole, _) if has_others_name => whole,
        (Conversion::Units { to, .. }, Kind::Input) => Conversion::Units { from: None, to },
        (Conversion::Units { from, .. }, Kind::Output) => Conversion::Units { from, to: None },
        (Conversion::Function(_), _) => Conversion::DECLARED,
    }
}
