//! Sampled models.

use fmu_export::{Context, Error, Persistent, Sample, Sampled, SampledModel, Simulation};
use fmu_export_equations::{TunedTicks, stairs, tuned_ticks, two_clocks, two_clocks_3};

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

/// Defines models that record their samples: the clock, its sample's number and time.
macro_rules! recorders {
    ($($name:ident: $module:ident;)*) => {$(
        #[derive(Clone, Debug, Default, Persistent)]
        struct $name {
            samples: Vec<(String, u64, f64)>,
        }

        impl Sampled for $name {
            type Variables = $module::Variables;

            fn initialize(
                &mut self,
                variables: &mut $module::Variables,
                _context: &mut Context<'_>,
            ) -> Result<(), Error> {
                let $module::Variables { parameters, clocks, .. } = variables;
                if parameters.interval.is_sign_positive() {
                    clocks.seldom.set_interval(parameters.interval);
                }
                clocks.seldom.set_shift(parameters.shift);
                Ok(())
            }

            fn sample(
                &mut self,
                sample: Sample,
                variables: &mut $module::Variables,
                _context: &mut Context<'_>,
            ) -> Result<(), Error> {
                let clocks = &variables.clocks;
                let clock = match (clocks.often.ticks(), clocks.seldom.ticks()) {
                    (true, false) => "often",
                    (false, true) => "seldom",
                    both => panic!("{both:?} tick"),
                };
                self.samples.push((clock.to_owned(), sample.number, sample.time));
                variables.outputs.samples += 1;
                Ok(())
            }
        }
    )*};
}
recorders! {
    Recorder: two_clocks;
    Recorder3: two_clocks_3;
}

/// 3 · 0.1 is more than 0.3 in floating point, and the same time: that of the earlier tick is that of both.
#[test]
fn clocks_tick_by_their_own_intervals_and_at_once_by_priority() {
    let mut simulation = Simulation::<SampledModel<Recorder>>::default();
    // Again from the start.
    for _ in 0..2 {
        simulation.initialize().unwrap();
        simulation.step(0.3).unwrap();
        assert_eq!(simulation.model.sampled.samples.len(), 4);
        simulation.step(0.1).unwrap();
        let expected = [
            ("often", 0, 0.0),
            ("seldom", 0, 0.0),
            ("often", 1, 0.1),
            ("often", 2, 0.2),
            ("often", 3, 0.3),
            ("seldom", 1, 0.3),
        ];
        assert_eq!(
            simulation.model.sampled.samples,
            expected.map(|(clock, number, time)| (clock.to_owned(), number, time))
        );
    }
    // Without an FMU, as FMI 3.0 too; there an importer ticks the clocks.
    let mut other = Simulation::<SampledModel<Recorder3>>::default();
    other.initialize().unwrap();
    other.step(0.4).unwrap();
    assert_eq!(other.model.sampled.samples, simulation.model.sampled.samples);
    other.tick(|variables| &mut variables.clocks.seldom).unwrap();
    assert_eq!(other.model.sampled.samples[6], ("seldom".to_owned(), 2, 0.4));
}

/// In whatever order the clocks' own times come.
#[test]
fn ticks_at_once_have_the_same_time() {
    for start in [0.0, 1e5, 1.7e9] {
        let mut simulation = Simulation::<SampledModel<Recorder>>::default();
        simulation.experiment.start_time = start;
        simulation.initialize().unwrap();
        simulation.step(60.05).unwrap();
        let samples = &simulation.model.sampled.samples;
        assert_eq!(samples.len(), 601 + 201);
        assert!(samples.is_sorted_by(|(.., before), (.., time)| before <= time), "from {start} s");
        for (_, number, time) in samples.iter().filter(|(clock, ..)| clock == "seldom") {
            let both = samples.iter().filter(|(_, _, other)| other.to_bits() == time.to_bits()).count();
            assert_eq!(both, 2, "seldom {number} at {time} s");
        }
    }
}

#[test]
fn clocks_whose_interval_is_lost_in_the_rounding_of_the_start_are_refused() {
    let mut simulation = Simulation::<SampledModel<Recorder>>::default();
    simulation.experiment.start_time = 1e300;
    assert_eq!(
        simulation.initialize().unwrap_err().to_string(),
        "the sample period is 0.1 s, which is lost in the rounding of the start time 1e300 s"
    );
}

#[test]
fn a_shift_delays_the_first_tick() {
    let mut simulation = Simulation::<SampledModel<Recorder>>::default();
    simulation.experiment.start_time = 2.0;
    simulation.variables.parameters.shift = 0.15;
    simulation.initialize().unwrap();
    simulation.step(0.5).unwrap();
    let seldom = simulation.model.sampled.samples.iter().filter(|(clock, ..)| clock == "seldom");
    let times: Vec<_> = seldom.map(|(_, number, time)| (*number, *time)).collect();
    assert_eq!(times, [(0, 2.0 + 0.15), (1, 2.0 + 0.15 + 0.3)]);
}

#[test]
fn a_clock_without_a_valid_interval_is_named() {
    for (interval, shift, expected) in [
        (-1.0, 0.0, "the model has not set the interval of the clock seldom"),
        (0.0, 0.0, "0 s for the interval of the clock seldom"),
        (f64::INFINITY, 0.0, "inf s for the interval of the clock seldom"),
        (f64::NAN, 0.0, "NaN s for the interval of the clock seldom"),
        (0.3, -0.1, "-0.1 s for the shift of the clock seldom"),
    ] {
        let mut simulation = Simulation::<SampledModel<Recorder>>::default();
        (simulation.variables.parameters.interval, simulation.variables.parameters.shift) = (interval, shift);
        assert_eq!(simulation.initialize().unwrap_err().to_string(), expected);
    }
    let mut simulation = Simulation::<SampledModel<Recorder>>::default();
    simulation.variables.parameters.interval = 1e-3;
    simulation.initialize().unwrap();
    let error = simulation.step(1e8).unwrap_err().to_string();
    assert!(error.contains(" samples, from 0 s on, one every 0.001 s; at most 1e7"), "{error}");
}
