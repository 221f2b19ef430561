//! The C functions around a small model, called as an importer would: what each answers, and what it
//! leaves behind. (What it says is tested with the exported libraries, where a logger in C is at hand.)

use std::ffi::{CString, c_char, c_int};
use std::ptr;

use fmu_export::c_types::{
    CO_SIMULATION, CallbackFunctions, Component, FALSE, FmuState, Status, TRUE, status_kind,
};
use fmu_export::description::{
    Capabilities, Causality, DataType, Initial, ModelDescription, ValueReference, Variability,
    VariableDescription,
};
use fmu_export::{Context, Error, Inputs, InputsOf, Model, RealInput, Step, Variables, c_api};

const TIME: ValueReference = 0;
const INPUT: ValueReference = 1;
const GAIN: ValueReference = 2;
const OFFSET: ValueReference = 3;
const COUNT: ValueReference = 4;
const INTEGRAL: ValueReference = 5;
const TEXT: ValueReference = 6;
const LIFT: ValueReference = 7;
const VALVE: ValueReference = 8;

const fn variable(
    name: &'static str,
    data_type: DataType,
    causality: Causality,
    variability: Variability,
    initial: Initial,
) -> VariableDescription {
    let is_real_input = matches!((data_type, causality), (DataType::Real, Causality::Input));
    VariableDescription {
        name,
        data_type,
        causality,
        variability,
        initial,
        min: -10.0,
        max: 10.0,
        real_input: if is_real_input { Some(0) } else { None },
    }
}

static DESCRIPTION: ModelDescription = ModelDescription {
    model_identifier: "Integrator",
    guid: "{guid}",
    variables: &[
        variable("time", DataType::Real, Causality::Independent, Variability::Continuous, Initial::None),
        variable("input", DataType::Real, Causality::Input, Variability::Continuous, Initial::None),
        variable("gain", DataType::Real, Causality::Parameter, Variability::Tunable, Initial::Exact),
        variable("offset", DataType::Real, Causality::Parameter, Variability::Fixed, Initial::Exact),
        variable("count", DataType::Integer, Causality::Local, Variability::Discrete, Initial::Calculated),
        variable("integral", DataType::Real, Causality::Output, Variability::Continuous, Initial::Calculated),
        variable("text", DataType::String, Causality::Parameter, Variability::Tunable, Initial::Exact),
        variable("lift", DataType::Integer, Causality::Input, Variability::Discrete, Initial::None),
        VariableDescription {
            real_input: Some(1),
            ..variable("valve", DataType::Real, Causality::Input, Variability::Discrete, Initial::None)
        },
    ],
    log_categories: &["logStatusError", "logStatusWarning", "logEvents"],
    capabilities: Capabilities {
        interpolate_inputs: true,
        get_and_set_state: true,
        serialize_state: true,
        directional_derivatives: false,
    },
};

#[derive(Clone, Default)]
struct InputVariables {
    input: f64,
    lift: i32,
    valve: f64,
}

impl Inputs for InputVariables {
    const REALS: &'static [RealInput] = &[RealInput { min: -10.0, max: 10.0 }; 2];

    fn real(&self, position: usize) -> f64 {
        [self.input, self.valve][position]
    }

    fn set_reals(&mut self, value: impl Fn(usize) -> f64) {
        (self.input, self.valve) = (value(0), value(1));
    }
}

#[derive(Clone, Default)]
struct AllVariables {
    inputs: InputVariables,
    gain: f64,
    offset: f64,
    count: i32,
    integral: f64,
    text: String,
}

impl Variables for AllVariables {
    type Inputs = InputVariables;
    const DESCRIPTION: &'static ModelDescription = &DESCRIPTION;
    const MODEL_DESCRIPTION_XML: &'static str = "";

    fn inputs(&self) -> &InputVariables {
        &self.inputs
    }

