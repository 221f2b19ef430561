//! The memory of an instance, which is the content of a saved state: the model, its variables, and the progress of the
//! calling sequence and the events.
//!
//! Ticks of clocks are computed when values are requested. The state before them is kept until they end.

use core::mem;

use fmu_abi::calling_sequence::Phase;
use fmu_solve::persistence::{Archive, Persistent};
use fmu_solve::time::Ahead;
use fmu_solve::{Error, Events};
use fmu_terms::InstanceType;

use crate::instance::logger::RecentMessages;
use crate::kinds::input_signal::InputSignal;
use crate::kinds::{InputsOf, Model, calculate_parameters};
use crate::model::clock::Clock;
use crate::model::context::Experiment;
use crate::model::description::{ClockDescription, ValueReference};
use crate::model::variables::{Accessed as _, Described as _};

/// The content of a saved state.
#[derive(Clone)]
pub(crate) struct Memory<M: Model> {
    pub(super) instance_type: InstanceType,
    pub(super) phase: Phase,
    pub(super) model: M,
    pub(super) variables: M::Variables,
    pub(super) inputs: InputSignal<InputsOf<M>>,
    /// The experiment, once set up.
    pub(super) experiment: Experiment,
    pub(super) is_set_up: bool,
    pub(super) time: f64,
    /// The importer's clock at this time.
    pub(super) ahead: Ahead,
    /// Whether anything was set since the values were computed.
    pub(super) stale: bool,
    /// Whether a tunable parameter was set since the parameters were last checked.
    pub(super) parameters_changed: bool,
    /// Messages logged during initialization.
    pub(super) recent_messages: RecentMessages,
    /// When the model requested the end, in s.
    pub(super) end: Option<f64>,
    /// Events handled by the importer.
    pub(super) events: Events,
    /// The event in Event Mode.
    pub(super) event: EventUnderWay,
    /// Ticks of clocks.
    pub(super) ticks: Ticks<M>,
}

/// The event iterations since Event Mode was entered.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EventUnderWay {
    pub(super) iterations: u32,
    /// Whether an iteration changed a state; the last one reports it.
    pub(super) states_changed: bool,
}

crate::persistent!(EventUnderWay { iterations, states_changed });

/// The pending ticks.
#[derive(Clone)]
pub(super) struct Ticks<M: Model> {
    pub(super) are_computed: bool,
    /// The state before the last ticks. It is kept, so that only the first ticks allocate.
    before: Option<Box<BeforeTicks<M>>>,
}

#[derive(Clone)]
struct BeforeTicks<M: Model> {
    model: M,
    variables: M::Variables,
    end: Option<f64>,
}

// An instance of another type rejects the memory before; ticks are rewound before.
impl<M: Model> Persistent for Memory<M> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        let Self {
            instance_type: _,
            phase,
            model,
            variables,
            inputs,
            experiment,
            is_set_up,
            time,
            ahead,
            stale,
            parameters_changed,
            recent_messages,
            end,
            events,
            event,
            ticks: _,
        } = self;
        let mut number = *phase as u8;
        number.persist(archive)?;
        *phase = Phase::numbered(number)
            .ok_or_else(|| Error::new(format!("{number} is not a state of an instance")))?;
        model.persist(archive)?;
        variables.persist(archive)?;
        inputs.persist(archive)?;
        experiment.persist(archive)?;
        is_set_up.persist(archive)?;
        time.persist(archive)?;
        ahead.persist(archive)?;
        stale.persist(archive)?;
        parameters_changed.persist(archive)?;
        recent_messages.persist(archive)?;
        end.persist(archive)?;
        events.persist(archive)?;
        event.persist(archive)
    }
}

impl<M: Model> Memory<M> {
    const CLOCKS: &'static [ClockDescription] = M::Variables::CLOCKS;

