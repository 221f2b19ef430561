//! A model with a clock of each kind, for tests of the exporter.
#![allow(non_snake_case)] // the library is named after the model identifier

use fmu_export::{Context, Error, Persistent, Sample, Sampled};

fmu_export::fmu!(sampled ClockedModel);

/// Its memory is in its variables.
#[derive(Clone, Debug, Default, Persistent)]
pub struct ClockedModel;

impl Sampled for ClockedModel {
    type Variables = Variables;

    fn initialize(&mut self, variables: &mut Variables, _context: &mut Context<'_>) -> Result<(), Error> {
        let Variables { parameters, clocks, .. } = variables;
        clocks.sample.set_interval(parameters.sample_time);
        clocks.sample.set_shift(parameters.delay);
        clocks.pulse.set_interval(0.125);
        Ok(())
    }

    fn refresh(&mut self, _time: f64, variables: &mut Variables) {
        variables.clocks.tuned.set_interval(variables.parameters.tuned_time);
    }

    fn sample(
        &mut self,
        sample: Sample,
        variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let Variables { inputs, clocks, outputs, locals, .. } = variables;
        let names = [
            (clocks.constant, "constant"),
            (clocks.trigger, "trigger"),
            (clocks.given, "given"),
            (clocks.tuned, "tuned"),
            (clocks.adapted, "adapted"),
            (clocks.pulse, "pulse"),
            (clocks.alarm, "alarm"),
            (clocks.sample, "sample"),
        ];
        for (_, name) in names.iter().filter(|(clock, _)| clock.ticks()) {
            outputs.order += name;
            outputs.order += " ";
            outputs.count += 1;
        }
        locals.last = sample.time;
        if clocks.trigger.ticks() {
            locals.last_sum = outputs.sum;
            outputs.sum += inputs.amount;
            if inputs.amount < 0 {
                context.warn(format_args!("the amount is {}", inputs.amount));
            }
            match inputs.amount {
                101.. => return Err(Error::new("the amount is too large")),
                100 => context.terminate(sample.time),
                11.. => clocks.alarm.set_interval(f64::from(inputs.amount - 11)),
                _ => {}
            }
        }
        if clocks.pulse.ticks() {
            clocks.pulse.set_interval(0.125 * f64::from(outputs.count));
        }
        if outputs.count % 3 == 0 {
            clocks.third.tick();
        }
        Ok(())
    }
}
