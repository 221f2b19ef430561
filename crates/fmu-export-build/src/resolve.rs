//! From the JSON to the flat model: components filled in, arrays spread into scalars, names looked up.
//!
//! Everything that is generated is printed from the [`Resolved`] model, and what reaches it is complete
//! and consistent: whatever cannot be is refused on the way, here and in [`check`].

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::check;
use super::dependencies;
use super::error::Refusal;
use super::json;

/// A model that is ready to be printed.
pub(crate) struct Resolved<'a> {
    pub(crate) model: &'a json::Model,
    /// The version of the package that the model belongs to.
    pub(crate) version: &'a str,
    /// The units that are used.
    pub(crate) units: Vec<&'a json::Unit>,
    /// The interface (the part without a name) and the components.
    pub(crate) parts: Vec<Part<'a>>,
    /// Every scalar variable; the position is the value reference.
    pub(crate) variables: Vec<Variable>,
}

/// The variables of one component, or those of none.
pub(crate) struct Part<'a> {
    pub(crate) name: Option<&'a str>,
    pub(crate) component_type: Option<&'a str>,
    pub(crate) state_group: Option<&'a str>,
    pub(crate) description: &'a str,
    pub(crate) fields: Vec<Field<'a>>,
}

/// A variable as it is declared, maybe an array: a field of a generated struct.
pub(crate) struct Field<'a> {
    pub(crate) json: &'a json::Variable,
    pub(crate) role: Role,
    pub(crate) data_type: DataType,
    /// The positions of its scalars, row by row.
    pub(crate) positions: Vec<usize>,
}

/// What a variable is for; this decides the generated struct that holds it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Role {
    Independent,
    Parameter,
    Input,
    State,
    Derivative,
    Output,
    CalculatedParameter,
    Local,
}

impl Role {
    /// The causality; none for the independent variable.
    pub(crate) fn causality(self) -> Option<json::Causality> {
        match self {
            Self::Independent => None,
            Self::Parameter => Some(json::Causality::Parameter),
            Self::Input => Some(json::Causality::Input),
            Self::Output => Some(json::Causality::Output),
            Self::CalculatedParameter => Some(json::Causality::CalculatedParameter),
            Self::State | Self::Derivative | Self::Local => Some(json::Causality::Local),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DataType {
    Real,
    Integer,
    Boolean,
    String,
    /// The position among the model's enumerations.
    Enumeration(usize),
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Start {
    Real(f64),
    Integer(i32),
    Boolean(bool),
    String(String),
    /// The position among the enumeration's items, from 0.
    Item(usize),
}

/// A scalar variable.
pub(crate) struct Variable {
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) role: Role,
    pub(crate) variability: json::Variability,
    /// None for inputs and the independent variable.
    pub(crate) initial: Option<json::Initial>,
    pub(crate) data_type: DataType,
    pub(crate) unit: Option<String>,
    pub(crate) display_unit: Option<String>,
    pub(crate) min: Option<f64>,
    pub(crate) max: Option<f64>,
    pub(crate) nominal: Option<f64>,
    pub(crate) start: Option<Start>,
    /// For a derivative: the position of its state.
    pub(crate) state: Option<usize>,
    /// Where the value is in the generated struct of its role, e.g. `tank.pressure` or `gain[0][2]`.
    pub(crate) path: String,
    /// The positions of the variables that its equation reads; empty for knowns.
    pub(crate) reads: Vec<usize>,
    /// The same in initialization, where that differs.
    pub(crate) initial_reads: Option<Vec<usize>>,
}

impl Variable {
    /// Whether it is given while the model steps.
    pub(crate) fn known_in_steps(&self) -> bool {
        matches!(self.role, Role::Input | Role::State | Role::Independent)
    }

    /// Whether it is given in initialization.
    pub(crate) fn known_in_initialization(&self) -> bool {
        matches!(self.role, Role::Input | Role::Independent) || self.initial == Some(json::Initial::Exact)
    }

    /// Whether it belongs to the `InitialUnknowns`.
    pub(crate) fn unknown_in_initialization(&self) -> bool {
        !self.known_in_initialization()
            && matches!(self.role, Role::Output | Role::State | Role::Derivative | Role::CalculatedParameter)
    }

    /// The positions of what its equation reads in initialization.
    pub(crate) fn reads_in_initialization(&self) -> &[usize] {
        self.initial_reads.as_deref().unwrap_or(&self.reads)
    }
}

impl Resolved<'_> {
    /// The positions of the variables of a role.
    pub(crate) fn of_role(&self, role: Role) -> impl Iterator<Item = usize> {
        (0..self.variables.len()).filter(move |&position| self.variables[position].role == role)
    }
}

/// Flattens and checks a model.
pub(crate) fn resolve<'a>(
    model: &'a json::Model,
    units: &'a [json::Unit],
    version: &'a str,
) -> Result<Resolved<'a>, Refusal> {
    check::model(model)?;
    let mut flattening = Flattening::new(model);
    let interface =
        Part { name: None, component_type: None, state_group: None, description: "", fields: vec![] };
    flattening.add_part(interface, &model.variables, &BTreeMap::new())?;
    for component in &model.components {
        flattening.add_component(component)?;
    }
    flattening.refuse_unused_types()?;
    flattening.look_up_reads()?;
    let Flattening { parts, variables, .. } = flattening;
    let units = check::units(model, &variables, units)?;
    check::state_groups(model, &parts)?;
    check::type_names(model, &parts)?;
    check::outputs(&variables)?;
    dependencies::refuse_cycles(&variables)?;
    check::calculated_parameters(&variables)?;
    Ok(Resolved { model, version, units, parts, variables })
}

