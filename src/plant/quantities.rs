//! What the importer sees of an evaluation: outputs and local variables.

use std::f64::consts::PI;

use super::compressor::Compression;
use super::port::PortFlow;
use super::system::{Evaluation, System};
use super::turbine::Expansion;
use super::variables::{CompressorLocals, Inputs, Locals, Outputs, PortLocals, States, TurbineLocals};

/// The outputs and locals that belong to inputs, states and their evaluation.
#[must_use]
pub fn quantities(
    system: &System,
    inputs: &Inputs,
    states: &States,
    evaluation: &Evaluation,
) -> (Outputs, Locals) {
    let e = evaluation;
    let work = system.cylinders.work(
        inputs.engine_speed,
        e.cylinders.fuel,
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
        hp_wastegate_position: e.hp_wastegate_opening,
        supply_voltage_measured: states.supply_sensor.voltage,
        engine_torque: work.torque,
        air_mass_flow: e.cylinders.air,
        hp_turbo_speed: states.hp_shaft.speed * rpm,
        lp_turbo_speed: states.lp_shaft.speed * rpm,
        exhaust_temperature: e.exhaust_temperature,
        charge_temperature: e.charge_temperature,
    };
    let mut locals = Locals::default();
    locals.valve.voltage = e.voltage;
    locals.valve.commanded_duty = e.commanded_duty;
    locals.valve.pressure = e.valve.pressure;
    locals.valve.opening = e.valve.opening;
    locals.valve.tank_mass_flow = e.valve.tank;
    locals.valve.ambient_mass_flow = e.valve.ambient;
    locals.valve.leakage_mass_flow = e.valve.leakage;
    locals.pump.drawn_mass_flow = e.pumped;
    locals.actuator.volume = e.chamber_volume;
    locals.actuator.membrane_force = e.forces.membrane;
    locals.actuator.exhaust_force = e.forces.exhaust;
    locals.actuator.spring_force = e.forces.spring;
    locals.actuator.stop_force = e.forces.stop;
    locals.hp_wastegate_port.effective_area = e.hp_wastegate.area;
    locals.hp_wastegate_port.mass_flow = e.hp_wastegate.mass_flow;
    locals.air_filter.mass_flow = e.air_filter;
    locals.lp_compressor = compressor(&e.lp_compressor);
    locals.hp_compressor = compressor(&e.hp_compressor);
    locals.hp_bypass_port = port(e.hp_bypass);
    locals.intercooler.inlet_temperature = e.intercooler_inlet_temperature;
    locals.intercooler.mass_flow = e.intercooler;
    locals.intercooler.outlet_temperature = e.charge_temperature;
    locals.surge_valve_port = port(e.surge_valve);
    locals.throttle_body.mass_flow = e.throttle.mass_flow;
    locals.cylinders.volumetric_efficiency = e.cylinders.volumetric_efficiency;
    locals.cylinders.air_mass_flow = e.cylinders.air;
    locals.cylinders.fuel_mass_flow = e.cylinders.fuel;
    locals.cylinders.exhaust_mass_flow = e.cylinders.exhaust;
    locals.cylinders.exhaust_temperature = e.cylinders.exhaust_temperature;
    locals.cylinders.indicated_work = work.indicated;
    locals.cylinders.friction_mean_effective_pressure = work.friction_pressure;
    locals.exhaust_manifold.temperature = e.exhaust_temperature;
    locals.hp_turbine = turbine(&e.hp_turbine);
    locals.interstage_exhaust.temperature = e.interstage_temperature;
    locals.lp_turbine = turbine(&e.lp_turbine);
    locals.lp_wastegate_port = port(e.lp_wastegate);
    locals.exhaust.temperature = e.tail_temperature;
    locals.exhaust.mass_flow = e.exhaust;
    (outputs, locals)
}

fn compressor(compression: &Compression) -> CompressorLocals {
    CompressorLocals {
        mass_flow: compression.mass_flow,
        efficiency: compression.efficiency,
        outlet_temperature: compression.outlet_temperature,
        power: compression.power,
    }
}

fn port(flow: PortFlow) -> PortLocals {
    PortLocals { effective_area: flow.area, mass_flow: flow.mass_flow }
}

fn turbine(expansion: &Expansion) -> TurbineLocals {
    TurbineLocals {
        mass_flow: expansion.mass_flow,
        speed_ratio: expansion.speed_ratio,
        efficiency: expansion.efficiency,
        outlet_temperature: expansion.outlet_temperature,
        power: expansion.power,
    }
}
