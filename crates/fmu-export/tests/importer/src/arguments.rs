//! The arguments of calls: valid ones, and what a whim makes of them.

use std::cell::Cell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::mem::MaybeUninit;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::{fmt, ptr, slice};

use fmu_package::{FmuVariable, ValueType};
use fmu_terms::{Causality, DataType, Initial, Variability, Version};

use crate::functions::{Element, Function, Kind, Raw};
use crate::instance::{Instance, State};

/// The bytes before and behind an array, which no call may change.
const MARGIN: usize = 64;
const CANARY: u8 = 0xa5;

/// Numbers that an importer should not pass.
pub const ODD_NUMBERS: [f64; 12] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    5e-324,
    -0.0,
    0.0,
    -1.0,
    1.0,
    1e9,
    1e300,
];

/// An array of an importer, at any address.
pub struct Memory {
    bytes: Box<[Cell<u8>]>,
    start: usize,
    size: usize,
    element: usize,
    texts: Vec<CString>,
    _binaries: Vec<Vec<u8>>,
}

impl Memory {
    fn new(content: &[u8], element: usize) -> Self {
        static MADE: AtomicUsize = AtomicUsize::new(0);
        let bytes = vec![CANARY; content.len() + 2 * MARGIN + 8].into_iter().map(Cell::new);
        let bytes: Box<[Cell<u8>]> = bytes.collect();
        // Half of all arrays are unaligned.
        let start = MARGIN + bytes.as_ptr().align_offset(8) % 8 + MADE.fetch_add(1, Ordering::Relaxed) % 2;
        for (byte, &value) in bytes[start..].iter().zip(content) {
            byte.set(value);
        }
        Self { bytes, start, size: content.len(), element, texts: vec![], _binaries: vec![] }
    }

    fn of_texts(texts: Vec<Option<CString>>) -> Self {
        let addresses: Vec<*const c_char> =
            texts.iter().map(|text| text.as_ref().map_or(ptr::null(), |text| text.as_ptr())).collect();
        Self { texts: texts.into_iter().flatten().collect(), ..Self::new(bytes_of(&addresses), 8) }
    }

    /// What is there.
    pub fn content(&self) -> Vec<u8> {
        self.bytes[self.start..self.start + self.size].iter().map(Cell::get).collect()
    }

    /// What is there, as numbers.
    pub fn numbers(&self) -> Vec<f64> {
        let content = self.content();
        content
            .chunks_exact(self.element)
            .map(|bytes| match *bytes {
                [a, b, c, d] => f32::from_ne_bytes([a, b, c, d]).into(),
                _ => f64::from_ne_bytes(bytes.try_into().expect("eight bytes")),
            })
            .collect()
    }

    fn addresses(&self) -> Vec<usize> {
        let content = self.content();
        content.chunks_exact(8).map(|bytes| usize::from_ne_bytes(bytes.try_into().expect("eight"))).collect()
    }

    /// The texts whose addresses are there.
    ///
    /// # Safety
    /// They are null, or those of texts.
    pub unsafe fn texts(&self) -> Vec<u8> {
        let texts = self.addresses().into_iter().filter(|&address| address != 0);
        // SAFETY: the caller's promise.
        texts
            .flat_map(|text| unsafe { CStr::from_ptr(text as *const c_char) }.to_bytes_with_nul().to_vec())
            .collect()
    }

    /// The binaries whose addresses are there, with these sizes.
    ///
    /// # Safety
    /// As for [`Self::texts`].
    pub unsafe fn binaries(&self, sizes: Option<&Vec<u8>>) -> Vec<u8> {
        let sizes = Self::new(sizes.map_or(&[], |sizes| sizes), 8).addresses();
        let binaries = self.addresses().into_iter().zip(sizes).filter(|&(address, _)| address != 0);
        // SAFETY: the caller's promise.
        binaries
            .flat_map(|(at, size)| unsafe { slice::from_raw_parts(at as *const u8, size) }.to_vec())
            .collect()
    }

    /// Checks the bytes around it.
    pub fn check(&self, function: &str) {
        let around = self.bytes[..self.start].iter().chain(&self.bytes[self.start + self.size..]);
        assert!(around.map(Cell::get).all(|byte| byte == CANARY), "{function} writes beyond an array");
    }
}