/// The work in progress.
struct Flattening<'a> {
    model: &'a json::Model,
    parts: Vec<Part<'a>>,
    variables: Vec<Variable>,
    /// The scalars behind each name by which `reads` may call them: each scalar's, and each array's.
    names: BTreeMap<String, Vec<usize>>,
    /// The equations whose reads are still to be looked up.
    equations: Vec<Equation<'a>>,
}

/// What a scalar reads, in the words of the JSON.
struct Equation<'a> {
    position: usize,
    part: usize,
    reads: &'a [String],
    initial_reads: Option<&'a [String]>,
}

impl<'a> Flattening<'a> {
    fn new(model: &'a json::Model) -> Self {
        let time = Variable {
            name: "time".to_owned(),
            description: "Time".to_owned(),
            role: Role::Independent,
            variability: json::Variability::Continuous,
            initial: None,
            data_type: DataType::Real,
            unit: Some("s".to_owned()),
            display_unit: None,
            min: None,
            max: None,
            nominal: None,
            start: None,
            state: None,
            path: String::new(),
            reads: Vec::new(),
            initial_reads: None,
        };
        Self {
            model,
            parts: Vec::new(),
            variables: vec![time],
            names: BTreeMap::from([("time".to_owned(), vec![0])]),
            equations: Vec::new(),
        }
    }

    fn add_component(&mut self, component: &'a json::Component) -> Result<(), Refusal> {
        let name = &component.name;
        let (variables, component_type) = match (&component.variables, &component.component_type) {
            (Some(variables), None) => {
                if !component.start.is_empty() || !component.connections.is_empty() {
                    return Err(Refusal::new(format!(
                        "component '{name}': 'start' and 'connections' are for components with a type"
                    )));
                }
                (variables, None)
            }
            (None, Some(wanted)) => {
                let found = self.model.component_types.iter().find(|known| known.name == *wanted);
                let found = found.ok_or_else(|| {
                    Refusal::new(format!(
                        "component '{name}': type '{wanted}' is not among the component_types"
                    ))
                })?;
                (&found.variables, Some(wanted.as_str()))
            }
            _ => {
                let reason = format!("component '{name}': it needs either 'variables' or a 'type'");
                return Err(Refusal::new(reason));
            }
        };
        for started in component.start.keys() {
            if !variables.iter().any(|variable| variable.name == *started) {
                let reason = "its component's 'start' names it, but the type has no such variable";
                return Err(Refusal::of(format!("{name}.{started}"), reason));
            }
        }
        let part = Part {
            name: Some(name),
            component_type,
            state_group: component.state_group.as_deref(),
            description: &component.description,
            fields: Vec::new(),
        };
        self.add_part(part, variables, &component.start)
    }

    fn add_part(
        &mut self,
        mut part: Part<'a>,
        variables: &'a [json::Variable],
        starts: &BTreeMap<String, Value>,
    ) -> Result<(), Refusal> {
        for variable in variables {
            let start = starts.get(&variable.name).or(variable.start.as_ref());
            part.fields.push(self.add_field(part.name, part.description, variable, start)?);
        }
        self.parts.push(part);
        Ok(())
    }

