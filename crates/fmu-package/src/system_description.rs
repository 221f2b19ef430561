//! Reads the SystemStructure.ssd of a package from any tool: a system's components and their connections (SSP 1.0,
//! section 5).
//!
//! Nested systems, mapped parameters and connections with value tables are rejected.

use std::io;

use fmu_terms::{Linear, Unit};

use crate::system_structure::{End, Kind};
use crate::units;
use crate::validation::archive::is_inside;
use crate::xml::{self, Element, children, flag, listed, named, number, text, wrong};

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
        let document = xml::read(xml, ROOT)?;
        let root = document.root_element();
        let version = text(root, "version");
        if !version.starts_with("1.") {
            return Err(wrong(root, &format!("structures of version '{version}' are not supported")));
        }
        let mut read = Self {
            description: text(root, "description"),
            units: units::read(named(root, "Units").flat_map(|list| named(list, "Unit")))?,
            ..Self::default()
        };
        for experiment in named(root, "DefaultExperiment") {
            read.start_time = number(experiment, "startTime")?;
            read.stop_time = number(experiment, "stopTime")?;
        }
        for master in root.descendants() {
            match master.tag_name().name() {
                "FixedStepMaster" => read.step_size = number(master, "stepSize")?,
                "FixedStepAlgorithm" => read.step_size = number(master, "baseStepSize")?,
                _ => {}
            }
        }
        let Some(system) = named(root, "System").next() else { return Ok(read) };
        read.name = text(system, "name");
        (read.connectors, read.parameter_sets) = (connectors(system), parameter_sets(system)?);
        for element in listed(system, "Elements") {
            let kind = element.tag_name().name();
            if kind != "Component" {
                return Err(wrong(element, &format!("{kind} elements are not supported")));
            }
            read.components.push(ComponentDescription {
                name: text(element, "name"),
                source: inside(element)?,
                connectors: connectors(element),
                parameter_sets: parameter_sets(element)?,
            });
        }
        let connections = named(system, "Connections").flat_map(|list| named(list, "Connection"));
        read.connections = connections.map(ConnectionDescription::read).collect::<io::Result<_>>()?;
        Ok(read)
    }
}

impl ConnectionDescription {
    fn read(connection: Element<'_>) -> io::Result<Self> {
        let end = |element: &str, connector: &str| End {
            component: connection.attribute(element).map(str::to_owned),
            connector: text(connection, connector),
        };
        let mut transformation = Linear::IDENTITY;
        for child in children(connection) {
            match child.tag_name().name() {
                "LinearTransformation" => {
                    transformation.factor = number(child, "factor")?.unwrap_or(1.0);
                    transformation.offset = number(child, "offset")?.unwrap_or(0.0);
                }
                "BooleanMappingTransformation"
                | "IntegerMappingTransformation"
                | "EnumerationMappingTransformation" => {
                    return Err(wrong(child, "connections with value tables are not supported"));
                }
                _ => {}
            }
        }
        Ok(Self {
            start: end("startElement", "startConnector"),
            end: end("endElement", "endConnector"),
            transformation,
            converts_units: !flag(connection, "suppressUnitConversion"),
        })
    }
}

/// The connectors of the system or of a component.
fn connectors(element: Element<'_>) -> Vec<ConnectorDescription> {
    let connectors = named(element, "Connectors").flat_map(|list| named(list, "Connector"));
    let read = |connector: Element<'_>| ConnectorDescription {
        name: text(connector, "name"),
        kind: match connector.attribute("kind") {
            Some("input") => Some(Kind::Input),
            Some("output") => Some(Kind::Output),
            _ => None,
        },
        unit: named(connector, "Real").next().map(|real| text(real, "unit")).unwrap_or_default(),
    };
    connectors.map(read).collect()
}

/// The parameter sets of the system or of a component.
fn parameter_sets(element: Element<'_>) -> io::Result<Vec<String>> {
    let bindings = named(element, "ParameterBindings").flat_map(|list| named(list, "ParameterBinding"));
    let read = |binding: Element<'_>| {
        if binding.has_attribute("prefix") || binding.attribute("sourceBase") == Some("component") {
            return Err(wrong(
                binding,
                "parameter sets with a prefix or within a component are not supported",
            ));
        }
        if named(binding, "ParameterMapping").next().is_some() {
            return Err(wrong(binding, "mapped parameters are not supported"));
        }
        inside(binding)
    };
    bindings.map(read).collect()
}

/// The path of a file in the package.
fn inside(element: Element<'_>) -> io::Result<String> {
    match element.attribute("source") {
        Some(path) if is_inside(path) => Ok(path.to_owned()),
        Some(path) => Err(wrong(element, &format!("'{path}' is not a file in the package"))),
        None => Err(wrong(element, "parameters within the structure are not supported")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRUCTURE: &str = r#"<ssd:SystemStructureDescription xmlns:ssd="ssd" xmlns:ssc="ssc" xmlns:osp="osp" version="1.0" name="any">
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
