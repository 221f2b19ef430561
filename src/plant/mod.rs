//! The plant: a two-stage turbocharged petrol engine with a vacuum-actuated wastegate.
//!
//! A PWM signal drives a solenoid valve, which mixes ambient air and the vacuum of a tank into the chamber of
//! the [actuator]; its rod opens the high-pressure turbine's wastegate. A mean value engine model gives the
//! effect on boost: flow resistances, valves, compressors, turbines, shafts, intercooler and cylinders, connected
//! by volumes with pressures as states. [`system`] is the assembly, in the order of the paper's fig. 2.
//!
//! Each component has its own file with its equations, their sources and units, independent of importers and time
//! steps. Pressures are in Pa, temperatures in K, mass flows in kg/s. A side of a flow is a pair of pressure and
//! temperature.
//!
//! The paper describes the actuation system and refers to the literature for the engine; the turbocharger maps
//! and volumes are not published. They are chosen here to reproduce the paper's figures; the description of each
//! parameter in `modelDescription/plant.json` states its source.
//!
//! [`Plant`] is the model: its equations, start (`initialization`) and `error_control`.

pub mod actuator;
mod air_filter;
mod compressor;
mod cylinders;
mod duty_latch;
mod error_control;
mod exhaust;
mod exhaust_manifold;
mod flow_resistance;
mod gas;
mod initialization;
mod intercooler;
mod orifice;
mod port;
mod shaft;
mod solenoid_valve;
mod supply;
pub mod system;
mod turbine;
mod vacuum_tank;

/// The plant's variables, generated from `modelDescription/plant.json`.
pub mod variables {
    fmu_export::include_variables!("BoostPlant");
}

use std::borrow::ToOwned as _;
use std::format;
use std::vec::Vec;

use fmu_export::display::Rounded;
use fmu_export::integrator::ROS34PW2;
use fmu_export::{
    Context, Equations, Error, Event, Integrated, Integration, Multirate, Number, Part, Persistent, TwoRates,
};

use self::duty_latch::DutyLatch;
use self::initialization::{Settled, follow_settled, running, settled};
use self::system::System;
use self::variables::{
    ActuationStates, Evaluation, GasPathStates, InitializationMode, Inputs, Parameters, StateGroups, States,
    Variables,
};
use crate::LONGEST_STEP;

/// The largest ratio of Dahl's stiffness to the Coulomb force in 1/m: beyond it the friction force changes too fast for
/// the 1/2400 s steps of the reference implementation.
pub const STIFFEST_FRICTION: f64 = 2000.0;
/// Relative tolerance of that limit, for rounding.
const ROUNDING: f64 = 1e-9;

/// The smallest tolerance, and the minimum of `solver.relative_tolerance`: below it, rounding dominates the error
/// estimate.
const SMALLEST_TOLERANCE: f64 = 1e-8;

/// The plant as an FMU's model.
///
/// The actuation is cheap, oscillates and has kinks (stops, friction reversal, the valve changing ports); the gas path
/// is several times as expensive, stiff, smooth and does not oscillate. Unless the exhaust pushes the wastegate, the
/// actuation drives the gas path but not vice versa, so each takes its own steps. `docs/integration.md` compares the
/// methods tried.
pub type BoostPlant = Integrated<Plant, TwoRates<{ ActuationStates::COUNT }, { GasPathStates::COUNT }>>;

/// The plant's equations.
///
/// PWM periods are time events. Kinks of the equations, such as the rod's stops and reversals, are not events: solvers do
/// not need them (`docs/integration.md`).
#[derive(Clone, Debug, Persistent)]
pub struct Plant {
    /// Values derived from the parameters, for the integration.
    #[persistent(skip)]
    system: System,
    latch: DutyLatch,
    /// The states of a settled start, for their derivatives.
    found: States,
    /// Whether the states `found` are a steady state.
    is_settled: bool,
}

