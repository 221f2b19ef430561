//! Communication steps.

use crate::c_boundary::arguments::not_null;
use crate::error::Error;
use crate::fmi3::c_types::{Boolean, Status};
use crate::instance::{Answer, Instance};
use crate::model::Model;

/// A communication step by a function that also returns whether the importer has an event to handle.
///
/// # Safety
/// The results are null or may be written to.
pub(super) unsafe fn step_by<M: Model>(
    instance: &mut Instance<M>,
    (start, size): (f64, f64),
    [event_handling_needed, terminate, early_return]: [*mut Boolean; 3],
    last_successful_time: *mut f64,
    do_step: impl FnOnce(&mut Instance<M>, f64, f64) -> Result<(Status, bool), Error>,
) -> Answer {
    let event_handling_needed = not_null("eventHandlingNeeded", event_handling_needed)?;
    let terminate = not_null("terminateSimulation", terminate)?;
    let early_return = not_null("earlyReturn", early_return)?;
    let last_successful_time = not_null("lastSuccessfulTime", last_successful_time)?;
    let write = |instance: &Instance<M>, has_event: bool, ends: bool| {
        let time = instance.last_successful_time();
        let is_early = (has_event || ends) && time < start + size;
        // SAFETY: the caller's promise.
        unsafe {
            event_handling_needed.write_unaligned(Boolean::from(has_event));
            terminate.write_unaligned(Boolean::from(ends));
            early_return.write_unaligned(Boolean::from(is_early && instance.early_return_allowed));
            last_successful_time.write_unaligned(time);
        }
    };
    // After an error, too.
    write(instance, false, false);
    let (status, has_event) = do_step(instance, start, size)?;
    let ends = instance.asks_for_end();
    write(instance, has_event, ends);
    Ok(if ends { Status::Ok } else { status })
}
