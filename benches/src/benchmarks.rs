//! The benchmarks: groups of one task each, once for every implementation.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use boost_fmu::BoostController;
use boost_fmu::controller::variables::{FeedbackStructure, Inputs as ControllerInputs, Strategy};
use boost_fmu::plant::BoostPlant;
use boost_fmu::plant::system::System;
use boost_fmu::plant::variables::{InitializationMode, Inputs, Parameters, States, Variables};
use fmu_export::Accessed as _;
use fmu_export::description::Causality;
use fmu_export::fmi2::c_types::ValueReference;

use crate::closed_loop::{Fmus, Models, controller_library};
use crate::direct::Direct;
use crate::experiment::{Experiment, STEP, Stretch, steps};
use crate::library::Instance;
use crate::plant::{Fmu, Plant, RungeKutta, library};
use crate::random_experiment::RandomExperiment;
use crate::reference::Reference;

/// A task to measure.
pub trait Subject {
    /// Prepares the next run, outside of the measurement.
    fn prepare(&mut self) {}
    /// Runs the task.
    fn run(&mut self);
}

/// A benchmark, with a constructor of its task, since that may take a while.
pub struct Benchmark {
    /// The task.
    pub group: String,
    /// The implementation: `fmu`, `direct` or `reference`.
    pub by: &'static str,
    /// Repetitions in one run.
    pub elements: u64,
    /// Whether to count its instructions as well.
    pub counted: bool,
    make: Box<dyn Fn() -> Box<dyn Subject>>,
}

impl Benchmark {
    fn new<S: Subject + 'static>(
        group: impl Into<String>,
        by: &'static str,
        elements: usize,
        make: impl Fn() -> S + 'static,
    ) -> Self {
        Self {
            group: group.into(),
            by,
            elements: elements as u64,
            counted: true,
            make: Box::new(move || Box::new(make())),
        }
    }

    fn timed_only(self) -> Self {
        Self { counted: false, ..self }
    }

    /// Makes the task.
    #[must_use]
    pub fn make(&self) -> Box<dyn Subject> {
        (self.make)()
    }
}

/// A short communication step, in s.
const SHORT_STEP: f64 = 1e-3;
/// Repetitions of a short task in one run, so that reading the clock does not count.
const OFTEN: usize = 1000;
/// The number of values read or set in one call.
const VALUES: usize = 10;
/// An exhaust area in m². With one the gas path acts on the actuation, and the plant cannot be integrated in two
/// halves.
const EXHAUST_AREA: f64 = 1e-4;

