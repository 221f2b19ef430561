//! The assembly: the components' connections (paper, figs. 2 and 3) and the resulting differential equations. The
//! integrator, the steady-state solver, outputs and local variables all use [`System::evaluate`].
//!
//! ```text
//! ambient ─ air filter ─ LPC ─┬─ HPC ────┬─ intercooler ─┬─ throttle ─ intake manifold ─ cylinders
//!                             ├─ bypass ─┘               │                                    │
//!                             └────── surge valve ───────┘                                    │
//! ambient ─ catalyst ─┬─ LPT ──────────┬─┬─ HPT ──────────┬─ exhaust manifold ────────────────┘
//!                     └─ LP wastegate ─┘ └─ HP wastegate ─┘
//!                                               │ rod
//! ambient ─ solenoid valve ─ chamber of the actuator      solenoid valve ─ vacuum tank ─ pump ─ ambient
//! ```
//!
//! Volumes between the components have pressures as states; temperatures are static, those of the inflowing gas.

use core::f64::consts::PI;

use super::actuator::Actuator;
use super::air_filter::AirFilter;
use super::compressor::Compressor;
use super::cylinders::{CylinderFlows, Cylinders};
use super::exhaust::Exhaust;
use super::exhaust_manifold::ExhaustManifold;
use super::gas::{Gas, Volume, mixed_temperature};
use super::intercooler::Intercooler;
use super::orifice::Orifice;
use super::port::Port;
use super::shaft::Shaft;
use super::solenoid_valve::SolenoidValve;
use super::supply::Supply;
use super::turbine::Turbine;
use super::vacuum_tank::VacuumTank;
use super::variables::{
    ActuationStates, ActuatorLocals, ActuatorStates, AirFilterLocals, AirFilterStates, CompressorLocals,
    CompressorStates, ExhaustLocals, ExhaustManifoldLocals, ExhaustManifoldStates, ExhaustStates,
    FaultParameters, GasPathStates, HpWastegatePortLocals, Inputs, IntakeManifoldStates, IntercoolerLocals,
    IntercoolerStates, InterstageExhaustLocals, InterstageExhaustStates, Locals, Outputs, Parameters,
    PortLocals, PortParameters, PumpLocals, ShaftStates, StateGroups, States, SupplySensorStates, TankStates,
    ThrottleBodyLocals, TurbineLocals, ValveLocals, ValveStates,
};
use crate::elementary::Elementary;

/// The lower limit in Pa of pressures in the equations: trial states of a solver may be zero or negative, where powers
/// and roots of pressure ratios do not exist.
const LOWEST_PRESSURE: f64 = 1.0;
/// Flow in kg/s below which the temperatures of mixed air flows are blended.
const AIR_MIXING_WIDTH: f64 = 1e-4;
/// Flow in kg/s below which the temperatures of mixed exhaust flows are blended.
const EXHAUST_MIXING_WIDTH: f64 = 1e-5;

/// All components with their parameters and derived constants.
#[derive(Clone, Copy, Debug)]
pub struct System<D = f64> {
    supply: Supply<D>,
    /// The solenoid valve.
    pub valve: SolenoidValve<D>,
    tank: VacuumTank<D>,
    /// The wastegate's actuator.
    pub actuator: Actuator<D>,
    air_filter: AirFilter<D>,
    lp_compressor: Compressor<D>,
    hp_compressor: Compressor<D>,
    hp_bypass: Port<D>,
    intercooler: Intercooler<D>,
    surge_valve: Port<D>,
    throttle: Port<D>,
    intake_manifold_volume: Volume<D>,
    pub(super) cylinders: Cylinders<D>,
    exhaust_manifold: ExhaustManifold<D>,
    hp_turbine: Turbine<D>,
    hp_wastegate: Port<D>,
    interstage_volume: Volume<D>,
    lp_turbine: Turbine<D>,
    lp_wastegate: Port<D>,
    exhaust: Exhaust<D>,
    hp_shaft: Shaft<D>,
    lp_shaft: Shaft<D>,
    fault: FaultParameters<D>,
}

