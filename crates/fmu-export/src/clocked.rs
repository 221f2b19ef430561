//! Models that compute when their clocks tick (FMI 3.0.2, section 2.2.8), in every interface of FMI 3.0.

use crate::error::Error;
use crate::event_mode::{EventMode, Stop, Stops};
use crate::events::Events;
use crate::model::{Context, InputsOf, Model, Step, Variables};
use crate::model_exchange::ModelExchange;
use crate::persistence::{Archive, Persistent};
use crate::scheduled_execution::ScheduledExecution;

/// A model that computes at the ticks of its clocks, which the importer activates; between them nothing changes by itself.
/// Its clocks are variables of the type `Clock`, in the field `clocks`.
///
/// `Clone` and [`Persistent`] must copy and hand out its whole memory, as in [`Model`].
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not implement `Clocked`: write `fmu!({Self})`, `fmu!(equations {Self})` or `fmu!(sampled {Self})` if it implements \
               `Model`, `Equations` or `Sampled`",
    label = "exported as a `Clocked`"
)]
pub trait Clocked: Clone + Default + Persistent + Send + Sync + 'static {
    /// The model's variables, generated from its JSON.
    type Variables: Variables<Of<f64> = Self::Variables>;

    /// Refuses parameters that contradict each other.
    ///
    /// # Errors
    /// A message that names the parameters and their values.
    fn check_parameters(variables: &Self::Variables) -> Result<(), Error> {
        let _ = variables;
        Ok(())
    }

    /// Computes the values before the first tick, and sets the intervals of clocks that follow from parameters. Called on a
    /// new model, maybe several times, as [`Model::initialize`].
    ///
    /// # Errors
    /// When there are no such values.
    fn initialize(
        &mut self,
        variables: &mut Self::Variables,
        inputs: &InputsOf<ClockedModel<Self>>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let _ = (variables, inputs, context);
        Ok(())
    }

    /// Recomputes, at a time (s) between ticks, what belongs to no clock and depends on inputs or tunable parameters that
    /// were set since; among it the intervals of tunable clocks.
    fn refresh(&mut self, time: f64, variables: &mut Self::Variables, inputs: &InputsOf<ClockedModel<Self>>) {
        let _ = (time, variables, inputs);
    }

    /// Computes the tick of a clock at a time in s: of the clocks that are inputs, one [ticks](crate::Clock::ticks). Where
    /// several tick at one time, there is a call for each, in the order of their `priority`.
    ///
    /// # Errors
    /// When the model cannot go on.
    fn tick(
        &mut self,
        time: f64,
        variables: &mut Self::Variables,
        inputs: &InputsOf<ClockedModel<Self>>,
        context: &mut Context<'_>,
    ) -> Result<(), Error>;
}

/// A clocked model as a [`Model`].
#[derive(Clone, Debug, Default)]
pub struct ClockedModel<C>(pub C);

impl<C: Clocked> Persistent for ClockedModel<C> {
    fn persist(&mut self, archive: &mut Archive<'_>) -> Result<(), Error> {
        self.0.persist(archive)
    }
}

impl<C: Clocked> Model for ClockedModel<C> {
    type Variables = C::Variables;

    fn check_parameters(variables: &Self::Variables) -> Result<(), Error> {
        C::check_parameters(variables)
    }

    fn initialize(
        &mut self,
        variables: &mut Self::Variables,
        inputs: &InputsOf<Self>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        *self = Self::default();
        self.0.initialize(variables, inputs, context)?;
        self.0.refresh(context.experiment.start_time, variables, inputs);
        Ok(())
    }

    fn step(
        &mut self,
        _variables: &mut Self::Variables,
        _step: &Step<'_, InputsOf<Self>>,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        Ok(())
    }

    fn refresh(&mut self, time: f64, variables: &mut Self::Variables, inputs: &InputsOf<Self>) {
        self.0.refresh(time, variables, inputs);
    }

    fn tick(
        &mut self,
        time: f64,
        variables: &mut Self::Variables,
        inputs: &InputsOf<Self>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.0.tick(time, variables, inputs, context)
    }
}

impl<C: Clocked> ModelExchange for ClockedModel<C> {}

impl<C: Clocked> EventMode for ClockedModel<C> {
    fn step_to_event(
        &mut self,
        _variables: &mut Self::Variables,
        _step: &Step<'_, InputsOf<Self>>,
        _events: Option<&mut Events>,
        _stops: Stops,
        _context: &mut Context<'_>,
    ) -> Result<Option<Stop>, Error> {
        Ok(None)
    }
}

impl<C: Clocked> ScheduledExecution for ClockedModel<C> {}
