//! A model that holds another crate's state, which serde saves.

use std::ffi::c_void;
use std::ptr;

use fmu_export::fmi2::{c_api, c_types};
use fmu_export::{Context, Error, Persistent, Sample, Sampled, SampledModel, Variables as _};
use fmu_export_equations::stairs;
use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng as _;

use crate::instantiate;

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
        _inputs: &stairs::Inputs,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.generator = Some(Pcg32::new(1, 2));
        Ok(())
    }

    fn sample(
        &mut self,
        _sample: Sample,
        variables: &mut Self::Variables,
        _inputs: &stairs::Inputs,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let drawn = self.generator.as_mut().map(|generator| f64::from(generator.next_u32()));
        variables.outputs.last_step = drawn.ok_or_else(|| Error::new("there is no generator"))?;
        Ok(())
    }
}

type Model = SampledModel<Noise>;

/// An instance of the FMU.
struct Importer(*mut c_void);

// SAFETY of every call below: the instance is the importer's, and used by one thread; arrays have the passed lengths, and
// what is passed outlives the call.
impl Importer {
    fn new() -> Self {
        let importer = Self(instantiate::<Model>(c_types::CO_SIMULATION));
        // SAFETY: see above.
        unsafe {
            c_api::fmi2SetupExperiment::<Model>(importer.0, 0, 0.0, 0.0, 0, 0.0);
            c_api::fmi2EnterInitializationMode::<Model>(importer.0);
            let status = c_api::fmi2ExitInitializationMode::<Model>(importer.0);
            assert_eq!(status, c_types::Status::Ok);
        }
        importer
    }

    /// The noise after a step from a time (s).
    fn step(&self, start: u32) -> f64 {
        let mut described = stairs::Variables::described();
        let (reference, _) = described.find(|(_, variable)| variable.name() == "last_step").unwrap();
        let mut value = f64::NAN;
        // SAFETY: see above.
        unsafe {
            let status = c_api::fmi2DoStep::<Model>(self.0, f64::from(start), 1.0, 1);
            assert_eq!(status, c_types::Status::Ok);
            c_api::fmi2GetReal::<Model>(self.0, &raw const reference, 1, &raw mut value);
        }
        value
    }

    fn save(&self) -> Vec<u8> {
        let (mut state, mut size) = (ptr::null_mut(), 0);
        // SAFETY: see above.
        unsafe {
            c_api::fmi2GetFMUstate::<Model>(self.0, &raw mut state);
            c_api::fmi2SerializedFMUstateSize::<Model>(self.0, state, &raw mut size);
            let mut bytes = vec![0; size];
            c_api::fmi2SerializeFMUstate::<Model>(self.0, state, bytes.as_mut_ptr(), size);
            c_api::fmi2FreeFMUstate::<Model>(self.0, &raw mut state);
            bytes.into_iter().map(i8::cast_unsigned).collect()
        }
    }

    fn restore(&self, bytes: &[u8]) {
        let mut state = ptr::null_mut();
        // SAFETY: see above.
        unsafe {
            let status = c_api::fmi2DeSerializeFMUstate::<Model>(
                self.0,
                bytes.as_ptr().cast(),
                bytes.len(),
                &raw mut state,
            );
            assert_eq!(status, c_types::Status::Ok);
            c_api::fmi2SetFMUstate::<Model>(self.0, state);
            c_api::fmi2FreeFMUstate::<Model>(self.0, &raw mut state);
        }
    }
}

impl Drop for Importer {
    fn drop(&mut self) {
        // SAFETY: the instance is this importer's, and this its last use.
        unsafe { c_api::fmi2FreeInstance::<Model>(self.0) }
    }
}

#[test]
fn a_run_continued_by_another_instance_is_that_of_one_that_never_stopped() {
    let one = Importer::new();
    let before: Vec<_> = (0..10).map(|start| one.step(start)).collect();
    let saved = one.save();
    let expected: Vec<_> = (10..20).map(|start| one.step(start)).collect();
    assert_ne!(before, expected);
    let other = Importer::new();
    other.restore(&saved);
    let found: Vec<_> = (10..20).map(|start| other.step(start)).collect();
    assert_eq!(found, expected);
}
