//! Systems of coupled components: the .ssd and .ssp files of System Structure and Parameterization 1.0
//! (SSP, sections 3 and 5).
//!
//! Beyond the schema, known tools have requirements:
//!
//! - OMSimulator needs its own annotation, which selects co-simulation, first; it needs the usual prefixes, and
//!   rejects `SystemGeometry` and a component's elements other than connectors, geometry and parameter bindings; from
//!   Python it fails on units of parameters inside the structure, so all parameter sets are separate files, and
//!   on a transformation that lacks one of its attributes;
//! - libcosim reads its step size from its own annotation, and supports only connections between components, hence
//!   [`SystemStructure::of_components`];
//! - FMPy needs a connection for every listed input.

use std::io::{self, Write};
use std::iter;

use fmu_terms::{Causality, Linear, Unit, Word};
use fmu_xml::{Attributes, XmlWriter, document, element, empty, float};

use crate::archive;
use crate::parameter_set::{self, Parameter, ParameterSet, Value};
use crate::units;
use crate::variable::ValueType;

/// The namespace of system structures.
const NAMESPACE: &str = "http://ssp-standard.org/SSP1/SystemStructureDescription";
/// The namespace of OMSimulator's annotations.
const OMSIMULATOR_NAMESPACE: &str =
    "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd";
/// The tolerance that OMSimulator passes to the FMUs: its own default. Its schema requires one.
const OMSIMULATOR_TOLERANCE: f64 = 1e-4;
/// The namespace of libcosim's annotations.
const LIBCOSIM_NAMESPACE: &str = "http://opensimulationplatform.com/SSP/OSPAnnotations";
/// The type of components that are FMUs (SSP, section 5).
pub(crate) const FMU_TYPE: &str = "application/x-fmu-sharedlibrary";
/// The structure that every package has, and every tool reads (SSP, section 3).
pub const DEFAULT_STRUCTURE: &str = "SystemStructure.ssd";

/// A system structure description: the system and its default simulation settings.
#[derive(Clone, Debug)]
pub struct SystemStructure {
    /// The name, unique among the variants in a package.
    pub name: String,
    /// The description for users.
    pub description: String,
    /// The root system; it contains the FMUs.
    pub system: System,
    /// The units used by connectors.
    pub units: Vec<Unit>,
    /// The default start of the simulation in s.
    pub start_time: f64,
    /// The default end of the simulation in s.
    pub stop_time: f64,
    /// The default communication step in s.
    pub step_size: f64,
}

/// A system of components.
#[derive(Clone, Debug)]
pub struct System {
    /// The system's name, unique within its parent.
    pub name: String,
    /// The system's connectors.
    pub connectors: Vec<Connector>,
    /// The components; sequential masters step them in this order.
    pub components: Vec<SystemComponent>,
    /// The connections between connectors of the components and the system.
    pub connections: Vec<Connection>,
}

/// An FMU in a system.
#[derive(Clone, Debug)]
pub struct SystemComponent {
    /// The component's name, unique within its parent.
    pub name: String,
    /// The FMU's path in the package.
    pub source: String,
    /// The connectors: variables of the FMU.
    pub connectors: Vec<Connector>,
    /// The component's rectangle in the diagram.
    pub placement: Placement,
    /// The paths of the component's parameter sets in the package; later ones override earlier ones.
    pub parameter_sets: Vec<String>,
}

/// A rectangle in mm, y upwards.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// The lower left corner.
    pub lower_left: (f64, f64),
    /// The upper right corner.
    pub upper_right: (f64, f64),
}

/// A connector of an element.
#[derive(Clone, Debug)]
pub struct Connector {
    /// The connector's name, unique within its parent.
    pub name: String,
    /// The direction, seen from outside the element.
    pub kind: Kind,
    /// The type of the connector's values: Real, Boolean or else Integer.
    pub value_type: ValueType,
    /// The unit; empty if unknown.
    pub unit: String,
    /// The start value of a system's input.
    pub start: Option<f64>,
    /// The position in the element's rectangle: 0 to 1 from left to right and bottom to top.
    pub place: (f64, f64),
}

