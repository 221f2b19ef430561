//! From the declaration to the flat model: fills in components, spreads arrays into scalars, resolves names.
//!
//! All output is printed from the [`Model`], which is complete and consistent: anything else is rejected on the way,
//! here and in [`check`].

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

use serde_json::Value;

use crate::Package;
use crate::check;
use crate::declaration::{
    Causality, ComponentDeclaration, Declaration, Described, Initial, UnitDeclaration, UnitNames,
    Variability, VariableDeclaration,
};
use crate::dependencies;
use crate::error::{Refusal, Refusals, nearest};
use crate::interfaces::{Fmi, Version};
use crate::rust;
use crate::units::{self, Unit, Units};

/// The largest value reference that can be declared, leaving room for those that follow.
const LARGEST_REFERENCE: u32 = i32::MAX.cast_unsigned();

/// What an FMU for Scheduled Execution adds to the identifier of the same model's other FMU.
const SCHEDULED: &str = "Scheduled";

/// A model ready to be printed.
pub(crate) struct Model<'a> {
    pub(crate) declaration: &'a Declaration,
    pub(crate) fmi: Fmi,
    /// The declared identifier: the library's name.
    pub(crate) library: String,
    /// The FMU's identifier.
    pub(crate) identifier: String,
    pub(crate) description: Option<String>,
    pub(crate) author: Option<String>,
    pub(crate) license: Option<String>,
    pub(crate) version: &'a str,
    pub(crate) log_categories: Vec<Described>,
    /// The units used: those of the file first, in its order.
    pub(crate) units: Vec<Unit>,
    /// The interface (the part without a name) and the components.
    pub(crate) parts: Vec<Part<'a>>,
    /// All scalar variables, in the order of the XML.
    pub(crate) scalars: Vec<Scalar>,
    /// The scalars behind each name of a scalar or an array.
    pub(crate) names: BTreeMap<String, Vec<usize>>,
}

/// The variables of one component, or of none.
pub(crate) struct Part<'a> {
    pub(crate) name: Option<&'a str>,
    pub(crate) component_type: Option<&'a str>,
    pub(crate) state_group: Option<&'a str>,
    pub(crate) description: Option<&'a str>,
    pub(crate) fields: Vec<Field<'a>>,
    /// Its path in the declaration; empty for the interface.
    pub(crate) key: String,
}

/// A declared variable, possibly an array: a field of a generated struct.
pub(crate) struct Field<'a> {
    pub(crate) declaration: &'a VariableDeclaration,
    pub(crate) place: Place,
    pub(crate) data_type: DataType,
    /// Its scalars' positions, row by row.
    pub(crate) positions: Vec<usize>,
}

impl Field<'_> {
    /// Its name in Rust.
    pub(crate) fn name(&self) -> String {
        rust::snake_case(&self.declaration.name)
    }
}

/// The field of the generated `Variables` that holds a value; time and event indicators have none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Place {
    Time,
    Parameters,
    Inputs,
    States,
    Derivatives,
    Locals,
    Outputs,
    EventIndicators,
    Clocks,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DataType {
    Real,
    Integer,
    Boolean,
    String,
    /// The position among the model's enumerations.
    Enumeration(usize),
    /// FMI 3.0 only.
    Float32,
    /// FMI 3.0 only.
    Whole(Whole),
    /// FMI 3.0 only.
    Binary,
    /// FMI 3.0 only.
    Clock,
}

/// The integer types of FMI 3.0 other than `Int32`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Whole {
    Int8,
    UInt8,
    Int16,
    UInt16,
    UInt32,
    Int64,
    UInt64,
}

impl Whole {
    pub(crate) const ALL: [Self; 7] =
        [Self::Int8, Self::UInt8, Self::Int16, Self::UInt16, Self::UInt32, Self::Int64, Self::UInt64];

