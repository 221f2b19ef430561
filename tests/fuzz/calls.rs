//! Random calls.

use fmu_export::Variables;
use fmu_export::description::{Causality, DataType, Variability};
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use proptest::sample::{Index, select};

/// The types with their own functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    Real,
    Integer,
    Boolean,
    String,
}

impl Type {
    fn of(data_type: DataType) -> Self {
        match data_type {
            DataType::Real => Self::Real,
            DataType::Integer | DataType::Enumeration => Self::Integer,
            DataType::Boolean => Self::Boolean,
            DataType::String => Self::String,
            other => panic!("FMI 2.0 has no type {other:?}"),
        }
    }
}

/// A value to set a variable to.
#[derive(Clone, Copy, Debug)]
pub enum Number {
    /// A fraction of the range from min to max.
    Share(f64),
    /// A number for any variable.
    Special(f64),
}

/// A call. Value references may be invalid; states are in numbered slots, which may be empty.
#[derive(Clone, Debug)]
pub enum Call {
    SetDebugLogging(bool),
    SetupExperiment {
        tolerance: Option<f64>,
        start_time: f64,
        stop_time: Option<f64>,
    },
    EnterInitializationMode,
    ExitInitializationMode,
    Terminate,
    Reset,
    Get(Type, Vec<u32>),
    Set(Type, Vec<(u32, Number)>),
    SetInputDerivatives(Vec<(u32, i32, f64)>),
    GetOutputDerivatives(Vec<(u32, i32)>),
    GetDirectionalDerivative {
        unknowns: Vec<u32>,
        knowns: Vec<u32>,
    },
    /// From the current time, `late` steps later.
    DoStep {
        late: f64,
        size: f64,
    },
    CancelStep,
    EnterEventMode,
    NewDiscreteStates,
    EnterContinuousTimeMode,
    CompletedIntegratorStep,
    SetTime(Time),
    /// Values for the states, and how many more than there are states, or fewer.
    SetContinuousStates(Vec<f64>, isize),
    GetVector(Vector, isize),
    /// A step of explicit Euler.
    Integrate(f64),
    /// An event, iterated to its end.
    HaveEvent,
    GetStatus {
        function: &'static str,
        kind: i32,
    },
    GetState(usize),
    SetState(usize),
    FreeState(usize),
    /// Serializes a state and makes another one from its bytes, in another slot.
    CopyState {
        from: usize,
        to: usize,
    },
}

/// A time to set.
#[derive(Clone, Copy, Debug)]
pub enum Time {
    Later(f64),
    /// The next time event, earlier by a part of it.
    NextEvent(f64),
    Any(f64),
}

/// What there are arrays of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vector {
    ContinuousStates,
    Derivatives,
    EventIndicators,
    Nominals,
}

/// The number of slots for states.
pub const PLACES: usize = 3;

/// Numbers that an importer should not pass.
fn odd_number() -> impl Strategy<Value = f64> {
    let odd = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        f64::MIN,
        f64::MIN_POSITIVE,
        5e-324,
        -0.0,
        0.0,
        -1.0,
        1.0,
        1e9,
        1e300,
    ];
    select(odd.to_vec())
}

fn number() -> impl Strategy<Value = Number> {
    prop_oneof![
        12 => (0.0..=1.0).prop_map(Number::Share),
        1 => select(vec![0.0, 1.0, -0.01, 1.01]).prop_map(Number::Share),
        1 => odd_number().prop_map(Number::Special),
    ]
}

/// The value references of the variables of a type that meet a condition.
fn references<V: Variables>(data_type: Type, wanted: impl Fn(Causality, Variability) -> bool) -> Vec<u32> {
    V::described()
        .filter(|(_, variable)| {
            Type::of(variable.data_type) == data_type && wanted(variable.causality, variable.variability)
        })
        .map(|(reference, _)| reference)
        .collect()
}

/// A value reference, mostly a useful one.
fn mostly<V: Variables>(useful: Vec<u32>) -> BoxedStrategy<u32> {
    let any: Vec<_> = V::described().map(|(reference, _)| reference).collect();
    let after = any.iter().max().expect("a variable") + 1;
    let useful = if useful.is_empty() { any.clone() } else { useful };
    prop_oneof![
        30 => select(useful),
        1 => select(any),
        1 => select(vec![after, 1 << 31, u32::MAX]),
    ]
    .boxed()
}

