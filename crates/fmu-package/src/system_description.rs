//! Reads the SystemStructure.ssd of a package from any tool: a system's components and their connections (SSP 1.0,
//! section 5).
//!
//! Nested systems, mapped parameters and connections with value tables are rejected.

use std::io;

use super::archive::{broken, is_inside};
use super::model_description::{Attributes, read_elements};
use super::system_structure::{End, Kind};
use super::units::{Linear, Unit};

const ROOT: &str = "SystemStructureDescription";

/// A system as described in its package.
#[derive(Clone, Debug, Default)]
pub struct SystemDescription {
    /// The system's name.
    pub name: String,
    /// The purpose of the system.
    pub description: String,
    /// The default start of the simulation (s).
    pub start_time: Option<f64>,
    /// The default end of the simulation (s).
    pub stop_time: Option<f64>,
    /// The default communication step (s), from the annotations of OMSimulator and libcosim.
    pub step_size: Option<f64>,
    /// The system's connectors.
    pub connectors: Vec<ConnectorDescription>,
    /// The paths of the system's parameter sets in the package; later ones override earlier ones.
    pub parameter_sets: Vec<String>,
    /// In file order.
    pub components: Vec<ComponentDescription>,
    /// Between connectors of the components and the system.
    pub connections: Vec<ConnectionDescription>,
    /// The units used by connectors.
    pub units: Vec<Unit>,
}

/// A connector of the system or of a component.
#[derive(Clone, Debug, PartialEq)]
pub struct ConnectorDescription {
    /// Unique within its parent.
    pub name: String,
    /// The direction; none for parameters.
    pub kind: Option<Kind>,
    /// The unit; empty if unknown.
    pub unit: String,
}

/// A component: an FMU.
#[derive(Clone, Debug, Default)]
pub struct ComponentDescription {
    /// Unique within the system.
    pub name: String,
    /// The FMU's path in the package.
    pub source: String,
    /// Its connectors.
    pub connectors: Vec<ConnectorDescription>,
    /// The paths of its parameter sets in the package; later ones override earlier ones.
    pub parameter_sets: Vec<String>,
}

/// A connection of two connectors.
#[derive(Clone, Debug, PartialEq)]
pub struct ConnectionDescription {
    /// The source.
    pub start: End,
    /// The target.
    pub end: End,
    /// A conversion after the unit conversion.
    pub transformation: Linear,
    /// Whether values are converted if the connectors' units differ.
    pub converts_units: bool,
}

impl SystemDescription {
    /// Reads the text of a SystemStructure.ssd.
    ///
    /// # Errors
    /// When it is not XML, or not of a flat system of SSP 1; the message names the element.
    pub fn parse(xml: &str) -> io::Result<Self> {
        let mut system = Self::default();
        let root = read_elements(xml, |path, name, attributes| match path {
            [ROOT, rest @ ..] => system.take(rest, name, &attributes),
            [] if name == ROOT => {
                let version = attributes.text("version");
                if !version.starts_with("1.") {
                    return Err(broken(format!("structures of version '{version}' are not supported")));
                }
                system.description = attributes.text("description");
                Ok(())
            }
            _ => Ok(()),
        })?;
        if root != ROOT {
            return Err(broken(format!("the root element is {root}, not {ROOT}")));
        }
        Ok(system)
    }

    /// Adopts an element below the root.
    fn take(&mut self, path: &[&str], name: &str, attributes: &Attributes) -> io::Result<()> {
        match (path, name) {
            ([], "System") => self.name = attributes.text("name"),
            ([], "DefaultExperiment") => {
                self.start_time = time(attributes, "startTime")?;
                self.stop_time = time(attributes, "stopTime")?;
            }
            ([.., "SimulationInformation"], "FixedStepMaster") => {
                self.step_size = time(attributes, "stepSize")?;
            }
            ([.., "Algorithm"], "FixedStepAlgorithm") => self.step_size = time(attributes, "baseStepSize")?,
            (["Units"], "Unit") => {
                self.units.push(Unit { name: attributes.text("name"), base: None, display_units: vec![] });
            }
            (["Units", "Unit"], _) => {
                if let Some(unit) = self.units.last_mut() {
                    unit.take(name, attributes)?;
                }
            }
            (["System", rest @ ..], _) => self.take_in_system(rest, name, attributes)?,
            _ => {}
        }
        Ok(())
    }