    /// The name in the standard, and in a declaration.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Int8 => "Int8",
            Self::UInt8 => "UInt8",
            Self::Int16 => "Int16",
            Self::UInt16 => "UInt16",
            Self::UInt32 => "UInt32",
            Self::Int64 => "Int64",
            Self::UInt64 => "UInt64",
        }
    }

    /// The Rust type, and its bounds.
    pub(crate) fn in_rust(self) -> (&'static str, RangeInclusive<i128>) {
        match self {
            Self::Int8 => ("i8", i8::MIN.into()..=i8::MAX.into()),
            Self::UInt8 => ("u8", u8::MIN.into()..=u8::MAX.into()),
            Self::Int16 => ("i16", i16::MIN.into()..=i16::MAX.into()),
            Self::UInt16 => ("u16", u16::MIN.into()..=u16::MAX.into()),
            Self::UInt32 => ("u32", u32::MIN.into()..=u32::MAX.into()),
            Self::Int64 => ("i64", i64::MIN.into()..=i64::MAX.into()),
            Self::UInt64 => ("u64", u64::MIN.into()..=u64::MAX.into()),
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Start {
    Real(f64),
    Integer(i128),
    Boolean(bool),
    String(String),
    Binary(Vec<u8>),
    /// The position among the enumeration's items, from 0.
    Item(usize),
}

/// A scalar variable.
pub(crate) struct Scalar {
    pub(crate) name: String,
    /// The path in the declaration.
    pub(crate) key: String,
    /// The positions of its part, and of its field there; a derivative has its state's.
    field: [usize; 2],
    pub(crate) value_reference: u32,
    pub(crate) description: Option<String>,
    pub(crate) place: Place,
    /// None for the independent variable.
    pub(crate) causality: Option<Causality>,
    pub(crate) variability: Variability,
    /// None for inputs and the independent variable.
    pub(crate) initial: Option<Initial>,
    pub(crate) data_type: DataType,
    pub(crate) unit: Option<String>,
    pub(crate) display_unit: Option<String>,
    pub(crate) min: Option<f64>,
    pub(crate) max: Option<f64>,
    pub(crate) nominal: Option<f64>,
    pub(crate) start: Option<Start>,
    /// For a derivative: the position of its state.
    pub(crate) state: Option<usize>,
    /// For a state: whether events may set it.
    pub(crate) reinit: bool,
    /// For a state: whether the equations are invalid below `min`, and above `max`.
    pub(crate) strict: [bool; 2],
    /// The positions of the clocks at whose ticks it changes; none if it changes at any time.
    pub(crate) clocks: Vec<usize>,
    /// For a clocked state: the position of its previous value.
    pub(crate) previous: Option<usize>,
    /// Whether it is such a previous value.
    pub(crate) is_previous: bool,
    /// Where the value is within its place, such as `tank.pressure` or `gain[0][2]`.
    pub(crate) path: String,
    pub(crate) reads: Reads,
    /// Likewise in initialization.
    pub(crate) initial_reads: Reads,
}

/// The positions of the variables that an equation reads; none if it may read everything.
pub(crate) type Reads = Option<Vec<usize>>;

impl Scalar {
    fn time() -> Self {
        Self {
            name: "time".to_owned(),
            key: String::new(),
            field: [0, 0],
            value_reference: 0,
            description: Some("Time".to_owned()),
            place: Place::Time,
            causality: None,
            variability: Variability::Continuous,
            initial: None,
            data_type: DataType::Real,
            unit: Some("s".to_owned()),
            display_unit: None,
            min: None,
            max: None,
            nominal: None,
            start: None,
            state: None,
            reinit: false,
            strict: [false; 2],
            clocks: Vec::new(),
            previous: None,
            is_previous: false,
            path: String::new(),
            reads: Some(Vec::new()),
            initial_reads: Some(Vec::new()),
        }
    }

    /// Whether it is given between steps.
    pub(crate) fn known_in_steps(&self) -> bool {
        matches!(self.place, Place::Inputs | Place::States | Place::Time) || self.is_input_clock()
    }

    /// Whether the importer activates it as a clock.
    pub(crate) fn is_input_clock(&self) -> bool {
        self.place == Place::Clocks && self.causality == Some(Causality::Input)
    }

    /// Whether it is given in initialization.
    pub(crate) fn known_in_initialization(&self) -> bool {
        matches!(self.place, Place::Inputs | Place::Time) || self.initial == Some(Initial::Exact)
    }

    /// Whether it belongs to the `InitialUnknowns`.
    pub(crate) fn unknown_in_initialization(&self) -> bool {
        !self.known_in_initialization()
            && (matches!(self.place, Place::Outputs | Place::States | Place::Derivatives)
                || self.place == Place::Clocks && self.causality == Some(Causality::Output)
                || self.causality == Some(Causality::CalculatedParameter))
    }
}

impl<'a> Model<'a> {
    /// Flattens and checks a declaration.
    pub(crate) fn new(
        declaration: &'a Declaration,
        units: &'a [UnitDeclaration],
        package: &'a Package,
        fmi: Fmi,
    ) -> Result<Self, Refusals> {
        let mut flattening = Flattening::new(declaration);
        let given = |text: &str| Some(text.to_owned()).filter(|text| !text.is_empty());
        let identifier =
            declaration.model_identifier.clone().unwrap_or_else(|| package.name.replace('-', "_"));
        check::declaration(declaration, &identifier, &mut flattening.refusals);
        flattening.refusals.check()?;
        flattening.add_part("variables", None, &declaration.variables);
        for (number, component) in declaration.components.iter().enumerate() {
            flattening.add_component(number, component);
        }
        flattening.refuse_unused_types();
        flattening.refusals.check()?;
        flattening.assign_value_references();
        flattening.look_up_reads();
        flattening.look_up_clocks();
        flattening.look_up_previous();
        let units = flattening.find_units(&Units::new(units));
        let Flattening { mut parts, mut scalars, names, mut refusals, .. } = flattening;
        check::state_groups(declaration, &parts, &scalars, &mut refusals);
        check::type_names(declaration, &parts, &mut refusals);
        check::types_of_version(&scalars, fmi.version, &mut refusals);
        check::outputs(&scalars, &mut refusals);
        check::calculated_parameters(&scalars, &mut refusals);
        check::clocks::all(declaration, fmi, &parts, &scalars, &mut refusals);
        dependencies::refuse_cycles(&scalars, &mut refusals);
        refusals.check()?;
        if fmi.version == Version::Three && fmi.interfaces.model_exchange() {
            add_event_indicators(&declaration.event_indicators, &mut scalars, &names, &mut refusals);
            refusals.check()?;
        }
        let library = identifier;
        let mut identifier = library.clone();
        if fmi.interfaces.scheduled_execution()
            && let Some(clock) = &declaration.sample_clock
        {
            identifier += SCHEDULED;
            add_sample_clock(clock, &mut parts, &mut scalars);
        }
        let model = Self {
            declaration,
            fmi,
            library,
            identifier,
            description: declaration.description.clone().or_else(|| given(&package.description)),
            author: declaration.author.clone().or_else(|| given(&package.authors.replace(':', ", "))),
            license: declaration.license.clone().or_else(|| given(&package.license)),
            version: &package.version,
            log_categories: log_categories(&declaration.log_categories),
            units,
            parts,
            scalars,
            names,
        };
        check::terminals(&model, &mut refusals);
        refusals.check()?;
        Ok(model)
    }

    /// The arrays that are one variable each, by their elements' positions: in FMI 3.0 those whose elements share a
    /// unit, and the derivatives of states. None in FMI 2.0.
    pub(crate) fn arrays(&self) -> Vec<Vec<usize>> {
        let mut arrays = Vec::new();
        if self.fmi.version == Version::Three {
            for field in self.parts.iter().flat_map(|part| &part.fields) {
                let declaration = field.declaration;
                if declaration.sizes.is_empty() || matches!(declaration.unit, Some(UnitNames::Each(_))) {
                    continue;
                }
                arrays.push(field.positions.clone());
                if field.place == Place::States {
                    arrays.push(field.positions.iter().map(|position| position + 1).collect());
                }
            }
        }
        arrays.sort_by_key(|array| self.scalars[array[0]].value_reference);
        arrays
    }

    /// The declared variable of a position.
    pub(crate) fn field(&self, position: usize) -> &Field<'a> {
        let [part, field] = self.scalars[position].field;
        &self.parts[part].fields[field]
    }

    /// The positions of a place's variables.
    pub(crate) fn in_place(&self, place: Place) -> impl Iterator<Item = usize> {
        (0..self.scalars.len()).filter(move |&position| self.scalars[position].place == place)
    }
}

/// Adds a sampled model's clock, with the value reference after all others. Everything that changes does so at its
/// ticks, depending on all that is known then.
fn add_sample_clock<'a>(clock: &'a VariableDeclaration, parts: &mut [Part<'a>], scalars: &mut Vec<Scalar>) {
    let position = scalars.len();
    for scalar in scalars.iter_mut() {
        if matches!(scalar.place, Place::Inputs | Place::Outputs | Place::Locals)
            && matches!(scalar.variability, Variability::Continuous | Variability::Discrete)
        {
            scalar.variability = Variability::Discrete;
            scalar.clocks = vec![position];
            scalar.reads = None;
        }
    }
    let last = scalars.iter().map(|scalar| scalar.value_reference).max().unwrap_or(0);
    let field = Field {
        declaration: clock,
        place: Place::Clocks,
        data_type: DataType::Clock,
        positions: vec![position],
    };
    scalars.push(Scalar {
        name: clock.name.clone(),
        field: [0, parts[0].fields.len()],
        value_reference: last + 1,
        description: clock.description.clone(),
        place: Place::Clocks,
        causality: Some(Causality::Input),
        variability: Variability::Discrete,
        data_type: DataType::Clock,
        unit: None,
        path: field.name(),
        ..Scalar::time()
    });
    parts[0].fields.push(field);
}

/// Adds the event indicators, variables in FMI 3.0, with the value references after all others.
fn add_event_indicators(
    indicators: &[String],
    scalars: &mut Vec<Scalar>,
    names: &BTreeMap<String, Vec<usize>>,
    refusals: &mut Refusals,
) {
    let last = scalars.iter().map(|scalar| scalar.value_reference).max().unwrap_or(0);
    for (number, (name, value_reference)) in indicators.iter().zip(last + 1..).enumerate() {
        let indicator = Scalar {
            name: format!("event_indicators.{name}"),
            value_reference,
            description: Some(format!("Event indicator {name}")),
            place: Place::EventIndicators,
            causality: Some(Causality::Local),
            initial: Some(Initial::Calculated),
            unit: None,
            reads: None,
            initial_reads: None,
            ..Scalar::time()
        };
        if names.contains_key(&indicator.name) {
            let reason = format!("{}: another variable has this name", indicator.name);
            refusals.add(format!("event_indicators[{number}]"), reason);
        }
        scalars.push(indicator);
    }
}

/// The runtime's log categories, unless declared, and the declared ones.
fn log_categories(declared: &[Described]) -> Vec<Described> {
    let default = [("logStatusError", "errors"), ("logStatusWarning", "warnings"), ("logEvents", "events")];
    default
        .into_iter()
        .filter(|(name, _)| declared.iter().all(|category| category.name != *name))
        .map(|(name, description)| Described { name: name.to_owned(), description: description.to_owned() })
        .chain(declared.iter().cloned())
        .collect()
}

/// The flattening in progress.
struct Flattening<'a> {
    declaration: &'a Declaration,
    /// The positions of the component types.
    types: BTreeMap<&'a str, usize>,
    parts: Vec<Part<'a>>,
    scalars: Vec<Scalar>,
    /// The declared value references, with their keys' paths.
    pinned: Vec<(usize, u32, String)>,
    /// The scalars behind each name in `reads`, of a scalar or an array.
    names: BTreeMap<String, Vec<usize>>,
    /// The equations whose reads are not yet resolved.
    equations: Vec<Equation<'a>>,
    refusals: Refusals,
}

