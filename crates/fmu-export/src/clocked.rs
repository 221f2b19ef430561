//! Models that compute when their clocks tick (FMI 3.0.2, section 2.2.8), for all interfaces of FMI 3.0.

use crate::audit::check_calculated_parameters;
use crate::context::Context;
use crate::error::Error;
use crate::events::Events;
use crate::model::{InputsOf, Model, Serves, Step, calculate_parameters};
use crate::persistence::{Archive, Persistent};
use crate::stops::{Stop, Stops};
use crate::variables::Variables;

/// A model that computes at the ticks of its clocks, activated by the importer; nothing changes in between. Its clocks
/// are variables of type `Clock`, in the field `clocks`.
///
/// `Clone` and [`Persistent`] must cover its whole memory, as in [`Model`].
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not implement `Clocked`: write `fmu!({Self})`, `fmu!(equations {Self})` or `fmu!(sampled {Self})` if it implements \
               `Model`, `Equations` or `Sampled`",
    label = "exported as a `Clocked`"
)]
pub trait Clocked: Clone + Default + Persistent + Send + Sync + 'static {
    /// The model's variables, generated from its JSON.
    type Variables: Variables<Of<f64> = Self::Variables>;

    /// Rejects contradictory parameters.
    ///
    /// # Errors
    /// A message with the parameters and their values.
    fn check_parameters(variables: &Self::Variables) -> Result<(), Error> {
        let _ = variables;
        Ok(())
    }

    /// Calculates what depends on parameters only: all calculated parameters, and all locals whose variability is
    /// `fixed` or `tunable`. No other hook sets them. Called before [`Clocked::initialize`], and after each change of
    /// tunable parameters.
    fn calculate_parameters(
        &self,
        parameters: &<Self::Variables as Variables>::Parameters<f64>,
        calculated: &mut <Self::Variables as Variables>::CalculatedParameters<f64>,
    ) {
        let _ = (parameters, calculated);
    }

    /// Computes the values before the first tick, and sets clock intervals that depend on parameters. Called on a new
    /// model, possibly repeatedly, like [`Model::initialize`].
    ///
    /// # Errors
    /// When no such values exist.
    fn initialize(
        &mut self,
        variables: &mut Self::Variables,
        inputs: &InputsOf<ClockedModel<Self>>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let _ = (variables, inputs, context);
        Ok(())
    }

    /// Recomputes, at a time (s) between ticks, what belongs to no clock and depends on inputs or tunable parameters
    /// that have changed, including the intervals of tunable clocks.
    fn refresh(&mut self, time: f64, variables: &mut Self::Variables, inputs: &InputsOf<ClockedModel<Self>>) {
        let _ = (time, variables, inputs);
    }

    /// Computes a clock's tick at a time in s: exactly one input clock [ticks](crate::Clock::ticks). Simultaneous
    /// ticks are one call each, ordered by `priority`.
    ///
    /// # Errors
    /// When the model cannot continue.
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
    const SERVES: Serves = Serves::ALL;
    const TAKES_PARAMETERS: bool = C::Variables::HAS_CALCULATED_PARAMETERS;

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
        calculate_parameters(self, variables);
        self.0.initialize(variables, inputs, context)?;
        check_calculated_parameters(variables, |variables| calculate_parameters(self, variables))?;
        self.0.refresh(context.experiment.start_time, variables, inputs);
        Ok(())
    }

    fn calculate_parameters(
        &self,
        parameters: &<Self::Variables as Variables>::Parameters<f64>,
        calculated: &mut <Self::Variables as Variables>::CalculatedParameters<f64>,
    ) {
        self.0.calculate_parameters(parameters, calculated);
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
