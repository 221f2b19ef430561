//! The controller's gain schedule: its grid of engine speeds and boost references, and its other parameters for an
//! identification.

use anyhow::{Context, Result, bail};
use boost_interface::Role;
use fmu_package::terminal::number;
use fmu_package::{FmuDescription, FmuVariable, Value, like};

/// The names of the axes: engine speeds of columns, boost references of rows.
pub(super) const ENGINE_SPEED: &str = "schedule.engine_speed";
pub(super) const BOOST_REFERENCE: &str = "schedule.boost_reference";
/// The controller's parameter for the desired time constant of the closed loop.
pub(super) const LAMBDA: &str = "lambda";
/// The controller's parameter for the least duty, below which its reference model does not go either.
pub(super) const LEAST_DUTY: &str = "pwm_min";

/// The controller's choice between strategies, and the one whose schedule this is; a controller with one strategy
/// needs none.
pub(super) const STRATEGY: (&str, &str) = ("strategy", "by_speed");

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
}

impl ScheduleTable {
    pub const ALL: [Self; 4] = [Self::Feedforward, Self::Gain, Self::TimeConstant, Self::Delay];

    /// The controller's name for a value of the map; rows and columns count from 0 here, from 1 there.
    pub fn parameter(self, row: usize, column: usize) -> String {
        let map = match self {
            Self::Feedforward => "feedforward",
            Self::Gain => "gain",
            Self::TimeConstant => "time_constant",
            Self::Delay => "delay",
        };
        format!("schedule.{map}[{},{}]", row + 1, column + 1)
    }

    /// The unit of identified values.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Feedforward => "%",
            Self::Gain => "Pa/%",
            Self::TimeConstant | Self::Delay => "s",
        }
    }
}

/// The grid of a controller, with the related start values.
#[derive(Clone, Debug)]
pub struct Schedule {
    pub controller: String,
    /// The engine speeds of the columns (rpm), ascending.
    pub engine_speeds: Vec<f64>,
    /// The boost references of the rows (Pa), ascending.
    pub boost_references: Vec<f64>,
    /// The supply voltage of the maps (V).
    pub nominal_voltage: f64,
    /// The controller's sample time (s).
    pub sample_time: f64,
    /// The desired time constant of the closed loop (s).
    pub lambda: f64,
    /// The ranges of the maps, in the order of [`ScheduleTable::ALL`].
    ranges: [(f64, f64); 4],
    /// The controller's description.
    pub(super) description: FmuDescription,
}

impl Schedule {
    pub fn built_in() -> Result<Self> {
        Self::read(Role::Controller.description())
    }

    pub fn read(controller: &FmuDescription) -> Result<Self> {
        let mut ranges = [(0.0, 0.0); 4];
        let engine_speeds = axis(controller, ENGINE_SPEED, "rpm")?;
        let boost_references = axis(controller, BOOST_REFERENCE, "Pa")?;
        for (map, range) in ScheduleTable::ALL.into_iter().zip(&mut ranges) {
            for row in 0..boost_references.len() {
                for column in 0..engine_speeds.len() {
                    *range = parameter(controller, &map.parameter(row, column), map.unit())?.range()?;
                }
            }
        }
        let start_of = |name, unit| start(parameter(controller, name, unit)?);
        parameter(controller, LEAST_DUTY, "%")?;
        let schedule = Self {
            controller: controller.attribute("modelName").to_owned(),
            nominal_voltage: start_of("nominal_voltage", "V")?,
            sample_time: start_of("sample_time", "s")?,
            lambda: start_of(LAMBDA, "s")?,
            description: controller.clone(),
            engine_speeds,
            boost_references,
            ranges,
        };
        schedule.check()?;
        Ok(schedule)
    }

    /// The same controller with other values on its grid, and another time constant of the closed loop (s).
    pub fn with(
        mut self,
        engine_speeds: Option<Vec<f64>>,
        boost_references: Option<Vec<f64>>,
        lambda: Option<f64>,
    ) -> Result<Self> {
        self.lambda = lambda.unwrap_or(self.lambda);
        for (name, given, own) in [
            ("engine speeds", engine_speeds, &mut self.engine_speeds),
            ("boost references", boost_references, &mut self.boost_references),
        ] {
            if let Some(given) = given {
                if given.len() != own.len() {
                    bail!("{} {name} are given; the controller has {}", given.len(), own.len());
                }
                *own = given;
            }
        }
        self.check()?;
        Ok(self)
    }