/// What a scalar reads, as declared.
struct Equation<'a> {
    position: usize,
    component: Option<&'a ComponentDeclaration>,
    reads: Option<&'a [String]>,
    initial_reads: Option<&'a [String]>,
}

impl<'a> Flattening<'a> {
    fn new(declaration: &'a Declaration) -> Self {
        let types = declaration.component_types.iter().enumerate();
        Self {
            declaration,
            types: types.map(|(position, known)| (known.name.as_str(), position)).collect(),
            parts: Vec::new(),
            scalars: vec![Scalar::time()],
            pinned: Vec::new(),
            names: BTreeMap::from([("time".to_owned(), vec![0])]),
            equations: Vec::new(),
            refusals: Refusals::default(),
        }
    }

    fn add_component(&mut self, number: usize, component: &'a ComponentDeclaration) {
        let (name, key) = (&component.name, format!("components[{number}]"));
        let types = &self.declaration.component_types;
        let (variables, list) = match (&component.variables, &component.component_type) {
            (Some(variables), None) => {
                for (unused, of) in [
                    (!component.start.is_empty(), "start"),
                    (!component.connections.is_empty(), "connections"),
                ] {
                    if unused {
                        let reason = format!("{name}: '{of}' is for components with a type");
                        self.refusals.add(format!("{key}.{of}"), reason);
                    }
                }
                (variables, format!("{key}.variables"))
            }
            (None, Some(wanted)) => {
                if let Some(&found) = self.types.get(wanted.as_str()) {
                    (&types[found].variables, format!("component_types[{found}].variables"))
                } else {
                    let nearest = nearest(wanted, types.iter().map(|known| known.name.clone()));
                    let reason = format!("{name}: '{wanted}' is not one of the component_types{nearest}");
                    return self.refusals.add(format!("{key}.type"), reason);
                }
            }
            _ => return self.refusals.add(key, format!("{name}: it needs either 'variables' or a 'type'")),
        };
        let names: BTreeSet<_> = variables.iter().map(|variable| &variable.name).collect();
        for started in component.start.keys() {
            if !names.contains(started) {
                let known = variables.iter().map(|variable| variable.name.clone());
                let reason =
                    format!("{name}: its type has no variable '{started}'{}", nearest(started, known));
                self.refusals.add(format!("{key}.start.{started}"), reason);
            }
        }
        self.add_part(&list, Some((number, component)), variables);
    }

