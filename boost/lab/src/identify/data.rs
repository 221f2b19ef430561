//! Measured data from a CSV file, in SI units.

use std::path::Path;

use anyhow::{Context, Result, bail};
use fmu_io::reading;
use fmu_io::terminal::number as shown;
use fmu_record::headings;

/// A quantity that a column of the data can hold.
struct Quantity {
    name: &'static str,
    /// The description in messages.
    meaning: &'static str,
    /// The columns' default names.
    columns: &'static [&'static str],
    /// Units, each with its factor and offset; columns without a unit are in the first one.
    units: &'static [(&'static str, f64, f64)],
    /// The plausible range, in the first unit; values outside are probably in another unit.
    range: (f64, f64),
    is_required: bool,
}

/// An absolute pressure, from a good vacuum to ten times ambient pressure.
const PRESSURE: Quantity = Quantity {
    name: "",
    meaning: "",
    columns: &[],
    units: &[
        ("Pa", 1.0, 0.0),
        ("hPa", 1e2, 0.0),
        ("mbar", 1e2, 0.0),
        ("kPa", 1e3, 0.0),
        ("bar", 1e5, 0.0),
        ("MPa", 1e6, 0.0),
    ],
    range: (1e3, 1e6),
    is_required: true,
};

const QUANTITIES: [Quantity; 9] = [
    Quantity {
        name: "time",
        meaning: "the time",
        columns: &["time"],
        units: &[("s", 1.0, 0.0), ("ms", 1e-3, 0.0)],
        range: (f64::NEG_INFINITY, f64::INFINITY),
        is_required: true,
    },
    Quantity {
        name: "duty",
        meaning: "the duty of the valve's PWM",
        columns: &["hp_wastegate_pwm"],
        units: &[("%", 1.0, 0.0), ("1", 1e2, 0.0)],
        range: (-1.0, 101.0),
        is_required: true,
    },
    Quantity {
        name: "supply_voltage",
        meaning: "the supply voltage",
        columns: &["supply_voltage", "supply_voltage_measured"],
        units: &[("V", 1.0, 0.0), ("mV", 1e-3, 0.0)],
        range: (0.0, 50.0),
        is_required: true,
    },
    Quantity {
        name: "tank_pressure",
        meaning: "the absolute vacuum tank pressure",
        columns: &["tank_pressure"],
        ..PRESSURE
    },
    Quantity {
        name: "actuator_pressure",
        meaning: "the absolute actuator chamber pressure",
        columns: &["actuator_pressure"],
        ..PRESSURE
    },
    Quantity {
        name: "position",
        meaning: "the actuator rod position",
        columns: &["actuator.position", "hp_wastegate_position"],
        units: &[("m", 1.0, 0.0), ("mm", 1e-3, 0.0), ("1", 1.0, 0.0), ("%", 1e-2, 0.0)],
        range: (-0.5, 1.5),
        is_required: true,
    },
    Quantity {
        name: "pump",
        meaning: "whether the vacuum pump runs, 1 or 0",
        columns: &["vacuum_pump"],
        units: &[("1", 1.0, 0.0)],
        range: (0.0, 1.0),
        is_required: false,
    },
    Quantity {
        name: "ambient_pressure",
        meaning: "the ambient pressure",
        columns: &["ambient_pressure"],
        is_required: false,
        ..PRESSURE
    },
    Quantity {
        name: "ambient_temperature",
        meaning: "the ambient temperature",
        columns: &["ambient_temperature"],
        units: &[("K", 1.0, 0.0), ("degC", 1.0, 273.15), ("\u{b0}C", 1.0, 273.15)],
        range: (200.0, 350.0),
        is_required: false,
    },
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
    /// Units by quantity; they override those of the header.
    pub units: Vec<(String, String)>,
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
    /// Reads a CSV file, with units below its header or in it: `tank_pressure (kPa)`.
    pub fn read(path: &Path, naming: &Naming) -> Result<Self> {
        Self::parse(&reading::text(path)?, naming).with_context(|| path.display().to_string())
    }

    fn parse(text: &str, naming: &Naming) -> Result<Self> {
        for (quantity, _) in naming.columns.iter().chain(&naming.units) {
            if QUANTITIES.iter().all(|known| known.name != quantity) {
                bail!("unknown quantity {quantity}: there are {}", quantities());
            }
        }
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
        let header = headings(text)?;
        let found: Vec<_> =
            QUANTITIES.iter().map(|quantity| find(quantity, &header, naming)).collect::<Result<_>>()?;
        let mut values: Vec<Vec<f64>> = vec![vec![]; QUANTITIES.len()];
        let mut last_line = 1;
        for row in reader.records() {
            let row = row?;
            let line = row.position().map_or(0, csv::Position::line);
            last_line = line;
            for ((values, column), quantity) in values.iter_mut().zip(&found).zip(&QUANTITIES) {
                let Some(DataColumn { index, factor, offset, is_relative }) = column else { continue };
                let text = row.get(*index).unwrap_or_default();
                let number = text.parse().ok().filter(|number: &f64| number.is_finite());
                let number = number.with_context(|| {
                    format!("line {line}, {}: expected a number, found \"{text}\"", header[*index].0)
                })?;
                let value = factor * number + offset;
                let (least, most) = quantity.range;
                if !(least..=most).contains(&value) {
                    let unit = if *is_relative { "" } else { quantity.units[0].0 };
                    let [least, most, value] = [least, most, value].map(shown);
                    bail!(
                        "line {line}, {}: expected {least} to {most} {unit}, found {value} {unit}; give another unit in \
                         the header's brackets or with --unit {}=UNIT",
                        header[*index].0,
                        quantity.name
                    );
                }
                values.push(value);
            }
            if let [.., before, now] = values[0][..]
                && now <= before
            {
                bail!(
                    "line {line}, {}: expected a time after {} s, found {} s",
                    column_name(&found, &header),
                    shown(before),
                    shown(now)
                );
            }
        }
        if values[0].is_empty() {
            bail!("line 2: expected rows of numbers, found none");
        }
        let position_is_relative = found[5].as_ref().is_some_and(|column| column.is_relative);
        let has = |index: usize, values: Vec<f64>| found[index].is_some().then_some(values);
        let values: [Vec<f64>; QUANTITIES.len()] = values.try_into().unwrap_or_default();
        let [time, duty, voltage, tank, chamber, position, pump, pressure, temperature] = values;
        Ok(Self {
            time,
            duty,
            voltage,
            tank,
            chamber,
            position,
            position_is_relative,
            pump: has(6, pump),
            ambient_pressure: has(7, pressure),
            ambient_temperature: has(8, temperature),
            last_line,
        })
    }
}

