//! The faults of a study: those of the plant's parameters `fault`, by signals, and a supply voltage that drops.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::names::help;
use fmu_master::scenario::Signal;

/// When a fault begins (s).
pub const BEGIN: f64 = 10.0;
/// The vacuum tank's pressure at the start (Pa): the pump is switched on at 35 kPa, so that a fault of the vacuum shows.
pub const PUMP_NEAR: f64 = 34.9e3;
/// How long the supply voltage is low (s), and the voltage (V): below what the controller takes for plausible.
const LOW_SUPPLY: (f64, f64) = (3.0, 5.5);
/// The rate of a boost sensor's drift (Pa/s) and how long it lasts (s).
const DRIFT: (f64, f64) = (1e3, 90.0);

/// What fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// boost sensor stuck
    BoostSensorStuck,
    /// boost sensor reads 0
    BoostSensorDead,
    /// boost sensor drifts by −1 kPa/s
    BoostSensorDriftsDown,
    /// boost sensor drifts by 1 kPa/s
    BoostSensorDriftsUp,
    /// boost sensor 10 kPa low
    BoostSensor10KPaLow,
    /// boost sensor 10 kPa high
    BoostSensor10KPaHigh,
    /// boost sensor 250 kPa high
    BoostSensor250KPaHigh,
    /// supply at 5.5 V for 3 s
    SupplyLowFor3S,
    /// supply sensor 6 V low
    SupplySensor6VLow,
    /// supply sensor 8 V low
    SupplySensor8VLow,
    /// supply sensor 8 V high
    SupplySensor8VHigh,
    /// wastegate stuck shut
    WastegateStuckShut,
    /// wastegate stuck anywhere
    WastegateStuck,
    /// wastegate stuck open
    WastegateStuckOpen,
    /// vacuum leak of 0.02 mm²
    SmallVacuumLeak,
    /// vacuum leak of 0.04 mm²
    VacuumLeak,
    /// pump dead
    PumpDead,
    /// tank sensor reads 0
    TankSensorDead,
}

impl FaultKind {
    /// The fault's name for readers.
    pub fn name(self) -> String {
        help(&self)
    }
}

/// A fault that begins at [`BEGIN`].
#[derive(Clone, Debug)]
pub struct Fault {
    pub kind: FaultKind,
    /// The plant's parameters and their signals.
    pub signals: Vec<(&'static str, Signal)>,
}

impl Fault {
    /// A fault by a share from 0 to 1; the sensor of boost pressure sticks at the reference (Pa), the wastegate at a share
    /// of its opening.
    pub fn drawn(share: f64, reference: f64, position: f64) -> Self {
        let kinds = FaultKind::value_variants();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small and not negative
        let index = (share * kinds.len() as f64) as usize;
        let kind = kinds[index.min(kinds.len() - 1)];
        let switched = |name, value| (name, Signal::Steps(vec![(0.0, 0.0), (BEGIN, value)]));
        let drift = |sign: f64| {
            let (rate, duration) = DRIFT;
            let points = vec![(BEGIN, 0.0), (BEGIN + duration, sign * rate * duration)];
            vec![("fault.boost_sensor_offset", Signal::Lines(points))]
        };
        let offset = |value| vec![switched("fault.boost_sensor_offset", value)];
        let supply_offset = |value| vec![switched("fault.supply_sensor_offset", value)];
        let stuck = |value| {
            vec![
                ("fault.boost_sensor_stuck_pressure", Signal::Constant(value)),
                switched("fault.boost_sensor_stuck", 1.0),
            ]
        };
        let wastegate = |value| {
            vec![
                ("fault.wastegate_stuck_position", Signal::Constant(value)),
                switched("fault.wastegate_stuck", 1.0),
            ]
        };
        let signals = match kind {
            FaultKind::BoostSensorStuck => stuck(reference),
            FaultKind::BoostSensorDead => stuck(0.0),
            FaultKind::BoostSensorDriftsDown => drift(-1.0),
            FaultKind::BoostSensorDriftsUp => drift(1.0),
            FaultKind::BoostSensor10KPaLow => offset(-10e3),
            FaultKind::BoostSensor10KPaHigh => offset(10e3),
            FaultKind::BoostSensor250KPaHigh => offset(250e3),
            FaultKind::SupplyLowFor3S => vec![],
            FaultKind::SupplySensor6VLow => supply_offset(-6.0),
            FaultKind::SupplySensor8VLow => supply_offset(-8.0),
            FaultKind::SupplySensor8VHigh => supply_offset(8.0),
            FaultKind::WastegateStuckShut => wastegate(0.0),
            FaultKind::WastegateStuck => wastegate(position),
            FaultKind::WastegateStuckOpen => wastegate(1.0),
            FaultKind::SmallVacuumLeak => vec![switched("fault.vacuum_leak_area", 2e-8)],
            FaultKind::VacuumLeak => vec![switched("fault.vacuum_leak_area", 4e-8)],
            FaultKind::PumpDead => vec![switched("fault.pump_dead", 1.0)],
            FaultKind::TankSensorDead => vec![switched("fault.tank_sensor_dead", 1.0)],
        };
        Self { kind, signals }
    }

    /// The supply voltage of an engine with a voltage (V) and this fault.
    pub fn supply(&self, voltage: f64) -> Signal {
        let (duration, low) = LOW_SUPPLY;
        match self.kind {
            FaultKind::SupplyLowFor3S => {
                Signal::Steps(vec![(0.0, voltage), (BEGIN, low), (BEGIN + duration, voltage)])
            }
            _ => Signal::Constant(voltage),
        }
    }
}