/// The direction of a connector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Kind {
    Input,
    Output,
}

impl Kind {
    /// The kind's name in the standards, as FMI's causality and as SSP's kind.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.causality().as_str()
    }

    /// The causality of the variables that have such connectors.
    #[must_use]
    pub fn causality(self) -> Causality {
        match self {
            Self::Input => Causality::Input,
            Self::Output => Causality::Output,
        }
    }
}

/// A connection of two connectors.
#[derive(Clone, Debug)]
pub struct Connection {
    /// The source.
    pub start: End,
    /// The target.
    pub end: End,
    /// A conversion that replaces the unit conversion.
    pub transformation: Option<Linear>,
    /// The corners of the line, in mm.
    pub corners: Vec<(f64, f64)>,
}

/// One end of a connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct End {
    /// The component; none for the system itself.
    pub component: Option<String>,
    /// The connector's name.
    pub connector: String,
}

/// The .ssp archive: structures with their FMUs and parameter sets.
#[derive(Clone, Debug)]
pub struct SystemPackage {
    /// The structure for tools that do not support variants.
    pub structure: SystemStructure,
    /// Other structures by file name, such as `Components.ssd`.
    pub variants: Vec<(String, SystemStructure)>,
    /// FMUs and parameter sets by path.
    pub resources: Vec<(String, Vec<u8>)>,
}

impl SystemStructure {
    /// The structure without the system's connectors, under another name. It is for masters without support for system
    /// connectors, whose users set the components' inputs.
    #[must_use]
    pub fn of_components(&self, name: &str) -> Self {
        let mut structure = Self { name: name.to_owned(), ..self.clone() };
        structure.system.connectors.clear();
        structure.system.connections.retain(|connection| {
            [&connection.start, &connection.end].iter().all(|end| end.component.is_some())
        });
        structure
    }

    /// The structure with only these inputs of the system. It is for masters that set unconnected inputs to zero: those
    /// behind the other inputs are no connectors any more, and keep their start values.
    #[must_use]
    pub fn with_inputs(mut self, names: &[String]) -> Self {
        let System { connectors, components, connections, .. } = &mut self.system;
        let is_hidden =
            |connector: &Connector| connector.kind == Kind::Input && !names.contains(&connector.name);
        let hidden: Vec<_> = connectors.extract_if(.., |connector| is_hidden(connector)).collect();
        let is_from_hidden = |connection: &Connection| {
            let End { component, connector } = &connection.start;
            component.is_none() && hidden.iter().any(|known| known.name == *connector)
        };
        for Connection { end, .. } in connections.extract_if(.., |connection| is_from_hidden(connection)) {
            for component in components.iter_mut().filter(|known| end.component.as_ref() == Some(&known.name))
            {
                component.connectors.retain(|known| known.name != end.connector);
            }
        }
        self
    }

    /// The text of the .ssd file.
    #[must_use]
    pub fn to_xml(&self) -> String {
        let attributes = vec![
            ("xmlns:ssc", parameter_set::COMMON_NAMESPACE.to_owned()),
            ("xmlns:ssd", NAMESPACE.to_owned()),
            ("xmlns:ssv", parameter_set::NAMESPACE.to_owned()),
            ("xmlns:oms", OMSIMULATOR_NAMESPACE.to_owned()),
            ("xmlns:osp", LIBCOSIM_NAMESPACE.to_owned()),
            ("version", "1.0".to_owned()),
            ("name", self.name.clone()),
            ("description", self.description.clone()),
            ("generationTool", concat!("fmu-export ", env!("CARGO_PKG_VERSION")).to_owned()),
        ];
        document(|writer| {
            element(writer, "ssd:SystemStructureDescription", attributes, |writer| {
                self.write_system(writer)?;
                let is_used = |unit: &&Unit| {
                    let components =
                        self.system.components.iter().flat_map(|component| &component.connectors);
                    self.system
                        .connectors
                        .iter()
                        .chain(components)
                        .any(|connector| connector.unit == unit.name)
                };
                let units: Vec<_> = self.units.iter().filter(is_used).cloned().collect();
                units::write(writer, "ssd:Units", &units)?;
                let times = vec![("startTime", float(self.start_time)), ("stopTime", float(self.stop_time))];
                element(writer, "ssd:DefaultExperiment", times, |writer| self.write_libcosim_step(writer))
            })
        })
    }