/// The full scale of high-pressure shaft speed over the nominal value of both shafts.
const HP_SHAFT_SCALE: f64 = 2.0;
/// The full scales of the gas path's states.
pub const GAS_PATH_SCALES: GasPathStates = {
    let mut scales = GasPathStates::NOMINAL;
    scales.hp_shaft.speed *= HP_SHAFT_SCALE;
    scales
};

/// The actuation at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Actuation<D = f64> {
    /// The states' derivatives.
    pub derivatives: ActuationStates<D>,
    /// Opening of the high-pressure wastegate, from 0 to 1.
    pub hp_wastegate_opening: D,
    valve: ValveLocals<D>,
    pump: PumpLocals<D>,
    actuator: ActuatorLocals<D>,
}

/// The gas path at an instant.
#[derive(Clone, Copy, Debug)]
pub struct GasPath<D = f64> {
    /// The states' derivatives.
    pub derivatives: GasPathStates<D>,
    air_filter: AirFilterLocals<D>,
    lp_compressor: CompressorLocals<D>,
    hp_compressor: CompressorLocals<D>,
    hp_bypass_port: PortLocals<D>,
    intercooler: IntercoolerLocals<D>,
    surge_valve_port: PortLocals<D>,
    throttle_body: ThrottleBodyLocals<D>,
    cylinders: CylinderFlows<D>,
    exhaust_manifold: ExhaustManifoldLocals<D>,
    hp_turbine: TurbineLocals<D>,
    hp_wastegate_port: HpWastegatePortLocals<D>,
    interstage_exhaust: InterstageExhaustLocals<D>,
    lp_turbine: TurbineLocals<D>,
    lp_wastegate_port: PortLocals<D>,
    exhaust: ExhaustLocals<D>,
}

/// All components at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Instant<D = f64> {
    /// Fig. 3 of the paper.
    pub actuation: Actuation<D>,
    /// Fig. 2 of the paper.
    pub gas_path: GasPath<D>,
}

impl<D: Elementary> Instant<D> {
    /// The states' derivatives.
    #[must_use]
    pub fn derivatives(&self) -> States<D> {
        States::from_groups(StateGroups {
            actuation: self.actuation.derivatives,
            gas_path: self.gas_path.derivatives,
        })
    }
}

impl<D: Elementary> System<D> {
    /// Builds the components.
    #[must_use]
    pub fn new(parameters: &Parameters<D>) -> Self {
        let p = parameters;
        let (air, exhaust_gas) = (Gas::new(p.air), Gas::new(p.exhaust_gas));
        let air_orifice = Orifice::new(air, p.restrictions.linear_pressure_ratio);
        let exhaust_orifice = Orifice::new(exhaust_gas, p.restrictions.linear_pressure_ratio);
        Self {
            supply: Supply { pump: p.pump, sensor: p.supply_sensor },
            valve: SolenoidValve {
                parameters: p.valve,
                orifice: Orifice::new(air, p.valve.linear_pressure_ratio),
                leak_area: p.fault.vacuum_leak_area,
            },
            tank: VacuumTank { parameters: p.tank, pump: p.pump, volume: air.volume(p.tank.volume) },
            actuator: Actuator {
                parameters: p.actuator,
                air,
                stuck: p.fault.wastegate_stuck.then_some(p.fault.wastegate_stuck_position),
            },
            air_filter: AirFilter { parameters: p.air_filter, volume: air.volume(p.air_filter.volume) },
            lp_compressor: Compressor::new(p.lp_compressor, air),
            hp_compressor: Compressor::new(p.hp_compressor, air),
            hp_bypass: Port::new(p.hp_bypass_port, air_orifice),
            intercooler: Intercooler { parameters: p.intercooler, volume: air.volume(p.intercooler.volume) },
            surge_valve: Port::new(p.surge_valve_port, air_orifice),
            // The area of the throttle is the effective one.
            throttle: Port::new(
                PortParameters { area: p.throttle_body.area, discharge_coefficient: 1.0.into() },
                air_orifice,
            ),
            intake_manifold_volume: air.volume(p.intake_manifold.volume),
            cylinders: Cylinders {
                parameters: p.cylinders,
                fuel_air_ratio: p.cylinders.stoichiometric_air_fuel_ratio.recip(),
                air,
                residual_exponent: exhaust_gas.parameters.heat_capacity_ratio.recip(),
            },
            exhaust_manifold: ExhaustManifold {
                parameters: p.exhaust_manifold,
                volume: exhaust_gas.volume(p.exhaust_manifold.volume),
                gas: exhaust_gas,
            },
            hp_turbine: Turbine::new(p.hp_turbine, exhaust_gas),
            hp_wastegate: Port::new(
                PortParameters {
                    area: p.hp_wastegate_port.area,
                    discharge_coefficient: p.hp_wastegate_port.discharge_coefficient,
                },
                exhaust_orifice,
            ),
            interstage_volume: exhaust_gas.volume(p.interstage_exhaust.volume),
            lp_turbine: Turbine::new(p.lp_turbine, exhaust_gas),
            lp_wastegate: Port::new(p.lp_wastegate_port, exhaust_orifice),
            exhaust: Exhaust { parameters: p.exhaust, volume: exhaust_gas.volume(p.exhaust.volume) },
            hp_shaft: Shaft::new(p.hp_shaft),
            lp_shaft: Shaft::new(p.lp_shaft),
            fault: p.fault,
        }
    }

