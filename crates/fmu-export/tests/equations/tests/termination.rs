//! The end that a model requests (FMI 3.0.2, section 4.2.1), where its description promises whole steps.

use fmu_export::{Described as _, Integrated};
use fmu_export_equations::{Ending, ending};
use fmu_terms::InstanceType;

use crate::importer::{Importer, heard};

/// A first step of this size: whether the model asks for the end, whether the step ended early, and the time reached.
fn step(size: f64) -> (bool, bool, u64) {
    let mut importer = Importer::<Integrated<Ending>>::new(InstanceType::CoSimulation);
    importer.initialize();
    let ([_, ends, is_early], reached) = importer.step_with_flags(0.0, size);
    (ends, is_early, reached.to_bits())
}

#[test]
fn an_end_within_a_step_that_is_not_declared_warns() {
    assert!(ending::Variables::MODEL_DESCRIPTION_XML.contains("mightReturnEarlyFromDoStep=\"false\""));
    heard();
    assert_eq!(step(1.0), (true, true, 0.25_f64.to_bits()));
    let messages = heard();
    assert!(messages.iter().any(|text| text.contains("{\"termination\": true}")), "{messages:?}");
}

#[test]
fn an_end_at_the_end_of_a_step_need_not() {
    for size in [0.25, 0.25_f64.next_up()] {
        assert_eq!(step(size), (true, false, size.to_bits()));
    }
}