    fn real(&self, reference: ValueReference) -> f64 {
        match reference {
            INPUT => self.inputs.input,
            VALVE => self.inputs.valve,
            GAIN => self.gain,
            OFFSET => self.offset,
            INTEGRAL => self.integral,
            _ => 0.0,
        }
    }

    fn set_real(&mut self, reference: ValueReference, value: f64) {
        match reference {
            INPUT => self.inputs.input = value,
            VALVE => self.inputs.valve = value,
            GAIN => self.gain = value,
            OFFSET => self.offset = value,
            _ => {}
        }
    }

    fn integer(&self, reference: ValueReference) -> i32 {
        if reference == LIFT { self.inputs.lift } else { self.count }
    }

    fn set_integer(&mut self, reference: ValueReference, value: i32) {
        if reference == LIFT {
            self.inputs.lift = value;
        }
    }

    fn boolean(&self, _reference: ValueReference) -> bool {
        false
    }

    fn set_boolean(&mut self, _reference: ValueReference, _value: bool) {}

    fn string(&self, _reference: ValueReference) -> &str {
        &self.text
    }

    fn set_string(&mut self, _reference: ValueReference, value: &str) {
        value.clone_into(&mut self.text);
    }

    fn zero() -> Self {
        Self::default()
    }

    fn along_derivatives(&self) -> Self {
        Self::default()
    }

    fn first_non_finite(&self) -> Option<ValueReference> {
        (!self.integral.is_finite()).then_some(INTEGRAL)
    }
}

fmu_export::persistent!(InputVariables { input, lift, valve });
fmu_export::persistent!(AllVariables { inputs, gain, offset, count, integral, text });
fmu_export::persistent!(Integrator {});

/// Integrates its input, on which the valve's opening is added, times a gain, lifted in each step; obeys the
/// text `panic`, `overflow` and `warn`.
#[derive(Clone, Default)]
struct Integrator {}

impl Model for Integrator {
    type Variables = AllVariables;

    fn check_parameters(variables: &AllVariables) -> Result<(), Error> {
        if variables.gain + variables.offset > 15.0 {
            return Err(Error::new("gain and offset contradict each other"));
        }
        Ok(())
    }

    fn initialize(
        &mut self,
        variables: &mut AllVariables,
        inputs: &InputsOf<Self>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        if variables.text == "warn" {
            context.warn(format_args!("the input is {}", inputs.input));
        }
        variables.integral = variables.offset + inputs.input;
        variables.count = 0;
        Ok(())
    }

    fn step(
        &mut self,
        variables: &mut AllVariables,
        step: &Step<'_, InputsOf<Self>>,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        match variables.text.as_str() {
            "panic" => panic!("as asked"),
            "overflow" => variables.integral = f64::INFINITY,
            _ => {}
        }
        // Simpson's rule is exact for inputs up to the third order.
        let at = |share: f64| {
            let inputs = step.inputs.at(share * step.size);
            inputs.input + inputs.valve
        };
        variables.integral += variables.gain * step.size / 6.0 * (at(0.0) + 4.0 * at(0.5) + at(1.0));
        variables.integral += f64::from(step.inputs.initial().lift);
        variables.count += 1;
        Ok(())
    }
}

/// An instance, freed when it goes.
struct Importer(Component);

impl Drop for Importer {
    fn drop(&mut self) {
        // SAFETY: the component is this importer's and used no more.
        unsafe { c_api::free_instance::<Integrator>(self.0) }
    }
}

fn instantiate(name: &str, guid: &str, fmu_type: i32) -> Component {
    let callbacks = CallbackFunctions {
        logger: None,
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: ptr::null_mut(),
    };
    let (name, guid) = (CString::new(name).unwrap(), CString::new(guid).unwrap());
    // SAFETY: all arguments are valid during the call.
    unsafe {
        c_api::instantiate::<Integrator>(
            name.as_ptr(),
            fmu_type,
            guid.as_ptr(),
            ptr::null(),
            &raw const callbacks,
            FALSE,
            FALSE,
        )
    }
}