impl fmt::Debug for Memory {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.element {
            4.. if !self.texts.is_empty() => write!(formatter, "{:?}", self.texts),
            1 if self.size > 32 => write!(formatter, "{} bytes", self.size),
            8 => write!(formatter, "{:?}", self.numbers()),
            size => formatter.debug_list().entries(self.content().chunks(size)).finish(),
        }
    }
}

/// The bytes of plain numbers and addresses.
fn bytes_of<T: Copy>(values: &[T]) -> &[u8] {
    // SAFETY: numbers and addresses have no padding.
    unsafe { slice::from_raw_parts(values.as_ptr().cast(), size_of_val(values)) }
}

/// An argument.
#[derive(Debug)]
pub enum Argument {
    /// A number.
    Number(f64),
    /// Anything whole.
    Whole(u64),
    /// A saved state.
    State(*mut c_void),
    /// An array.
    Memory(Memory),
    /// No array.
    Null,
}

impl Argument {
    /// An array of numbers or addresses.
    pub fn of<T: Copy>(values: &[T]) -> Self {
        Self::Memory(Memory::new(bytes_of(values), size_of::<T>()))
    }

    /// An array of texts.
    pub fn of_texts(texts: Vec<Option<CString>>) -> Self {
        Self::Memory(Memory::of_texts(texts))
    }

    /// As it is passed.
    pub fn raw(&self) -> Raw {
        match self {
            &Self::Number(value) => Raw::Number(value),
            &Self::Whole(value) => Raw::Whole(value),
            &Self::State(state) => Raw::Address(state),
            Self::Memory(memory) => Raw::Address(memory.bytes[memory.start..].as_ptr().cast_mut().cast()),
            Self::Null => Raw::Address(ptr::null_mut()),
        }
    }

    /// The saved state that is at the address.
    pub fn handle(&self) -> *mut c_void {
        let Self::Memory(memory) = self else { panic!("{self:?} is no array") };
        let mut handle = MaybeUninit::<*mut c_void>::uninit();
        let from = memory.bytes[memory.start..].as_ptr().cast::<u8>();
        // SAFETY: there is room for the bytes of an address, which the function has written as one.
        unsafe {
            ptr::copy_nonoverlapping(from, handle.as_mut_ptr().cast(), size_of::<*mut c_void>());
            handle.assume_init()
        }
    }
}

/// What an importer does instead of what it should, drawn from a seed.
#[derive(Debug)]
pub struct Whim {
    /// `None`: it does as it should.
    state: Option<u64>,
}

impl Whim {
    /// None.
    pub fn none() -> Self {
        Self { state: None }
    }

    /// From a seed.
    pub fn from(seed: u64) -> Self {
        Self { state: Some(seed) }
    }

    /// `SplitMix64` (Steele, Lea and Flood 2014).
    fn next(&mut self) -> u64 {
        let Some(state) = &mut self.state else { return 0 };
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// A number from 0 to 1; 0 without a whim.
    pub fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Whether something happens that does in a share of cases, and never without a whim.
    pub fn has(&mut self, chance: f64) -> bool {
        self.state.is_some() && self.share() < chance
    }

    /// One of the choices; the first without a whim.
    #[allow(clippy::cast_possible_truncation, reason = "any will do")]
    pub fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.next() as usize % choices.len()]
    }
}