    fn add_part(
        &mut self,
        list: &str,
        component: Option<(usize, &'a ComponentDeclaration)>,
        variables: &'a [VariableDeclaration],
    ) {
        let (number, component) = component.unzip();
        let mut part = Part {
            name: component.map(|component| component.name.as_str()),
            component_type: component.and_then(|component| component.component_type.as_deref()),
            state_group: component.and_then(|component| component.state_group.as_deref()),
            description: component.and_then(|component| component.description.as_deref()),
            fields: Vec::new(),
            key: number.map(|number| format!("components[{number}]")).unwrap_or_default(),
        };
        let mut names = BTreeMap::new();
        for (position, variable) in variables.iter().enumerate() {
            let key = format!("{list}[{position}]");
            let own = component.and_then(|component| component.start.get(&variable.name));
            let (start, start_key) = match own {
                Some(_) => (own, format!("{}.start.{}", part.key, variable.name)),
                None => (variable.start.as_ref(), format!("{key}.start")),
            };
            let name_key = format!("{key}.name");
            let field = self.add_field(&part, component, variable, start, [key, start_key]);
            let Some(field) = self.refusals.take(field) else { continue };
            let name = &variable.name;
            if let Some(other) = names.insert((field.place, field.name()), name) {
                self.refusals.add(name_key, format!("{name}: its Rust name is that of '{other}'"));
            }
            part.fields.push(field);
        }
        self.parts.push(part);
    }

    /// Spreads a declared variable into its scalars, each state followed by its derivative.
    fn add_field(
        &mut self,
        part: &Part<'a>,
        component: Option<&'a ComponentDeclaration>,
        declaration: &'a VariableDeclaration,
        start: Option<&Value>,
        [key, start_key]: [String; 2],
    ) -> Result<Field<'a>, Refusal> {
        let prefix = part.name.map(|component| format!("{component}.")).unwrap_or_default();
        let name = format!("{prefix}{}", declaration.name);
        let before = self.scalars.len();
        let checked =
            check::variable(self.declaration, declaration, start, before).map_err(|(of, reason)| {
                let key = if of == "start" { start_key } else { format!("{key}.{of}") };
                Refusal::new(key, if of == "name" { reason } else { format!("{name}: {reason}") })
            })?;
        let describe = |text: &str| match part.description {
            Some(component) => format!("{component}: {text}"),
            None => text.to_owned(),
        };
        let mut positions = Vec::new();
        for (number, (subscripts, indices)) in elements(&declaration.sizes).into_iter().enumerate() {
            let position = self.scalars.len();
            positions.push(position);
            let unit = declaration.unit.as_ref().map(|unit| unit.of(number).to_owned());
            // A structural parameter's start value is its only value.
            let fixed = start.filter(|_| declaration.causality == Causality::StructuralParameter);
            let fixed = fixed.and_then(Value::as_f64);
            let state = Scalar {
                name: format!("{name}{subscripts}"),
                key: key.clone(),
                field: [self.parts.len(), part.fields.len()],
                description: declaration.description.as_deref().map(describe),
                place: checked.place,
                causality: Some(declaration.causality),
                variability: checked.variability,
                initial: checked.initial,
                data_type: checked.data_type,
                unit: unit.clone(),
                display_unit: declaration.display_unit.clone(),
                min: fixed.or(declaration.min),
                max: fixed.or(declaration.max),
                nominal: declaration.nominal,
                reinit: declaration.reinit,
                strict: [declaration.strict_min, declaration.strict_max],
                start: checked.starts.as_ref().map(|starts| starts[number].clone()),
                path: format!("{prefix}{}{indices}", rust::snake_case(&declaration.name)),
                ..Scalar::time()
            };
            let rate = declaration.derivative.as_ref().map(|derivative| Scalar {
                name: format!("der({})", state.name),
                key: format!("{key}.derivative"),
                field: state.field,
                description: Some(match &derivative.description {
                    Some(description) => describe(description),
                    None => format!("Time derivative of {}", state.name),
                }),
                place: Place::Derivatives,
                causality: Some(Causality::Local),
                variability: Variability::Continuous,
                initial: Some(Initial::Calculated),
                unit: derivative.unit.clone().or_else(|| unit.as_deref().map(units::per_second)),
                state: Some(position),
                path: state.path.clone(),
                ..Scalar::time()
            });
            let calculated = match checked.place {
                Place::Inputs | Place::Parameters => false,
                Place::Clocks => declaration.causality != Causality::Input,
                Place::States => checked.initial != Some(Initial::Exact),
                _ => checked.variability != Variability::Constant,
            };
            self.add_scalar(state)?;
            if calculated {
                self.equations.push(Equation {
                    position,
                    component,
                    reads: declaration.reads.as_deref(),
                    initial_reads: declaration.initial_reads.as_deref(),
                });
            }
            if let (Some(rate), Some(derivative)) = (rate, &declaration.derivative) {
                self.add_scalar(rate)?;
                self.equations.push(Equation {
                    position: position + 1,
                    component,
                    reads: derivative.reads.as_deref(),
                    initial_reads: derivative.initial_reads.as_deref(),
                });
            }
        }
        if !declaration.sizes.is_empty() {
            if checked.place == Place::States {
                let derivatives = positions.iter().map(|position| position + 1).collect();
                self.names.insert(format!("der({name})"), derivatives);
            }
            if self.names.insert(name.clone(), positions.clone()).is_some() {
                return Err(duplicate(&name, &key));
            }
        }
        self.pin(declaration, &positions, &key)?;
        Ok(Field { declaration, place: checked.place, data_type: checked.data_type, positions })
    }