impl Importer {
    fn new() -> Self {
        let component = instantiate("integrator", DESCRIPTION.guid, CO_SIMULATION);
        assert!(!component.is_null());
        Self(component)
    }

    /// An instance that is ready to step from 0.
    fn ready() -> Self {
        let importer = Self::new();
        assert_eq!(importer.set_up(), Status::Ok);
        assert_eq!(importer.set(GAIN, 1.0), Status::Ok);
        assert_eq!(importer.enter(), Status::Ok);
        assert_eq!(importer.exit(), Status::Ok);
        importer
    }

    fn set_up(&self) -> Status {
        // SAFETY: as everywhere here: the component is this importer's, and arrays have their lengths.
        unsafe { c_api::setup_experiment::<Integrator>(self.0, FALSE, 0.0, 0.0, TRUE, 100.0) }
    }

    fn set_up_with(&self, tolerance: f64) -> Status {
        // SAFETY: see `set_up`.
        unsafe { c_api::setup_experiment::<Integrator>(self.0, TRUE, tolerance, 0.0, TRUE, 100.0) }
    }

    fn enter(&self) -> Status {
        // SAFETY: see `set_up`.
        unsafe { c_api::enter_initialization_mode::<Integrator>(self.0) }
    }

    fn exit(&self) -> Status {
        // SAFETY: see `set_up`.
        unsafe { c_api::exit_initialization_mode::<Integrator>(self.0) }
    }

    fn reset(&self) -> Status {
        // SAFETY: see `set_up`.
        unsafe { c_api::reset::<Integrator>(self.0) }
    }

    fn set(&self, reference: ValueReference, value: f64) -> Status {
        // SAFETY: see `set_up`.
        unsafe { c_api::set_real::<Integrator>(self.0, &raw const reference, 1, &raw const value) }
    }

    fn set_integer(&self, reference: ValueReference, value: i32) -> Status {
        // SAFETY: see `set_up`.
        unsafe { c_api::set_integer::<Integrator>(self.0, &raw const reference, 1, &raw const value) }
    }

    fn set_text(&self, text: &str) -> Status {
        let text = CString::new(text).unwrap();
        // SAFETY: see `set_up`.
        unsafe { c_api::set_string::<Integrator>(self.0, &TEXT, 1, &text.as_ptr()) }
    }

    fn get(&self, reference: ValueReference) -> Result<f64, Status> {
        let mut value = f64::NAN;
        // SAFETY: see `set_up`.
        let status =
            unsafe { c_api::get_real::<Integrator>(self.0, &raw const reference, 1, &raw mut value) };
        if status == Status::Ok { Ok(value) } else { Err(status) }
    }

    fn slope(&self, order: i32, value: f64) -> Status {
        self.slope_of(INPUT, order, value)
    }

    fn slope_of(&self, reference: ValueReference, order: i32, value: f64) -> Status {
        // SAFETY: see `set_up`.
        unsafe {
            c_api::set_real_input_derivatives::<Integrator>(
                self.0,
                &raw const reference,
                1,
                &raw const order,
                &raw const value,
            )
        }
    }

    fn step(&self, time: f64, size: f64) -> Status {
        // SAFETY: see `set_up`.
        unsafe { c_api::do_step::<Integrator>(self.0, time, size, FALSE) }
    }

    /// The present state as bytes.
    fn serialized(&self) -> Vec<c_char> {
        let (mut state, mut size) = (ptr::null_mut(), 0);
        // SAFETY: see `set_up`.
        unsafe {
            assert_eq!(c_api::get_fmu_state::<Integrator>(self.0, &raw mut state), Status::Ok);
            let status = c_api::serialized_fmu_state_size::<Integrator>(self.0, state, &raw mut size);
            assert_eq!(status, Status::Ok);
            let mut bytes = vec![0; size];
            let status = c_api::serialize_fmu_state::<Integrator>(self.0, state, bytes.as_mut_ptr(), size);
            assert_eq!(status, Status::Ok);
            assert_eq!(c_api::free_fmu_state::<Integrator>(self.0, &raw mut state), Status::Ok);
            bytes
        }
    }