impl<'f> Instance<'f> {
    /// The variables for a function's value references, of which derivative functions have two lists.
    pub fn selected(&self, function: &Function, whim: &mut Whim) -> [Vec<&'f FmuVariable>; 2] {
        let name = &function.name[4..];
        let Some(data_type) = function.data_type() else { return [vec![], vec![]] };
        let variables = || self.fmu.variables(data_type);
        let is_continuous = |variable: &&FmuVariable, of: Causality| {
            variable.causality == of && variable.variability == Variability::Continuous
        };
        let of = |causality| variables().filter(move |v| is_continuous(v, causality)).collect();
        let [mut first, mut second]: [Vec<_>; 2] = if name.contains("OutputDerivatives") {
            [of(Causality::Output), vec![]]
        } else if name.contains("InputDerivatives") {
            [of(Causality::Input), vec![]]
        } else if name.contains("Derivative") {
            [of(Causality::Output), of(Causality::Input)]
        } else if data_type == "Clock" {
            if whim.state.is_none() {
                return [vec![], vec![]];
            }
            [variables().collect(), vec![]]
        } else {
            let is_readable =
                self.at.state != State::Instantiated || self.fmu.description.version() == Version::Two;
            let reads = name.starts_with("Get") && is_readable;
            let fits = |variable: &&FmuVariable| reads || self.is_settable(variable);
            [variables().filter(fits).collect(), vec![]]
        };
        if whim.state.is_none() {
            // They are set only while their clocks tick.
            let reads = name.starts_with("Get");
            first.retain(|variable| reads || !self.fmu.clocked.contains(&variable.name));
            return [first, second];
        }
        for list in [&mut first, &mut second] {
            let all: Vec<_> = self.fmu.description.variables.iter().collect();
            let from = if list.is_empty() { &all } else { &*list };
            let count = whim.of(&[0, 1, 1, 2, 3]);
            *list = (0..count).map(|_| if whim.has(0.03) { whim.of(&all) } else { whim.of(from) }).collect();
        }
        [first, second]
    }

    /// Whether a variable can be set now (FMI 2.0.5, the notes of section 4.2.4; FMI 3.0.2, section 2.3).
    pub fn is_settable(&self, variable: &FmuVariable) -> bool {
        let is_input = variable.causality == Causality::Input;
        match self.at.state {
            State::Instantiated => variable.is_settable(),
            State::InitializationMode => variable.is_settable() && variable.initial != Initial::Approx,
            State::ContinuousTimeMode => is_input && variable.variability == Variability::Continuous,
            _ => {
                is_input
                    || variable.causality == Causality::Parameter
                        && variable.variability == Variability::Tunable
            }
        }
    }

    /// The arguments of a function: valid unless a whim spoils them.
    pub fn arguments(&mut self, function: &'static Function, whim: &mut Whim) -> Vec<Argument> {
        let selected = self.selected(function, whim);
        self.arguments_of(function, selected, whim)
    }