    fn write_system(&self, writer: &mut XmlWriter) -> io::Result<()> {
        let system = &self.system;
        element(writer, "ssd:System", vec![("name", system.name.clone())], |writer| {
            self.write_connectors(writer, &system.connectors)?;
            let starts = self.start_values().map(|(path, _)| path);
            write_parameter_bindings(writer, starts.as_slice())?;
            element(writer, "ssd:Elements", vec![], |writer| {
                system.components.iter().try_for_each(|component| self.write_component(writer, component))
            })?;
            if !system.connections.is_empty() {
                element(writer, "ssd:Connections", vec![], |writer| {
                    system.connections.iter().try_for_each(|connection| connection.write(writer))
                })?;
            }
            self.write_omsimulator_step(writer)
        })
    }

    /// The start values of the system's inputs as a parameter set, with its path in the package, if any.
    fn start_values(&self) -> Option<(String, ParameterSet)> {
        let starts = self.system.connectors.iter().filter_map(|connector| {
            Some(Parameter {
                name: connector.name.clone(),
                description: String::new(),
                value: Value::Real(connector.start?, Some(connector.unit.clone())),
            })
        });
        let set = ParameterSet {
            name: "start values".to_owned(),
            description: String::new(),
            parameters: starts.collect(),
            units: self.units.clone(),
        };
        let path = format!("resources/{}_start_values.ssv", self.name);
        (!set.parameters.is_empty()).then_some((path, set))
    }

    fn write_component(&self, writer: &mut XmlWriter, component: &SystemComponent) -> io::Result<()> {
        let attributes = vec![
            ("name", component.name.clone()),
            ("type", FMU_TYPE.to_owned()),
            ("source", component.source.clone()),
            ("implementation", "CoSimulation".to_owned()),
        ];
        element(writer, "ssd:Component", attributes, |writer| {
            self.write_connectors(writer, &component.connectors)?;
            let Placement { lower_left, upper_right } = component.placement;
            let corners = vec![
                ("x1", float(lower_left.0)),
                ("y1", float(lower_left.1)),
                ("x2", float(upper_right.0)),
                ("y2", float(upper_right.1)),
            ];
            empty(writer, "ssd:ElementGeometry", corners)?;
            write_parameter_bindings(writer, &component.parameter_sets)
        })
    }

    fn write_connectors(&self, writer: &mut XmlWriter, connectors: &[Connector]) -> io::Result<()> {
        if connectors.is_empty() {
            return Ok(());
        }
        element(writer, "ssd:Connectors", vec![], |writer| {
            connectors.iter().try_for_each(|connector| {
                let kind = connector.kind.name().to_owned();
                let attributes = vec![("name", connector.name.clone()), ("kind", kind)];
                element(writer, "ssd:Connector", attributes, |writer| {
                    let is_defined =
                        self.units.iter().any(|unit| unit.name == connector.unit && unit.base.is_some());
                    let unit: Attributes =
                        is_defined.then(|| ("unit", connector.unit.clone())).into_iter().collect();
                    match connector.value_type {
                        ValueType::Real => empty(writer, "ssc:Real", unit)?,
                        ValueType::Boolean => empty(writer, "ssc:Boolean", vec![])?,
                        _ => empty(writer, "ssc:Integer", vec![])?,
                    }
                    let (x, y) = connector.place;
                    empty(writer, "ssd:ConnectorGeometry", vec![("x", float(x)), ("y", float(y))])
                })
            })
        })
    }

