//! The controller's gain schedule: its grid of engine speeds and boost references, and the other parameters that an
//! identification needs.

use crate::interface::INTERFACE;
use anyhow::{Context, Result, bail};
use boost_fmu::controller::variables::AllocationParameters;
use boost_interface::Role;
use fmu_io::terminal::number;
use fmu_package::{FmuDescription, FmuVariable, Value};
use fmu_terms::like;
use serde::Serialize;

use super::procedure::Strategy;

/// The controller's parameter for the feedback's desired closed-loop time constant.
pub(super) fn lambda_parameter(strategy: Strategy) -> &'static str {
    match strategy {
        Strategy::SplitRange => "feedback_lambda",
        Strategy::BySpeed => "lambda",
    }
}

/// The controller's parameter for the minimum duty, which also limits its reference model.
pub(super) const LEAST_DUTY: &str = "pwm_min";

/// The controller's parameters for the actuator's lag and the share of the engine speed sensitivity (strategy
/// `split_range`).
pub(super) const ACTUATOR_LAG: &str = "actuator_lag";
pub(super) const RAMP_SHARE: &str = "speed_feedforward.share";

/// The controller's choice between strategies; a controller with one strategy needs none.
pub(super) const STRATEGY: &str = "strategy";

/// The controller's parameter for the maximum duty of the high-pressure wastegate.
const LARGEST_DUTY: &str = "pwm_max";
/// The controller's upper limit of the boost reference, at any engine speed.
const BOOST_LIMIT: &str = "boost_limit";

/// A map over the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScheduleTable {
    /// The duty that holds a boost pressure (%).
    Feedforward,
    /// The static gain of paper eq. (10) (Pa/%).
    Gain,
    /// The time constant of eq. (10) (s).
    TimeConstant,
    /// The time delay of eq. (10) (s).
    Delay,
    /// Deviation of boost pressure from rest while engine speed rises by 1 rpm/s (Pa s/rpm).
    SpeedSensitivity,
}

impl ScheduleTable {
    const ALL: [Self; 5] =
        [Self::Feedforward, Self::Gain, Self::TimeConstant, Self::Delay, Self::SpeedSensitivity];

    /// The maps of a strategy.
    pub fn all(strategy: Strategy) -> &'static [Self] {
        match strategy {
            Strategy::SplitRange => &Self::ALL,
            Strategy::BySpeed => &Self::ALL[..4],
        }
    }

    /// The unit of identified values.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Feedforward => "%",
            Self::Gain => "Pa/%",
            Self::TimeConstant | Self::Delay => "s",
            Self::SpeedSensitivity => "Pa.s/rpm",
        }
    }
}

/// The grid of a controller, with the related start values.
#[derive(Clone, Debug, Serialize)]
pub struct Schedule {
    pub controller: String,
    pub strategy: Strategy,
    /// The engine speeds of the columns (rpm), ascending.
    pub engine_speeds: Vec<f64>,
    /// The boost references of the rows (Pa), ascending.
    pub boost_references: Vec<f64>,
    /// The supply voltage of the maps (V).
    pub nominal_voltage: f64,
    /// The controller's sample time (s).
    pub sample_time: f64,
    /// The desired closed-loop time constant (s).
    pub lambda: f64,
    /// Where the closed-loop time constant is from.
    #[serde(skip)]
    pub source_of_lambda: &'static str,
    /// The desired time constant of the response to the reference (s); none for the strategy `by_speed`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_lambda: Option<f64>,
    /// The allocation of a virtual duty to the three valves; none for the strategy `by_speed`.
    #[serde(skip)]
    pub allocation: Option<Allocation>,
    /// The ranges of the maps, in the order of [`ScheduleTable::all`].
    #[serde(skip)]
    ranges: Vec<(f64, f64)>,
    /// The controller's description.
    #[serde(skip)]
    pub(super) description: FmuDescription,
}

/// The allocation of a controller, with the related limits.
#[derive(Clone, Debug)]
pub struct Allocation {
    pub parameters: AllocationParameters,
    /// The largest duty of the high-pressure wastegate (%).
    pub largest_duty: f64,
    /// The largest boost reference at any engine speed (Pa).
    pub boost_limit: f64,
}