    /// The arguments of a function with the value references of these variables.
    #[allow(
        clippy::too_many_lines,
        clippy::cast_possible_truncation,
        reason = "one case a kind; any value will do"
    )]
    pub fn arguments_of(
        &mut self,
        function: &'static Function,
        [first, second]: [Vec<&FmuVariable>; 2],
        whim: &mut Whim,
    ) -> Vec<Argument> {
        let name = &function.name[4..];
        let takes_state = function
            .parameters
            .iter()
            .any(|(_, kind)| matches!(kind, Kind::State | Kind::Out(Element::State)))
            && !name.eq_ignore_ascii_case("GetFMUstate");
        let state = match self.saved.last() {
            Some(&(state, _)) => state,
            None if takes_state => {
                let (at, state) = (self.at, self.save());
                self.saved.push((state, at));
                state
            }
            None => ptr::null_mut(),
        };
        let bytes = if name.contains("erialize") { self.serialize(state) } else { vec![] };
        let states = if function
            .parameters
            .iter()
            .any(|(name, kind)| matches!(kind, Kind::In(_)) && ["x", "continuousStates"].contains(name))
        {
            self.states()
        } else {
            vec![]
        };

        let size = |list: &[&FmuVariable]| list.iter().map(|variable| self.fmu.size(variable)).sum();
        let (of_states, of_indicators) = self.fmu.counts;
        let mut counts: Vec<_> = function
            .parameters
            .iter()
            .filter(|(_, kind)| *kind == Kind::Count)
            .map(|&(parameter, _)| match (parameter, name) {
                ("nvr" | "nValueReferences" | "nUnknown" | "nUnknowns", _) => first.len(),
                ("nKnown" | "nKnowns", _) => second.len(),
                ("nSeed", "GetDirectionalDerivative") | ("nSensitivity", "GetAdjointDerivative") => {
                    size(&second)
                }
                ("nValues" | "nSeed" | "nSensitivity", _) => size(&first),
                ("nx" | "nContinuousStates", _) => of_states,
                ("ni" | "nEventIndicators", _) => of_indicators,
                ("nCategories" | "nDependencies", _) => 1,
                ("size", _) => bytes.len(),
                other => panic!("{other:?} is unknown"),
            })
            .collect();
        if !counts.is_empty() && whim.has(0.03) {
            let position = whim.of(&(0..counts.len()).collect::<Vec<_>>());
            counts[position] = whim.of(&[0, 1, 2, 5, 16]);
        }
        let room = counts.iter().max().map_or(1, |&most| most);

        let mut rest = counts.iter();
        let mut references = [&first, &second].into_iter();
        let sizes_of_binaries = (0..room).map(|_| whim.of(&[2, 0, 300])).collect::<Vec<usize>>();
        function
            .parameters
            .iter()
            .map(|&(parameter, kind)| match kind {
                Kind::Number => Argument::Number(self.number(parameter, whim)),
                Kind::Whole => Argument::Whole(whole(parameter, name, whim)),
                Kind::Count => Argument::Whole(*rest.next().expect("as many") as u64),
                Kind::Reference => {
                    let clocks =
                        self.fmu.variables("Clock").filter(|clock| clock.causality == Causality::Input);
                    let any = self.fmu.description.variables.iter();
                    let choices: Vec<_> = clocks.chain(any).map(reference).collect();
                    Argument::Whole(if whim.has(0.5) { whim.of(&choices) } else { choices[0] }.into())
                }
                Kind::State => Argument::State(state),
                Kind::In(_) | Kind::Out(_) if whim.has(0.01) => Argument::Null,
                Kind::Out(Element::State) if takes_state => {
                    Argument::of(&[if name.contains("erialize") { ptr::null_mut() } else { state }])
                }
                Kind::Out(element) => {
                    // Not-a-number, which no call returns, unless there is more room than values.
                    let is_full = counts.iter().all(|&count| count == room);
                    let fill = if is_full && matches!(element, Element::Float(_)) { 0xff } else { 0 };
                    let content = vec![fill; room * element.size()];
                    Argument::Memory(Memory::new(&content, element.size()))
                }
                Kind::In(Element::Reference) => {
                    let list = references.next().expect("two lists at most");
                    let mut list: Vec<_> = list.iter().map(|variable| reference(variable)).collect();
                    list.resize(list.len().max(room), 0);
                    for reference in &mut list {
                        if whim.has(0.02) {
                            *reference = whim.of(&[99, 1 << 31, u32::MAX]);
                        }
                    }
                    Argument::of(&list)
                }
                Kind::In(Element::Whole(1)) if parameter == "serializedState" => Argument::of(&bytes),
                Kind::In(Element::Text) if parameter == "categories" => {
                    Argument::of_texts(vec![text("logStatusError", whim); room])
                }
                Kind::In(element) => {
                    let mut scalars = first.iter().flat_map(|variable| {
                        let starts: Vec<_> = variable.start.split_whitespace().collect();
                        (0..self.fmu.size(variable)).map(move |position| {
                            (*variable, *starts.get(position).or(starts.first()).unwrap_or(&""))
                        })
                    });
                    let mut content = vec![];
                    let (mut texts, mut binaries) = (vec![], vec![]);
                    for position in 0..room {
                        let scalar = scalars.next();
                        let value = match parameter {
                            "x" | "continuousStates" => {
                                let state = states.get(position).copied().unwrap_or_default();
                                let moved = state + 0.1 * (whim.share() - 0.5) * state.abs().max(0.1);
                                if whim.has(0.03) { whim.of(&ODD_NUMBERS) } else { moved }
                            }
                            "order" | "orders" => whim.of(&[1.0, 1.0, 1.0, 2.0, 0.0, 9.0, -1.0]),
                            "resolutions" => whim.of(&[8.0, 80.0, 1.0, 0.0]),
                            "valueSizes" => sizes_of_binaries[position] as f64,
                            _ => scalar.map_or(0.5, |(variable, start)| value(variable, start, whim)),
                        };
                        match element {
                            Element::Float(4) => content.extend((value as f32).to_ne_bytes()),
                            Element::Float(_) => content.extend(value.to_ne_bytes()),
                            Element::Whole(size) => {
                                content.extend(&(value as i64).to_ne_bytes()[..size]);
                            }
                            Element::Text => {
                                texts.push(text(scalar.map_or("", |(variable, _)| &variable.start), whim));
                            }
                            Element::Binary => {
                                binaries.push(vec![7_u8; sizes_of_binaries[position]]);
                                content.extend(bytes_of(&[binaries[position].as_ptr()]));
                            }
                            other => panic!("{other:?} is not read"),
                        }
                    }
                    if element == Element::Text {
                        return Argument::of_texts(texts);
                    }
                    let memory = Memory::new(&content, element.size());
                    Argument::Memory(Memory { _binaries: binaries, ..memory })
                }
            })
            .collect()
    }

    /// The continuous states, or none where they cannot be read.
    fn states(&mut self) -> Vec<f64> {
        let (get, at) = (self.fmu.function("GetContinuousStates"), self.at);
        if !self.allows(get) {
            return vec![];
        }
        let count = self.fmu.counts.0;
        let arguments = [Argument::of(&vec![0.0_f64; count]), Argument::Whole(count as u64)];
        let _ = self.call(get, &arguments);
        self.at.time = at.time;
        let Argument::Memory(memory) = &arguments[0] else { return vec![] };
        memory.numbers()
    }

    fn number(&self, parameter: &str, whim: &mut Whim) -> f64 {
        if whim.has(0.05) {
            return whim.of(&ODD_NUMBERS);
        }
        let now = self.at.time;
        match parameter {
            "currentCommunicationPoint" => now,
            "communicationStepSize" => whim.of(&[0.125, 0.0125, 0.001]),
            "time" | "activationTime" => now + whim.of(&[0.0, 0.01, 0.0625]),
            "tolerance" => 1e-6,
            "startTime" => 0.0,
            "stopTime" => 1e3,
            other => panic!("{other} is unknown"),
        }
    }
}

