//! Reads the structure of a system from any tool, in SSP 1.0 and 2.0 (SSP, section 5): its elements, which are FMUs,
//! systems and references to signal dictionaries, with their connections and parameters.

use std::collections::BTreeMap;
use std::io;

use fmu_terms::{Interface, Unit, Word};

use crate::model_description::Enumeration;
use crate::parameter_mapping::ParameterMapping;
use crate::parameter_set::ParameterSet;
use crate::system_structure::{DEFAULT_STRUCTURE, End, FMU_TYPE, Kind};
use crate::transformation::Transformation;
use crate::units;
use crate::xml::{
    self, Element, check_version, children, flag, listed, named, number, required, text, wrong,
};

/// A system as described in its package.
#[derive(Clone, Debug)]
pub struct SystemDescription {
    /// The default start of the simulation (s).
    pub start_time: Option<f64>,
    /// The default end of the simulation (s).
    pub stop_time: Option<f64>,
    /// The default communication step (s), from the annotations of OMSimulator and libcosim.
    pub step_size: Option<f64>,
    /// The root system.
    pub system: ElementDescription,
    /// Notes on what is ignored, as the schema of SSP does not have it.
    pub notes: Vec<String>,
}

/// A system, or an element of one.
#[derive(Clone, Debug)]
pub struct ElementDescription {
    /// The element's name, unique within its system.
    pub name: String,
    /// The element's connectors.
    pub connectors: Vec<ConnectorDescription>,
    /// The element's parameter sets; later ones override earlier ones.
    pub parameters: Vec<ParameterBinding>,
    /// What the element is.
    pub content: Content,
}

/// What an element is.
#[derive(Clone, Debug)]
pub enum Content {
    /// Elements and their connections.
    System {
        /// The system's elements, in file order.
        elements: Vec<ElementDescription>,
        /// The connections between connectors of the elements and the system.
        connections: Vec<ConnectionDescription>,
        /// The names of the system's signal dictionaries.
        dictionaries: Vec<String>,
    },
    /// A file.
    Component {
        /// What the component's file is.
        kind: ComponentKind,
        /// The file's path.
        source: String,
    },
    /// The signals of a dictionary in the system, or in one around it.
    Reference {
        /// The dictionary's name.
        dictionary: String,
    },
}

/// What the file of a component is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ComponentKind {
    /// An FMU, with the interface by which it must run, if the structure says so.
    Fmu(Option<Interface>),
    /// A package, with the name of the structure in it that is the component.
    Package(String),
    /// A structure.
    Structure,
}

/// A connector of the system or of an element.
#[derive(Clone, Debug, PartialEq)]
pub struct ConnectorDescription {
    /// The connector's name, unique within its parent.
    pub name: String,
    /// Whether the connector takes values, as inputs and parameters do, or gives them; none if its connections show it.
    pub kind: Option<Kind>,
    /// The unit, if one is given; its definition may be missing.
    pub unit: Option<Unit>,
    /// The items of an enumeration.
    pub items: Vec<(String, i32)>,
}

/// A connection of two connectors, which tell its direction.
#[derive(Clone, Debug, PartialEq)]
pub struct ConnectionDescription {
    /// One end of the connection.
    pub start: End,
    /// The other end of the connection.
    pub end: End,
    /// A transformation after the unit conversion.
    pub transformation: Transformation,
    /// Whether values are converted if the connectors' units differ.
    pub converts_units: bool,
}

/// A parameter set of an element.
#[derive(Clone, Debug)]
pub struct ParameterBinding {
    /// The prefix of the names in the set.
    pub prefix: String,
    /// The parameter set.
    pub set: Resource<ParameterSet>,
    /// How the parameters are mapped; if not, they keep their names.
    pub mapping: Option<Resource<ParameterMapping>>,
}

/// What a structure contains or refers to.
#[derive(Clone, Debug)]
pub enum Resource<T> {
    /// A resource in the structure itself.
    Inline(T),
    /// A file, by its path from the structure.
    File(String),
    /// A file in the component, by its path there.
    InComponent(String),
}

/// The definitions of a structure.
struct Definitions {
    units: Vec<Unit>,
    enumerations: Vec<Enumeration>,
}

