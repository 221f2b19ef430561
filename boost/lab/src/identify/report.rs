//! The reports of an identification: a self-contained report.html for readers, and report.json for programs.

use anyhow::Result;
use fmu_xml::page::unit;
use serde::Serialize;

use super::{Fit, Identification, ParameterEstimate, Residuals, Unidentified};
use fmu_plot::{Cell, Report, Table};
use fmu_record::numbers::{estimate, number, quantity};

const STYLE: &str = "
.wide { max-width: 58rem; margin: 1.8rem 0; } .wide table { margin: 0; }
";

#[derive(Serialize)]
struct IdentificationReport<'a> {
    #[serde(flatten)]
    identification: &'a Identification,
    parameters: Vec<&'a ParameterEstimate>,
}

pub fn json(identification: &Identification) -> Result<String> {
    let parameters = identification.parameters().collect();
    Ok(serde_json::to_string_pretty(&IdentificationReport { identification, parameters })? + "\n")
}

pub fn html(identification: &Identification) -> String {
    let Identification { file, rows, duration, noise, phases_at_rest, fits, unidentified, notes, .. } =
        identification;
    let mut report = Report::new("Identified wastegate actuator");
    report.paragraph(&format!(
        "From {file}: {rows} rows over {}, with {phases_at_rest} phases in which the actuator is at rest.{} Values are \
         given with standard errors: the larger of one for independent residuals and one that treats each phase as a \
         unit, since residuals of a phase may be correlated. No fit has seen the validation data.",
        quantity(*duration, "s"),
        noise.map_or_else(String::new, |noise| format!(
            " At rest the chamber pressure scatters by {}, the position by {}.",
            quantity(noise.chamber, "Pa"),
            quantity(noise.position, "m")
        )),
    ));
    for note in notes {
        report.paragraph(note);
    }
    if !unidentified.is_empty() {
        report.section("Parameters not determined by the data");
        let mut table = Table::new(["Parameter", "Why"]);
        for Unidentified { name, reason } in unidentified {
            table.row([name.into(), reason.into()]);
        }
        report.table(&table);
        report
            .paragraph("These are not in the parameter set; the plant and the fits keep the plant's values.");
    }
    for fit in fits {
        section(&mut report, fit);
    }
    report.page(STYLE)
}

fn section(report: &mut Report, fit: &Fit) {
    report.section(&fit.title);
    report.figure(&fit.drawing, &fit.method);
    let mut table =
        Table::new(["Parameter", "Value and standard error", "Unit", "Plant before"]).caption("Parameters");
    for parameter in &fit.parameters {
        table.row([
            (&parameter.name).into(),
            Cell::number(&estimate(parameter.value, parameter.standard_error)),
            Cell::html(&unit(if parameter.unit == "1" { "" } else { &parameter.unit })),
            Cell::number(&number(parameter.plant_value)),
        ]);
    }
    report.table(&table);
    let mut table =
        Table::new(["Quantity", "Tuning", "Validation", "Noise at rest"]).caption("RMS residuals");
    for Residuals { name, unit, tuning, validation, noise } in &fit.residuals {
        let shown = [tuning, validation, noise].map(|value| value.map(|value| quantity(value, unit)));
        let shown = shown.map(|text| Cell::number(&text.unwrap_or_default()));
        table.row([name.into()].into_iter().chain(shown));
    }
    report.table(&table);
}
