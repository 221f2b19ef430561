//! Measured data for the actuator, in SI units.

use std::path::Path;

use anyhow::{Context, Error, Result, anyhow, bail};
use fmu_io::terminal::number as shown;
use fmu_record::{DataColumn, as_number, as_truth};
use fmu_terms::{BaseUnit, UnitTable, spelled};

/// A quantity that a column of the data can hold.
#[derive(Clone, Copy)]
struct Quantity {
    name: &'static str,
    /// The description in messages.
    meaning: &'static str,
    /// The columns' default names.
    columns: &'static [&'static str],
    /// The unit of the values here, and of columns without a unit.
    unit: &'static str,
    /// The plausible range in this unit; values outside are probably in another unit.
    range: (f64, f64),
}

/// An absolute pressure, from a good vacuum to ten times ambient pressure.
const PRESSURE: Quantity = Quantity { name: "", meaning: "", columns: &[], unit: "Pa", range: (1e3, 1e6) };

/// The name of the time, for its unit; it is the first column.
const TIME: &str = "time";

const DUTY: Quantity = Quantity {
    name: "duty",
    meaning: "the duty of the valve's PWM",
    columns: &["hp_wastegate_pwm"],
    unit: "%",
    range: (-1.0, 101.0),
};
const SUPPLY_VOLTAGE: Quantity = Quantity {
    name: "supply_voltage",
    meaning: "the supply voltage",
    columns: &["supply_voltage", "supply_voltage_measured"],
    unit: "V",
    range: (0.0, 50.0),
};
const TANK_PRESSURE: Quantity = Quantity {
    name: "tank_pressure",
    meaning: "the absolute vacuum tank pressure",
    columns: &["tank_pressure"],
    ..PRESSURE
};
const ACTUATOR_PRESSURE: Quantity = Quantity {
    name: "actuator_pressure",
    meaning: "the absolute actuator chamber pressure",
    columns: &["actuator_pressure"],
    ..PRESSURE
};
const POSITION: Quantity = Quantity {
    name: "position",
    meaning: "the actuator rod position",
    columns: &["actuator.position", "hp_wastegate_position"],
    unit: "m",
    range: (-0.5, 1.5),
};
const PUMP: Quantity = Quantity {
    name: "pump",
    meaning: "whether the vacuum pump runs, 1 or 0",
    columns: &["vacuum_pump"],
    unit: "1",
    range: (0.0, 1.0),
};
const AMBIENT_PRESSURE: Quantity = Quantity {
    name: "ambient_pressure",
    meaning: "the ambient pressure",
    columns: &["ambient_pressure"],
    ..PRESSURE
};
const AMBIENT_TEMPERATURE: Quantity = Quantity {
    name: "ambient_temperature",
    meaning: "the ambient temperature",
    columns: &["ambient_temperature"],
    unit: "K",
    range: (200.0, 350.0),
};

const QUANTITIES: [&Quantity; 8] = [
    &DUTY,
    &SUPPLY_VOLTAGE,
    &TANK_PRESSURE,
    &ACTUATOR_PRESSURE,
    &POSITION,
    &PUMP,
    &AMBIENT_PRESSURE,
    &AMBIENT_TEMPERATURE,
];

/// The names of the quantities, for the command's help.
pub fn quantities() -> String {
    QUANTITIES.map(|quantity| quantity.name).join(", ")
}

/// Columns and units other than the defaults, by quantity.
#[derive(Clone, Debug, Default)]
pub struct Naming {
    /// Column names, by quantity.
    pub columns: Vec<(String, String)>,
    /// Units by quantity, the time among them; they override those of the header.
    pub units: Vec<(String, String)>,
}

impl Naming {
    fn unit(&self, quantity: &str) -> Option<&str> {
        self.units.iter().find(|(name, _)| name == quantity).map(|(_, unit)| unit.as_str())
    }
}

/// Measured data in SI units, the duty in percent.
#[derive(Clone, Debug, Default)]
pub struct Data {
    pub time: Vec<f64>,
    pub duty: Vec<f64>,
    pub voltage: Vec<f64>,
    pub tank: Vec<f64>,
    pub chamber: Vec<f64>,
    pub position: Vec<f64>,
    /// Whether the position is a fraction of the stroke.
    pub position_is_relative: bool,
    pub pump: Option<Vec<f64>>,
    pub ambient_pressure: Option<Vec<f64>>,
    pub ambient_temperature: Option<Vec<f64>>,
    /// The line of the last row.
    pub last_line: u64,
}