    pub(super) fn new(instance_type: InstanceType) -> Self {
        let variables = M::Variables::default();
        let indicators = match instance_type {
            InstanceType::CoSimulation | InstanceType::ScheduledExecution => 0,
            InstanceType::CoSimulationWithEvents | InstanceType::ModelExchange => {
                M::Variables::EVENT_INDICATORS.len()
            }
        };
        Self {
            instance_type,
            phase: Phase::Instantiated,
            model: M::default(),
            inputs: InputSignal::constant(variables.inputs()),
            variables,
            experiment: Experiment::default(),
            is_set_up: false,
            time: 0.0,
            ahead: Ahead::default(),
            stale: true,
            parameters_changed: true,
            recent_messages: RecentMessages::default(),
            end: None,
            events: Events::new(indicators),
            event: EventUnderWay::default(),
            ticks: Ticks { are_computed: false, before: None },
        }
    }

    /// Checks the parameters set since the last check, and passes them to the model. Returns whether there were any.
    pub(super) fn accept_parameters(&mut self) -> Result<bool, Error> {
        if !self.parameters_changed {
            return Ok(false);
        }
        M::check_parameters(&self.variables)?;
        self.take_parameters();
        self.parameters_changed = false;
        Ok(true)
    }

    /// Computes what follows from the parameters.
    pub(super) fn take_parameters(&mut self) {
        calculate_parameters(&self.model, &mut self.variables);
        self.model.take_parameters(&self.variables);
    }

    /// Sets a Real input at a position, within its bounds. Returns whether the value has just left them.
    #[inline]
    pub(super) fn set_real_input(&mut self, reference: ValueReference, position: usize, value: f64) -> bool {
        let Self { variables, inputs, .. } = self;
        inputs.go_back(variables.inputs_mut());
        let (bounded, has_left) = inputs.take(position, value);
        variables.set_real(reference, bounded);
        has_left
    }

    /// An input that is not Real has been set to another value.
    pub(super) fn note_changed_input(&mut self) {
        self.inputs.go_back(self.variables.inputs_mut());
        self.inputs.note_change();
    }

    pub(super) fn clock_mut(&mut self, position: usize) -> &mut Clock {
        self.variables.clock_mut(position).expect("each position has a clock")
    }

    /// Rewinds computed ticks; they are recomputed when a value is requested.
    pub(super) fn rewind(&mut self) {
        if !Self::CLOCKS.is_empty() && mem::take(&mut self.ticks.are_computed) {
            let before = self.ticks.before.as_ref().expect("it is kept when ticks are computed");
            self.model.clone_from(&before.model);
            self.variables.clone_from(&before.variables);
            self.end = before.end;
            self.stale = true;
        }
    }

    /// Keeps the state before the ticks.
    pub(super) fn keep_before_ticks(&mut self) {
        let Self { model, variables, end, ticks, .. } = self;
        match &mut ticks.before {
            Some(before) => {
                before.model.clone_from(model);
                before.variables.clone_from(variables);
                before.end = *end;
            }
            none => {
                let before = BeforeTicks { model: model.clone(), variables: variables.clone(), end: *end };
                *none = Some(Box::new(before));
            }
        }
        ticks.are_computed = true;
    }

    /// Whether an input clock was active when the computed ticks began.
    pub(super) fn ticked(&self, position: usize) -> bool {
        self.ticks.before.as_ref().is_some_and(|before| is_activated::<M>(&before.variables, position))
    }

    /// Ends the ticks: their results become the state.
    pub(super) fn end_ticks(&mut self) {
        if !Self::CLOCKS.is_empty() && mem::take(&mut self.ticks.are_computed) {
            self.recent_messages = RecentMessages::default();
        }
        for (position, description) in Self::CLOCKS.iter().enumerate() {
            let clock = self.clock_mut(position);
            clock.has_ticked |= mem::take(&mut clock.ticks) && description.is_input;
        }
    }

    /// Event Mode begins.
    pub(super) fn begin_event(&mut self) {
        for position in 0..Self::CLOCKS.len() {
            self.clock_mut(position).has_ticked = false;
        }
    }
}

/// Whether an input clock ticks.
pub(super) fn is_activated<M: Model>(variables: &M::Variables, position: usize) -> bool {
    M::Variables::CLOCKS[position].is_input && variables.clock(position).is_some_and(|clock| clock.ticks)
}