impl Allocation {
    /// The parameters' names after `allocation.`, their units, and their places.
    #[rustfmt::skip]
    fn fields(of: &mut AllocationParameters) -> [(&'static str, &'static str, &mut f64); 11] {
        [
            ("low_pressure_start", "%", &mut of.low_pressure_start),
            ("low_pressure_span", "%", &mut of.low_pressure_span),
            ("low_pressure_shape", "1", &mut of.low_pressure_shape),
            ("low_pressure_shut_below", "rpm", &mut of.low_pressure_shut_below),
            ("low_pressure_free_above", "rpm", &mut of.low_pressure_free_above),
            ("bypass_start", "%", &mut of.bypass_start),
            ("bypass_end", "%", &mut of.bypass_end),
            ("bypass_shut_below", "rpm", &mut of.bypass_shut_below),
            ("bypass_free_above", "rpm", &mut of.bypass_free_above),
            ("bypass_opening_time", "s", &mut of.bypass_opening_time),
            ("bypass_closing_time", "s", &mut of.bypass_closing_time),
        ]
    }

    fn read(controller: &FmuDescription) -> Result<Self> {
        let mut parameters = AllocationParameters::default();
        for (name, unit, value) in Self::fields(&mut parameters) {
            *value = start(parameter(controller, &format!("allocation.{name}"), unit)?)?;
        }
        Ok(Self {
            parameters,
            largest_duty: start(parameter(controller, LARGEST_DUTY, "%")?)?,
            boost_limit: start(parameter(controller, BOOST_LIMIT, "Pa")?)?,
        })
    }

    /// Name, value and unit of each parameter.
    fn given(&self) -> impl Iterator<Item = (String, f64, &'static str)> {
        let mut parameters = self.parameters;
        let given = Self::fields(&mut parameters)
            .map(|(name, unit, value)| (format!("allocation.{name}"), *value, unit));
        given.into_iter()
    }
}