    fn add_scalar(&mut self, scalar: Scalar) -> Result<(), Refusal> {
        if self.names.insert(scalar.name.clone(), vec![self.scalars.len()]).is_some() {
            return Err(duplicate(&scalar.name, &scalar.key));
        }
        self.scalars.push(scalar);
        Ok(())
    }

    /// Records a variable's declared value references: its own, and its derivative's, which follows unless declared.
    fn pin(
        &mut self,
        declaration: &VariableDeclaration,
        positions: &[usize],
        key: &str,
    ) -> Result<(), Refusal> {
        let derivative = declaration.derivative.as_ref();
        let own_derivative = derivative.and_then(|derivative| derivative.value_reference);
        let stride = if derivative.is_some() && own_derivative.is_none() { 2 } else { 1 };
        let mut pin = |first: Option<u64>, step: usize, offset: usize, key: &str| {
            let key = format!("{key}.value_reference");
            for (number, position) in positions.iter().enumerate() {
                let Some(first) = first else { continue };
                let reference = u32::try_from(first + (number * step) as u64).ok();
                let reference =
                    reference.filter(|&reference| reference <= LARGEST_REFERENCE).ok_or_else(|| {
                        Refusal::new(&key, format!("value references go up to {LARGEST_REFERENCE}"))
                    })?;
                self.pinned.push((position + offset, reference, key.clone()));
            }
            Ok(())
        };
        let own = declaration.value_reference.map(u64::from);
        pin(own, stride, 0, key)?;
        pin(own_derivative.map(u64::from), 1, 1, &format!("{key}.derivative"))?;
        if stride == 2 {
            pin(own.map(|own| own + 1), stride, 1, key)?;
        }
        Ok(())
    }

