//! The boost pressure controller's firmware in the loop: an FMU with the variables of `BoostController`, whose samples the
//! firmware computes on QEMU's Cortex-M7.
#![allow(non_snake_case)]

pub mod ecu;
pub mod image;

use fmu_export::calibration;
use fmu_export::persistence::Archive;
use fmu_export::{Context, Error, Float, Persistent, Sample, Sampled};

use ecu::Ecu;

fmu_export::fmu!(sampled InTheLoop);

/// The firmware on a processor of its own.
#[derive(Debug, Default, Persistent)]
pub struct InTheLoop {
    #[persistent(skip)]
    ecu: Option<Ecu>,
    /// The page of parameters that the firmware has.
    #[persistent(skip)]
    page: Vec<u64>,
}

/// A clone has no processor: the FMU offers no states to save.
impl Clone for InTheLoop {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl InTheLoop {
    /// Has the firmware work with the variables' parameters and inputs, and takes its results.
    fn work(
        &mut self,
        work: impl FnOnce(&mut Ecu, &mut dyn Iterator<Item = u64>) -> Result<(), Error>,
        variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let ecu = match &mut self.ecu {
            Some(ecu) => ecu,
            none => none.insert(Ecu::start()?),
        };
        if !calibration::page(variables).eq(self.page.iter().copied()) {
            self.page = calibration::page(variables).collect();
            ecu.write_page(&self.page)?;
        }
        work(ecu, &mut calibration::inputs(variables))?;
        let results = ecu.answer(context)?;
        let mut archive = Archive::reading(&results);
        variables.outputs.persist(&mut archive)?;
        variables.locals.persist(&mut archive)?;
        if archive.is_exhausted() {
            return Ok(());
        }
        Err(Error::new("the firmware has more results: was it compiled with the same FMU_PRECISION?"))
    }
}

impl Sampled for InTheLoop {
    type Variables = Variables;

    fn period(variables: &Variables) -> f64 {
        Float::decimal(variables.parameters.sample_time)
    }

    fn initialize(&mut self, variables: &mut Variables, context: &mut Context<'_>) -> Result<(), Error> {
        self.work(Ecu::initialize, variables, context)
    }

    fn sample(
        &mut self,
        _sample: Sample,
        variables: &mut Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.work(Ecu::sample, variables, context)
    }
}
