//! What the importer sees of an evaluation: outputs and local variables.

use std::f64::consts::PI;

use super::scalar::Scalar;
use super::system::{Evaluation, System};
use super::variables::{
    AirFilterLocals, CylindersLocals, ExhaustLocals, ExhaustManifoldLocals, HpWastegatePortLocals, Inputs,
    IntercoolerLocals, InterstageExhaustLocals, Locals, Outputs, PumpLocals, States, ThrottleBodyLocals,
};

/// The outputs and locals that belong to inputs, states and their evaluation.
#[must_use]
pub fn quantities<D: Scalar>(
    system: &System<D>,
    inputs: &Inputs<D>,
    states: &States<D>,
    evaluation: &Evaluation<D>,
) -> (Outputs<D>, Locals<D>) {
    let (actuation, gas_path) = (&evaluation.actuation, &evaluation.gas_path);
    let work = system.cylinders.work(
        inputs.engine_speed,
        gas_path.cylinders.fuel,
        states.intake_manifold.pressure,
        states.exhaust_manifold.pressure,
    );
    let rpm = 30.0 / PI;
    let outputs = Outputs {
        boost_pressure: states.intercooler.outlet_pressure,
        tank_pressure: states.tank.pressure,
        actuator_pressure: states.actuator.chamber_pressure,
        intake_manifold_pressure: states.intake_manifold.pressure,
        exhaust_manifold_pressure: states.exhaust_manifold.pressure,
        interstage_exhaust_pressure: states.interstage_exhaust.pressure,
        hp_wastegate_position: actuation.hp_wastegate_opening,
        supply_voltage_measured: states.supply_sensor.voltage,
        engine_torque: work.torque,
        air_mass_flow: gas_path.cylinders.air,
        hp_turbo_speed: states.hp_shaft.speed * rpm,
        lp_turbo_speed: states.lp_shaft.speed * rpm,
        exhaust_temperature: gas_path.exhaust_temperature,
        charge_temperature: gas_path.charge_temperature,
    };
    let locals = Locals {
        valve: actuation.valve,
        pump: PumpLocals { drawn_mass_flow: actuation.pumped },
        actuator: actuation.actuator,
        hp_wastegate_port: HpWastegatePortLocals {
            effective_area: gas_path.hp_wastegate.effective_area,
            mass_flow: gas_path.hp_wastegate.mass_flow,
        },
        air_filter: AirFilterLocals { mass_flow: gas_path.air_filter },
        lp_compressor: gas_path.lp_compressor,
        hp_compressor: gas_path.hp_compressor,
        hp_bypass_port: gas_path.hp_bypass,
        intercooler: IntercoolerLocals {
            inlet_temperature: gas_path.intercooler_inlet_temperature,
            mass_flow: gas_path.intercooler,
            outlet_temperature: gas_path.charge_temperature,
        },
        surge_valve_port: gas_path.surge_valve,
        throttle_body: ThrottleBodyLocals { mass_flow: gas_path.throttle.mass_flow },
        cylinders: CylindersLocals {
            volumetric_efficiency: gas_path.cylinders.volumetric_efficiency,
            air_mass_flow: gas_path.cylinders.air,
            fuel_mass_flow: gas_path.cylinders.fuel,
            exhaust_mass_flow: gas_path.cylinders.exhaust,
            exhaust_temperature: gas_path.cylinders.exhaust_temperature,
            indicated_work: work.indicated,
            friction_mean_effective_pressure: work.friction_pressure,
        },
        exhaust_manifold: ExhaustManifoldLocals { temperature: gas_path.exhaust_temperature },
        hp_turbine: gas_path.hp_turbine,
        interstage_exhaust: InterstageExhaustLocals { temperature: gas_path.interstage_temperature },
        lp_turbine: gas_path.lp_turbine,
        lp_wastegate_port: gas_path.lp_wastegate,
        exhaust: ExhaustLocals { temperature: gas_path.tail_temperature, mass_flow: gas_path.exhaust },
    };
    (outputs, locals)
}
