//! A model that holds another crate's state, which serde saves.

use std::ops::Range;

use fmu_export::{Context, Error, Persistent, Sample, Sampled, SampledModel};
use fmu_export_equations::stairs;
use fmu_terms::InstanceType;
use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng as _;

use crate::importer::Importer;

/// Shows noise at each sample.
#[derive(Clone, Debug, Default, Persistent)]
struct Noise {
    #[persistent(serde)]
    generator: Option<Pcg32>,
}

impl Sampled for Noise {
    type Variables = stairs::Variables;

    fn period(variables: &Self::Variables) -> f64 {
        variables.parameters.interval
    }

    fn initialize(
        &mut self,
        _variables: &mut Self::Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.generator = Some(Pcg32::new(1, 2));
        Ok(())
    }

    fn sample(
        &mut self,
        _sample: Sample,
        variables: &mut Self::Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let drawn = self.generator.as_mut().map(|generator| f64::from(generator.next_u32()));
        variables.outputs.last_step = drawn.ok_or_else(|| Error::new("there is no generator"))?;
        Ok(())
    }
}

/// The noise after steps from some times (s).
fn noise<S: Sampled>(importer: &mut Importer<SampledModel<S>>, starts: Range<u32>) -> Vec<f64> {
    let step = |start: u32| {
        importer.step(start.into(), 1.0);
        importer.get(["last_step"])[0]
    };
    starts.map(step).collect()
}

/// The noise of a generator that could be cloned, but not written.
#[derive(Clone, Debug, Default, Persistent)]
struct Unwritten {
    #[persistent(skip)]
    noise: Noise,
}

impl Sampled for Unwritten {
    type Variables = stairs::Variables;

    fn period(variables: &Self::Variables) -> f64 {
        Noise::period(variables)
    }

    fn initialize(
        &mut self,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.noise.initialize(variables, context)
    }

    fn sample(
        &mut self,
        sample: Sample,
        variables: &mut Self::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.noise.sample(sample, variables, context)
    }
}

/// The second run is the same again, random numbers included.
#[test]
fn a_state_in_memory_has_the_skipped_fields() {
    let mut importer = Importer::<SampledModel<Unwritten>>::new(InstanceType::CoSimulation);
    importer.initialize();
    let before = noise(&mut importer, 0..10);
    let [first, second] = importer.twice(|importer| noise(importer, 10..20));
    assert_ne!(before, first);
    assert_eq!(first, second);
}

#[test]
fn a_run_continued_by_another_instance_is_that_of_one_that_never_stopped() {
    let mut one = Importer::<SampledModel<Noise>>::new(InstanceType::CoSimulation);
    one.initialize();
    let before = noise(&mut one, 0..10);
    let mut other = one.restored();
    let expected = noise(&mut one, 10..20);
    assert_ne!(before, expected);
    assert_eq!(noise(&mut other, 10..20), expected);
}
