//! A file of all connections of the system with an FMU, for the user to edit.

use fmu_io::document::Location;
use fmu_io::terminal::in_line;
use fmu_package::Kind;
use fmu_package::connection::{Connection, Conversion};

use crate::compatibility::{Compatibility, Match};
use crate::{Port, Role};

/// Stands for the name that the user fills in.
const OPEN: &str = "?";

impl Compatibility<'_> {
    /// The text of a file of all connections of the system. Those that are open are comments, with the most similar
    /// variable if there is one.
    #[must_use]
    pub fn connections(&self) -> String {
        let mut text = format!(
            "# {} as the {}: all connections, for a scenario or --connections\n",
            in_line(self.fmu.attribute("modelName")),
            self.role.name()
        );
        for (port, found) in self.connectable() {
            let given = self.choices.get(port.name()).map(|choice| choice.connection.clone());
            let lines = match (found, found.proposal()) {
                (Match::Found { variable, .. }, _) => {
                    table(&given.unwrap_or_else(|| self.connection(port, &variable.name)))
                }
                (_, Some(name)) => commented(&self.connection(port, name)),
                _ if port.is_required() => commented(&self.connection(port, OPEN)),
                _ => continue,
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
        text
    }

    /// The interface's names for which the file proposes a similar name of the FMU.
    pub fn proposed(&self) -> impl Iterator<Item = &str> {
        let proposed = self.connectable().filter(|(_, found)| found.proposal().is_some());
        proposed.map(|(port, _)| port.name())
    }

    /// What a connection can lead to or from.
    fn connectable(&self) -> impl Iterator<Item = &(Port<'_>, Match<'_>)> {
        self.matches.iter().filter(|(port, _)| port.couples() || port.kind == Kind::Input)
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

fn table(connection: &Connection) -> String {
    format!("[[connection]]\n{connection}")
}

fn commented(connection: &Connection) -> String {
    format!("# {}\n", table(connection).trim_end().replace('\n', "\n# "))
}
