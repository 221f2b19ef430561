//! The system of a plant and a controller: components, connections and connectors, with their diagram.
//!
//! Connections follow from the interface: outputs of either FMU are connected to inputs of the other, and inputs
//! without a source become inputs of the system, a common one if both have it. All outputs become outputs of the
//! system. If an FMU's units differ from the interface's, the connection converts.

use boost_interface::{Compatibility, Match, Port, Role};
use fmu_package::{
    Causality, Connection, Connector, End, FmuVariable, Function, Kind, Linear, System, SystemComponent,
    SystemPackage, SystemStructure, Unit, ValueType,
};

use super::layout::{Counts, Layout, relative};

/// The file of the structure without the system's connectors.
const COMPONENTS: &str = "Components.ssd";

/// An FMU in the system.
pub struct Member<'a> {
    /// The FMU's variables in the interface.
    pub compatibility: &'a Compatibility<'a>,
    /// The .fmu file.
    pub fmu: Vec<u8>,
    /// Parameter sets: file name and content.
    pub parameter_sets: Vec<(String, String)>,
}

/// A variable of an FMU in the interface.
struct Wire<'a> {
    port: &'a Port<'a>,
    variable: &'a FmuVariable,
    /// The conversion in the direction of the signal.
    conversion: Linear,
}

/// A system under construction.
struct Builder {
    layout: Layout,
    connectors: Vec<Connector>,
    connections: Vec<Connection>,
    /// The connectors of controller and plant.
    controller: Vec<Connector>,
    plant: Vec<Connector>,
    names: [String; 2],
}

/// The package of a fitting plant and controller.
pub fn couple(name: &str, plant: Member<'_>, controller: Member<'_>) -> SystemPackage {
    let fits = [controller.compatibility, plant.compatibility];
    let names = component_names(fits);
    let units = units(fits);
    let mut system = build(plant.compatibility, controller.compatibility, names.clone());
    for connector in system.controller.iter_mut().chain(&mut system.plant) {
        // Units that the FMUs define differently are removed; the connections convert.
        if !units.iter().any(|unit| unit.name == connector.unit) {
            connector.unit.clear();
        }
    }
    let mut resources = vec![];
    let connectors = [system.controller, system.plant];
    let placements = [system.layout.controller, system.layout.plant];
    let mut components = vec![];
    for (((member, name), connectors), placement) in
        [controller, plant].into_iter().zip(names).zip(connectors).zip(placements)
    {
        let source = format!("resources/{name}.fmu");
        let sets: Vec<_> = member
            .parameter_sets
            .into_iter()
            .map(|(file, text)| (format!("resources/{file}"), text))
            .collect();
        components.push(SystemComponent {
            name,
            source: source.clone(),
            connectors,
            placement,
            parameter_sets: sets.iter().map(|(path, _)| path.clone()).collect(),
        });
        resources.push((source, member.fmu));
        resources.extend(sets.into_iter().map(|(path, text)| (path, text.into_bytes())));
    }
    let [start_time, stop_time, step_size] = default_experiment(fits);
    let structure = SystemStructure {
        name: name.to_owned(),
        description: "Boost control: a plant and its controller".to_owned(),
        system: System {
            name: name.to_owned(),
            connectors: system.connectors,
            components,
            connections: system.connections,
        },
        units,
        start_time,
        stop_time,
        step_size,
    };
    let of_components = structure.of_components(&format!("{name}Components"));
    SystemPackage { structure, variants: vec![(COMPONENTS.to_owned(), of_components)], resources }
}