    /// Rejects types without a component, which nothing would check.
    fn refuse_unused_types(&mut self) {
        let used: BTreeSet<_> = self.parts.iter().filter_map(|part| part.component_type).collect();
        for (number, component_type) in self.declaration.component_types.iter().enumerate() {
            let name = &component_type.name;
            if !used.contains(name.as_str()) {
                self.refusals
                    .add(format!("component_types[{number}]"), format!("no component has the type '{name}'"));
            }
        }
    }

    /// Assigns the declared value references, and the gaps to other variables, in declaration order.
    fn assign_value_references(&mut self) {
        let mut taken = BTreeMap::new();
        for (position, reference, key) in &self.pinned {
            if let Some(other) = taken.insert(*reference, *position) {
                let (name, other) = (&self.scalars[*position].name, &self.scalars[other].name);
                let reason = format!("{name}: '{other}' also has the value reference {reference}");
                self.refusals.add(key, reason);
            }
            self.scalars[*position].value_reference = *reference;
        }
        let pinned: BTreeSet<_> = self.pinned.iter().map(|(position, ..)| *position).collect();
        let mut free = (0..).filter(|reference| !taken.contains_key(reference));
        for (position, scalar) in self.scalars.iter_mut().enumerate() {
            if !pinned.contains(&position) {
                scalar.value_reference = free.next().expect("there are more numbers than variables");
            }
        }
    }