impl Data {
    /// Reads measured data; of two rows of one time, the second counts.
    pub fn read(path: &Path, naming: &Naming) -> Result<Self> {
        let named = naming.columns.iter().map(|(name, _)| name);
        let in_unit = naming.units.iter().map(|(name, _)| name).filter(|name| *name != TIME);
        for quantity in named.chain(in_unit) {
            if QUANTITIES.iter().all(|known| known.name != quantity) {
                bail!("unknown quantity {quantity}: there are {}", quantities());
            }
        }
        let source = Source { data: fmu_record::Data::read(path, naming.unit(TIME))?, naming };
        source.in_si_units().with_context(|| path.display().to_string())
    }
}

/// The columns of a file.
struct Source<'a> {
    data: fmu_record::Data,
    naming: &'a Naming,
}

impl Source<'_> {
    fn in_si_units(&self) -> Result<Data> {
        let position = self.required(&POSITION)?;
        let position_is_relative = base(self.unit(&POSITION, position))?.exponents == base("1")?.exponents;
        let position_in = Quantity { unit: if position_is_relative { "1" } else { "m" }, ..POSITION };
        let values = |quantity| self.values(quantity, self.required(quantity)?);
        let optional =
            |quantity| self.find(quantity)?.map(|column| self.values(quantity, column)).transpose();
        Ok(Data {
            time: self.kept(self.data.time()),
            duty: values(&DUTY)?,
            voltage: values(&SUPPLY_VOLTAGE)?,
            tank: values(&TANK_PRESSURE)?,
            chamber: values(&ACTUATOR_PRESSURE)?,
            position: self.values(&position_in, position)?,
            position_is_relative,
            pump: optional(&PUMP)?,
            ambient_pressure: optional(&AMBIENT_PRESSURE)?,
            ambient_temperature: optional(&AMBIENT_TEMPERATURE)?,
            last_line: self.data.line(self.data.time().len() - 1),
        })
    }

    /// The values of the rows that are not followed by another of their time.
    fn kept(&self, values: &[f64]) -> Vec<f64> {
        let time = self.data.time();
        let is_last = |row: &usize| time.get(row + 1).is_none_or(|next| *next > time[*row]);
        (0..time.len()).filter(is_last).map(|row| values[row]).collect()
    }

    /// The column of a quantity, if the data have it.
    fn find(&self, quantity: &Quantity) -> Result<Option<&DataColumn>> {
        let column = |name: &str| self.data.columns().iter().find(|column| column.name() == name);
        match self.naming.columns.iter().find(|(name, _)| name == quantity.name) {
            Some((_, given)) => column(given).map(Some).ok_or_else(|| self.missing(quantity, given)),
            None => Ok(quantity.columns.iter().find_map(|name| column(name))),
        }
    }

    fn required(&self, quantity: &Quantity) -> Result<&DataColumn> {
        self.find(quantity)?.ok_or_else(|| self.missing(quantity, &quantity.columns.join(" or ")))
    }

    fn missing(&self, quantity: &Quantity, wanted: &str) -> Error {
        let names: Vec<_> = self.data.columns().iter().map(DataColumn::name).collect();
        anyhow!(
            "line 1: expected a column {wanted} ({}), found {}; name another with --column {}=NAME",
            quantity.meaning,
            names.join(", "),
            quantity.name
        )
    }

    /// The unit of a quantity's column.
    fn unit<'a>(&'a self, quantity: &Quantity, column: &'a DataColumn) -> &'a str {
        match self.naming.unit(quantity.name).unwrap_or(column.unit()) {
            "" if column.name() == "hp_wastegate_position" => "1",
            "" => quantity.unit,
            unit => unit,
        }
    }

    /// The values of a column in the quantity's unit.
    fn values(&self, quantity: &Quantity, column: &DataColumn) -> Result<Vec<f64>> {
        let &Quantity { name, unit, range: (least, most), .. } = quantity;
        let own = self.unit(quantity, column);
        let conversion = base(own)
            .and_then(|own_base| {
                let conversion = own_base.to(&base(unit)?);
                conversion.with_context(|| format!("the unit {own} does not convert to {unit}"))
            })
            .with_context(|| format!("line 1, {}", column.name()))?;
        let numbers = match name {
            "pump" => self.data.values(column, as_truth, "0, 1, true or false"),
            _ => self.data.values(column, as_number, "a number"),
        };
        let mut values = numbers?;
        for (row, value) in values.iter_mut().enumerate() {
            *value = conversion.apply(*value);
            if !(least..=most).contains(value) {
                let [least, most, value] = [least, most, *value].map(shown);
                bail!(
                    "{}, {}: expected {least} to {most} {unit}, found {value} {unit}; give another unit in the \
                     header's brackets or with --unit {name}=UNIT",
                    self.data.place(row),
                    column.name(),
                );
            }
        }
        Ok(self.kept(&values))
    }
}