    /// The voltage in V at the terminals of valve and sensor, and the duty in percent at nominal voltage equivalent to
    /// the commanded one.
    #[must_use]
    pub fn command(&self, inputs: &Inputs<D>) -> (D, D) {
        let voltage = self.supply.voltage(inputs.supply_voltage, self.running_pump(inputs));
        (voltage, self.valve.commanded_duty(inputs.hp_wastegate_pwm, voltage))
    }

    /// The actual state of the vacuum pump (0 … 1).
    fn running_pump(&self, inputs: &Inputs<D>) -> D {
        if self.fault.pump_dead { 0.0.into() } else { inputs.vacuum_pump }
    }

    /// Everything at an instant.
    #[must_use]
    #[inline(never)]
    pub fn evaluate(&self, inputs: &Inputs<D>, states: &States<D>) -> Instant<D> {
        let gas_path = GasPathStates::of(states);
        let actuation =
            self.actuation(inputs, &ActuationStates::of(states), Self::exhaust_difference(&gas_path));
        let gas_path = self.gas_path(inputs, &gas_path, actuation.hp_wastegate_opening);
        Instant { actuation, gas_path }
    }

    /// The pressure difference in Pa across the high-pressure wastegate, for the states of the gas path.
    #[must_use]
    pub fn exhaust_difference(states: &GasPathStates<D>) -> D {
        let [upstream, downstream] = [states.exhaust_manifold.pressure, states.interstage_exhaust.pressure];
        upstream.max(LOWEST_PRESSURE) - downstream.max(LOWEST_PRESSURE)
    }