/// The column of a quantity, and its conversion.
struct DataColumn {
    index: usize,
    factor: f64,
    offset: f64,
    is_relative: bool,
}

fn column_name<'a>(found: &[Option<DataColumn>], header: &'a [(String, String)]) -> &'a str {
    found[0].as_ref().map_or("", |column| &header[column.index].0)
}

fn find(quantity: &Quantity, header: &[(String, String)], naming: &Naming) -> Result<Option<DataColumn>> {
    let named = naming.columns.iter().find(|(name, _)| name == quantity.name);
    let candidates = named.map_or_else(|| quantity.columns.to_vec(), |(_, column)| vec![column.as_str()]);
    let position = |name: &&str| header.iter().position(|(heading, _)| heading == name);
    let Some(index) = candidates.iter().find_map(position) else {
        if !quantity.is_required && named.is_none() {
            return Ok(None);
        }
        let names: Vec<_> = header.iter().map(|(heading, _)| heading.as_str()).collect();
        bail!(
            "line 1: expected a column {} ({}), found {}; name another with --column {}=NAME",
            candidates.join(" or "),
            quantity.meaning,
            names.join(", "),
            quantity.name
        );
    };
    let (heading, of_header) = &header[index];
    let given = naming.units.iter().find(|(name, _)| name == quantity.name).map(|(_, unit)| unit);
    let unit = given.unwrap_or(of_header);
    let known = match unit.as_str() {
        "" if heading == "hp_wastegate_position" => Some(("1", 1.0, 0.0)),
        "" => Some(quantity.units[0]),
        unit => quantity.units.iter().find(|(name, ..)| *name == unit).copied(),
    };
    let Some((name, factor, offset)) = known else {
        let names: Vec<_> = quantity.units.iter().map(|(name, ..)| *name).collect();
        bail!("line 1, {heading}: expected one of the units {}, found {unit}", names.join(", "));
    };
    Ok(Some(DataColumn { index, factor, offset, is_relative: matches!(name, "1" | "%") }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "time (ms),hp_wastegate_pwm,U [mV],tank_pressure (kPa),actuator_pressure,x (mm)\n";

    fn naming() -> Naming {
        let columns = [("supply_voltage", "U"), ("position", "x")];
        Naming {
            columns: columns.map(|(quantity, name)| (quantity.to_owned(), name.to_owned())).to_vec(),
            units: vec![],
        }
    }

    fn error(text: &str, naming: &Naming) -> String {
        Data::parse(text, naming).map_or_else(|error| format!("{error:#}"), |_| "no error".to_owned())
    }

    #[test]
    fn units_become_those_of_si() -> Result<()> {
        let text = format!("{HEADER}0,40,12000,32.5,8e4,5\n12.5,41,12100,32,7e4,6\n");
        let data = Data::parse(&text, &naming())?;
        let close = |found: f64, expected: f64| (found - expected).abs() < 1e-12 * expected;
        assert!(close(data.time[1], 0.0125) && close(data.voltage[1], 12.1) && close(data.tank[0], 32.5e3));
        assert!(close(data.chamber[1], 7e4) && close(data.position[1], 6e-3) && close(data.duty[1], 41.0));
        assert!(data.pump.is_none() && !data.position_is_relative);
        Ok(())
    }

    #[test]
    fn a_position_may_be_a_fraction_of_the_stroke() -> Result<()> {
        let mut naming = naming();
        naming.units.push(("position".to_owned(), "%".to_owned()));
        let data = Data::parse(&format!("{HEADER}0,40,12000,32.5,8e4,50\n"), &naming)?;
        assert!(data.position_is_relative && (data.position[0] - 0.5).abs() < 1e-15);
        Ok(())
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
            (format!("{rows}0,40,12000,32.5,8e4,5\n"), "line 3, time: expected a time after 0 s, found 0 s"),
            (format!("{rows}12.5,40\n"), "line: 3"),
            (HEADER.to_owned(), "line 2: expected rows of numbers, found none"),
            (
                rows.replace("(kPa)", "(psi)"),
                "line 1, tank_pressure: expected one of the units Pa, hPa, mbar",
            ),
            (
                rows.replace("hp_wastegate_pwm", "pwm"),
                "line 1: expected a column hp_wastegate_pwm (the duty of the valve's PWM), found time, pwm, U,",
            ),
        ] {
            let error = error(&text, &naming());
            assert!(error.contains(message), "{error}");
        }
        let mut wrong = naming();
        wrong.columns.push(("speed".to_owned(), "x".to_owned()));
        assert!(
            error(&rows, &wrong).contains("unknown quantity speed: there are time, duty, supply_voltage")
        );
    }
}