/// A unit in SI base units.
fn base(unit: &str) -> Result<BaseUnit> {
    let base = UnitTable::default().base(&spelled(unit)).map_err(Error::msg)?;
    base.with_context(|| format!("the unit {unit} has fractional powers"))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const HEADER: &str = "time (ms),hp_wastegate_pwm,U [mV],tank_pressure (kPa),actuator_pressure,x (mm)\n";

    fn naming() -> Naming {
        let columns = [("supply_voltage", "U"), ("position", "x")];
        Naming {
            columns: columns.map(|(quantity, name)| (quantity.to_owned(), name.to_owned())).to_vec(),
            units: vec![],
        }
    }

    fn read(text: &str, naming: &Naming) -> Result<Data, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data.csv");
        fs::write(&path, text).unwrap();
        Data::read(&path, naming).map_err(|error| format!("{error:#}"))
    }

    #[test]
    fn units_become_those_of_si() {
        let text = format!("{HEADER}0,40,12000,32.5,8e4,5\n12.5,41,12100,32,7e4,6\n");
        let data = read(&text, &naming()).unwrap();
        let close = |found: f64, expected: f64| (found - expected).abs() < 1e-12 * expected;
        assert!(close(data.time[1], 0.0125) && close(data.voltage[1], 12.1) && close(data.tank[0], 32.5e3));
        assert!(close(data.chamber[1], 7e4) && close(data.position[1], 6e-3) && close(data.duty[1], 41.0));
        assert!(data.pump.is_none() && !data.position_is_relative);
    }

    #[test]
    fn a_position_may_be_a_fraction_of_the_stroke() {
        let mut naming = naming();
        naming.units.push(("position".to_owned(), "%".to_owned()));
        let data = read(&format!("{HEADER}0,40,12000,32.5,8e4,50\n"), &naming).unwrap();
        assert!(data.position_is_relative && (data.position[0] - 0.5).abs() < 1e-15);
    }

    #[test]
    fn of_two_rows_of_one_time_the_second_counts() {
        let text = format!("{HEADER}0,40,12000,32.5,8e4,5\n1,40,12000,33,8e4,5\n1,50,12000,34,8e4,5\n");
        let data = read(&text, &naming()).unwrap();
        assert_eq!(
            (data.time, data.duty, data.tank),
            (vec![0.0, 1e-3], vec![40.0, 50.0], vec![32.5e3, 34e3])
        );
    }

    #[test]
    fn a_pump_is_a_boolean() {
        let text = format!("{}0,40,12000,32.5,8e4,5,TRUE\n", HEADER.replace('\n', ",vacuum_pump\n"));
        assert_eq!(read(&text, &naming()).unwrap().pump, Some(vec![1.0]));
        let refusal = read(&text.replace("TRUE", "2"), &naming()).unwrap_err();
        assert!(refusal.ends_with("line 2, vacuum_pump: expected 0, 1, true or false, found 2"), "{refusal}");
    }

    #[test]
    fn errors_are_named() {
        let rows = format!("{HEADER}0,40,12000,32.5,8e4,5\n");
        for (text, message) in [
            (
                format!("{rows}12.5,,12000,32.5,8e4,5\n"),
                "line 3, hp_wastegate_pwm: expected a number, found \"\"",
            ),
            (
                format!("{rows}12.5,40,12000,off,8e4,5\n"),
                "line 3, tank_pressure: expected a number, found \"off\"",
            ),
            (format!("{rows}12.5,40\n"), "line: 3"),
            (HEADER.to_owned(), "it has no rows"),
            (rows.replace("(kPa)", "(inHg)"), "line 1, tank_pressure: the unit 'inHg' is not known"),
            (rows.replace("(kPa)", "(V)"), "line 1, tank_pressure: the unit V does not convert to Pa"),
            (
                rows.replace("32.5", "325000"),
                "line 2, tank_pressure: expected 1000 to 1000000 Pa, found 325000000 Pa; give another unit",
            ),
            (
                rows.replace("hp_wastegate_pwm", "pwm"),
                "line 1: expected a column hp_wastegate_pwm (the duty of the valve's PWM), found pwm, U,",
            ),
        ] {
            let error = read(&text, &naming()).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
        let mut wrong = naming();
        wrong.columns.push(("speed".to_owned(), "x".to_owned()));
        let error = read(&rows, &wrong).unwrap_err();
        assert!(error.contains("unknown quantity speed: there are duty, supply_voltage"), "{error}");
    }
}