/// All benchmarks, in the order of the table.
#[must_use]
pub fn all() -> Vec<Benchmark> {
    let mut all = vec![
        Benchmark::new("right-hand side", "direct", OFTEN, || {
            Rates::new(System::new(&Parameters::default()))
        }),
        Benchmark::new("right-hand side", "reference", OFTEN, || {
            Rates::new(Reference::new(&Parameters::default()))
        }),
    ];
    for stretch in [Stretch::QUIET, Stretch::VOLTAGE, Stretch::DUTY, Stretch::LOAD] {
        let group = format!("plant 12.5 ms {}", stretch.name);
        all.extend(plant_steps(&group, stretch, STEP, 0.0));
    }
    for stretch in [Stretch::QUIET, Stretch::DUTY] {
        let group = format!("plant 12.5 ms {} exhaust area", stretch.name);
        all.extend(plant_steps(&group, stretch, STEP, EXHAUST_AREA));
    }
    for stretch in [Stretch::QUIET, Stretch::DUTY] {
        let group = format!("plant 1 ms {}", stretch.name);
        all.extend(plant_steps(&group, stretch, SHORT_STEP, 0.0));
    }
    all.extend(plant_steps("plant 12.5 ms whole", Stretch::WHOLE, STEP, 0.0).map(Benchmark::timed_only));
    all.extend([
        Benchmark::new("plant 12.5 ms slowest", "fmu", 1, SlowestStep::<Fmu>::new).timed_only(),
        Benchmark::new("plant 12.5 ms slowest", "direct", 1, SlowestStep::<Direct<BoostPlant>>::new)
            .timed_only(),
        Benchmark::new("plant 12.5 ms slowest", "reference", 1, SlowestStep::<RungeKutta>::new).timed_only(),
    ]);
    for number in RandomExperiment::NUMBERS {
        let group = format!("plant 12.5 ms random {number}");
        let count = RandomExperiment::STEPS as usize;
        all.extend([
            Benchmark::new(&group, "fmu", count, move || PlantSteps::<Fmu>::random(number)).timed_only(),
            Benchmark::new(&group, "reference", count, move || PlantSteps::<RungeKutta>::random(number))
                .timed_only(),
        ]);
    }
    let default = Control {
        step: STEP,
        sample_time: STEP,
        structure: FeedbackStructure::ModelReference,
        measured: Measured::NOTHING,
    };
    for (group, control) in [
        ("controller 12.5 ms", default),
        ("controller 12.5 ms thin air", Control { measured: Measured::THIN_AIR, ..default }),
        ("controller 12.5 ms thin air with shaft", Control { measured: Measured::SHAFT, ..default }),
        // As the controller in Python.
        ("controller 12.5 ms paper", Control { structure: FeedbackStructure::Paper, ..default }),
        ("controller 1 ms", Control { step: SHORT_STEP, ..default }),
        // Between two samples, as long as the benchmark lasts.
        ("controller empty", Control { step: 1e-7, sample_time: 0.1, ..default }),
    ] {
        all.extend([
            Benchmark::new(group, "fmu", OFTEN, move || FmuController::new(control)),
            Benchmark::new(group, "direct", OFTEN, move || DirectController::new(control)),
        ]);
    }
    all.extend([
        Benchmark::new("get ten Reals", "fmu", OFTEN, || FmuGet(FmuReals::new(Causality::Output))),
        Benchmark::new("get ten Reals", "direct", OFTEN, || DirectGet(DirectReals::new(Causality::Output))),
        Benchmark::new("set ten Reals", "fmu", OFTEN, || FmuSet(FmuReals::new(Causality::Input))),
        Benchmark::new("set ten Reals", "direct", OFTEN, || DirectSet(DirectReals::new(Causality::Input))),
    ]);
    for (group, mode) in [
        ("instantiate running", InitializationMode::Running),
        ("instantiate settled", InitializationMode::Settled),
    ] {
        all.extend([
            Benchmark::new(group, "fmu", 1, move || FmuStart { mode, instance: None }),
            Benchmark::new(group, "direct", 1, move || DirectStart { mode, plant: None }),
        ]);
    }
    all.extend([
        Benchmark::new("closed loop", "fmu", 1, Both::<Fmus>::default).timed_only(),
        Benchmark::new("closed loop", "direct", 1, Both::<Models>::default).timed_only(),
    ]);
    all
}

/// A right-hand side.
trait RightHandSide {
    fn rates(&self, states: &States, inputs: &Inputs) -> States;
}

impl RightHandSide for System {
    fn rates(&self, states: &States, inputs: &Inputs) -> States {
        self.evaluate(inputs, states).derivatives()
    }
}

impl RightHandSide for Reference {
    fn rates(&self, states: &States, inputs: &Inputs) -> States {
        self.right_hand_side(states, inputs)
    }
}

/// A right-hand side, evaluated along the recorded experiment.
struct Rates<R> {
    system: R,
    points: Vec<(States, Inputs)>,
}

impl<R> Rates<R> {
    fn new(system: R) -> Self {
        let recorded = Experiment::recorded();
        let every = recorded.inputs.len() / OFTEN;
        let mut plant = Direct::<BoostPlant>::given(&recorded.states, &recorded.inputs[0], 0.0);
        let mut points = Vec::new();
        for (row, inputs) in recorded.inputs.iter().enumerate() {
            if row % every == 0 && points.len() < OFTEN {
                points.push((plant.variables.states, *inputs));
            }
            Plant::set(&mut plant, inputs);
            plant.step(STEP);
        }
        Self { system, points }
    }
}

impl<R: RightHandSide> Subject for Rates<R> {
    fn run(&mut self) {
        for (states, inputs) in &self.points {
            black_box(self.system.rates(black_box(states), black_box(inputs)));
        }
    }
}

/// The plant over a stretch of the recorded experiment, for each implementation.
fn plant_steps(group: &str, stretch: Stretch, size: f64, exhaust_area: f64) -> [Benchmark; 3] {
    let count = steps(stretch.count, size);
    [
        Benchmark::new(group, "fmu", count, move || PlantSteps::<Fmu>::new(&stretch, size, exhaust_area)),
        Benchmark::new(group, "direct", count, move || {
            PlantSteps::<Direct<BoostPlant>>::new(&stretch, size, exhaust_area)
        }),
        Benchmark::new(group, "reference", count, move || {
            PlantSteps::<RungeKutta>::new(&stretch, size, exhaust_area)
        }),
    ]
}

