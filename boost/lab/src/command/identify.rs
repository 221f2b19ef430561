//! `identify`: plant parameters from measured data, to an .ssv file, report.html and report.json.

use std::path::PathBuf;

use super::{HTML, JSON};
use crate::identify::{Naming, ParameterEstimate, html, identify, json};
use anyhow::Result;
use clap::Args;
use fmu_io::terminal::{complain, print};
use fmu_record::numbers::estimate;
use fmu_run::name_and_value;

/// The files in the folder of results.
const SET: &str = "identified.ssv";

#[derive(Args)]
pub struct Arguments {
    /// Measured data, CSV or Parquet: the time, then other columns; a row's duty and supply hold until the next row
    #[arg(value_name = "DATA.csv")]
    data: PathBuf,
    /// The plant, whose values are taken as known or as starting points of the fits
    #[arg(long, value_name = "FILE.fmu")]
    plant: PathBuf,
    /// Plant parameters, such as the membrane area; may be given several times
    #[arg(long, value_name = "FILE.ssv")]
    parameters: Vec<PathBuf>,
    #[arg(long, value_name = "QUANTITY=NAME", value_parser = name_and_value::<String>("QUANTITY=NAME"), help = columns_help())]
    column: Vec<(String, String)>,
    /// Unit of a quantity, if the header does not give it in brackets
    #[arg(long, value_name = "QUANTITY=UNIT", value_parser = name_and_value::<String>("QUANTITY=UNIT"))]
    unit: Vec<(String, String)>,
    /// Share of the data kept for validation
    #[arg(long, value_name = "SHARE", default_value_t = 0.3, value_parser = super::number_in(0.0..=0.9, "a number from 0 to 0.9"))]
    validation_share: f64,
    /// The folder for identified.ssv, report.html and report.json
    #[arg(long, value_name = "DIR", default_value = "target/identification")]
    out: PathBuf,
}

fn columns_help() -> String {
    format!("Column of a quantity, if not its name: {}", crate::identify::quantities())
}

pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments { data, plant, parameters, column, unit, validation_share, out } = arguments;
    let outputs = [SET, HTML, JSON].map(|name| out.join(name));
    super::refuse_overlap(&out, &outputs, &[&[data.clone(), plant.clone()], &parameters[..]].concat())?;
    let plant = fmu_run::open(&plant)?;
    let sets = super::parameter_sets(&parameters)?;
    let naming = Naming { columns: column, units: unit };
    let identification = identify(&data, &naming, &plant, &sets, validation_share)?;
    super::make_folder(&out)?;
    for note in &identification.notes {
        complain(&format!("note: {note}"));
    }
    for parameter in identification.parameters() {
        let ParameterEstimate { name, value, standard_error, unit, .. } = parameter;
        print(&format!("{name:32} {} {unit}\n", estimate(*value, *standard_error)))?;
    }
    for parameter in &identification.unidentified {
        print(&format!("{:32} not identified: {}\n", parameter.name, parameter.reason))?;
    }
    let texts = [
        (SET, identification.parameter_set(&plant).to_xml()),
        (HTML, html(&identification)),
        (JSON, json(&identification)?),
    ];
    super::write(&out, texts)
}
