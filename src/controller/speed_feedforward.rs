//! The feedforward from engine speed changes.
//!
//! While engine speed rises with the valves held, the shafts lag, and boost is below its steady-state value by about S
//! times the rate of change: the schedule's `speed_sensitivity`. So the duty that holds a pressure during the change is
//! the one that holds a pressure higher by that at rest.

use super::schedule::OperatingPoint;
use super::variables::{Parameters, Real};
use crate::elementary::{larger, smaller};

/// Iterations of the pressure shift at the shifted pressure, after the first at the pressure itself. The map is smooth: a third would change less than the
/// map's accuracy.
const ITERATIONS: usize = 2;

/// The range of the shifted pressure (Pa), that of the measurement, to stay finite for absurd maps.
const PRESSURES: (Real, Real) = (0.0, 1e6);

/// The engine speed (rpm) for the sensitivity, at an engine speed (rpm), its rate (rpm/s) and a bypass opening.
///
/// While the bypass is open, it is the speed that corresponds to its opening at rest, since the bypass lags engine
/// speed. A deceleration uses a speed higher by the range in which the low-pressure wastegate shuts, up to the end of
/// that range: it passes the range before the shafts reach the greater sensitivity there, and the speed lost by the
/// high-pressure shaft is missing when it ends.
fn sensitive_speed(parameters: &Parameters, engine_speed: Real, rate: Real, bypass: Real) -> Real {
    let allocation = &parameters.allocation;
    let (shut, free) = (allocation.bypass_shut_below, allocation.bypass_free_above);
    let of_bypass = if engine_speed < free && bypass > 0.0 {
        larger(engine_speed, shut + bypass * (free - shut))
    } else {
        engine_speed
    };
    if rate >= 0.0 {
        return of_bypass;
    }
    let (shut, free) = (allocation.low_pressure_shut_below, allocation.low_pressure_free_above);
    larger(of_bypass, smaller(engine_speed + (free - shut), free))
}

/// The virtual duty (%) that holds a boost pressure (Pa) while engine speed (rpm) changes at a rate (rpm/s); none at
/// constant speed.
pub fn holding_duty(
    parameters: &Parameters,
    boost_pressure: Real,
    engine_speed: Real,
    rate: Real,
    bypass: Real,
) -> Option<Real> {
    if rate == 0.0 {
        return None;
    }
    let schedule = &parameters.range_schedule;
    let at = |engine_speed| OperatingPoint::new(schedule, boost_pressure, engine_speed);
    let sensitive = at(sensitive_speed(parameters, engine_speed, rate, bypass));
    let shift = |pressure| {
        let sensitivity = sensitive.at_pressure(pressure).interpolate(&schedule.speed_sensitivity);
        parameters.speed_feedforward.share * sensitivity * rate
    };
    let mut shifted = boost_pressure;
    for _ in 0..=ITERATIONS {
        shifted = boost_pressure + shift(shifted);
    }
    Some(at(engine_speed).extrapolated_feedforward(shifted.clamp(PRESSURES.0, PRESSURES.1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deceleration_keeps_the_sensitivity_of_higher_speeds() {
        let parameters = Parameters::default();
        let near = |engine_speed, rate, bypass, expected: Real| {
            let found = sensitive_speed(&parameters, engine_speed, rate, bypass);
            assert!((found - expected).abs() < 1e-9, "{found}, not {expected}");
        };
        for (engine_speed, in_a_deceleration) in
            [(1600.0, 2100.0), (2000.0, 2500.0), (2300.0, 2500.0), (3000.0, 3000.0)]
        {
            near(engine_speed, -1000.0, 0.0, in_a_deceleration);
            near(engine_speed, 1000.0, 0.0, engine_speed);
        }
        // The bypass would be a quarter open at 3250 rpm.
        near(2300.0, -1000.0, 0.25, 3250.0);
        near(2300.0, 1000.0, 0.25, 3250.0);
    }
}
