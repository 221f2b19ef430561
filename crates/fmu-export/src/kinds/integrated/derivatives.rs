//! Derivatives of a model's equations: along a direction by dual numbers, and of a weighted sum by a tape.

use fmu_solve::{Dual, Recorded, Tape};

use super::{Integrate, Integrated};
use crate::kinds::equations::{Equations, VariablesOf, calculate_parameters, duals, evaluate};
use crate::model::variables::{Accessed as _, Numbered as _};

impl<E: Equations, I: Integrate<E>> Integrated<E, I> {
    /// The derivatives of the calculated variables along a direction, with states already initialized.
    pub(super) fn derivatives(
        &self,
        time: Dual,
        variables: &E::Variables,
        direction: &E::Variables,
        initialize: impl FnOnce(&mut VariablesOf<E, Dual>),
    ) -> E::Variables {
        let mut direction = direction.clone();
        direction.states_from_start();
        let mut duals = duals(variables, &direction, &Dual::new);
        calculate_parameters::<E, Dual>(&self.equations, &mut duals);
        initialize(&mut duals);
        evaluate(&self.equations, time, &mut duals);
        E::Variables::collected(&duals, &direction, |dual: Dual, _| dual.derivative)
    }

    /// The derivatives of a weighted sum of calculated variables with respect to the knowns, with states already
    /// initialized.
    #[allow(clippy::too_many_arguments, reason = "those of its callers")]
    pub(super) fn derivatives_backwards<'t>(
        &self,
        time: f64,
        variables: &E::Variables,
        known: &E::Variables,
        weights: &E::Variables,
        tape: &'t mut Tape,
        initialize: impl FnOnce(&mut VariablesOf<E, Recorded<'t>>),
    ) -> E::Variables {
        tape.clear();
        let tape = &*tape;
        let is_known = |known: f64| known != 0.0;
        let mut recorded = variables.combined(known, |value, known| {
            if is_known(known) { tape.variable(value) } else { Recorded::from(value) }
        });
        calculate_parameters::<E, Recorded<'_>>(&self.equations, &mut recorded);
        initialize(&mut recorded);
        evaluate(&self.equations, Recorded::from(time), &mut recorded);
        let _ = E::Variables::collected(&recorded, weights, |number: Recorded<'_>, weight| {
            tape.weigh(number, weight);
            0.0
        });
        tape.go_back();
        let mut derivatives = tape.derivatives_in_order();
        variables
            .combined(known, |_, known| if is_known(known) { derivatives.next().unwrap_or(0.0) } else { 0.0 })
    }
}