/// The connections of the system.
fn build(plant: &Compatibility<'_>, controller: &Compatibility<'_>, names: [String; 2]) -> Builder {
    let of_plant = |kind| wires(plant, kind);
    let of_controller = |kind| wires(controller, kind);
    let is_taken = |wires: &[Wire<'_>], name: &str| wires.iter().any(|wire| wire.port.name() == name);

    let (plant_inputs, plant_outputs) = (of_plant(Kind::Input), of_plant(Kind::Output));
    let (controller_inputs, controller_outputs) = (of_controller(Kind::Input), of_controller(Kind::Output));
    let is_external = |wire: &&Wire<'_>| !wire.port.couples();
    let is_shared = |wire: &&Wire<'_>| {
        is_taken(&plant_inputs, wire.port.name()) && is_taken(&controller_inputs, wire.port.name())
    };
    let external =
        |wires: &'_ [Wire<'_>]| wires.iter().filter(is_external).filter(|wire| !is_shared(wire)).count();
    let shared: Vec<_> = plant_inputs.iter().filter(is_external).filter(is_shared).collect();
    let layout = Layout::new(Counts {
        controller_inputs: external(&controller_inputs),
        plant_inputs: external(&plant_inputs),
        shared_inputs: shared.len(),
        commands: controller_outputs.len(),
        measurements: plant_outputs.iter().filter(|wire| wire.port.couples()).count(),
        plant_outputs: plant_outputs.iter().filter(|wire| !wire.port.couples()).count(),
    });
    let mut system =
        Builder { layout, connectors: vec![], connections: vec![], controller: vec![], plant: vec![], names };

    let own = |wires: &'_ [Wire<'_>]| -> Vec<usize> {
        (0..wires.len()).filter(|&i| is_external(&&wires[i]) && !is_shared(&&wires[i])).collect()
    };
    for (index, &wire) in own(&controller_inputs).iter().enumerate() {
        let place = layout.controller_input(index);
        system.add_input(&controller_inputs[wire], place);
        system.connect_input(Role::Controller, &controller_inputs[wire], place, vec![]);
    }
    for (index, &wire) in own(&plant_inputs).iter().enumerate() {
        let place = layout.plant_input(index);
        system.add_input(&plant_inputs[wire], (0.0, place.1));
        system.connect_input(Role::Plant, &plant_inputs[wire], place, vec![]);
    }
    for (index, wire) in shared.into_iter().enumerate() {
        let [outside, at_controller, at_plant] = layout.shared_input(index);
        system.add_input(wire, outside);
        system.connect_input(Role::Plant, wire, at_plant, vec![]);
        if let Some(twin) = controller_inputs.iter().find(|twin| twin.port.name() == wire.port.name()) {
            let corner = (at_controller.0, outside.1);
            system.connect_input(Role::Controller, twin, at_controller, vec![corner]);
        }
    }
    for (index, wire) in controller_outputs.iter().enumerate() {
        let [at_controller, at_plant, outside] = layout.command(index);
        system.add(Role::Controller, wire, at_controller);
        if let Some(taker) = plant_inputs.iter().find(|taker| taker.port.name() == wire.port.name()) {
            system.add(Role::Plant, taker, at_plant);
            system.connect((Role::Controller, wire), taker, vec![(at_plant.0, at_controller.1)]);
        }
        system.add_output(Role::Controller, wire, outside, vec![]);
    }
    for (index, wire) in plant_outputs.iter().filter(|wire| wire.port.couples()).enumerate() {
        let ([at_plant, at_controller, outside], height) = layout.measurement(index);
        system.add(Role::Plant, wire, at_plant);
        if let Some(taker) = controller_inputs.iter().find(|taker| taker.port.name() == wire.port.name()) {
            system.add(Role::Controller, taker, at_controller);
            let corners = vec![(at_plant.0, height), (at_controller.0, height)];
            system.connect((Role::Plant, wire), taker, corners);
        }
        system.add_output(Role::Plant, wire, outside, vec![(at_plant.0, outside.1)]);
    }
    for (index, wire) in plant_outputs.iter().filter(|wire| !wire.port.couples()).enumerate() {
        let place = layout.plant_output(index);
        system.add(Role::Plant, wire, place);
        system.add_output(Role::Plant, wire, place, vec![]);
    }
    system
}

impl Builder {
    fn name(&self, role: Role) -> &str {
        match role {
            Role::Controller => &self.names[0],
            Role::Plant => &self.names[1],
        }
    }

    /// Adds a connector to a component.
    fn add(&mut self, role: Role, wire: &Wire<'_>, place: (f64, f64)) {
        let (connectors, placement) = match role {
            Role::Controller => (&mut self.controller, self.layout.controller),
            Role::Plant => (&mut self.plant, self.layout.plant),
        };
        connectors.push(Connector {
            name: wire.variable.name.clone(),
            kind: wire.port.kind,
            value_type: wire.variable.value_type(),
            unit: wire.variable.unit.clone(),
            start: None,
            place: relative(place, placement),
        });
    }

    /// Adds an input of the system.
    fn add_input(&mut self, wire: &Wire<'_>, place: (f64, f64)) {
        self.connectors.push(Connector {
            name: wire.port.name().to_owned(),
            kind: Kind::Input,
            value_type: ValueType::Real,
            unit: wire.port.unit().name,
            start: wire.port.variable.start.parse().ok(),
            place: relative(place, self.layout.canvas()),
        });
    }

    /// Adds an input to a component and connects it with the system's.
    fn connect_input(&mut self, role: Role, wire: &Wire<'_>, place: (f64, f64), corners: Vec<(f64, f64)>) {
        self.add(role, wire, place);
        self.connections.push(Connection {
            start: End { component: None, connector: wire.port.name().to_owned() },
            end: self.end(role, wire),
            transformation: transformation(wire.conversion),
            corners,
        });
    }