/// A value reference to get.
fn readable<V: Variables>(data_type: Type) -> BoxedStrategy<u32> {
    mostly::<V>(references::<V>(data_type, |_, _| true))
}

/// A value reference to set between steps: an input or a tunable parameter.
fn settable<V: Variables>(data_type: Type) -> BoxedStrategy<u32> {
    let inputs = references::<V>(data_type, |causality, _| causality == Causality::Input);
    let tunable = references::<V>(data_type, |_, variability| variability == Variability::Tunable);
    mostly::<V>([&inputs[..], &inputs, &inputs, &tunable].concat())
}

/// Settings of parameters, as before initialization.
pub fn settings<V: Variables>() -> impl Strategy<Value = Vec<Call>> {
    let setting = data_type().prop_flat_map(|data_type| {
        let parameters = references::<V>(data_type, |causality, _| causality == Causality::Parameter);
        (mostly::<V>(parameters), number()).prop_map(move |value| Call::Set(data_type, vec![value]))
    });
    vec(setting, 0..4)
}

fn data_type() -> impl Strategy<Value = Type> {
    prop_oneof![5 => Just(Type::Real), 1 => Just(Type::Integer), 1 => Just(Type::Boolean), 1 => Just(Type::String)]
}

fn step() -> impl Strategy<Value = Call> {
    let late = prop_oneof![
        20 => Just(0.0),
        1 => select(vec![1e-9, -1e-9, 1e-3, 1.0, -1.0, f64::NAN, f64::INFINITY]),
    ];
    let size = prop_oneof![
        10 => 1e-4..0.05,
        10 => Just(0.0125),
        1 => select(vec![0.0, -0.0125, 1e-9, 1e-300, 1e6, 1e300, f64::NAN, f64::INFINITY]),
    ];
    (late, size).prop_map(|(late, size)| Call::DoStep { late, size })
}

/// A call that only Model Exchange has.
fn of_model_exchange() -> impl Strategy<Value = Call> {
    let time = prop_oneof![
        8 => (0.0..0.1).prop_map(Time::Later),
        4 => select(vec![0.0, 0.0, 1e-10, 1e-8, -1e-3]).prop_map(Time::NextEvent),
        1 => (-1e3..1e3).prop_map(Time::Any),
        1 => odd_number().prop_map(Time::Any),
    ];
    let size = prop_oneof![10 => 1e-3..0.1, 1 => -0.01..0.0, 1 => select(vec![1.0, 1e3, 1e300])];
    let more = || prop_oneof![12 => Just(0), 1 => select(vec![-1, 1, 5])];
    let state = prop_oneof![12 => -2.0..2.0, 1 => odd_number()];
    let vector = select(vec![
        Vector::ContinuousStates,
        Vector::Derivatives,
        Vector::EventIndicators,
        Vector::EventIndicators,
        Vector::Nominals,
    ]);
    prop_oneof![
        3 => Just(Call::EnterEventMode),
        4 => Just(Call::NewDiscreteStates),
        4 => Just(Call::EnterContinuousTimeMode),
        1 => Just(Call::CompletedIntegratorStep),
        4 => time.prop_map(Call::SetTime),
        2 => (vec(state, 8), more()).prop_map(|(states, more)| Call::SetContinuousStates(states, more)),
        6 => (vector, more()).prop_map(|(vector, more)| Call::GetVector(vector, more)),
        10 => size.prop_map(Call::Integrate),
        6 => Just(Call::HaveEvent),
    ]
}

/// A call without saved states.
pub fn without_states<V: Variables>() -> BoxedStrategy<Call> {
    let others = of_every_fmu_or_co_simulation::<V>();
    if V::DESCRIPTION.interfaces.model_exchange {
        prop_oneof![2 => others, 1 => of_model_exchange()].boxed()
    } else {
        others.boxed()
    }
}

