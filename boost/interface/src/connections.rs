//! A file of all connections of the system with an FMU, for the user to edit.

use fmu_io::document::Location;
use fmu_io::terminal::in_line;
use fmu_package::connection::{Connection, Conversion};
use fmu_package::{Causality, FmuVariable, Kind};

use crate::compatibility::{Compatibility, Match};
use crate::{Port, Role};

/// Stands for the name that the user fills in.
const OPEN: &str = "?";

impl Compatibility<'_> {
    /// The text of a file of all connections of the system. Those that are open are comments, with the most similar
    /// variable if there is one, followed by a list of the FMU's variables that they can have.
    #[must_use]
    pub fn connections(&self) -> String {
        let mut text = format!(
            "# {} as the {}: all connections, for a scenario or --connections\n",
            in_line(self.fmu.attribute("modelName")),
            self.role.name()
        );
        for (port, found) in self.matches.iter().filter(|(port, _)| port.is_connectable()) {
            let given = self.choices.get(port.name()).map(|choice| choice.connection.clone());
            let lines = match (found, found.proposal()) {
                (Match::Found { variable, .. }, _) => {
                    table(&given.unwrap_or_else(|| self.connection(port, &variable.name)))
                }
                (_, Some(name)) => commented(&self.connection(port, name)),
                _ => commented(&self.connection(port, OPEN)),
            };
            let remarks = match found.remarks() {
                none if none.is_empty() => none,
                remarks => format!("# {}\n", in_line(&format!("{}: {remarks}", port.name()))),
            };
            text += &format!("\n{remarks}{lines}");
        }
        let others = self.interface.ports(self.role.other());
        for port in others.filter(|port| port.kind == Kind::Input && !port.couples()) {
            let connection = connection(&port, self.role.other(), port.name(), Conversion::DECLARED);
            text += &format!("\n{}", table(&connection));
        }
        for causality in [Causality::Input, Causality::Output] {
            let variables: String = self.unconnected(causality).map(described).collect();
            if !variables.is_empty() {
                let model = in_line(self.fmu.attribute("modelName"));
                text += &format!("\n# {causality}s of {model} without a connection:\n{variables}");
            }
        }
        text
    }

    /// The interface's names for which the file proposes a similar name of the FMU.
    pub fn proposed(&self) -> impl Iterator<Item = &str> {
        let proposed =
            self.matches.iter().filter(|(port, found)| port.is_connectable() && found.proposal().is_some());
        proposed.map(|(port, _)| port.name())
    }

    /// The connection of a port with a variable of the FMU. A signal has no declared unit: it has the interface's.
    fn connection(&self, port: &Port<'_>, name: &str) -> Connection {
        let unit = port.unit().name;
        let differs = self.fmu.variable(name).is_some_and(|variable| variable.unit != unit);
        let from = (differs && !port.couples()).then_some(unit);
        connection(port, self.role, name, Conversion::Units { from, to: None })
    }
}

/// The connection of a port with a variable of an FMU in a role.
fn connection(port: &Port<'_>, role: Role, name: &str, conversion: Conversion) -> Connection {
    let other = role.other().name().to_owned();
    let [own_name, interface_name] = [name, port.name()].map(str::to_owned);
    let (source, output, target, input) = match port.kind {
        Kind::Input => (port.couples().then_some(other), interface_name, role.name().to_owned(), own_name),
        Kind::Output => (Some(role.name().to_owned()), own_name, other, interface_name),
    };
    let location = Location::argument(port.name());
    Connection { source, output, target, input, conversion, threshold: None, location }
}

/// A variable's name, type, unit and description, as a comment.
fn described(variable: &FmuVariable) -> String {
    let FmuVariable { name, data_type, unit, description, .. } = variable;
    let unit = if unit.is_empty() { String::new() } else { format!(", {unit}") };
    let description = if description.is_empty() { String::new() } else { format!(": {description}") };
    format!("# {}\n", in_line(&format!("  {name} ({data_type}{unit}){description}")))
}

fn table(connection: &Connection) -> String {
    format!("[[connection]]\n{connection}")
}

fn commented(connection: &Connection) -> String {
    format!("# {}\n", table(connection).trim_end().replace('\n', "\n# "))
}