    /// Spreads a declared variable into its scalars, each state followed by its derivative.
    fn add_field(
        &mut self,
        component: Option<&str>,
        component_description: &str,
        json: &'a json::Variable,
        start: Option<&Value>,
    ) -> Result<Field<'a>, Refusal> {
        let prefix = component.map(|component| format!("{component}.")).unwrap_or_default();
        let name = format!("{prefix}{}", json.name);
        let refuse = |reason: String| Refusal::of(&name, reason);
        let checked = check::variable(self.model, json, start).map_err(refuse)?;
        let describe = |text: &str| match component {
            Some(_) => format!("{component_description}: {text}"),
            None => text.to_owned(),
        };
        let mut positions = Vec::new();
        for (number, (subscripts, indices)) in elements(&json.dimensions).into_iter().enumerate() {
            let position = self.variables.len();
            positions.push(position);
            self.add_scalar(Variable {
                name: format!("{name}{subscripts}"),
                description: describe(&json.description),
                role: checked.role,
                variability: checked.variability,
                initial: checked.initial,
                data_type: checked.data_type,
                unit: json.unit.as_ref().map(|unit| unit.of(number).to_owned()),
                display_unit: json.display_unit.clone(),
                min: json.min,
                max: json.max,
                nominal: json.nominal,
                start: checked.starts.as_ref().map(|starts| starts[number].clone()),
                state: None,
                path: format!("{name}{indices}"),
                reads: Vec::new(),
                initial_reads: None,
            })?;
            let part = self.parts.len();
            let reads = json.reads.as_deref().unwrap_or_default();
            let initial_reads = json.initial_reads.as_deref();
            self.equations.push(Equation { position, part, reads, initial_reads });
            if let Some(derivative) = &json.derivative {
                let state = &self.variables[position];
                let (reads, initial_reads) = (&derivative.reads, derivative.initial_reads.as_deref());
                let position = position + 1;
                self.equations.push(Equation { position, part, reads, initial_reads });
                let description = match &derivative.description {
                    Some(description) => describe(description),
                    None => format!("Time derivative of {}", state.name),
                };
                self.add_scalar(Variable {
                    name: format!("der({})", state.name),
                    description,
                    role: Role::Derivative,
                    variability: json::Variability::Continuous,
                    initial: Some(json::Initial::Calculated),
                    data_type: DataType::Real,
                    unit: derivative
                        .unit
                        .clone()
                        .or_else(|| json.unit.as_ref().map(|unit| format!("{}/s", unit.of(number)))),
                    display_unit: None,
                    min: None,
                    max: None,
                    nominal: None,
                    start: None,
                    state: Some(position - 1),
                    path: state.path.clone(),
                    reads: Vec::new(),
                    initial_reads: None,
                })?;
            }
        }
        if !json.dimensions.is_empty() {
            if checked.role == Role::State {
                let derivatives = positions.iter().map(|position| position + 1).collect();
                self.names.insert(format!("der({name})"), derivatives);
            }
            if self.names.insert(name.clone(), positions.clone()).is_some() {
                return Err(refuse(DUPLICATE.to_owned()));
            }
        }
        Ok(Field { json, role: checked.role, data_type: checked.data_type, positions })
    }

    fn add_scalar(&mut self, variable: Variable) -> Result<(), Refusal> {
        if self.names.insert(variable.name.clone(), vec![self.variables.len()]).is_some() {
            return Err(Refusal::of(variable.name, DUPLICATE));
        }
        self.variables.push(variable);
        Ok(())
    }

    /// A type without a component is checked by nothing, so it must not be there.
    fn refuse_unused_types(&self) -> Result<(), Refusal> {
        for component_type in &self.model.component_types {
            let name = &component_type.name;
            if !self.parts.iter().any(|part| part.component_type == Some(name)) {
                return Err(Refusal::new(format!("component type '{name}' has no component")));
            }
        }
        Ok(())
    }

    /// Turns the names that equations read into positions.
    fn look_up_reads(&mut self) -> Result<(), Refusal> {
        let mut used = BTreeSet::new();
        for equation in &self.equations {
            let component = self.parts[equation.part].name;
            let component = self.model.components.iter().find(|known| Some(known.name.as_str()) == component);
            let mut look_up = |names: &'a [String]| -> Result<Vec<usize>, Refusal> {
                let mut positions = BTreeSet::new();
                for name in names {
                    let found = look_up_read(&self.names, component, name, &mut used)
                        .map_err(|reason| Refusal::of(&self.variables[equation.position].name, reason))?;
                    positions.extend(found);
                }
                Ok(positions.into_iter().collect())
            };
            let reads = look_up(equation.reads)?;
            let initial_reads = equation.initial_reads.map(look_up).transpose()?;
            let variable = &mut self.variables[equation.position];
            variable.reads = reads;
            variable.initial_reads = initial_reads;
        }
        for component in &self.model.components {
            for (connection, variable) in &component.connections {
                let reason = if !self.names.contains_key(variable) {
                    format!("connection '{connection}' names '{variable}', which does not exist")
                } else if used.contains(&(component.name.as_str(), connection.as_str())) {
                    continue;
                } else {
                    format!("connection '{connection}' is read by no variable")
                };
                return Err(Refusal::new(format!("component '{}': {reason}", component.name)));
            }
        }
        Ok(())
    }
}

const DUPLICATE: &str = "there is another variable of this name";

/// The positions behind one entry of `reads`; notes which connections were used.
fn look_up_read<'n, 'a>(
    names: &'n BTreeMap<String, Vec<usize>>,
    component: Option<&'a json::Component>,
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
            .ok_or_else(|| format!("it reads '{read}', but connections are for components with a type"))?;
        let name = component.connections.get(connection).ok_or_else(|| {
            format!("it reads '{read}', but component '{}' has no such connection", component.name)
        })?;
        used.insert((&component.name, connection));
        vec![wrap(name)]
    } else {
        let own = component.map(|component| wrap(&format!("{}.{read}", component.name)));
        own.into_iter().chain([wrap(read)]).collect()
    };
    candidates
        .iter()
        .find_map(|name| names.get(name))
        .map(Vec::as_slice)
        .ok_or_else(|| format!("it reads '{}', which does not exist", candidates[candidates.len() - 1]))
}

/// The elements of an array, row by row: the subscripts in FMI's notation (`[1,2]`) and the indices in
/// Rust's (`[0][1]`). A scalar has one element without either.
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