    /// Makes a state of bytes, in a variable that may hold anything.
    fn deserialize(&self, bytes: &[c_char], state: &mut FmuState) -> Status {
        // SAFETY: see `set_up`.
        unsafe { c_api::deserialize_fmu_state::<Integrator>(self.0, bytes.as_ptr(), bytes.len(), state) }
    }

    fn set_state(&self, state: FmuState) -> Status {
        // SAFETY: see `set_up`.
        unsafe { c_api::set_fmu_state::<Integrator>(self.0, state) }
    }
}

#[test]
fn wrong_arguments_give_no_instance() {
    assert!(instantiate(" ", DESCRIPTION.guid, CO_SIMULATION).is_null());
    assert!(instantiate("name", "{another}", CO_SIMULATION).is_null());
    assert!(instantiate("name", DESCRIPTION.guid, 0).is_null());
    // SAFETY: null is an answer to every argument.
    unsafe {
        let none = ptr::null();
        assert!(c_api::instantiate::<Integrator>(none, 1, none, none, ptr::null(), 0, 0).is_null());
        assert_eq!(c_api::reset::<Integrator>(ptr::null_mut()), Status::Error);
        c_api::free_instance::<Integrator>(ptr::null_mut());
    }
}

#[test]
fn the_calling_sequence_is_kept() {
    let importer = Importer::new();
    assert_eq!(importer.step(0.0, 1.0), Status::Error);
    assert_eq!(importer.get(INTEGRAL), Err(Status::Error));
    assert_eq!(importer.enter(), Status::Error, "fmi2SetupExperiment comes before");
    assert_eq!(importer.set_up(), Status::Ok);
    assert_eq!(importer.enter(), Status::Ok);
    assert_eq!(importer.set_up(), Status::Error);
    assert_eq!(importer.set(OFFSET, 2.0), Status::Ok);
    assert_eq!(importer.exit(), Status::Ok);
    assert_eq!(importer.set(OFFSET, 3.0), Status::Error, "a fixed parameter");
    assert_eq!(importer.set(INTEGRAL, 3.0), Status::Error, "an output");
    assert_eq!(importer.get(INTEGRAL), Ok(2.0), "and nothing changed");
    assert_eq!(importer.step(0.0, 1.0), Status::Ok);
    // SAFETY: the component is the importer's.
    assert_eq!(unsafe { c_api::terminate::<Integrator>(importer.0) }, Status::Ok);
    assert_eq!(importer.step(1.0, 1.0), Status::Error);
    assert_eq!(importer.get(INTEGRAL), Ok(2.0));
    assert_eq!(importer.reset(), Status::Ok);
    assert_eq!(importer.set_up(), Status::Ok);
}

#[test]
fn initialization_follows_every_set() {
    let importer = Importer::new();
    assert_eq!(importer.set_up(), Status::Ok);
    assert_eq!(importer.enter(), Status::Ok);
    for value in [1.0, 4.0, 2.0] {
        assert_eq!(importer.set(INPUT, value), Status::Ok);
        assert_eq!(importer.get(INTEGRAL), Ok(value));
    }
}