impl SystemDescription {
    /// Reads the text of a structure.
    ///
    /// # Errors
    /// When it is not XML, or not a structure of SSP; the message names the element.
    pub fn parse(xml: &str) -> io::Result<Self> {
        let xml = xml::with_prefixes(xml);
        let document = xml::read(&xml, "SystemStructureDescription")?;
        let root = document.root_element();
        check_version(root, "structures")?;
        let item = |item| Ok((text(item, "name"), number(item, "value")?.unwrap_or_default()));
        let enumerations = listed(root, "Enumerations").map(|enumeration| {
            let items = named(enumeration, "Item").map(item).collect::<io::Result<_>>()?;
            Ok(Enumeration { name: text(enumeration, "name"), items })
        });
        let definitions = Definitions {
            units: units::read(named(root, "Units").flat_map(|list| named(list, "Unit")))?,
            enumerations: enumerations.collect::<io::Result<_>>()?,
        };
        let system = named(root, "System").next().ok_or_else(|| wrong(root, "it has no System"))?;
        let mut read = Self {
            start_time: None,
            stop_time: None,
            step_size: None,
            system: ElementDescription::read(system, &definitions)?,
            notes: unknown_attributes(root),
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
        Ok(read)
    }
}

/// The attributes of each element here in SSP 1.0 and 2.0, besides `id` and `description`, which all have.
const ATTRIBUTES: [(&str, &[&str]); 6] = [
    ("System", &["name"]),
    ("Component", &["name", "type", "source", "implementation"]),
    ("SignalDictionaryReference", &["name", "dictionary"]),
    ("Connector", &["name", "kind"]),
    (
        "Connection",
        &[
            "startElement",
            "startConnector",
            "endElement",
            "endConnector",
            "suppressUnitConversion",
            "startIndices",
            "endIndices",
        ],
    ),
    ("ParameterBinding", &["type", "source", "sourceBase", "prefix"]),
];

/// A note for each kind of attribute that the schema forbids, with the line of the first.
fn unknown_attributes(root: Element<'_>) -> Vec<String> {
    let own = root.tag_name().namespace();
    let mut notes = BTreeMap::new();
    for element in root.descendants().filter(|element| element.tag_name().namespace() == own) {
        let name = element.tag_name().name();
        let Some((_, known)) = ATTRIBUTES.iter().find(|(known, _)| *known == name) else { continue };
        let unknown = element.attributes().filter(|attribute| {
            attribute.namespace().is_none()
                && !["id", "description"].contains(&attribute.name())
                && !known.contains(&attribute.name())
        });
        for attribute in unknown {
            let line = element.document().text_pos_at(element.range().start).row;
            notes.entry((name, attribute.name())).or_insert(line);
        }
    }
    let note = |((element, attribute), line): ((&str, &str), u32)| {
        format!("line {line}: a {element} of SSP has no attribute {attribute}, which is ignored")
    };
    notes.into_iter().map(note).collect()
}

impl ElementDescription {
    fn read(element: Element<'_>, definitions: &Definitions) -> io::Result<Self> {
        let connectors = named(element, "Connectors").flat_map(|list| named(list, "Connector"));
        let bindings = named(element, "ParameterBindings").flat_map(|list| named(list, "ParameterBinding"));
        Ok(Self {
            name: required(element, "name")?,
            connectors: connectors
                .map(|connector| ConnectorDescription::read(connector, definitions))
                .collect(),
            parameters: bindings.map(ParameterBinding::read).collect::<io::Result<_>>()?,
            content: Content::read(element, definitions)?,
        })
    }
}

impl Content {
    fn read(element: Element<'_>, definitions: &Definitions) -> io::Result<Self> {
        match element.tag_name().name() {
            "System" => {
                let elements =
                    listed(element, "Elements").map(|each| ElementDescription::read(each, definitions));
                let connections = named(element, "Connections").flat_map(|list| named(list, "Connection"));
                let dictionaries = named(element, "SignalDictionaries");
                let dictionaries = dictionaries.flat_map(|list| named(list, "SignalDictionary"));
                Ok(Self::System {
                    elements: elements.collect::<io::Result<_>>()?,
                    connections: connections.map(ConnectionDescription::read).collect::<io::Result<_>>()?,
                    dictionaries: dictionaries.map(|dictionary| text(dictionary, "name")).collect(),
                })
            }
            "Component" => Self::component(element),
            "SignalDictionaryReference" => {
                Ok(Self::Reference { dictionary: required(element, "dictionary")? })
            }
            kind => Err(wrong(element, &format!("elements of the kind {kind} are not supported"))),
        }
    }