    /// Adds an output of the system and connects it with a component's.
    fn add_output(&mut self, role: Role, wire: &Wire<'_>, place: (f64, f64), corners: Vec<(f64, f64)>) {
        self.connectors.push(Connector {
            name: wire.port.name().to_owned(),
            kind: Kind::Output,
            value_type: ValueType::Real,
            unit: wire.port.unit().name,
            start: None,
            place: relative(place, self.layout.canvas()),
        });
        self.connections.push(Connection {
            start: self.end(role, wire),
            end: End { component: None, connector: wire.port.name().to_owned() },
            transformation: transformation(wire.conversion),
            corners,
        });
    }

    /// Connects an output of a component with an input of the other.
    fn connect(&mut self, (role, giver): (Role, &Wire<'_>), taker: &Wire<'_>, corners: Vec<(f64, f64)>) {
        self.connections.push(Connection {
            start: self.end(role, giver),
            end: self.end(role.other(), taker),
            transformation: transformation(giver.conversion.then(taker.conversion)),
            corners,
        });
    }

    fn end(&self, role: Role, wire: &Wire<'_>) -> End {
        End { component: Some(self.name(role).to_owned()), connector: wire.variable.name.clone() }
    }
}

/// The connected variables of a kind.
fn wires<'a>(compatibility: &'a Compatibility<'a>, kind: Kind) -> Vec<Wire<'a>> {
    compatibility
        .matches
        .iter()
        .filter(|(port, _)| port.kind == kind)
        .filter_map(|(port, found)| match found {
            Match::Found { variable, conversion, .. } => {
                Some(Wire { port, variable, conversion: linear(variable, conversion)? })
            }
            _ => None,
        })
        .collect()
}

/// The conversion of a variable's values as a system can have it, whose tables are of Booleans or of integers, but not
/// between these and the interface's numbers. A table of a Boolean's two values is a line through both.
pub fn linear(variable: &FmuVariable, conversion: &Function) -> Option<Linear> {
    let entries = match conversion {
        Function::Linear(linear) => return Some(*linear),
        Function::Table(entries) => entries,
    };
    // An input refuses other numbers only if the line leads from 0 and 1 to them.
    let is_truth = |number: f64| [0.0, 1.0].contains(&number);
    let is_whole = variable.causality == Causality::Output
        || entries.len() == 2 && entries.iter().all(|(from, to)| is_truth(*from) && is_truth(*to));
    let [offset, end] = [0.0, 1.0].map(|truth| conversion.apply(truth));
    let factor = end - offset;
    (variable.value_type() == ValueType::Boolean && is_whole && factor != 0.0)
        .then_some(Linear { factor, offset })
}

fn transformation(function: Linear) -> Option<Linear> {
    (function != Linear::IDENTITY).then_some(function)
}

/// The names of controller and plant in the system: their identifiers, made unique.
fn component_names(fits: [&Compatibility<'_>; 2]) -> [String; 2] {
    let identifiers = fits.map(|compatibility| {
        compatibility.fmu.co_simulation_identifier().unwrap_or(compatibility.role.name())
    });
    if identifiers[0].eq_ignore_ascii_case(identifiers[1]) {
        fits.map(|compatibility| format!("{}_{}", identifiers[0], compatibility.role.name()))
    } else {
        identifiers.map(str::to_owned)
    }
}

/// The units of the interface, and those of the FMUs without a conflicting definition there.
fn units(fits: [&Compatibility<'_>; 2]) -> Vec<Unit> {
    let interface = [Role::Controller, Role::Plant].map(|role| &fits[0].interface.description(role).units);
    let own = fits.map(|compatibility| &compatibility.fmu.units);
    let mut units: Vec<Unit> = vec![];
    let mut ambiguous: Vec<String> = vec![];
    for unit in interface.into_iter().chain(own).flatten() {
        match units.iter().find(|known| known.name == unit.name) {
            None => units.push(unit.clone()),
            Some(known) if known.base != unit.base => ambiguous.push(unit.name.clone()),
            Some(_) => {}
        }
    }
    units.retain(|unit| !ambiguous.contains(&unit.name));
    units
}

/// Start, stop and step of the default experiment in s: the longer duration with the smaller step.
fn default_experiment(fits: [&Compatibility<'_>; 2]) -> [f64; 3] {
    let values = |name: &str| {
        fits.map(|compatibility| {
            let given = compatibility.fmu.default_experiment.iter().find(|(known, _)| known == name);
            given.and_then(|(_, text)| text.parse::<f64>().ok())
        })
        .into_iter()
        .flatten()
    };
    [
        values("startTime").fold(0.0, f64::max),
        values("stopTime").fold(1.0, f64::max),
        values("stepSize").fold(0.0125, f64::min),
    ]
}