#[test]
fn wrong_values_change_nothing() {
    let importer = Importer::ready();
    for value in [f64::NAN, f64::INFINITY, 11.0] {
        assert_eq!(importer.set(GAIN, value), Status::Error);
    }
    assert_eq!(importer.set(INPUT, f64::NAN), Status::Error);
    assert_eq!(importer.set(99, 1.0), Status::Error);
    assert_eq!(importer.set(COUNT, 1.0), Status::Error, "an Integer");
    assert_eq!(importer.get(COUNT), Err(Status::Error));
    // SAFETY: the arrays have two elements; the second reference does not exist, so the first is not set.
    let status =
        unsafe { c_api::set_real::<Integrator>(importer.0, [GAIN, 99].as_ptr(), 2, [5.0, 5.0].as_ptr()) };
    assert_eq!(status, Status::Error);
    assert_eq!(importer.get(GAIN), Ok(1.0));
    // SAFETY: null arrays are an answer to no values, and an error with some.
    unsafe {
        assert_eq!(c_api::get_real::<Integrator>(importer.0, ptr::null(), 0, ptr::null_mut()), Status::Ok);
        assert_eq!(c_api::get_real::<Integrator>(importer.0, ptr::null(), 1, ptr::null_mut()), Status::Error);
    }
}

#[test]
fn an_input_out_of_bounds_is_bounded_and_warned_of_once() {
    let importer = Importer::ready();
    assert_eq!(importer.set(INPUT, 12.0), Status::Warning);
    assert_eq!(importer.set(INPUT, 13.0), Status::Ok);
    assert_eq!(importer.get(INPUT), Ok(13.0));
    assert_eq!(importer.step(0.0, 1.0), Status::Ok);
    assert_eq!(importer.get(INTEGRAL), Ok(10.0));
    assert_eq!(importer.set(INPUT, 0.0), Status::Ok);
    assert_eq!(importer.set(INPUT, -11.0), Status::Warning);
}

#[test]
fn an_input_that_is_not_real_is_taken_within_its_bounds_alone() {
    let importer = Importer::ready();
    assert_eq!(importer.set_integer(LIFT, 3), Status::Ok);
    for value in [-11, 11] {
        assert_eq!(importer.set_integer(LIFT, value), Status::Error);
    }
    assert_eq!(importer.set(INPUT, 12.0), Status::Warning);
    assert_eq!(importer.step(0.0, 1.0), Status::Ok);
    assert_eq!(importer.get(INTEGRAL), Ok(10.0 + 3.0), "the Real input is bounded all the same");
}

#[test]
fn contradictory_parameters_are_refused_until_corrected() {
    let importer = Importer::new();
    assert_eq!(importer.set_up(), Status::Ok);
    assert_eq!(importer.set(OFFSET, 9.0), Status::Ok);
    assert_eq!(importer.set(GAIN, 9.0), Status::Ok);
    assert_eq!(importer.enter(), Status::Ok);
    assert_eq!(importer.get(INTEGRAL), Ok(9.0), "values may be got before all parameters are set");
    assert_eq!(importer.exit(), Status::Error);
    assert_eq!(importer.set(GAIN, 1.0), Status::Ok);
    assert_eq!(importer.exit(), Status::Ok);
    assert_eq!(importer.set(GAIN, 9.0), Status::Ok);
    assert_eq!(importer.step(0.0, 1.0), Status::Error);
    assert_eq!(importer.set(GAIN, 2.0), Status::Ok);
    assert_eq!(importer.step(0.0, 1.0), Status::Ok);
}

#[test]
fn impossible_steps_are_refused() {
    let importer = Importer::ready();
    for size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(importer.step(0.0, size), Status::Error);
    }
    assert_eq!(importer.step(f64::NAN, 1.0), Status::Error);
    assert_eq!(importer.step(0.5, 1.0), Status::Error, "the time is 0");
    assert_eq!(importer.step(0.0, 100.5), Status::Error, "past the stop time");
    assert_eq!(importer.step(0.0, 1.0), Status::Ok, "none of it did harm");
    assert_eq!(importer.get(TIME), Ok(1.0));
}

#[test]
fn communication_points_may_have_round_off() {
    for by_adding in [false, true] {
        let importer = Importer::ready();
        let mut sum = 0.0;
        for index in 0..99_999 {
            let time = if by_adding { sum } else { f64::from(index) * 0.001 };
            assert_eq!(importer.step(time, 0.001), Status::Ok, "at {time}");
            sum += 0.001;
        }
    }
}