impl Schedule {
    /// What the experiments depend on.
    pub(super) fn identity(&self) -> [(&'static str, String); 6] {
        let Self {
            strategy,
            engine_speeds,
            boost_references,
            nominal_voltage,
            sample_time,
            allocation,
            // These make a schedule of what the experiments give.
            lambda: _,
            source_of_lambda: _,
            reference_lambda: _,
            ranges: _,
            controller: _,
            description: _,
        } = self;
        [
            ("the strategy", format!("{strategy:?}")),
            ("the engine speeds", format!("{engine_speeds:?}")),
            ("the boost references", format!("{boost_references:?}")),
            ("the nominal voltage", format!("{nominal_voltage:?}")),
            ("the sample time", format!("{sample_time:?}")),
            ("the allocation", format!("{allocation:?}")),
        ]
    }

    pub fn built_in(strategy: Strategy) -> Result<Self> {
        Self::read(INTERFACE.description(Role::Controller), strategy)
    }

    pub fn read(controller: &FmuDescription, strategy: Strategy) -> Result<Self> {
        let engine_speeds = axis(controller, &in_component(strategy, ENGINE_SPEED), "rpm")?;
        let boost_references = axis(controller, &in_component(strategy, BOOST_REFERENCE), "Pa")?;
        let mut ranges = vec![];
        for &map in ScheduleTable::all(strategy) {
            let mut range = (0.0, 0.0);
            for row in 0..boost_references.len() {
                for column in 0..engine_speeds.len() {
                    let name = map_parameter(strategy, map, row, column);
                    range = parameter(controller, &name, map.unit())?.range()?;
                }
            }
            ranges.push(range);
        }
        let start_of = |name, unit| start(parameter(controller, name, unit)?);
        let (allocation, reference_lambda) = match strategy {
            Strategy::SplitRange => {
                for column in 0..engine_speeds.len() {
                    parameter(controller, &boost_limit_parameter(column), "Pa")?;
                }
                parameter(controller, ACTUATOR_LAG, "s")?;
                parameter(controller, RAMP_SHARE, "1")?;
                (Some(Allocation::read(controller)?), Some(start_of("reference_lambda", "s")?))
            }
            Strategy::BySpeed => (None, None),
        };
        parameter(controller, LEAST_DUTY, "%")?;
        let schedule = Self {
            controller: controller.attribute("modelName").to_owned(),
            nominal_voltage: start_of("nominal_voltage", "V")?,
            sample_time: start_of("sample_time", "s")?,
            lambda: start_of(lambda_parameter(strategy), "s")?,
            source_of_lambda: "the controller's",
            reference_lambda,
            description: controller.clone(),
            strategy,
            allocation,
            engine_speeds,
            boost_references,
            ranges,
        };
        schedule.check()?;
        Ok(schedule)
    }

    /// Replaces the engine speeds, boost references and closed-loop time constant (s) that are given.
    pub fn with(
        mut self,
        engine_speeds: Option<Vec<f64>>,
        boost_references: Option<Vec<f64>>,
        lambda: Option<f64>,
    ) -> Result<Self> {
        if let Some(lambda) = lambda {
            (self.lambda, self.source_of_lambda) = (lambda, "as requested");
        }
        for (name, given, own) in [
            ("engine speeds", engine_speeds, &mut self.engine_speeds),
            ("boost references", boost_references, &mut self.boost_references),
        ] {
            if let Some(given) = given {
                if given.len() != own.len() {
                    bail!("{} {name} given, but the controller has {}", given.len(), own.len());
                }
                *own = given;
            }
        }
        self.check()?;
        Ok(self)
    }

    /// Takes the λ of the feedback (s) that was found by runs at rest.
    pub fn find_lambda(&mut self, lambda: f64) {
        (self.lambda, self.source_of_lambda) =
            (lambda, "the shortest with which the pump sustains noise at rest");
    }

    /// The controller's name for a value of a map.
    pub fn parameter(&self, map: ScheduleTable, row: usize, column: usize) -> String {
        map_parameter(self.strategy, map, row, column)
    }

    /// Whether the low-pressure wastegate takes part at the engine speed of a column.
    pub fn is_wide(&self, column: usize) -> bool {
        self.allocation
            .as_ref()
            .is_some_and(|of| self.engine_speeds[column] > of.parameters.low_pressure_shut_below)
    }

    /// The given parameters of the controller: the time constant, the grid, and the allocation.
    pub(super) fn given(&self) -> Vec<(String, f64, &'static str)> {
        let axes =
            [(ENGINE_SPEED, &self.engine_speeds, "rpm"), (BOOST_REFERENCE, &self.boost_references, "Pa")];
        let mut given = vec![(lambda_parameter(self.strategy).to_owned(), self.lambda, "s")];
        given.extend(self.allocation.iter().flat_map(Allocation::given));
        for (axis, values, unit) in axes {
            let axis = in_component(self.strategy, axis);
            given.extend(
                values.iter().zip(1..).map(|(&value, index)| (format!("{axis}[{index}]"), value, unit)),
            );
        }
        given
    }

    /// Whether a value is within a map's range.
    pub fn takes(&self, map: ScheduleTable, value: f64) -> bool {
        let (least, most) = self.ranges[map as usize];
        (least..=most).contains(&value)
    }

    fn check(&self) -> Result<()> {
        for (axis, values) in [(ENGINE_SPEED, &self.engine_speeds), (BOOST_REFERENCE, &self.boost_references)]
        {
            if !values.windows(2).all(|pair| pair[0] < pair[1]) {
                bail!("the values of {} must ascend: {values:?}", in_component(self.strategy, axis));
            }
        }
        if self.sample_time <= 0.0 {
            bail!("the controller's sample_time is {} s; it must be above 0", number(self.sample_time));
        }
        for (name, value, unit) in self.given() {
            let variable = parameter(&self.description, &name, unit)?;
            Value::Real(value, None).check_range(variable)?;
        }
        Ok(())
    }
}

/// The names of the axes: engine speeds of columns, boost references of rows.
const ENGINE_SPEED: &str = "engine_speed";
const BOOST_REFERENCE: &str = "boost_reference";

/// A name within the component of a strategy's schedule.
fn in_component(strategy: Strategy, name: &str) -> String {
    let component = match strategy {
        Strategy::SplitRange => "range_schedule",
        Strategy::BySpeed => "schedule",
    };
    format!("{component}.{name}")
}

/// The controller's name for a value of a map: rows and columns, from 0 here, count from 1 in the name.
fn map_parameter(strategy: Strategy, map: ScheduleTable, row: usize, column: usize) -> String {
    let map = match (map, strategy) {
        (ScheduleTable::Feedforward, Strategy::SplitRange) => "virtual_duty",
        (ScheduleTable::Feedforward, Strategy::BySpeed) => "feedforward",
        (ScheduleTable::Gain, _) => "gain",
        (ScheduleTable::TimeConstant, _) => "time_constant",
        (ScheduleTable::Delay, _) => "delay",
        (ScheduleTable::SpeedSensitivity, _) => "speed_sensitivity",
    };
    in_component(strategy, &format!("{map}[{},{}]", row + 1, column + 1))
}

/// The controller's name for the limit of the reference at the engine speed of a column, from 0.
pub(super) fn boost_limit_parameter(column: usize) -> String {
    in_component(Strategy::SplitRange, &format!("{BOOST_LIMIT}[{}]", column + 1))
}

/// The start values of `name[1]`, `name[2]` and so on.
fn axis(controller: &FmuDescription, name: &str, unit: &str) -> Result<Vec<f64>> {
    let element = |index: usize| format!("{name}[{index}]");
    let mut values = vec![];
    // Without any, the first is missing.
    while values.len() < 2 || controller.variable(&element(values.len() + 1)).is_some() {
        values.push(start(parameter(controller, &element(values.len() + 1), unit)?)?);
    }
    Ok(values)
}

fn parameter<'a>(controller: &'a FmuDescription, name: &str, unit: &str) -> Result<&'a FmuVariable> {
    let names = || controller.variables.iter().map(|variable| variable.name.as_str());
    let variable = controller.variable(name).with_context(|| {
        format!("the controller {} has no {name}{}", controller.attribute("modelName"), like(name, names()))
    })?;
    check_unit(variable, unit)?;
    Ok(variable)
}