/// A call that every FMU has, or only co-simulation.
fn of_every_fmu_or_co_simulation<V: Variables>() -> impl Strategy<Value = Call> {
    let input = || settable::<V>(Type::Real);
    let output = || readable::<V>(Type::Real);
    let experiment = (
        option::weighted(0.3, prop_oneof![3 => 1e-9..1e-2, 1 => odd_number()]),
        prop_oneof![5 => Just(0.0), 3 => -1e3..1e3, 1 => odd_number()],
        option::weighted(0.3, prop_oneof![5 => 0.0..2e3, 1 => odd_number()]),
    );
    let status = (
        select(vec![
            "fmi2GetStatus",
            "fmi2GetRealStatus",
            "fmi2GetIntegerStatus",
            "fmi2GetBooleanStatus",
            "fmi2GetStringStatus",
        ]),
        -1..6,
    );
    prop_oneof![
        1 => any::<bool>().prop_map(Call::SetDebugLogging),
        2 => experiment.prop_map(|(tolerance, start_time, stop_time)| Call::SetupExperiment {
            tolerance,
            start_time,
            stop_time,
        }),
        3 => Just(Call::EnterInitializationMode),
        3 => Just(Call::ExitInitializationMode),
        1 => Just(Call::Terminate),
        1 => Just(Call::Reset),
        8 => data_type().prop_flat_map(|data_type| {
            vec(readable::<V>(data_type), 0..8)
                .prop_map(move |references| Call::Get(data_type, references))
        }),
        12 => data_type().prop_flat_map(|data_type| {
            vec((settable::<V>(data_type), number()), 0..5)
                .prop_map(move |values| Call::Set(data_type, values))
        }),
        3 => vec((input(), prop_oneof![8 => 1..=2, 1 => -1..12], prop_oneof![5 => -10.0..10.0, 1 => odd_number()]), 0..4)
            .prop_map(Call::SetInputDerivatives),
        1 => vec((output(), 0..4), 0..4).prop_map(Call::GetOutputDerivatives),
        1 => (vec(output(), 0..4), vec(input(), 0..4))
            .prop_map(|(unknowns, knowns)| Call::GetDirectionalDerivative { unknowns, knowns }),
        20 => step(),
        1 => Just(Call::CancelStep),
        2 => status.prop_map(|(function, kind)| Call::GetStatus { function, kind }),
    ]
}

/// A call of any function.
pub fn any_call<V: Variables>() -> impl Strategy<Value = Call> {
    prop_oneof![
        50 => without_states::<V>(),
        4 => (0..PLACES).prop_map(Call::GetState),
        4 => (0..PLACES).prop_map(Call::SetState),
        1 => (0..PLACES).prop_map(Call::FreeState),
        2 => (0..PLACES, 0..PLACES).prop_map(|(from, to)| Call::CopyState { from, to }),
    ]
}

/// Damage to serialized bytes.
#[derive(Clone, Debug)]
pub enum Damage {
    Cut(Index),
    Flip(Index, u8),
    Replace(Index, Vec<u8>),
    Insert(Index, Vec<u8>),
    Remove(Index, usize),
}

impl Arbitrary for Damage {
    type Parameters = ();
    type Strategy = BoxedStrategy<Self>;

    fn arbitrary_with((): ()) -> BoxedStrategy<Self> {
        // Also large numbers, which may be read as lengths.
        let some = prop_oneof![
            vec(proptest::num::u8::ANY, 1..9),
            select(vec![vec![0xff; 8], vec![0xff, 0xff, 0xff, 0x7f], vec![0; 8], vec![1]]),
        ];
        prop_oneof![
            1 => any::<Index>().prop_map(Self::Cut),
            4 => (any::<Index>(), 0_u8..8).prop_map(|(at, bit)| Self::Flip(at, bit)),
            4 => (any::<Index>(), some.clone()).prop_map(|(at, bytes)| Self::Replace(at, bytes)),
            1 => (any::<Index>(), some).prop_map(|(at, bytes)| Self::Insert(at, bytes)),
            1 => (any::<Index>(), 1_usize..20).prop_map(|(at, count)| Self::Remove(at, count)),
        ]
        .boxed()
    }
}

impl Damage {
    /// The damaged bytes.
    pub fn done_to(&self, mut bytes: Vec<u8>) -> Vec<u8> {
        let length = bytes.len();
        let at = |index: &Index| index.index(length + 1);
        match self {
            Self::Cut(index) => bytes.truncate(at(index)),
            Self::Flip(index, bit) => {
                if let Some(byte) = bytes.get_mut(at(index)) {
                    *byte ^= 1 << bit;
                }
            }
            Self::Replace(index, new) => {
                for (byte, &new) in bytes.iter_mut().skip(at(index)).zip(new) {
                    *byte = new;
                }
            }
            Self::Insert(index, new) => {
                bytes.splice(at(index)..at(index), new.iter().copied());
            }
            Self::Remove(index, count) => {
                bytes.drain(at(index)..(at(index) + count).min(length));
            }
        }
        bytes
    }
}