    /// Adopts an element of the system.
    fn take_in_system(&mut self, path: &[&str], name: &str, attributes: &Attributes) -> io::Result<()> {
        match (path, name) {
            (["Elements"], "Component") => self.components.push(ComponentDescription {
                name: attributes.text("name"),
                source: inside(attributes)?,
                ..ComponentDescription::default()
            }),
            (["Elements"], other) => {
                return Err(broken(format!("{other} elements are not supported")));
            }
            (["Connections"], "Connection") => {
                let end = |element: &str, connector: &str| End {
                    component: attributes.get(element).map(str::to_owned),
                    connector: attributes.text(connector),
                };
                self.connections.push(ConnectionDescription {
                    start: end("startElement", "startConnector"),
                    end: end("endElement", "endConnector"),
                    transformation: Linear::IDENTITY,
                    converts_units: !matches!(attributes.get("suppressUnitConversion"), Some("true" | "1")),
                });
            }
            (["Connections", "Connection"], "LinearTransformation") => {
                if let Some(connection) = self.connections.last_mut() {
                    connection.transformation = Linear {
                        factor: attributes.number("factor", 1.0)?,
                        offset: attributes.number("offset", 0.0)?,
                    };
                }
            }
            (
                ["Connections", "Connection"],
                "BooleanMappingTransformation"
                | "IntegerMappingTransformation"
                | "EnumerationMappingTransformation",
            ) => {
                return Err(broken("connections with value tables are not supported"));
            }
            (["Elements", "Component", rest @ ..], _) => {
                if let Some(component) = self.components.last_mut() {
                    take_part(
                        &mut component.connectors,
                        &mut component.parameter_sets,
                        rest,
                        name,
                        attributes,
                    )?;
                }
            }
            _ => take_part(&mut self.connectors, &mut self.parameter_sets, path, name, attributes)?,
        }
        Ok(())
    }
}

/// Adopts connectors and parameter sets, alike in systems and components.
fn take_part(
    connectors: &mut Vec<ConnectorDescription>,
    parameter_sets: &mut Vec<String>,
    path: &[&str],
    name: &str,
    attributes: &Attributes,
) -> io::Result<()> {
    match (path, name) {
        (["Connectors"], "Connector") => connectors.push(ConnectorDescription {
            name: attributes.text("name"),
            kind: match attributes.get("kind") {
                Some("input") => Some(Kind::Input),
                Some("output") => Some(Kind::Output),
                _ => None,
            },
            unit: String::new(),
        }),
        (["Connectors", "Connector"], "Real") => {
            if let Some(connector) = connectors.last_mut() {
                connector.unit = attributes.text("unit");
            }
        }
        (["ParameterBindings"], "ParameterBinding") => {
            if attributes.get("prefix").is_some() || attributes.get("sourceBase") == Some("component") {
                return Err(broken("parameter sets with a prefix or within a component are not supported"));
            }
            parameter_sets.push(inside(attributes)?);
        }
        (["ParameterBindings", "ParameterBinding"], "ParameterMapping") => {
            return Err(broken("mapped parameters are not supported"));
        }
        _ => {}
    }
    Ok(())
}

/// The path of a file in the package.
fn inside(attributes: &Attributes) -> io::Result<String> {
    match attributes.get("source") {
        Some(path) if is_inside(path) => Ok(path.to_owned()),
        Some(path) => Err(broken(format!("'{path}' is not a file in the package"))),
        None => Err(broken("parameters within the structure are not supported")),
    }
}