    /// Resolves the names that equations read to positions.
    fn look_up_reads(&mut self) {
        let (mut used, mut read) = (BTreeSet::new(), 0);
        for Equation { position, component, reads, initial_reads } in &self.equations {
            let scalar = &self.scalars[*position];
            let mut look_up = |list: &str, names: &'a [String]| {
                let mut positions = BTreeSet::new();
                for (number, name) in names.iter().enumerate() {
                    if read > dependencies::MOST {
                        self.refusals.add(format!("{}.{list}", scalar.key), dependencies::too_many(scalar));
                        break;
                    }
                    match look_up_read(&self.names, *component, name, &mut used) {
                        Ok(found) => {
                            read += found.len();
                            positions.extend(found);
                        }
                        Err(reason) => {
                            let reason = format!("{}: {reason}", scalar.name);
                            self.refusals.add(format!("{}.{list}[{number}]", scalar.key), reason);
                        }
                    }
                }
                positions.into_iter().collect::<Vec<_>>()
            };
            let reads = reads.map(|names| look_up("reads", names));
            let initial_reads = initial_reads.map(|names| look_up("initial_reads", names));
            let scalar = &mut self.scalars[*position];
            scalar.initial_reads = initial_reads.or_else(|| reads.clone());
            if scalar.place != Place::States {
                scalar.reads = reads;
            }
        }
        for (number, component) in self.declaration.components.iter().enumerate() {
            for (connection, variable) in &component.connections {
                let name = &component.name;
                let reason = if !self.names.contains_key(variable) {
                    format!(
                        "{name}: there is no variable '{variable}'{}",
                        nearest(variable, self.names.keys().cloned())
                    )
                } else if used.contains(&(name.as_str(), connection.as_str())) {
                    continue;
                } else {
                    format!("{name}: no variable reads '{{{connection}}}'")
                };
                self.refusals.add(format!("components[{number}].connections.{connection}"), reason);
            }
        }
    }

    /// Resolves names of clocks to positions. A variable depends on their ticks, too.
    fn look_up_clocks(&mut self) {
        let mut clocked = Vec::new();
        for field in self.parts.iter().flat_map(|part| &part.fields) {
            for (number, name) in field.declaration.clocks.iter().enumerate() {
                let first = &self.scalars[field.positions[0]];
                let is_clock = |scalar: &&Scalar| scalar.place == Place::Clocks;
                let found = self.names.get(name).and_then(|positions| positions.first().copied());
                let reason = match found.filter(|&clock| is_clock(&&self.scalars[clock])) {
                    None => {
                        let clocks = self.scalars.iter().filter(is_clock).map(|clock| clock.name.clone());
                        format!("there is no clock '{name}'{}", nearest(name, clocks))
                    }
                    Some(clock) if clock == field.positions[0] => {
                        "a clock cannot belong to itself".to_owned()
                    }
                    Some(clock)
                        if self.scalars[clock].causality == Some(Causality::Local)
                            && first.causality != Some(Causality::Local) =>
                    {
                        format!("the clock '{name}' is local, so only local variables can belong to it")
                    }
                    Some(clock) => {
                        clocked.extend(field.positions.iter().map(|&position| (position, clock)));
                        continue;
                    }
                };
                self.refusals
                    .add(format!("{}.clocks[{number}]", first.key), format!("{}: {reason}", first.name));
            }
        }
        for (position, clock) in clocked {
            let scalar = &mut self.scalars[position];
            scalar.clocks.push(clock);
            if let Some(reads) = scalar.reads.as_mut().filter(|reads| !reads.contains(&clock)) {
                reads.push(clock);
            }
        }
    }

    /// Resolves names of previous values to positions (FMI 3.0.2, section 2.4.7.4).
    fn look_up_previous(&mut self) {
        let mut found = BTreeMap::new();
        for field in self.parts.iter().flat_map(|part| &part.fields) {
            let Some(name) = &field.declaration.previous else { continue };
            let first = &self.scalars[field.positions[0]];
            let previous = self.names.get(name);
            let reason = match previous.map(|positions| (positions, &self.scalars[positions[0]])) {
                None => format!("there is no variable '{name}'{}", nearest(name, self.names.keys().cloned())),
                Some((positions, _)) if *positions == field.positions => {
                    "a variable is not its own previous value".to_owned()
                }
                Some((positions, previous))
                    if previous.data_type != first.data_type || positions.len() != field.positions.len() =>
                {
                    format!("'{name}' differs in type or size")
                }
                Some((_, previous))
                    if previous.variability != Variability::Discrete
                        || previous.causality == Some(Causality::Input) =>
                {
                    format!("'{name}' is not a discrete output or local variable")
                }
                Some((positions, _)) if found.contains_key(&positions[0]) => {
                    format!("'{name}' is the previous value of another variable")
                }
                Some((positions, _)) => {
                    found.extend(positions.iter().copied().zip(field.positions.iter().copied()));
                    continue;
                }
            };
            self.refusals.add(format!("{}.previous", first.key), format!("{}: {reason}", first.name));
        }
        for (previous, state) in found {
            self.scalars[state].previous = Some(previous);
            self.scalars[previous].is_previous = true;
        }
    }

    /// The units used by variables.
    fn find_units(&mut self, units: &Units<'_>) -> Vec<Unit> {
        let mut used: Vec<Unit> = Vec::new();
        let mut places = BTreeMap::new();
        for scalar in &self.scalars {
            let Some(name) = scalar.unit.as_deref() else { continue };
            let mut refuse = |of: &str, reason: String| {
                self.refusals.add(format!("{}.{of}", scalar.key), format!("{}: {reason}", scalar.name));
            };
            let place = *places.entry(name).or_insert_with(|| {
                let unit = units.find(name).map_err(|reason| refuse("unit", reason)).ok()?;
                used.push(unit);
                Some(used.len() - 1)
            });
            if let Some(unit) = place.map(|place| &mut used[place])
                && let Some(display) = scalar.display_unit.as_deref()
                && unit.display_units.iter().all(|known| known.name != display)
            {
                match units.display_unit(name, display) {
                    Ok(display) => unit.display_units.push(display),
                    Err(reason) => refuse("display_unit", reason),
                }
            }
        }
        used.sort_by_key(|unit| units.position(&unit.name).unwrap_or(usize::MAX));
        used
    }
}

