//! Sampled models.

use fmu_export::{Context, Error, Persistent, Sample, Sampled, SampledModel, Simulation};
use fmu_export_equations::{TunedTicks, stairs, tuned_ticks};

/// Counts its samples.
#[derive(Clone, Debug, Default, Persistent)]
struct Counter;

impl Sampled for Counter {
    type Variables = stairs::Variables;

    fn period(variables: &Self::Variables) -> f64 {
        variables.parameters.interval
    }

    fn sample(
        &mut self,
        sample: Sample,
        variables: &mut Self::Variables,
        _inputs: &stairs::Inputs,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        variables.outputs.steps += 1;
        variables.outputs.last_step = sample.time;
        Ok(())
    }
}

/// A step must end; one of some seconds' work is computed.
#[test]
fn a_step_with_too_many_samples_is_refused() {
    let mut simulation = Simulation::<SampledModel<Counter>>::default();
    simulation.variables.parameters.interval = 0.5;
    simulation.initialize().unwrap();
    simulation.step(1e5).unwrap();
    assert_eq!(simulation.variables.outputs.steps, 200_000);
    for size in [1e8, 1e308] {
        let error = simulation.step(size).unwrap_err().to_string();
        assert!(error.contains(" samples, from 100000 s on, one every 0.5 s; at most 1e7"), "{error}");
    }
    assert_eq!(simulation.variables.outputs.steps, 200_000);
}

/// Otherwise a step would have samples without end, or none.
#[test]
fn a_period_that_is_not_finite_and_above_zero_is_refused() {
    for (period, shown) in [(0.0, "0"), (-0.1, "-0.1"), (f64::NAN, "NaN"), (f64::INFINITY, "inf")] {
        let expected = format!("the sample period is {shown} s; it must be finite and above 0");
        let mut simulation = Simulation::<SampledModel<Counter>>::default();
        simulation.variables.parameters.interval = period;
        assert_eq!(simulation.initialize().unwrap_err().to_string(), expected);
    }
    let mut simulation = Simulation::<SampledModel<Counter>>::default();
    simulation.variables.parameters.interval = 0.5;
    simulation.initialize().unwrap();
    simulation.step(0.75).unwrap();
    assert_eq!(simulation.variables.outputs.steps, 2);
    assert_eq!(simulation.variables.outputs.last_step.to_bits(), 0.5_f64.to_bits());
}

/// Its JSON declares a clock, and it has a period, too.
#[derive(Clone, Debug, Default, Persistent)]
struct Both;

impl Sampled for Both {
    type Variables = tuned_ticks::Variables;

    fn period(_variables: &Self::Variables) -> f64 {
        0.5
    }

    fn sample(
        &mut self,
        _sample: Sample,
        _variables: &mut Self::Variables,
        _inputs: &tuned_ticks::Inputs,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        Ok(())
    }
}

#[test]
fn a_period_beside_clocks_is_refused() {
    let error = Simulation::<SampledModel<Both>>::default().initialize().unwrap_err().to_string();
    assert_eq!(
        error,
        "the sample period is 0.5 s; the clocks in the JSON have intervals of their own: omit `period`"
    );
    Simulation::<SampledModel<TunedTicks>>::default().initialize().unwrap();
}