impl Default for Plant {
    fn default() -> Self {
        Self {
            system: System::new(&Parameters::default()),
            latch: DutyLatch::default(),
            found: States::default(),
            is_settled: true,
        }
    }
}

impl Equations for Plant {
    type Variables = Variables;
    const LONGEST_STEP: f64 = LONGEST_STEP;
    const INTEGRATION: Integration<Variables> = Integration {
        // Of all states, where the parts are coupled.
        method: &ROS34PW2,
        longest_step: 0.025,
        error_scales: Some(&error_control::ERROR_SCALES),
        tolerance,
        // The duty.
        samples_inputs: true,
    };

    fn check_parameters(variables: &Variables) -> Result<(), Error> {
        let p = &variables.parameters;
        let actuator = &p.actuator;
        if actuator.friction_stiffness > STIFFEST_FRICTION * (1.0 + ROUNDING) * actuator.coulomb_friction {
            return Err(Error::new(format_args!(
                "actuator.friction_stiffness = {:?} N/m is more than 2000 1/m times \
                 actuator.coulomb_friction = {:?} N",
                actuator.friction_stiffness, actuator.coulomb_friction
            )));
        }
        if actuator.chamber_volume <= actuator.membrane_area * actuator.stroke {
            return Err(Error::new(format_args!(
                "actuator.chamber_volume = {:?} m3 is not more than what actuator.membrane_area = {:?} m2 \
                 displaces over actuator.stroke = {:?} m",
                actuator.chamber_volume, actuator.membrane_area, actuator.stroke
            )));
        }
        for (name, gas) in [("air", &p.air), ("exhaust_gas", &p.exhaust_gas)] {
            if gas.gas_constant >= gas.specific_heat {
                return Err(Error::new(format_args!(
                    "{name}.gas_constant = {:?} J/(kg.K) is not less than {name}.specific_heat = {:?} \
                     J/(kg.K)",
                    gas.gas_constant, gas.specific_heat
                )));
            }
        }
        Ok(())
    }

    #[inline]
    fn prepare(&mut self, variables: &mut Variables, context: &mut Context<'_>) -> Result<(), Error> {
        let Variables { parameters, inputs, start, .. } = variables;
        self.latch = DutyLatch::new(context.experiment.start_time);
        if parameters.initialization.mode == InitializationMode::Settled {
            let settled = settled(parameters, inputs, start.tank.pressure);
            warn_of_unsettled_start(&settled, inputs, context);
            (self.found, self.is_settled) = (settled.states, settled.shortcoming.is_none());
        }
        warn_of_ignored_starts(variables, context);
        warn_of_negative_pressure(&System::new(&variables.parameters), context);
        Ok(())
    }

    fn take_parameters(&mut self, variables: &Variables) {
        self.system = System::new(&variables.parameters);
    }

    fn initialize<T: Number>(&self, variables: &mut Variables<T>) {
        let Variables { parameters, inputs, states, .. } = variables;
        let tank_pressure = states.tank.pressure;
        match parameters.initialization.mode {
            InitializationMode::Settled => {
                *states = if self.is_settled {
                    follow_settled(parameters, inputs, &self.found, tank_pressure)
                } else {
                    self.found.map(T::from)
                };
            }
            InitializationMode::Running => {
                *states = running(&System::new(parameters), inputs, tank_pressure);
            }
            InitializationMode::Given => {}
        }
    }

    fn check_start(&self) -> Result<(), Error> {
        if self.is_settled {
            return Ok(());
        }
        Err(Error::new("the experiment does not start settled, so its start has no derivative"))
    }

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        self.evaluate_with(&System::new(variables.parameters), variables);
    }

    fn evaluate_values(&self, _time: f64, variables: Evaluation<'_>) {
        self.evaluate_with(&self.system, variables);
    }

    fn next_event(&self, _time: f64, variables: &Variables) -> Option<f64> {
        let valve = &variables.parameters.valve;
        valve.duty_latch.then(|| self.latch.next(valve.pwm_frequency))
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        if event.is_due {
            self.latch.take(variables.inputs.hp_wastegate_pwm);
        }
        Ok(())
    }
}