#[test]
fn input_derivatives_last_one_step() {
    let importer = Importer::ready();
    assert_eq!(importer.set(INPUT, 1.0), Status::Ok);
    assert_eq!(importer.slope(0, 1.0), Status::Error);
    assert_eq!(importer.slope(9, 1.0), Status::Error);
    assert_eq!(importer.slope(1, f64::NAN), Status::Error);
    assert_eq!(importer.slope(1, 2.0), Status::Ok);
    assert_eq!(importer.slope(2, 1.5), Status::Ok);
    assert_eq!(importer.step(0.0, 2.0), Status::Ok);
    // ∫ 1 + 2t + 1.5t²/2 from 0 to 2 is 2 + 4 + 2; small numbers, so nothing is rounded but Simpson's sixth.
    let first = importer.get(INTEGRAL).unwrap();
    assert!((first - 8.0).abs() < 1e-14, "{first}");
    assert_eq!(importer.step(2.0, 1.0), Status::Ok);
    let second = importer.get(INTEGRAL).unwrap();
    assert!((second - 9.0).abs() < 1e-14, "the slope is gone: {second}");
    assert_eq!(importer.slope(1, 5.0), Status::Ok);
    assert_eq!(importer.set(INPUT, 1.0), Status::Ok);
    assert_eq!(importer.step(3.0, 1.0), Status::Ok);
    let third = importer.get(INTEGRAL).unwrap();
    assert!((third - 10.0).abs() < 1e-14, "setting the value cleared the slope: {third}");
}

#[test]
fn a_derivative_of_a_discrete_input_is_ignored_with_one_warning() {
    let importer = Importer::ready();
    assert_eq!(importer.set(VALVE, 2.0), Status::Ok);
    assert_eq!(importer.slope_of(VALVE, 1, 0.0), Status::Ok, "nothing is ignored");
    assert_eq!(importer.slope_of(VALVE, 9, 1.0), Status::Error, "wrong for any input");
    assert_eq!(importer.slope_of(VALVE, 1, f64::NAN), Status::Error, "the same");
    let before = importer.serialized();
    assert_eq!(importer.slope_of(VALVE, 1, 3.0), Status::Warning);
    assert_eq!(importer.slope_of(VALVE, 2, -1.0), Status::Ok, "the input was named");
    assert_eq!(importer.step(0.0, 1.0), Status::Ok);
    assert_eq!(importer.get(INTEGRAL), Ok(2.0), "the input holds its value");
    assert_eq!(importer.slope_of(VALVE, 1, 3.0), Status::Ok);
    // The warning is part of the state, as that of an input out of its range.
    let mut state = ptr::null_mut();
    assert_eq!(importer.deserialize(&before, &mut state), Status::Ok);
    assert_eq!(importer.set_state(state), Status::Ok);
    assert_eq!(importer.slope_of(VALVE, 1, 3.0), Status::Warning);
    assert_eq!(importer.reset(), Status::Ok);
    assert_eq!(importer.slope_of(VALVE, 1, 3.0), Status::Warning);
}

#[test]
fn a_tolerance_of_zero_or_below_is_ignored() {
    for tolerance in [0.0, -0.0, -1e-6] {
        let importer = Importer::new();
        assert_eq!(importer.set_up_with(tolerance), Status::Warning);
        assert_eq!(importer.enter(), Status::Ok);
        assert_eq!(importer.exit(), Status::Ok);
        let without = Importer::new();
        assert_eq!(without.set_up(), Status::Ok);
        assert_eq!(without.enter(), Status::Ok);
        assert_eq!(without.exit(), Status::Ok);
        assert!(importer.serialized() == without.serialized(), "as without a tolerance");
    }
    let importer = Importer::new();
    for tolerance in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(importer.set_up_with(tolerance), Status::Error);
    }
    assert_eq!(importer.enter(), Status::Error, "none of these set the experiment up");
    assert_eq!(importer.set_up_with(1e-6), Status::Ok);
}