/// Rejects a variable with an unexpected unit.
pub(super) fn check_unit(variable: &FmuVariable, unit: &str) -> Result<()> {
    if !variable.unit.is_empty() && variable.unit != unit {
        bail!("{} is in {}, expected {unit}", variable.name, variable.unit);
    }
    Ok(())
}

fn start(variable: &FmuVariable) -> Result<f64> {
    let value = variable.start.trim().parse().ok().filter(|value: &f64| value.is_finite());
    value.with_context(|| {
        format!("the start value of {} is '{}', which is not a number", variable.name, variable.start)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_controller_of_this_repository_has_a_grid() {
        for (strategy, columns) in [(Strategy::BySpeed, 7), (Strategy::SplitRange, 12)] {
            let schedule = Schedule::built_in(strategy).unwrap();
            assert_eq!((schedule.boost_references.len(), schedule.engine_speeds.len()), (16, columns));
            assert_eq!(schedule.controller, "BoostController");
        }
    }

    #[test]
    fn missing_parameters_of_a_controller_are_named() {
        let refusal_of = |strategy, name: &str, change: fn(&mut FmuVariable)| {
            let mut controller = INTERFACE.description(Role::Controller).clone();
            let mut variables = controller.variables.to_vec();
            change(variables.iter_mut().find(|variable| variable.name == name).unwrap());
            controller.variables = variables.into();
            Schedule::read(&controller, strategy).unwrap_err().to_string()
        };
        let refusal = |name: &str, change| refusal_of(Strategy::BySpeed, name, change);
        for name in [
            "range_schedule.speed_sensitivity[16,12]",
            "range_schedule.boost_limit[1]",
            "allocation.bypass_end",
        ] {
            let message = refusal_of(Strategy::SplitRange, name, |variable| variable.unit = "mV".to_owned());
            assert!(message.starts_with(&format!("{name} is in mV, expected ")), "{message}");
        }
        assert_eq!(
            refusal("schedule.gain[16,7]", |variable| variable.name = "schedule.gain[17,7]".to_owned()),
            "the controller BoostController has no schedule.gain[16,7]; did you mean schedule.gain[1,7]?"
        );
        let message = refusal("schedule.engine_speed[1]", |variable| variable.name = "speed".to_owned());
        assert!(message.contains("has no schedule.engine_speed[1]"), "{message}");
        let message = refusal("nominal_voltage", |variable| variable.unit = "mV".to_owned());
        assert_eq!(message, "nominal_voltage is in mV, expected V");
    }

    #[test]
    fn a_grid_keeps_its_size_and_ascends() {
        let refusal = |speeds: &[f64]| {
            let schedule =
                Schedule::built_in(Strategy::BySpeed).unwrap().with(Some(speeds.to_vec()), None, None);
            schedule.unwrap_err().to_string()
        };
        assert_eq!(refusal(&[1000.0, 2000.0]), "2 engine speeds given, but the controller has 7");
        assert!(refusal(&[1.0, 2.0, 3.0, 4.0, 6.0, 5.0, 7.0]).contains("must ascend"));
    }

    /// Checks before spending hours on values that the controller rejects.
    #[test]
    fn given_values_are_within_the_controllers_ranges() {
        let with = |speeds, references, lambda| {
            Schedule::built_in(Strategy::BySpeed).unwrap().with(speeds, references, lambda)
        };
        let refusal = |speeds, references, lambda| with(speeds, references, lambda).unwrap_err().to_string();
        for lambda in [1e308, 0.0, -1.0, f64::NAN, f64::INFINITY] {
            let expected = format!("the value {} of lambda cannot be used: ", number(lambda));
            let message = refusal(None, None, Some(lambda));
            assert!(message.starts_with(&expected), "{message}");
        }
        assert_eq!(
            refusal(None, None, Some(1e308)),
            "the value 1e308 of lambda cannot be used: 1e308 is not within 0.001..100 s"
        );
        let speeds = (1..=7).map(|index| 1500.0 * f64::from(index)).collect();
        assert!(refusal(Some(speeds), None, None).contains("9000 of schedule.engine_speed[6]"));
        let references = (1..=16).map(|index| 1e5 * f64::from(index)).collect();
        assert!(refusal(None, Some(references), None).contains("of schedule.boost_reference[11]"));
        assert!(with(None, None, Some(0.5)).is_ok());
    }
}