/// The states at the beginning of a step of the recorded experiment, with an exhaust area in m².
fn states_at(row: usize, exhaust_area: f64) -> States {
    /// The states by the bits of the area, for the beginning of each step.
    static STATES: Mutex<BTreeMap<u64, Vec<States>>> = Mutex::new(BTreeMap::new());
    let mut states = STATES.lock().expect("nothing panicked");
    states.entry(exhaust_area.to_bits()).or_insert_with(|| {
        let recorded = Experiment::recorded();
        let mut plant = Direct::<BoostPlant>::given(&recorded.states, &recorded.inputs[0], exhaust_area);
        let begin = |inputs| {
            let states = plant.variables.states;
            Plant::set(&mut plant, inputs);
            plant.step(STEP);
            states
        };
        recorded.inputs.iter().map(begin).collect()
    })[row]
}

/// Steps through a stretch of an experiment.
struct PlantSteps<P: Plant> {
    plant: P,
    begin: P::Saved,
    changes: Vec<Option<Inputs>>,
    size: f64,
}

impl<P: Plant> PlantSteps<P> {
    fn new(stretch: &Stretch, size: f64, exhaust_area: f64) -> Self {
        let recorded = Experiment::recorded();
        // Half a second of steps before, since the step size control depends on earlier steps.
        let first = stretch.first.saturating_sub(40);
        let before = Stretch { name: "", first, count: stretch.first - first };
        let states = if first == 0 { recorded.states } else { states_at(first, exhaust_area) };
        let mut plant = P::given(&states, &recorded.inputs[first], exhaust_area);
        pass(&mut plant, &recorded.changes(&before, size), size);
        let begin = plant.save();
        Self { plant, begin, changes: recorded.changes(stretch, size), size }
    }

    /// Through an experiment in which all inputs move at random.
    fn random(number: u32) -> Self {
        let Experiment { states, inputs } = Experiment::random(number);
        let mut plant = P::given(&states, &inputs[0], 0.0);
        let begin = plant.save();
        Self { plant, begin, changes: inputs.into_iter().map(Some).collect(), size: STEP }
    }
}

fn pass(plant: &mut impl Plant, changes: &[Option<Inputs>], size: f64) {
    for change in changes {
        if let Some(inputs) = change {
            plant.set(inputs);
        }
        plant.step(size);
    }
}

impl<P: Plant> Subject for PlantSteps<P> {
    fn prepare(&mut self) {
        self.plant.restore(&self.begin);
    }

    fn run(&mut self) {
        pass(&mut self.plant, &self.changes, self.size);
    }
}

/// The step of the recorded experiment on which the FMU spends the longest time.
fn slowest_step() -> usize {
    static SLOWEST: OnceLock<usize> = OnceLock::new();
    *SLOWEST.get_or_init(|| {
        let recorded = Experiment::recorded();
        let mut plant = Fmu::given(&recorded.states, &recorded.inputs[0], 0.0);
        let begin = plant.save();
        // Other load hits different steps in each pass.
        let mut least = vec![Duration::MAX; recorded.inputs.len()];
        for _ in 0..10 {
            plant.restore(&begin);
            for (inputs, least) in recorded.inputs.iter().zip(&mut least) {
                plant.set(inputs);
                let start = Instant::now();
                plant.step(STEP);
                *least = start.elapsed().min(*least);
            }
        }
        let (slowest, time) =
            least.iter().enumerate().max_by_key(|&(_, time)| time).expect("there are steps");
        println!("the slowest step begins at {} s: {time:?}", slowest as f64 * STEP);
        slowest
    })
}

/// The slowest step of the recorded experiment.
struct SlowestStep<P: Plant> {
    plant: P,
    begin: P::Saved,
}

impl<P: Plant> SlowestStep<P> {
    fn new() -> Self {
        let recorded = Experiment::recorded();
        let mut plant = P::given(&recorded.states, &recorded.inputs[0], 0.0);
        let slowest = slowest_step();
        for inputs in &recorded.inputs[..slowest] {
            plant.set(inputs);
            plant.step(STEP);
        }
        plant.set(&recorded.inputs[slowest]);
        let begin = plant.save();
        Self { plant, begin }
    }
}

impl<P: Plant> Subject for SlowestStep<P> {
    fn prepare(&mut self) {
        self.plant.restore(&self.begin);
    }

