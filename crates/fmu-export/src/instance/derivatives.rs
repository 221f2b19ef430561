//! Derivatives: directional (FMI 2.0.5, section 2.1.9), adjoint (FMI 3.0.2, section 2.2.11), and of outputs over time
//! (FMI 2.0.5, section 4.2.1).

use fmu_abi::Status;
use fmu_abi::calling_sequence::Phase;
use fmu_solve::display::Shown;
use fmu_solve::{Dual, Error};

use super::values::REALS;
use super::{Answer, Instance};
use crate::kinds::Model;
use crate::model::description::{
    Causality, Roles, ScalarVariable, ValueReference, Variability, VariableDescription,
};
use crate::model::variables::{Accessed as _, Described as _, Numbered as _};

impl<M: Model> Instance<M> {
    /// The directional derivatives of unknowns along a direction of knowns (section 2.1.9).
    pub(crate) fn get_directional_derivative(
        &mut self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
        seeds: &[f64],
        sensitivities: &mut [f64],
    ) -> Answer {
        Self::check_differentiates("providesDirectionalDerivative is false")?;
        self.check_unknowns(unknowns)?;
        self.check_knowns(knowns)?;
        Self::check_seeds("knowns", knowns, seeds)?;
        let (mut rate_of_time, mut direction) = (0.0, M::Variables::zero());
        for (&known, &seed) in knowns.iter().zip(seeds) {
            if is_time::<M>(known) {
                rate_of_time = seed;
            } else if self.can_change(known) {
                direction.set_real(known, seed);
            }
        }
        let (status, derivatives) = self.differentiate(rate_of_time, &direction)?;
        self.copy_derivatives(&derivatives, direction, unknowns, sensitivities)?;
        Ok(status)
    }

    /// The derivatives of a sum of unknowns, each times its seed, with respect to knowns.
    pub(crate) fn get_adjoint_derivative(
        &mut self,
        unknowns: &[ValueReference],
        knowns: &[ValueReference],
        seeds: &[f64],
        sensitivities: &mut [f64],
    ) -> Answer {
        if !Self::DESCRIPTION.capabilities.adjoint_derivatives {
            return Err(Error::new("this FMU has no such derivatives (providesAdjointDerivatives is false)"));
        }
        self.check_unknowns(unknowns)?;
        self.check_knowns(knowns)?;
        Self::check_seeds("unknowns", unknowns, seeds)?;
        let status = self.compute_values()?;
        let by_time = if knowns.iter().any(|&known| is_time::<M>(known)) {
            let (_, derivatives) = self.differentiate(1.0, &M::Variables::zero())?;
            unknowns.iter().zip(seeds).map(|(&unknown, seed)| seed * derivatives.real(unknown)).sum()
        } else {
            0.0
        };
        let weights = M::Variables::weights(unknowns, seeds);
        let by_parameters =
            knowns.iter().any(|&known| Self::checked(known).causality == Causality::Parameter);
        let (memory, tape) = (&self.memory, &mut self.tape);
        let variables = &memory.variables;
        let derivatives = if memory.phase == Phase::InitializationMode {
            memory.model.differentiate_initialization_backwards(memory.time, variables, &weights, tape)
        } else {
            memory.model.differentiate_backwards(memory.time, variables, &weights, by_parameters, tape)
        }?;
        for (&known, sensitivity) in knowns.iter().zip(sensitivities) {
            *sensitivity = if is_time::<M>(known) {
                by_time
            } else if self.can_change(known) {
                derivatives.real(known)
            } else {
                0.0
            };
            if !sensitivity.is_finite() {
                let name = Self::checked(known).name();
                return Err(Error::new(format!("the derivative by {name} is {}", Shown(*sensitivity))));
            }
        }
        Ok(status)
    }

    /// The derivatives of outputs with respect to time (section 4.2.1).
    pub(crate) fn get_real_output_derivatives(
        &mut self,
        references: &[ValueReference],
        orders: impl Iterator<Item = i32>,
        values: &mut [f64],
    ) -> Answer {
        Self::check_differentiates("maxOutputDerivativeOrder is 0")?;
        for (&reference, order) in references.iter().zip(orders) {
            let variable = Self::variable(reference, REALS)?;
            if variable.causality != Causality::Output {
                return Err(Error::new(format!("the variable {} is not an output", variable.name())));
            }
            if order != 1 {
                return Err(Error::new(format!(
                    "order {order} of the derivative of {}; maxOutputDerivativeOrder is 1",
                    variable.name()
                )));
            }
        }
        let status = self.compute_values()?;
        // Along the direction in which time, states and inputs change.
        let mut direction = self.memory.variables.along_derivatives();
        for (reference, variable) in M::Variables::described() {
            if let Some(input) = variable.real_input() {
                direction.set_real(reference, self.memory.inputs.slope(input));
            }
        }
        let (_, derivatives) = self.differentiate(1.0, &direction)?;
        self.copy_derivatives(&derivatives, direction, references, values)?;
        Ok(status)
    }