    /// The actuation (fig. 3) at an instant. It depends on the gas path only through the pressure difference in Pa
    /// across the high-pressure wastegate.
    #[must_use]
    pub fn actuation(
        &self,
        inputs: &Inputs<D>,
        states: &ActuationStates<D>,
        exhaust_difference: D,
    ) -> Actuation<D> {
        let ambient = (inputs.ambient_pressure, inputs.ambient_temperature);
        let plunger_duty = states.valve.plunger_duty;
        let ActuatorStates { chamber_pressure, position: x, velocity: v, friction_force } = states.actuator;
        let (p_tank, p_act) =
            (states.tank.pressure.max(LOWEST_PRESSURE), chamber_pressure.max(LOWEST_PRESSURE));

        let command = self.command(inputs);
        let valve = self.valve.flows(command, plunger_duty, ambient, p_act, p_tank);
        let pump = self.tank.pump(self.running_pump(inputs), p_tank);
        let actuator = self.actuator.evaluate(x, v, ambient.0, p_act, exhaust_difference);
        Actuation {
            derivatives: ActuationStates {
                supply_sensor: SupplySensorStates {
                    voltage: self.supply.measured_rate(valve.voltage, states.supply_sensor.voltage),
                },
                valve: ValveStates {
                    plunger_duty: self.valve.plunger_rate(valve.commanded_duty, plunger_duty),
                },
                tank: TankStates {
                    pressure: self.tank.pressure_rate(
                        ambient.1,
                        valve.leakage_mass_flow + valve.tank_mass_flow - pump.drawn_mass_flow,
                    ),
                },
                actuator: ActuatorStates {
                    chamber_pressure: self.actuator.pressure_rate(
                        p_act,
                        ambient.1,
                        actuator.volume,
                        v,
                        valve.ambient_mass_flow - valve.tank_mass_flow,
                    ),
                    position: v,
                    velocity: self.actuator.acceleration(&actuator, friction_force, v),
                    friction_force: self.actuator.friction_rate(friction_force, v),
                },
            },
            hp_wastegate_opening: self.actuator.opening(x),
            valve,
            pump,
            actuator,
        }
    }