#[test]
fn warnings_of_initialization_are_given_once_and_do_not_accumulate() {
    let importer = Importer::new();
    assert_eq!(importer.set_up(), Status::Ok);
    assert_eq!(importer.set_text("warn"), Status::Ok);
    assert_eq!(importer.enter(), Status::Ok);
    let read = |input: f64| {
        assert_eq!(importer.set(INPUT, input), Status::Ok);
        importer.get(INTEGRAL)
    };
    let before = importer.serialized().len();
    for number in 0..2000 {
        assert_eq!(read(f64::from(number) / 1000.0), Err(Status::Warning), "another warning each time");
    }
    assert_eq!(importer.serialized().len(), before);
    // Whoever goes to and fro between values is told of each once.
    for _ in 0..3 {
        for number in 1997..2000 {
            let input = f64::from(number) / 1000.0;
            assert_eq!(read(input), Ok(input));
        }
    }
}

/// An importer's memory, aligned as a whole, in which every argument lies off the boundaries of its type.
#[repr(C, align(8))]
struct Memory(Arguments);

#[repr(C, packed)]
struct Arguments {
    offset: u8,
    references: [ValueReference; 2],
    values: [f64; 2],
    integer: c_int,
    size: usize,
    state: FmuState,
}

#[test]
fn arguments_may_lie_at_any_address() {
    let importer = Importer::ready();
    let mut memory = Memory(Arguments {
        offset: 0,
        references: [INPUT, VALVE],
        values: [3.0, 4.0],
        integer: 0,
        size: 0,
        state: ptr::null_mut(),
    });
    let references = (&raw const memory.0.references).cast::<ValueReference>();
    let values = (&raw mut memory.0.values).cast::<f64>();
    let (integer, size) = (&raw mut memory.0.integer, &raw mut memory.0.size);
    let state = &raw mut memory.0.state;
    assert!(!references.is_aligned() && !values.is_aligned() && !integer.is_aligned());
    assert!(!size.is_aligned() && !state.is_aligned());
    // SAFETY: the pointers are to the fields of `memory`, and the component is the importer's.
    unsafe {
        assert_eq!(c_api::set_real::<Integrator>(importer.0, references, 2, values), Status::Ok);
        memory.0.values = [0.0; 2];
        assert_eq!(c_api::get_real::<Integrator>(importer.0, references, 2, values), Status::Ok);
        assert_eq!({ memory.0.values }.map(f64::to_bits), [3.0, 4.0].map(f64::to_bits));
        assert_eq!(importer.step(0.0, 1.0), Status::Ok);
        let kind = status_kind::LAST_SUCCESSFUL_TIME;
        assert_eq!(c_api::get_real_status::<Integrator>(importer.0, kind, values), Status::Ok);
        assert_eq!({ memory.0.values }[0].to_bits(), 1.0_f64.to_bits());
        memory.0.references = [COUNT; 2];
        assert_eq!(c_api::get_integer::<Integrator>(importer.0, references, 1, integer), Status::Ok);
        assert_eq!({ memory.0.integer }, 1);

        assert_eq!(c_api::get_fmu_state::<Integrator>(importer.0, state), Status::Ok);
        let handle = memory.0.state;
        assert_eq!(c_api::serialized_fmu_state_size::<Integrator>(importer.0, handle, size), Status::Ok);
        assert_eq!({ memory.0.size }, importer.serialized().len());
        assert_eq!(c_api::free_fmu_state::<Integrator>(importer.0, state), Status::Ok);
        assert!({ memory.0.state }.is_null());
    }
}

/// What stands where a status shall be written to may be any number.
#[test]
fn the_callers_status_is_not_read() {
    let importer = Importer::ready();
    let mut status: c_int = 77;
    // SAFETY: the component and the number are this test's.
    let answer = unsafe { c_api::get_status::<Integrator>(importer.0, 0, &raw mut status) };
    assert_eq!((answer, status), (Status::Discard, 77));
}

