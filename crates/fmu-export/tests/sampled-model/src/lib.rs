//! A model that is sampled, for tests of the exporter.
#![allow(non_snake_case)] // the library is named after the model identifier

use fmu_export::{Context, Error, Persistent, Sample, Sampled};

fmu_export::fmu!(sampled SampledModel);

/// What the model remembers: the sum.
#[derive(Clone, Debug, Default, Persistent)]
pub struct SampledModel {
    sum: f64,
}

impl Sampled for SampledModel {
    type Variables = Variables;

    fn period(variables: &Variables) -> f64 {
        variables.parameters.sample_time
    }

    fn check_parameters(variables: &Variables) -> Result<(), Error> {
        let gain = variables.parameters.gain;
        if gain > 10.0 { Err(Error::new(format!("gain is {gain:?}"))) } else { Ok(()) }
    }

    fn sample(
        &mut self,
        sample: Sample,
        variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        if sample.time >= variables.parameters.end {
            context.terminate(sample.time);
        }
        self.sum += variables.parameters.gain * f64::from(variables.inputs.sign) * variables.inputs.signal;
        variables.outputs.sum = self.sum;
        variables.outputs.samples += 1;
        variables.locals.last = sample.time;
        Ok(())
    }
}