    /// The gas path (fig. 2) at an instant. It depends on the actuation only through the high-pressure wastegate's
    /// opening (0 … 1).
    #[must_use]
    #[allow(clippy::too_many_lines)] // One line a component: the figure above in words.
    pub fn gas_path(
        &self,
        inputs: &Inputs<D>,
        states: &GasPathStates<D>,
        hp_wastegate_opening: D,
    ) -> GasPath<D> {
        let ambient = (inputs.ambient_pressure, inputs.ambient_temperature);
        let [p_af, p_1, p_2, p_ic, p_im, p_em, p_it, p_t] = [
            states.air_filter.pressure,
            states.lp_compressor.outlet_pressure,
            states.hp_compressor.outlet_pressure,
            states.intercooler.outlet_pressure,
            states.intake_manifold.pressure,
            states.exhaust_manifold.pressure,
            states.interstage_exhaust.pressure,
            states.exhaust.pressure,
        ]
        .map(|pressure| pressure.max(LOWEST_PRESSURE));
        let (w_hp, w_lp) = (states.hp_shaft.speed, states.lp_shaft.speed);

        // All powers of pressure ratios at once, so that the processor computes them in parallel: temperature ratios of
        // isentropic flow, the volume ratio of the residual gas, and the drops that drive the turbines.
        let [lpc_rise, hpc_rise, intake, overlap, hpt_fall, lpt_fall] =
            D::logarithms([p_1 / p_af, p_2 / p_1, p_im / p_ic, p_em / p_im, p_it / p_em, p_t / p_it]);
        let (by_air, by_exhaust) =
            (self.hp_compressor.air.isentropic_exponent, self.hp_turbine.gas.isentropic_exponent);
        let [lpc_ratio, hpc_ratio, throttle_ratio, residual, hpt_ratio, hpt_drop, lpt_ratio, lpt_drop] =
            D::powers_of_two([
                lpc_rise * by_air,
                hpc_rise * by_air,
                intake * by_air,
                overlap * self.cylinders.residual_exponent,
                hpt_fall * by_exhaust,
                hpt_fall * self.hp_turbine.parameters.flow_exponent,
                lpt_fall * by_exhaust,
                lpt_fall * self.lp_turbine.parameters.flow_exponent,
            ]);

        // Air path (fig. 2, upper half).
        let air_filter = self.air_filter.evaluate(ambient, p_af);
        let lpc = self.lp_compressor.compress((p_af, ambient.1), lpc_ratio, w_lp);
        let between = (p_1, lpc.outlet_temperature);
        let hpc = self.hp_compressor.compress(between, hpc_ratio, w_hp);
        let bypass =
            self.hp_bypass.flow_at(inputs.hp_bypass, between, (p_2, hpc.outlet_temperature), hpc_ratio);
        let t_2m = mixed_temperature(
            (hpc.mass_flow, hpc.outlet_temperature),
            (bypass.mass_flow, lpc.outlet_temperature),
            AIR_MIXING_WIDTH.into(),
        );
        let intercooler = self.intercooler.evaluate((p_2, t_2m), p_ic, ambient.1);
        let t_ic = intercooler.outlet_temperature;
        let surge_valve = self.surge_valve.flow(inputs.surge_valve, (p_ic, t_ic), between);
        let throttle = self.throttle.flow_at(inputs.throttle, (p_ic, t_ic), (p_im, t_ic), throttle_ratio);

        // Cylinders and exhaust (fig. 2, lower half).
        let cylinders = self.cylinders.flows(inputs.engine_speed, (p_im, t_ic), residual);
        let exhaust_manifold =
            self.exhaust_manifold.evaluate((cylinders.exhaust, cylinders.exhaust_temperature), ambient.1);
        let t_em = exhaust_manifold.temperature;
        let hpt = self.hp_turbine.expand((p_em, t_em), hpt_ratio, hpt_drop, w_hp);
        // The flap's area grows with the square of the opening. A linear law would make boost far more sensitive to the
        // first opening than to the rest, and the control loop relies on a gain that varies less.
        let flap = hp_wastegate_opening * hp_wastegate_opening;
        let hp_wastegate = self.hp_wastegate.flow_at(flap, (p_em, t_em), (p_it, t_em), hpt_ratio);
        let t_it = mixed_temperature(
            (hpt.mass_flow, hpt.outlet_temperature),
            (hp_wastegate.mass_flow, t_em),
            EXHAUST_MIXING_WIDTH.into(),
        );
        let lpt = self.lp_turbine.expand((p_it, t_it), lpt_ratio, lpt_drop, w_lp);
        let lp_wastegate =
            self.lp_wastegate.flow_at(inputs.lp_wastegate, (p_it, t_it), (p_t, t_it), lpt_ratio);
        let t_t = mixed_temperature(
            (lpt.mass_flow, lpt.outlet_temperature),
            (lp_wastegate.mass_flow, t_it),
            EXHAUST_MIXING_WIDTH.into(),
        );
        let exhaust = self.exhaust.evaluate((p_t, t_t), ambient);

        // Balances of volumes and shafts.
        let derivatives = GasPathStates {
            air_filter: AirFilterStates {
                pressure: self
                    .air_filter
                    .volume
                    .pressure_rate(ambient.1, air_filter.mass_flow - lpc.mass_flow),
            },
            lp_compressor: CompressorStates {
                outlet_pressure: self.lp_compressor.outlet_volume.pressure_rate(
                    lpc.outlet_temperature,
                    lpc.mass_flow - hpc.mass_flow - bypass.mass_flow + surge_valve.mass_flow,
                ),
            },
            hp_compressor: CompressorStates {
                outlet_pressure: self
                    .hp_compressor
                    .outlet_volume
                    .pressure_rate(t_2m, hpc.mass_flow + bypass.mass_flow - intercooler.mass_flow),
            },
            intercooler: IntercoolerStates {
                outlet_pressure: self
                    .intercooler
                    .volume
                    .pressure_rate(t_ic, intercooler.mass_flow - throttle.mass_flow - surge_valve.mass_flow),
            },
            intake_manifold: IntakeManifoldStates {
                pressure: self.intake_manifold_volume.pressure_rate(t_ic, throttle.mass_flow - cylinders.air),
            },
            exhaust_manifold: ExhaustManifoldStates {
                pressure: self
                    .exhaust_manifold
                    .volume
                    .pressure_rate(t_em, cylinders.exhaust - hpt.mass_flow - hp_wastegate.mass_flow),
            },
            interstage_exhaust: InterstageExhaustStates {
                pressure: self.interstage_volume.pressure_rate(
                    t_it,
                    hpt.mass_flow + hp_wastegate.mass_flow - lpt.mass_flow - lp_wastegate.mass_flow,
                ),
            },
            exhaust: ExhaustStates {
                pressure: self
                    .exhaust
                    .volume
                    .pressure_rate(t_t, lpt.mass_flow + lp_wastegate.mass_flow - exhaust.mass_flow),
            },
            hp_shaft: ShaftStates { speed: self.hp_shaft.acceleration(w_hp, hpt.power, hpc.power) },
            lp_shaft: ShaftStates { speed: self.lp_shaft.acceleration(w_lp, lpt.power, lpc.power) },
        };
        GasPath {
            derivatives,
            air_filter,
            lp_compressor: lpc,
            hp_compressor: hpc,
            hp_bypass_port: bypass,
            intercooler,
            surge_valve_port: surge_valve,
            throttle_body: ThrottleBodyLocals { mass_flow: throttle.mass_flow },
            cylinders,
            exhaust_manifold,
            hp_turbine: hpt,
            hp_wastegate_port: HpWastegatePortLocals {
                effective_area: hp_wastegate.effective_area,
                mass_flow: hp_wastegate.mass_flow,
            },
            interstage_exhaust: InterstageExhaustLocals { temperature: t_it },
            lp_turbine: lpt,
            lp_wastegate_port: lp_wastegate,
            exhaust,
        }
    }

