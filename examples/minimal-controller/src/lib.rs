//! A minimal controller for `BoostPlant`: a PI controller of boost pressure that samples at each communication point,
//! and the relay of the vacuum pump. A template for your own controller.
#![allow(non_snake_case, reason = "the library is named after the model identifier")]

use fmu_export::{Context, Error, Persistent, Step, Stepper};

fmu_export::fmu!(stepper MinimalController);

/// The range of duties in which the wastegate moves, in %.
const DUTIES: [f64; 2] = [25.0, 75.0];
/// The tank's pressures in Pa at which the pump stops and starts.
const TANK_PRESSURES: [f64; 2] = [30_000.0, 35_000.0];

/// The controller's memory: the integral term in % of duty.
#[derive(Clone, Default, Persistent)]
struct MinimalController {
    integral: f64,
}

impl Stepper for MinimalController {
    type Variables = Variables;

    fn initialize(&mut self, variables: &mut Variables, _context: &mut Context<'_>) -> Result<(), Error> {
        self.integral = variables.parameters.duty;
        variables.outputs.hp_wastegate_pwm = compensated(self.integral, &variables.inputs);
        variables.outputs.vacuum_pump = 0.0;
        Ok(())
    }

    fn step(
        &mut self,
        variables: &mut Variables,
        step: &Step<'_, Inputs>,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let Variables { inputs, parameters, outputs, .. } = variables;
        let proportional = parameters.gain * (inputs.boost_reference - inputs.boost_pressure);
        let duty = (self.integral + proportional).clamp(DUTIES[0], DUTIES[1]);
        // At a bound the integral term is limited, against windup.
        let integral = self.integral + proportional * step.size / parameters.integral_time;
        self.integral = integral.clamp(DUTIES[0], DUTIES[1]);

        outputs.hp_wastegate_pwm = compensated(duty, inputs);
        if inputs.tank_pressure <= TANK_PRESSURES[0] {
            outputs.vacuum_pump = 0.0;
        } else if inputs.tank_pressure >= TANK_PRESSURES[1] {
            outputs.vacuum_pump = 1.0;
        }
        Ok(())
    }
}

/// A duty at 12 V, compensated for the present voltage (paper, eq. (9)).
fn compensated(duty: f64, inputs: &Inputs) -> f64 {
    (duty * 12.0 / inputs.supply_voltage_measured.max(6.0)).min(100.0)
}