    fn run(&mut self) {
        self.plant.step(STEP);
    }
}

/// Inputs of the controller. The measurement moves about the reference from step to step, as a sensor that is alive.
const REFERENCE: f64 = 150e3;
const MEASUREMENTS: [f64; 2] = [149.9e3, 150.1e3];

/// What the controller measures beside boost.
#[derive(Clone, Copy)]
struct Measured {
    /// Ambient pressure and temperature in Pa and K; 0 as without a sensor.
    ambient: [f64; 2],
    /// The high-pressure shaft speed in rpm; 0 as without a sensor.
    hp_turbo_speed: f64,
}

impl Measured {
    const NOTHING: Self = Self { ambient: [0.0; 2], hp_turbo_speed: 0.0 };
    const THIN_AIR: Self = Self { ambient: [80e3, 250.0], hp_turbo_speed: 0.0 };
    /// A measured shaft, below the speed at which it limits boost.
    const SHAFT: Self = Self { hp_turbo_speed: 190e3, ..Self::THIN_AIR };
}

/// How the controller runs.
#[derive(Clone, Copy)]
struct Control {
    /// The communication step, in s.
    step: f64,
    /// The sample time in s.
    sample_time: f64,
    structure: FeedbackStructure,
    measured: Measured,
}

impl Control {
    /// The paper's structure with the paper's strategy, as in `benches/python/controller.py`.
    fn strategy(self) -> Strategy {
        match self.structure {
            FeedbackStructure::Paper => Strategy::BySpeed,
            FeedbackStructure::ModelReference => Strategy::SplitRange,
        }
    }

    /// The inputs with a boost pressure (Pa).
    fn inputs(self, boost_pressure: f64) -> ControllerInputs {
        let Measured { ambient: [ambient_pressure, ambient_temperature], hp_turbo_speed } = self.measured;
        ControllerInputs {
            boost_reference: REFERENCE,
            boost_pressure,
            ambient_pressure,
            ambient_temperature,
            hp_turbo_speed,
            ..ControllerInputs::default()
        }
    }

    /// The measurements of some steps; none where no step has a sample.
    fn measurements(self) -> &'static [f64] {
        if self.step < 1e-3 * self.sample_time { &[] } else { &MEASUREMENTS }
    }
}

/// Steps of the controller's FMU.
struct FmuController {
    controller: Instance<'static>,
    control: Control,
    boost_pressure: Vec<ValueReference>,
}

impl FmuController {
    fn new(control: Control) -> Self {
        let library = controller_library();
        let mut controller = library.instantiate();
        let inputs = control.inputs(MEASUREMENTS[0]);
        let names = [
            "sample_time",
            "boost_reference",
            "boost_pressure",
            "ambient_pressure",
            "ambient_temperature",
            "hp_turbo_speed",
        ];
        let values = [
            control.sample_time,
            inputs.boost_reference,
            inputs.boost_pressure,
            inputs.ambient_pressure,
            inputs.ambient_temperature,
            inputs.hp_turbo_speed,
        ];
        controller.set(&library.references(&names), &values);
        controller.set_integer(library.references(&["structure"])[0], control.structure.value());
        controller.set_integer(library.references(&["strategy"])[0], control.strategy().value());
        controller.enter_initialization();
        controller.exit_initialization();
        controller.step(control.step);
        Self { controller, control, boost_pressure: library.references(&["boost_pressure"]) }
    }
}

impl Subject for FmuController {
    fn run(&mut self) {
        let mut measurements = self.control.measurements().iter().cycle();
        for _ in 0..OFTEN {
            if let Some(&measurement) = measurements.next() {
                self.controller.set(&self.boost_pressure, &[measurement]);
            }
            self.controller.step(self.control.step);
        }
    }
}

/// Steps of the controller's model.
struct DirectController {
    controller: Direct<BoostController>,
    control: Control,
}

impl DirectController {
    fn new(control: Control) -> Self {
        let mut controller = Direct::<BoostController>::new(control.inputs(MEASUREMENTS[0]), |variables| {
            variables.parameters.sample_time = control.sample_time;
            variables.parameters.structure = control.structure;
            variables.parameters.strategy = control.strategy();
        });
        controller.step(control.step);
        Self { controller, control }
    }
}