    fn component(element: Element<'_>) -> io::Result<Self> {
        let Some(uri) = element.attribute("source") else {
            // A design without an implementation counts as an empty system.
            return Ok(Self::System { elements: vec![], connections: vec![], dictionaries: vec![] });
        };
        let (uri, structure) = uri.split_once('#').unwrap_or((uri, DEFAULT_STRUCTURE));
        let source = path(element, uri)?;
        let ending = source.rsplit_once('.').map(|(_, ending)| ending);
        let kind = match (element.attribute("type"), ending) {
            (Some("application/x-ssp-package"), _) | (None, Some("ssp")) => {
                ComponentKind::Package(path(element, structure)?)
            }
            (Some("application/x-ssp-definition"), _) | (None, Some("ssd")) => ComponentKind::Structure,
            (None | Some(FMU_TYPE), _) => {
                let interface = match element.attribute("implementation") {
                    None | Some("any") => None,
                    Some(text) => Some(
                        Interface::of(text)
                            .ok_or_else(|| wrong(element, &format!("there is no implementation '{text}'")))?,
                    ),
                };
                ComponentKind::Fmu(interface)
            }
            (Some(other), _) => {
                return Err(wrong(element, &format!("components of the type {other} are not supported")));
            }
        };
        Ok(Self::Component { kind, source })
    }
}

impl ConnectorDescription {
    fn read(connector: Element<'_>, definitions: &Definitions) -> Self {
        let mut read = Self {
            name: text(connector, "name"),
            kind: match connector.attribute("kind") {
                Some("input" | "parameter" | "structuralParameter") => Some(Kind::Input),
                Some("output" | "calculatedParameter" | "constant" | "local") => Some(Kind::Output),
                _ => None,
            },
            unit: None,
            items: vec![],
        };
        for value_type in children(connector) {
            if let Some(name) = value_type.attribute("unit") {
                let known = units::find(name, &definitions.units);
                read.unit = Some(known.unwrap_or_else(|| Unit::undefined(name)));
            }
            if value_type.tag_name().name() == "Enumeration" {
                let name = text(value_type, "name");
                let known = definitions.enumerations.iter().find(|known| known.name == name);
                read.items = known.map(|known| known.items.clone()).unwrap_or_default();
            }
        }
        read
    }
}

impl ConnectionDescription {
    fn read(connection: Element<'_>) -> io::Result<Self> {
        if ["startIndices", "endIndices"].iter().any(|indices| connection.has_attribute(*indices)) {
            return Err(wrong(connection, "connections of an array's elements are not supported"));
        }
        let end = |element: &str, connector: &str| End {
            // OMSimulator has an empty name for the system.
            component: connection.attribute(element).filter(|name| !name.is_empty()).map(str::to_owned),
            connector: text(connection, connector),
        };
        Ok(Self {
            start: end("startElement", "startConnector"),
            end: end("endElement", "endConnector"),
            transformation: Transformation::read(connection)?,
            converts_units: !flag(connection, "suppressUnitConversion"),
        })
    }
}

impl ParameterBinding {
    fn read(binding: Element<'_>) -> io::Result<Self> {
        check_type(binding, "application/x-ssp-parameter-set")?;
        let set = match named(binding, "ParameterValues").next() {
            Some(values) => Resource::inline(values, "ParameterSet", ParameterSet::of)?,
            None => Resource::file(binding)?,
        };
        let mapping = named(binding, "ParameterMapping").next().map(|mapping| {
            check_type(mapping, "application/x-ssp-parameter-mapping")?;
            match mapping.attribute("source") {
                Some(_) => Resource::file(mapping),
                None => Resource::inline(mapping, "ParameterMapping", ParameterMapping::of),
            }
        });
        Ok(Self { prefix: text(binding, "prefix"), set, mapping: mapping.transpose()? })
    }
}

impl<T> Resource<T> {
    fn inline(
        parent: Element<'_>,
        name: &'static str,
        read: impl FnOnce(Element<'_>) -> io::Result<T>,
    ) -> io::Result<Self> {
        let content = named(parent, name).next();
        read(content.ok_or_else(|| wrong(parent, &format!("it has no {name}")))?).map(Self::Inline)
    }

    fn file(element: Element<'_>) -> io::Result<Self> {
        let path = path(element, &required(element, "source")?)?;
        Ok(if element.attribute("sourceBase") == Some("component") {
            Self::InComponent(path)
        } else {
            Self::File(path)
        })
    }
}

/// Refuses resources of other types than SSP's own.
fn check_type(element: Element<'_>, known: &str) -> io::Result<()> {
    match element.attribute("type") {
        Some(other) if other != known => Err(wrong(element, &format!("the type {other} is not supported"))),
        _ => Ok(()),
    }
}

/// The path that a relative URI means.
fn path(element: Element<'_>, uri: &str) -> io::Result<String> {
    let refuse = || wrong(element, &format!("the source '{uri}' is not a relative path"));
    if uri.is_empty() || uri.starts_with('/') || uri.contains(['\\', ':', '#', '?']) {
        return Err(refuse());
    }
    let mut parts = uri.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        let digits = part.get(..2).and_then(|digits| u8::from_str_radix(digits, 16).ok());
        bytes.push(digits.ok_or_else(refuse)?);
        bytes.extend(&part.as_bytes()[2..]);
    }
    let path = String::from_utf8(bytes).map_err(|_| refuse())?;
    if path.contains(['\\', ':', '\0']) { Err(refuse()) } else { Ok(path) }
}

#[cfg(test)]
mod tests {
    use fmu_terms::Linear;