    fn check_differentiates(missing: &str) -> Result<(), Error> {
        if Self::DESCRIPTION.capabilities.directional_derivatives {
            Ok(())
        } else {
            Err(Error::new(format!("this FMU has no such derivatives ({missing})")))
        }
    }

    fn check_unknowns(&self, unknowns: &[ValueReference]) -> Result<(), Error> {
        for &unknown in unknowns {
            let variable = Self::variable(unknown, REALS)?;
            // Event indicators never are (FMI 3.0.2, section 2.2.11).
            if unknown >= M::Variables::FIRST_EVENT_INDICATOR {
                return Err(Error::new(format!(
                    "{} is not an unknown: it is an event indicator",
                    variable.name()
                )));
            }
            self.check_unknown(&variable)?;
        }
        Ok(())
    }

    fn check_knowns(&self, knowns: &[ValueReference]) -> Result<(), Error> {
        knowns.iter().try_for_each(|&known| self.check_known(&Self::variable(known, REALS)?))
    }

    /// Checks the seeds of variables, each of which may occur once.
    fn check_seeds(role: &str, references: &[ValueReference], seeds: &[f64]) -> Result<(), Error> {
        for (&reference, &seed) in references.iter().zip(seeds) {
            if !seed.is_finite() {
                let name = Self::checked(reference).name();
                return Err(Error::new(format!("{} for the seed of {name}", Shown(seed))));
            }
        }
        if references.is_sorted_by(|one, next| one < next) {
            return Ok(());
        }
        let mut sorted = references.to_vec();
        sorted.sort_unstable();
        sorted.windows(2).find(|pair| pair[0] == pair[1]).map_or(Ok(()), |twice| {
            let name = Self::checked(twice[0]).name();
            Err(Error::new(format!("{name} occurs twice among the {role}")))
        })
    }

    /// Whether changing a known has an effect: an input held at a bound stays there, and a constant never changes.
    fn can_change(&self, known: ValueReference) -> bool {
        let known = Self::checked(known);
        known.variability != Variability::Constant
            && known.real_input().is_none_or(|input| self.memory.inputs.is_free(input))
    }

    /// A variable's roles in the equations of the present state.
    pub(super) fn roles(&self, variable: &VariableDescription) -> Roles {
        if self.is_before_steps() { variable.in_initialization } else { variable.in_steps }
    }

    pub(super) fn is_before_steps(&self) -> bool {
        let phase = self.memory.phase;
        matches!(phase, Phase::Instantiated | Phase::ConfigurationMode | Phase::InitializationMode)
    }

    fn check_unknown(&self, variable: &ScalarVariable) -> Result<(), Error> {
        if self.roles(variable).unknown {
            Ok(())
        } else {
            Err(Error::new(format!(
                "{} is not an unknown in the state {}",
                variable.name(),
                self.memory.phase
            )))
        }
    }

    fn check_known(&self, variable: &ScalarVariable) -> Result<(), Error> {
        if self.roles(variable).known {
            Ok(())
        } else {
            Err(Error::new(format!("{} is not a known in the state {}", variable.name(), self.memory.phase)))
        }
    }

    /// The derivatives along a direction, with time changing at a rate, after refreshing the values.
    fn differentiate(
        &mut self,
        rate_of_time: f64,
        direction: &M::Variables,
    ) -> Result<(Status, M::Variables), Error> {
        let status = self.compute_values()?;
        let memory = &self.memory;
        let variables = &memory.variables;
        let time = Dual::new(memory.time, rate_of_time);
        let derivatives = if memory.phase == Phase::InitializationMode {
            memory.model.differentiate_initialization(time, variables, direction)
        } else {
            memory.model.differentiate(time, variables, direction)
        };
        Ok((status, derivatives?))
    }

    /// Returns the derivatives of variables, if finite. Between steps, the derivative of a state is its seed.
    fn copy_derivatives(
        &self,
        derivatives: &M::Variables,
        mut direction: M::Variables,
        references: &[ValueReference],
        values: &mut [f64],
    ) -> Result<(), Error> {
        direction.states_from_start();
        let initializing = self.memory.phase == Phase::InitializationMode;
        for (&reference, value) in references.iter().zip(values) {
            let variable = Self::checked(reference);
            let from = if variable.state().is_some() && !initializing { &direction } else { derivatives };
            *value = from.real(reference);
            if !value.is_finite() {
                return Err(Error::new(format!(
                    "the derivative of {} is {}",
                    variable.name(),
                    Shown(*value)
                )));
            }
        }
        Ok(())
    }
}

fn is_time<M: Model>(reference: ValueReference) -> bool {
    M::Variables::description(reference).is_some_and(|variable| variable.causality == Causality::Independent)
}