    fn write_omsimulator_step(&self, writer: &mut XmlWriter) -> io::Result<()> {
        annotation(writer, "org.openmodelica", |writer| {
            element(writer, "oms:Annotations", vec![], |writer| {
                element(writer, "oms:SimulationInformation", vec![], |writer| {
                    let attributes = vec![
                        ("description", "oms-ma".to_owned()),
                        ("stepSize", float(self.step_size)),
                        ("relativeTolerance", float(OMSIMULATOR_TOLERANCE)),
                    ];
                    empty(writer, "oms:FixedStepMaster", attributes)
                })
            })
        })
    }

    fn write_libcosim_step(&self, writer: &mut XmlWriter) -> io::Result<()> {
        annotation(writer, "com.opensimulationplatform", |writer| {
            element(writer, "osp:Algorithm", vec![], |writer| {
                empty(writer, "osp:FixedStepAlgorithm", vec![("baseStepSize", float(self.step_size))])
            })
        })
    }
}

impl Connection {
    fn write(&self, writer: &mut XmlWriter) -> io::Result<()> {
        let mut attributes = vec![];
        attributes.extend(self.start.component.clone().map(|component| ("startElement", component)));
        attributes.push(("startConnector", self.start.connector.clone()));
        attributes.extend(self.end.component.clone().map(|component| ("endElement", component)));
        attributes.push(("endConnector", self.end.connector.clone()));
        if self.transformation.is_some() {
            // Without this, the transformation would be applied in addition to the unit conversion.
            attributes.push(("suppressUnitConversion", true.to_string()));
        }
        element(writer, "ssd:Connection", attributes, |writer| {
            if let Some(Linear { factor, offset }) = self.transformation {
                // An offset of -0.0 is 0.
                let attributes = vec![("factor", float(factor)), ("offset", float(offset + 0.0))];
                empty(writer, "ssc:LinearTransformation", attributes)?;
            }
            let list = |values: Vec<String>| values.join(" ");
            let x = list(self.corners.iter().map(|corner| float(corner.0)).collect());
            let y = list(self.corners.iter().map(|corner| float(corner.1)).collect());
            empty(writer, "ssd:ConnectionGeometry", vec![("pointsX", x), ("pointsY", y)])
        })
    }
}

impl SystemPackage {
    /// All structures with their file names.
    fn structures(&self) -> impl Iterator<Item = (&str, &SystemStructure)> {
        let variants = self.variants.iter().map(|(path, structure)| (path.as_str(), structure));
        iter::once((DEFAULT_STRUCTURE, &self.structure)).chain(variants)
    }

    /// Writes the archive.
    ///
    /// # Errors
    /// When writing fails, or two parts have the same path.
    pub fn write(&self, writer: impl Write) -> io::Result<()> {
        let structures = self.structures().map(|(path, structure)| (path.to_owned(), structure.to_xml()));
        let starts = self.structures().filter_map(|(_, structure)| structure.start_values());
        let texts: Vec<_> = structures.chain(starts.map(|(path, set)| (path, set.to_xml()))).collect();
        let texts = texts.iter().map(|(path, text)| (path.clone(), text.as_bytes()));
        let resources = self.resources.iter().map(|(path, content)| (path.clone(), content.as_slice()));
        let entries: Vec<_> = texts.chain(resources).collect();
        archive::write(writer, &entries)
    }
}

/// Binds parameter sets by path in the package.
fn write_parameter_bindings(writer: &mut XmlWriter, sources: &[String]) -> io::Result<()> {
    if sources.is_empty() {
        return Ok(());
    }
    element(writer, "ssd:ParameterBindings", vec![], |writer| {
        sources
            .iter()
            .try_for_each(|source| empty(writer, "ssd:ParameterBinding", vec![("source", source.clone())]))
    })
}

fn annotation(
    writer: &mut XmlWriter,
    kind: &'static str,
    content: impl FnOnce(&mut XmlWriter) -> io::Result<()>,
) -> io::Result<()> {
    element(writer, "ssd:Annotations", vec![], |writer| {
        element(writer, "ssc:Annotation", vec![("type", kind.to_owned())], content)
    })
}