#[test]
fn a_failed_step_ends_in_error_until_reset() {
    for text in ["panic", "overflow"] {
        let importer = Importer::ready();
        assert_eq!(importer.set_text(text), Status::Ok);
        assert_eq!(importer.step(0.0, 1.0), Status::Error);
        assert_eq!(importer.step(0.0, 1.0), Status::Error, "refused now");
        assert_eq!(importer.set_text(""), Status::Error);
        if text == "overflow" {
            assert_eq!(importer.get(INTEGRAL), Err(Status::Error), "never a wrong number");
        }
        assert_eq!(importer.reset(), Status::Ok);
        assert_eq!(importer.set_up(), Status::Ok);
        assert_eq!(importer.enter(), Status::Ok);
        assert_eq!(importer.exit(), Status::Ok);
        assert_eq!(importer.get(INTEGRAL), Ok(0.0));
        assert_eq!(importer.step(0.0, 1.0), Status::Ok);
    }
}

#[test]
fn a_saved_state_is_continued() {
    let importer = Importer::ready();
    assert_eq!(importer.set(INPUT, 3.0), Status::Ok);
    assert_eq!(importer.step(0.0, 1.0), Status::Ok);
    let mut state = ptr::null_mut();
    // SAFETY: the component and the state are this test's.
    unsafe {
        assert_eq!(c_api::get_fmu_state::<Integrator>(importer.0, &raw mut state), Status::Ok);
        let first = state;
        assert_eq!(importer.step(1.0, 1.0), Status::Ok);
        assert_eq!(importer.get(INTEGRAL), Ok(6.0));
        assert_eq!(importer.set_text("panic"), Status::Ok);
        assert_eq!(importer.step(2.0, 1.0), Status::Error);
        assert_eq!(c_api::set_fmu_state::<Integrator>(importer.0, state), Status::Ok);
        assert_eq!(importer.step(1.0, 1.0), Status::Ok, "the text was saved as well");
        assert_eq!(importer.get(INTEGRAL), Ok(6.0));
        assert_eq!(c_api::get_fmu_state::<Integrator>(importer.0, &raw mut state), Status::Ok);
        assert_eq!(state, first, "the handle is used again");
        assert_eq!(c_api::free_fmu_state::<Integrator>(importer.0, &raw mut state), Status::Ok);
        assert!(state.is_null());
        assert_eq!(c_api::free_fmu_state::<Integrator>(importer.0, &raw mut state), Status::Ok);
        assert_eq!(c_api::set_fmu_state::<Integrator>(importer.0, state), Status::Error);
    }
}

/// Section 2.1.8: `fmi2DeSerializeFMUstate` constructs a copy. What the importer's variable holds before, left by
/// an earlier call on the same place of the stack for one, does not matter.
#[test]
fn a_deserialized_state_is_always_new() {
    let importer = Importer::ready();
    assert_eq!(importer.set(INPUT, 3.0), Status::Ok);
    let mut older = ptr::null_mut();
    // SAFETY: the component and the state are this test's.
    assert_eq!(unsafe { c_api::get_fmu_state::<Integrator>(importer.0, &raw mut older) }, Status::Ok);
    assert_eq!(importer.step(0.0, 1.0), Status::Ok);
    let later = importer.serialized();

    let mut state = older;
    assert_eq!(importer.deserialize(&later, &mut state), Status::Ok);
    assert!(state != older);
    assert_eq!(importer.set_state(older), Status::Ok);
    assert_eq!(importer.get(INTEGRAL), Ok(0.0), "the older state is what it was");
    assert_eq!(importer.set_state(state), Status::Ok);
    assert_eq!(importer.get(INTEGRAL), Ok(3.0));

    let mut nothing = older;
    assert_eq!(importer.deserialize(&later[1..], &mut nothing), Status::Error);
    assert_eq!(nothing, older, "and what is refused leaves the variable alone");
    assert_eq!(importer.set_state(older), Status::Ok);
}
