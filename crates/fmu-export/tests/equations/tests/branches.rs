//! A branch, selected by an event, that omits a variable; and the tolerance of the declaration.

use fmu_export::{Context, Equations, Error, Event, Integrated, Model, Number, Persistent, Simulation};
use fmu_export_equations::{branches, branches_3};
use fmu_terms::InstanceType;

use crate::importer::{Importer, heard};

/// In s.
const PERIOD: f64 = 0.007_812_5;

/// What the branch omits, and how the error calls it.
const OMITTED: [(i32, &str); 5] = [(1, "double"), (2, "der(x)"), (3, "inner"), (4, "row[2]"), (5, "double")];

/// Defines the model in a version.
macro_rules! model {
    ($name:ident of $module:ident) => {
        #[derive(Clone, Debug, Default, Persistent)]
        struct $name {
            is_selected: bool,
        }

        impl Equations for $name {
            type Variables = $module::Variables;

            fn evaluate<T: Number>(&self, _time: T, variables: $module::Evaluation<'_, T>) {
                let $module::Evaluation { parameters, states, derivatives, locals, outputs, .. } = variables;
                let omitted = if self.is_selected { parameters.omits } else { 0 };
                if omitted != 2 {
                    derivatives.x = -states.x;
                }
                if omitted != 3 {
                    locals.inner = states.x;
                }
                match omitted {
                    1 => {}
                    5 => outputs.double = outputs.double + 1.0,
                    _ => outputs.double = states.x * 2.0,
                }
                outputs.row[0] = locals.inner;
                if omitted != 4 {
                    outputs.row[1] = states.x;
                }
                outputs.row[2] = states.x;
            }

            fn next_event(&self, _time: f64, variables: &$module::Variables) -> Option<f64> {
                let next = PERIOD * f64::from(variables.outputs.events + 1);
                (variables.parameters.after > 0).then_some(next)
            }

            fn event(
                &mut self,
                event: &Event<'_>,
                variables: &mut $module::Variables,
                _context: &mut Context<'_>,
            ) -> Result<(), Error> {
                if event.is_due {
                    variables.outputs.events += 1;
                    variables.outputs.word.push('!');
                    self.is_selected = variables.outputs.events >= variables.parameters.after;
                }
                Ok(())
            }
        }
    };
}

model!(Branches of branches);
model!(Branches3 of branches_3);

fn omitted(name: &str, time: f64) -> String {
    format!(
        "after the event at {time} s, `evaluate` does not set {name}, or computes it from its previous value"
    )
}

/// After so many events, a test does not evaluate twice either.
#[test]
fn a_late_branch_that_omits_a_variable_is_named() {
    for (omits, name) in OMITTED {
        let mut simulation = Simulation::<Integrated<Branches>>::default();
        simulation.variables.parameters.omits = omits;
        simulation.variables.parameters.after = 1500;
        simulation.initialize().unwrap();
        let size = 1499.0 * PERIOD;
        simulation.step(size).unwrap();
        assert_eq!(simulation.step(1.0).unwrap_err().to_string(), omitted(name, 1500.0 * PERIOD));
    }
}

fn check_model_exchange<M: Model>() {
    for (omits, name) in [(0, "")].into_iter().chain(OMITTED) {
        let mut importer = Importer::<M>::new(InstanceType::ModelExchange);
        importer.enter_initialization();
        importer.set_integer("omits", omits);
        importer.exit_initialization();
        assert_eq!(importer.update(), Some(PERIOD));
        importer.leave_event_mode();
        importer.set_time(PERIOD);
        importer.enter_event_mode();
        heard();
        assert_eq!(importer.try_iteration().is_some(), omits == 0, "{name}");
        if omits > 0 && !Importer::<M>::IS_FMI2 {
            assert_eq!(heard(), [format!("fmi3UpdateDiscreteStates: {}", omitted(name, PERIOD))]);
        }
    }
}

#[test]
fn a_branch_that_omits_a_variable_is_named_in_model_exchange() {
    check_model_exchange::<Integrated<Branches>>();
    check_model_exchange::<Integrated<Branches3>>();
}

/// x after 20 s, with the tolerance that the importer gives.
fn decayed<M: Model>(tolerance: Option<f64>) -> u64 {
    let mut importer = Importer::<M>::new(InstanceType::CoSimulation);
    importer.enter_initialization_with(tolerance, 0.0, None);
    importer.set_integer("after", 0);
    importer.exit_initialization();
    importer.step(0.0, 20.0);
    importer.get(["x"])[0].to_bits()
}

fn check_tolerance<M: Model>() {
    let own = decayed::<M>(None);
    assert_eq!(own, decayed::<M>(Some(0.01)));
    assert_ne!(own, decayed::<M>(Some(1e-6)));
}

#[test]
fn the_tolerance_of_the_declaration_holds_where_the_importer_gives_none() {
    check_tolerance::<Integrated<Branches>>();
    check_tolerance::<Integrated<Branches3>>();
    let x = |tolerance| {
        let mut simulation = Simulation::<Integrated<Branches>>::default();
        simulation.experiment.tolerance = tolerance;
        simulation.variables.parameters.after = 0;
        simulation.initialize().unwrap();
        simulation.step(20.0).unwrap();
        simulation.variables.states.x.to_bits()
    };
    assert_eq!(x(None), x(Some(0.01)));
    assert_ne!(x(None), x(Some(1e-6)));
}

#[test]
fn a_matrix_starts_from_a_flat_list_row_by_row() {
    let matrix = branches::Variables::default().parameters.matrix;
    assert_eq!(matrix, [[11.0, 12.0, 13.0], [21.0, 22.0, 23.0]]);
}