/// The tolerance of the parameter, or that of the importer if it is smaller.
fn tolerance(variables: &Variables, asked: Option<f64>) -> f64 {
    let own = variables.parameters.solver.relative_tolerance;
    own.min(asked.unwrap_or(own)).max(SMALLEST_TOLERANCE)
}

impl Multirate for Plant {
    #[inline]
    fn evaluate_part(&self, part: Part, _time: f64, variables: Evaluation<'_>) {
        let Evaluation { parameters, inputs, states, derivatives, .. } = variables;
        let inputs = self.latch.hold(parameters, *inputs);
        *derivatives = States::from_groups(match part {
            Part::Fast => StateGroups {
                actuation: self.system.actuation(&inputs, &ActuationStates::of(states), 0.0).derivatives,
                gas_path: GasPathStates::of(derivatives),
            },
            Part::Slow => {
                let opening = self.system.actuator.opening(states.actuator.position);
                StateGroups {
                    actuation: ActuationStates::of(derivatives),
                    gas_path: self.system.gas_path(&inputs, &GasPathStates::of(states), opening).derivatives,
                }
            }
        });
    }

    /// Whether the exhaust pushes the wastegate.
    fn is_coupled(&self, variables: &Variables) -> bool {
        variables.parameters.actuator.exhaust_area != 0.0
    }
}

impl Plant {
    fn evaluate_with<T: Number>(&self, system: &System<T>, variables: Evaluation<'_, T>) {
        let Evaluation { parameters, inputs, states, derivatives, locals, outputs } = variables;
        let inputs = self.latch.hold(parameters, *inputs);
        let instant = system.evaluate(&inputs, states);
        *derivatives = instant.derivatives();
        (*outputs, *locals) = system.quantities(&inputs, states, &instant);
    }
}

/// Warns if the experiment does not start at rest.
fn warn_of_unsettled_start(settled: &Settled, inputs: &Inputs, context: &mut Context<'_>) {
    let Some(shortcoming) = &settled.shortcoming else { return };
    let reason = shortcoming.failure;
    let instead = if shortcoming.followed > 0.0 {
        format!("the state of a running engine after {} s", shortcoming.followed)
    } else {
        "a running engine, as its transient cannot be integrated".to_owned()
    };
    context.warn(format_args!(
        "initialization.mode = settled: {reason} with engine_speed = {} rpm, throttle = {} and the other \
         inputs; the experiment starts from {instead}",
        Rounded(inputs.engine_speed),
        Rounded(inputs.throttle)
    ));
}

/// Warns of start values ignored by the initialization mode.
fn warn_of_ignored_starts(variables: &Variables, context: &mut Context<'_>) {
    if variables.parameters.initialization.mode == InitializationMode::Given {
        return;
    }
    let (start, default) = (variables.start.to_array(), States::default().to_array());
    let ignored: Vec<_> = (0..States::COUNT)
        .filter(|&i| start[i].to_bits() != default[i].to_bits())
        .map(|i| States::NAMES[i])
        .filter(|&name| name != "tank.pressure")
        .collect();
    if !ignored.is_empty() {
        context.warn(format_args!(
            "the start values of {} are ignored: only initialization.mode = given uses them",
            ignored.join(", ")
        ));
    }
}

/// Warns if the valve's polynomial asks for less than a vacuum.
fn warn_of_negative_pressure(system: &System, context: &mut Context<'_>) {
    let (pressure, duty) = system.valve.lowest_pressure();
    if pressure < 0.0 {
        context.warn(format_args!(
            "valve.pressure is {} Pa at a plunger duty of {duty} %: with these valve.pressure_coefficient, the valve asks for \
             less than a vacuum",
            Rounded(pressure)
        ));
    }
}