    use super::*;
    use crate::parameter_set::Value;

    const STRUCTURE: &str = r#"<s:SystemStructureDescription xmlns:s="ssd" xmlns:c="ssc" xmlns:v="ssv" xmlns:m="ssm" xmlns:osp="osp"
        version="1.0" name="any">
        <s:System name="Loop">
          <s:Connectors><s:Connector name="r" kind="input"><c:Real unit="bar"/></s:Connector>
            <s:Connector name="mode" kind="output"><c:Enumeration name="Mode"/></s:Connector></s:Connectors>
          <s:ParameterBindings><s:ParameterBinding source="start.ssv" prefix="a."><s:ParameterMapping>
            <m:ParameterMapping version="1.0"><m:MappingEntry source="x" target="k" suppressUnitConversion="1">
              <c:BooleanMappingTransformation><c:MapEntry source="0" target="true"/></c:BooleanMappingTransformation>
            </m:MappingEntry></m:ParameterMapping></s:ParameterMapping></s:ParameterBinding></s:ParameterBindings>
          <s:Elements><s:Component name="a" source="./resources/an%20A.fmu" implementation="ModelExchange">
            <s:Connectors><s:Connector name="u" kind="input"><c:Float64 unit="Pa"/></s:Connector>
            <s:Connector name="k" kind="parameter"><c:Real/></s:Connector></s:Connectors>
            <s:ParameterBindings><s:ParameterBinding><s:ParameterValues><v:ParameterSet version="2.0" name="own">
              <v:Parameters><v:Parameter name="T"><v:Float64 value="1 2"/><v:Dimension size="1"/><v:Dimension size="2"/></v:Parameter>
              </v:Parameters></v:ParameterSet></s:ParameterValues></s:ParameterBinding></s:ParameterBindings>
          </s:Component>
          <s:Component name="b" source="resources/b.ssp#Other.ssd"/><s:Component name="design"/>
          <s:SignalDictionaryReference name="bus" dictionary="signals"/></s:Elements>
          <s:Connections>
            <s:Connection startElement="" startConnector="r" endElement="a" endConnector="u" suppressUnitConversion="true">
              <c:LinearTransformation factor="2" offset="1"/></s:Connection>
          </s:Connections>
          <s:SignalDictionaries><s:SignalDictionary name="signals" source="s.ssb"/></s:SignalDictionaries>
        </s:System>
        <s:Enumerations><c:Enumeration name="Mode"><c:Item name="off" value="3"/></c:Enumeration></s:Enumerations>
        <s:Units><c:Unit name="bar"><c:BaseUnit kg="1" m="-1" s="-2" factor="1e5"/></c:Unit></s:Units>
        <s:DefaultExperiment startTime="1" stopTime="5"><s:Annotations><c:Annotation><osp:Algorithm>
          <osp:FixedStepAlgorithm baseStepSize="0.25"/></osp:Algorithm></c:Annotation></s:Annotations>
        </s:DefaultExperiment></s:SystemStructureDescription>"#;