fn duplicate(name: &str, key: &str) -> Refusal {
    Refusal::new(format!("{key}.name"), format!("{name}: another variable has this name"))
}

/// The positions behind an entry of `reads`; records which connections are used.
fn look_up_read<'n, 'a>(
    names: &'n BTreeMap<String, Vec<usize>>,
    component: Option<&'a ComponentDeclaration>,
    read: &'a str,
    used: &mut BTreeSet<(&'a str, &'a str)>,
) -> Result<&'n [usize], String> {
    let (read, of_derivative) = match read.strip_prefix("der(").and_then(|read| read.strip_suffix(')')) {
        Some(state) => (state, true),
        None => (read, false),
    };
    let wrap = |name: &str| {
        if of_derivative { format!("der({name})") } else { name.to_owned() }
    };
    let placeholder = read.strip_prefix('{').and_then(|read| read.strip_suffix('}'));
    let candidates = if let Some(connection) = placeholder {
        let component = component
            .filter(|component| component.component_type.is_some())
            .ok_or_else(|| format!("it reads '{read}', but connections are for components with a type"))?;
        let name = component.connections.get(connection).ok_or_else(|| {
            format!("it reads '{read}', but the component '{}' has no such connection", component.name)
        })?;
        used.insert((&component.name, connection));
        if !names.contains_key(name) {
            // The connection itself is rejected.
            return Ok(&[]);
        }
        vec![wrap(name)]
    } else {
        let own = component.map(|component| wrap(&format!("{}.{read}", component.name)));
        own.into_iter().chain([wrap(read)]).collect()
    };
    candidates.iter().find_map(|name| names.get(name)).map(Vec::as_slice).ok_or_else(|| {
        let read = &candidates[candidates.len() - 1];
        format!("it reads '{read}', which does not exist{}", nearest(&candidates[0], names.keys().cloned()))
    })
}

/// An array's elements, row by row: the subscripts in FMI's notation (`[1,2]`) and the indices in Rust's (`[0][1]`). A
/// scalar has one element without either.
fn elements(dimensions: &[usize]) -> Vec<(String, String)> {
    let mut elements = vec![Vec::new()];
    for &size in dimensions {
        elements = elements
            .iter()
            .flat_map(|outer| (0..size).map(|index| [outer.as_slice(), &[index]].concat()))
            .collect();
    }
    elements
        .iter()
        .map(|element| {
            let subscripts: Vec<_> = element.iter().map(|index| (index + 1).to_string()).collect();
            let indices: Vec<_> = element.iter().map(|index| format!("[{index}]")).collect();
            (
                if subscripts.is_empty() { String::new() } else { format!("[{}]", subscripts.join(",")) },
                indices.concat(),
            )
        })
        .collect()
}