    /// The outputs and local variables for inputs, states and the instant.
    #[must_use]
    pub fn quantities(
        &self,
        inputs: &Inputs<D>,
        states: &States<D>,
        instant: &Instant<D>,
    ) -> (Outputs<D>, Locals<D>) {
        let Instant { actuation, gas_path } = instant;
        let (cylinders, engine_torque) = self.cylinders.work(
            inputs.engine_speed,
            gas_path.cylinders,
            states.intake_manifold.pressure,
            states.exhaust_manifold.pressure,
        );
        let rpm = 30.0 / PI;
        let fault = &self.fault;
        let boost_pressure = if fault.boost_sensor_stuck {
            fault.boost_sensor_stuck_pressure
        } else {
            (states.intercooler.outlet_pressure + fault.boost_sensor_offset).max(0.0)
        };
        let outputs = Outputs {
            boost_pressure,
            tank_pressure: if fault.tank_sensor_dead { 0.0.into() } else { states.tank.pressure },
            actuator_pressure: states.actuator.chamber_pressure,
            intake_manifold_pressure: states.intake_manifold.pressure,
            exhaust_manifold_pressure: states.exhaust_manifold.pressure,
            interstage_exhaust_pressure: states.interstage_exhaust.pressure,
            hp_wastegate_position: actuation.hp_wastegate_opening,
            supply_voltage_measured: (states.supply_sensor.voltage + fault.supply_sensor_offset).max(0.0),
            engine_torque,
            air_mass_flow: cylinders.air_mass_flow,
            hp_turbo_speed: states.hp_shaft.speed * rpm,
            lp_turbo_speed: states.lp_shaft.speed * rpm,
            exhaust_temperature: gas_path.exhaust_manifold.temperature,
            charge_temperature: gas_path.intercooler.outlet_temperature,
        };
        let locals = Locals {
            valve: actuation.valve,
            pump: actuation.pump,
            actuator: actuation.actuator,
            hp_wastegate_port: gas_path.hp_wastegate_port,
            air_filter: gas_path.air_filter,
            lp_compressor: gas_path.lp_compressor,
            hp_compressor: gas_path.hp_compressor,
            hp_bypass_port: gas_path.hp_bypass_port,
            intercooler: gas_path.intercooler,
            surge_valve_port: gas_path.surge_valve_port,
            throttle_body: gas_path.throttle_body,
            cylinders,
            exhaust_manifold: gas_path.exhaust_manifold,
            hp_turbine: gas_path.hp_turbine,
            interstage_exhaust: gas_path.interstage_exhaust,
            lp_turbine: gas_path.lp_turbine,
            lp_wastegate_port: gas_path.lp_wastegate_port,
            exhaust: gas_path.exhaust,
        };
        (outputs, locals)
    }
}