    /// The given parameters of the controller: the time constant and the grid.
    pub(super) fn given(&self) -> Vec<(String, f64, &'static str)> {
        let axes =
            [(ENGINE_SPEED, &self.engine_speeds, "rpm"), (BOOST_REFERENCE, &self.boost_references, "Pa")];
        let mut given = vec![(LAMBDA.to_owned(), self.lambda, "s")];
        for (axis, values, unit) in axes {
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
        for (name, values) in [(ENGINE_SPEED, &self.engine_speeds), (BOOST_REFERENCE, &self.boost_references)]
        {
            if !values.windows(2).all(|pair| pair[0] < pair[1]) {
                bail!("the values of {name} do not ascend: {values:?}");
            }
        }
        if self.sample_time <= 0.0 {
            bail!("the controller's sample_time is {} s", number(self.sample_time));
        }
        for (name, value, unit) in self.given() {
            let variable = parameter(&self.description, &name, unit)?;
            Value::Real(value, None).check_range(variable)?;
        }
        Ok(())
    }
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

/// Refuses a variable with another unit than expected.
pub(super) fn check_unit(variable: &FmuVariable, unit: &str) -> Result<()> {
    if !variable.unit.is_empty() && variable.unit != unit {
        bail!("{} is in {}, expected is {unit}", variable.name, variable.unit);
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
        let schedule = Schedule::built_in().unwrap();
        assert_eq!((schedule.boost_references.len(), schedule.engine_speeds.len()), (16, 7));
        assert_eq!(schedule.controller, "BoostController");
    }

    #[test]
    fn missing_parameters_of_a_controller_are_named() {
        let refusal = |name: &str, change: fn(&mut FmuVariable)| {
            let mut controller = Role::Controller.description().clone();
            change(controller.variables.iter_mut().find(|variable| variable.name == name).unwrap());
            Schedule::read(&controller).unwrap_err().to_string()
        };
        assert_eq!(
            refusal("schedule.gain[16,7]", |variable| variable.name = "schedule.gain[17,7]".to_owned()),
            "the controller BoostController has no schedule.gain[16,7]; the nearest is schedule.gain[6,7]"
        );
        let message = refusal("schedule.engine_speed[1]", |variable| variable.name = "speed".to_owned());
        assert!(message.contains("has no schedule.engine_speed[1]"), "{message}");
        let message = refusal("nominal_voltage", |variable| variable.unit = "mV".to_owned());
        assert_eq!(message, "nominal_voltage is in mV, expected is V");
    }

    #[test]
    fn a_grid_keeps_its_size_and_ascends() {
        let refusal = |speeds: &[f64]| {
            let schedule = Schedule::built_in().unwrap().with(Some(speeds.to_vec()), None, None);
            schedule.unwrap_err().to_string()
        };
        assert_eq!(refusal(&[1000.0, 2000.0]), "2 engine speeds are given; the controller has 7");
        assert!(refusal(&[1.0, 2.0, 3.0, 4.0, 6.0, 5.0, 7.0]).contains("do not ascend"));
    }

    /// Before hours are spent on values that the controller rejects.
    #[test]
    fn given_values_are_within_the_controllers_ranges() {
        let with =
            |speeds, references, lambda| Schedule::built_in().unwrap().with(speeds, references, lambda);
        let refusal = |speeds, references, lambda| with(speeds, references, lambda).unwrap_err().to_string();
        for lambda in [1e308, 0.0, -1.0, f64::NAN, f64::INFINITY] {
            let expected = format!("the value {} of lambda cannot be taken: ", number(lambda));
            let message = refusal(None, None, Some(lambda));
            assert!(message.starts_with(&expected), "{message}");
        }
        assert_eq!(
            refusal(None, None, Some(1e308)),
            "the value 1e308 of lambda cannot be taken: 1e308 is not within 0.001..100"
        );
        let speeds = (1..=7).map(|index| 1500.0 * f64::from(index)).collect();
        assert!(refusal(Some(speeds), None, None).contains("9000 of schedule.engine_speed[6]"));
        let references = (1..=16).map(|index| 1e5 * f64::from(index)).collect();
        assert!(refusal(None, Some(references), None).contains("of schedule.boost_reference[11]"));
        assert!(with(None, None, Some(0.5)).is_ok());
    }
}