impl Subject for DirectController {
    fn run(&mut self) {
        let mut measurements = self.control.measurements().iter().cycle();
        for _ in 0..OFTEN {
            if let Some(&measurement) = measurements.next() {
                self.controller.set(self.control.inputs(measurement));
            }
            self.controller.step(self.control.step);
        }
        let fault_code = self.controller.variables.outputs.fault_code;
        assert!(fault_code == 0.0, "the diagnosis found {fault_code}");
    }
}

/// The value references of the plant's first Real variables of a causality.
fn references(causality: Causality) -> [ValueReference; VALUES] {
    let names: Vec<_> = library().named(causality).take(VALUES).collect();
    library().references(&names).try_into().expect("there are ten")
}

/// Values of the plant's FMU, after a step.
struct FmuReals {
    plant: Fmu,
    references: [ValueReference; VALUES],
    values: [f64; VALUES],
}

impl FmuReals {
    fn new(causality: Causality) -> Self {
        let references = references(causality);
        let mut plant = Fmu::given(&States::default(), &Inputs::default(), 0.0);
        plant.step(STEP);
        let mut values = [0.0; VALUES];
        plant.instance.get(&references, &mut values);
        Self { plant, references, values }
    }
}

/// Reads the values.
struct FmuGet(FmuReals);

impl Subject for FmuGet {
    fn run(&mut self) {
        for _ in 0..OFTEN {
            self.0.plant.instance.get(black_box(&self.0.references), &mut self.0.values);
            black_box(&self.0.values);
        }
    }
}

/// Sets the values.
struct FmuSet(FmuReals);

impl Subject for FmuSet {
    fn run(&mut self) {
        for _ in 0..OFTEN {
            self.0.plant.instance.set(black_box(&self.0.references), black_box(&self.0.values));
        }
    }
}

/// Values of the plant's variables, through the generated accessors.
struct DirectReals {
    variables: Variables,
    references: [ValueReference; VALUES],
    values: [f64; VALUES],
}

impl DirectReals {
    fn new(causality: Causality) -> Self {
        let references = references(causality);
        let variables = Direct::<BoostPlant>::given(&States::default(), &Inputs::default(), 0.0).variables;
        Self { values: references.map(|reference| variables.real(reference)), variables, references }
    }
}

struct DirectGet(DirectReals);

impl Subject for DirectGet {
    fn run(&mut self) {
        for _ in 0..OFTEN {
            for (value, &reference) in self.0.values.iter_mut().zip(black_box(&self.0.references)) {
                *value = self.0.variables.real(reference);
            }
            black_box(&self.0.values);
        }
    }
}

struct DirectSet(DirectReals);

impl Subject for DirectSet {
    fn run(&mut self) {
        for _ in 0..OFTEN {
            for (&value, &reference) in black_box(&self.0.values).iter().zip(black_box(&self.0.references)) {
                self.0.variables.set_real(reference, value);
            }
            black_box(&self.0.variables);
        }
    }
}

/// The plant's FMU from instantiation until it is ready for its first step.
struct FmuStart {
    mode: InitializationMode,
    instance: Option<Instance<'static>>,
}

impl Subject for FmuStart {
    fn prepare(&mut self) {
        self.instance = None;
    }

    fn run(&mut self) {
        let mut instance = library().instantiate();
        instance.set_integer(library().references(&["initialization.mode"])[0], self.mode.value());
        instance.enter_initialization();
        instance.exit_initialization();
        self.instance = Some(instance);
    }
}

/// The plant's model, called directly, until it is ready for its first step.
struct DirectStart {
    mode: InitializationMode,
    plant: Option<Box<Direct<BoostPlant>>>,
}

impl Subject for DirectStart {
    fn prepare(&mut self) {
        self.plant = None;
    }

    fn run(&mut self) {
        let change = |variables: &mut Variables| variables.parameters.initialization.mode = self.mode;
        self.plant = Some(Box::new(Direct::new(Inputs::default(), change)));
    }
}

/// Controller and plant through the steps of the paper's Fig. 13.
#[derive(Default)]
struct Both<L> {
    control: Option<L>,
}

impl Subject for Both<Fmus> {
    fn prepare(&mut self) {
        self.control = Some(Fmus::default());
    }

    fn run(&mut self) {
        black_box(self.control.as_mut().expect("it was prepared").run());
    }
}

impl Subject for Both<Models> {
    fn prepare(&mut self) {
        self.control = Some(Models::default());
    }

    fn run(&mut self) {
        black_box(self.control.as_mut().expect("it was prepared").run());
    }
}