/// The value reference of a variable.
pub fn reference(variable: &FmuVariable) -> u32 {
    variable.value_reference.meaning().expect("a value reference is a number")
}

/// A value for a variable.
fn value(variable: &FmuVariable, start: &str, whim: &mut Whim) -> f64 {
    // The test model fails on request, which has tests of its own; this value is refused.
    if variable.name.starts_with("fault.") {
        return if whim.state.is_none() { 1.0 } else { 0.0 };
    }
    if whim.state.is_none() {
        return start.parse().unwrap_or(f64::from(start == "true"));
    }
    if whim.has(0.05) {
        return whim.of(&ODD_NUMBERS);
    }
    if let Some(DataType::Boolean | DataType::Clock) = variable.data_type.meaning() {
        return whim.of(&[1.0, 0.0]);
    }
    let (min, max) = variable.range().expect("bounds are numbers");
    let most = if variable.value_type() == ValueType::Enumeration { 3.0 } else { 1e6 };
    let (min, max) = (min.max(-most), max.min(most));
    // Small numbers are useful where there is no bound.
    let share = whim.share() * whim.of(&[1.0, 1.0, 0.0, 1.02, -0.02]);
    if max - min > 1e5 { share } else { min + share * (max - min) }
}

fn whole(parameter: &str, function: &str, whim: &mut Whim) -> u64 {
    let choices = match (parameter, function) {
        ("s", "GetRealStatus" | "GetIntegerStatus") => [2, 0, 1, 3, 77],
        ("s", "GetBooleanStatus") => [3, 0, 1, 2, 77],
        ("s", "GetStringStatus") => [1, 0, 2, 3, 77],
        ("s", _) => [0, 1, 2, 3, 77],
        _ => [1, 0, 1, 0, 255],
    };
    whim.of(&choices)
}

fn text(usual: &str, whim: &mut Whim) -> Option<CString> {
    let odd: [Option<&[u8]>; 5] =
        [None, Some(b""), Some(b"\xff"), Some("é#%s".as_bytes()), Some(b"logEvents")];
    let text = if whim.has(0.1) { whim.of(&odd) } else { Some(usual.as_bytes()) };
    text.map(|text| CString::new(text).expect("there is no NUL in it"))
}