fn time(attributes: &Attributes, name: &str) -> io::Result<Option<f64>> {
    attributes.get(name).map(|_| attributes.number(name, 0.0)).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRUCTURE: &str = r#"<ssd:SystemStructureDescription xmlns:ssd="" xmlns:ssc="" version="1.0" name="any">
        <ssd:System name="Loop">
          <ssd:Connectors><ssd:Connector name="r" kind="input"><ssc:Real unit="bar"/></ssd:Connector></ssd:Connectors>
          <ssd:ParameterBindings><ssd:ParameterBinding source="start.ssv"/></ssd:ParameterBindings>
          <ssd:Elements><ssd:Component name="a" source="resources/A.fmu">
            <ssd:Connectors><ssd:Connector name="u" kind="input"><ssc:Real unit="Pa"/></ssd:Connector>
            <ssd:Connector name="k" kind="parameter"><ssc:Real/></ssd:Connector></ssd:Connectors>
            <ssd:ParameterBindings><ssd:ParameterBinding source="a.ssv"/></ssd:ParameterBindings>
          </ssd:Component></ssd:Elements>
          <ssd:Connections>
            <ssd:Connection startConnector="r" endElement="a" endConnector="u" suppressUnitConversion="true">
              <ssc:LinearTransformation factor="2" offset="1"/></ssd:Connection>
          </ssd:Connections>
        </ssd:System>
        <ssd:Units><ssc:Unit name="bar"><ssc:BaseUnit kg="1" m="-1" s="-2" factor="1e5"/></ssc:Unit></ssd:Units>
        <ssd:DefaultExperiment startTime="1" stopTime="5"><ssd:Annotations><ssc:Annotation><osp:Algorithm>
          <osp:FixedStepAlgorithm baseStepSize="0.25"/></osp:Algorithm></ssc:Annotation></ssd:Annotations>
        </ssd:DefaultExperiment></ssd:SystemStructureDescription>"#;

    #[test]
    fn a_structure_is_read() {
        let system = SystemDescription::parse(STRUCTURE).unwrap();
        let connector = |name: &str, kind, unit: &str| ConnectorDescription {
            name: name.to_owned(),
            kind,
            unit: unit.to_owned(),
        };
        assert_eq!(
            (system.name.as_str(), system.start_time, system.stop_time),
            ("Loop", Some(1.0), Some(5.0))
        );
        assert_eq!(system.step_size, Some(0.25));
        assert_eq!(system.connectors, [connector("r", Some(Kind::Input), "bar")]);
        assert_eq!(system.parameter_sets, ["start.ssv"]);
        let [component] = &system.components[..] else { panic!("{system:?}") };
        assert_eq!((component.name.as_str(), component.source.as_str()), ("a", "resources/A.fmu"));
        assert_eq!(component.connectors, [connector("u", Some(Kind::Input), "Pa"), connector("k", None, "")]);
        assert_eq!(component.parameter_sets, ["a.ssv"]);
        let end = |component: Option<&str>, connector: &str| End {
            component: component.map(str::to_owned),
            connector: connector.to_owned(),
        };
        assert_eq!(
            system.connections,
            [ConnectionDescription {
                start: end(None, "r"),
                end: end(Some("a"), "u"),
                transformation: Linear { factor: 2.0, offset: 1.0 },
                converts_units: false,
            }]
        );
        assert_eq!(system.units[0].base.map(|base| base.factor), Some(1e5));
    }

    #[test]
    fn what_is_not_supported_is_refused() {
        for (old, new, reason) in [
            ("version=\"1.0\"", "version=\"2.0\"", "structures of version '2.0' are not supported"),
            ("resources/A.fmu", "../A.fmu", "'../A.fmu' is not a file in the package"),
            (" source=\"a.ssv\"", "", "parameters within the structure are not supported"),
            ("source=\"a.ssv\"", "source=\"a.ssv\" prefix=\"b.\"", "with a prefix or within a component"),
            ("stopTime=\"5\"", "stopTime=\"five\"", "stopTime is 'five', which is not a valid number"),
            ("<ssd:Elements>", "<ssd:Elements><ssd:System name=\"b\"/>", "System elements are not supported"),
        ] {
            let text = STRUCTURE.replace(old, new);
            assert_ne!(text, STRUCTURE, "{old}");
            let refusal = SystemDescription::parse(&text).unwrap_err().to_string();
            assert!(refusal.contains(reason), "{new}: {refusal}");
        }
        assert!(SystemDescription::parse("<a/>").unwrap_err().to_string().contains("the root element is a"));
    }
}