    #[test]
    fn a_structure_is_read() {
        let SystemDescription { system, start_time, stop_time, step_size, notes } =
            SystemDescription::parse(STRUCTURE).unwrap();
        assert_eq!(notes, [] as [&str; 0]);
        assert_eq!([start_time, stop_time, step_size], [Some(1.0), Some(5.0), Some(0.25)]);
        assert_eq!(system.name, "Loop");
        let [input, mode] = &system.connectors[..] else { panic!("{system:?}") };
        assert_eq!((input.name.as_str(), input.kind), ("r", Some(Kind::Input)));
        assert_eq!(input.unit.as_ref().and_then(|unit| unit.base).map(|base| base.factor), Some(1e5));
        assert_eq!((mode.kind, &mode.items[..]), (Some(Kind::Output), &[("off".to_owned(), 3)][..]));
        let [binding] = &system.parameters[..] else { panic!("{system:?}") };
        assert_eq!(binding.prefix, "a.");
        assert!(matches!(&binding.set, Resource::File(path) if path == "start.ssv"));
        let Some(Resource::Inline(ParameterMapping { entries })) = &binding.mapping else {
            panic!("{binding:?}")
        };
        assert_eq!((entries[0].target.as_str(), entries[0].converts_units), ("k", false));
        assert_eq!(entries[0].transformation.tabulated(Value::Boolean(false)), Value::Boolean(true));
        let Content::System { elements, connections, dictionaries } = &system.content else {
            panic!("{system:?}")
        };
        assert_eq!(dictionaries, &["signals"]);
        let contents = elements.iter().map(|element| format!("{} {:?}", element.name, element.content));
        assert_eq!(
            contents.collect::<Vec<_>>(),
            [
                r#"a Component { kind: Fmu(Some(ModelExchange)), source: "./resources/an A.fmu" }"#,
                r#"b Component { kind: Package("Other.ssd"), source: "resources/b.ssp" }"#,
                "design System { elements: [], connections: [], dictionaries: [] }",
                r#"bus Reference { dictionary: "signals" }"#,
            ]
        );
        let parameter = elements[0].connectors.iter().find(|connector| connector.name == "k").unwrap();
        assert_eq!((parameter.kind, &parameter.unit), (Some(Kind::Input), &None));
        let Resource::Inline(set) = &elements[0].parameters[0].set else { panic!("{system:?}") };
        let values = set.parameters.iter().map(|parameter| (parameter.name.as_str(), &parameter.value));
        assert_eq!(
            values.collect::<Vec<_>>(),
            [("T[1,1]", &Value::Real(1.0, None)), ("T[1,2]", &Value::Real(2.0, None)),]
        );
        let end = |component: Option<&str>, connector: &str| End {
            component: component.map(str::to_owned),
            connector: connector.to_owned(),
        };
        assert_eq!(
            connections,
            &[ConnectionDescription {
                start: end(None, "r"),
                end: end(Some("a"), "u"),
                transformation: Transformation::Function(Linear { factor: 2.0, offset: 1.0 }.into()),
                converts_units: false,
            }]
        );
    }

    #[test]
    fn what_is_not_supported_is_refused() {
        for (old, new, reason) in [
            (
                "version=\"1.0\" name",
                "version=\"Draft\" name",
                "structures of version 'Draft' are not supported",
            ),
            ("source=\"start.ssv\"", "", "it has no source"),
            ("\"resources/b.ssp", "\"osp://b.ssp", "the source 'osp://b.ssp' is not a relative path"),
            ("an%20A", "an%2zA", "the source './resources/an%2zA.fmu' is not a relative path"),
            ("\"ModelExchange\"", "\"Other\"", "there is no implementation 'Other'"),
            ("value=\"1 2\"", "value=\"1\"", "the parameter T has not as many values as elements"),
            (
                "<s:Component name=\"b\"",
                "<s:Other name=\"b\"",
                "elements of the kind Other are not supported",
            ),
            (
                "=\"resources/b.ssp#Other.ssd\"",
                "=\"b\" type=\"text/x-modelica\"",
                "of the type text/x-modelica are not",
            ),
            ("stopTime=\"5\"", "stopTime=\"five\"", "stopTime is 'five', which is not a valid number"),
        ] {
            let text = STRUCTURE.replace(old, new);
            assert_ne!(text, STRUCTURE, "{old}");
            let refusal = SystemDescription::parse(&text).unwrap_err().to_string();
            assert!(refusal.contains(reason), "{new}: {refusal}");
        }
        assert!(SystemDescription::parse("<a/>").unwrap_err().to_string().contains("the root element is a"));
    }
}
