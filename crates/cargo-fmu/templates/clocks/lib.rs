//! Clocks: periodic, triggered, countdown set by the model, and an output that the model ticks.

use fmu_export::{Context, Error, Sample, Sampled};

fmu_export::fmu!(sampled struct {Type});

impl Sampled for {Type} {
    type Variables = Variables;

    fn sample(
        &mut self,
        sample: Sample,
        variables: &mut Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let (clocks, outputs) = (&mut variables.clocks, &mut variables.outputs);
        outputs.total_in_clock_ticks += 1;
        if clocks.in_clock1.ticks() {
            outputs.in_clock1_ticks += 1;
            if (4.0..5.0).contains(&sample.time) {
                clocks.in_clock3.set_interval(0.0);
            }
        }
        if clocks.in_clock2.ticks() {
            outputs.in_clock2_ticks += 1;
            outputs.result2 += variables.inputs.input2;
        }
        if clocks.in_clock3.ticks() {
            outputs.in_clock3_ticks += 1;
            outputs.output3 = 1000;
        }
        if outputs.total_in_clock_ticks % 5 == 0 {
            clocks.out_clock.tick();
        }
        Ok(())
    }
}
