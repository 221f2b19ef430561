//! The reports of an identification: a self-contained report.html for readers, and report.json for programs.

use anyhow::Result;
use fmu_xml::page::unit;
use serde::Serialize;

use super::phases::MeasurementNoise;
use super::{Fit, Identification, Known, ParameterEstimate, Unidentified};
use fmu_plot::escaped;
use fmu_plot::page;
use fmu_record::numbers::{estimate, number, quantity};

const STYLE: &str = "
.wide { max-width: 58rem; margin: 1.8rem 0; } .wide table { margin: 0; min-width: 30rem; }
";

#[derive(Serialize)]
struct IdentificationReport<'a> {
    data: &'a str,
    rows: usize,
    duration: f64,
    phases_at_rest: usize,
    noise: Option<MeasurementNoise>,
    parameters: Vec<&'a ParameterEstimate>,
    unidentified: &'a [Unidentified],
    fits: &'a [Fit],
    known: &'a Known,
    notes: &'a [String],
}

pub fn json(identification: &Identification) -> Result<String> {
    let Identification { file, rows, duration, known, noise, phases_at_rest, fits, unidentified, notes } =
        identification;
    let report = IdentificationReport {
        data: file,
        rows: *rows,
        duration: *duration,
        phases_at_rest: *phases_at_rest,
        noise: *noise,
        parameters: identification.parameters().collect(),
        unidentified,
        fits,
        known,
        notes,
    };
    Ok(serde_json::to_string_pretty(&report)? + "\n")
}

pub fn html(identification: &Identification) -> String {
    let Identification { file, rows, duration, noise, phases_at_rest, fits, unidentified, notes, .. } =
        identification;
    let mut body = format!(
        "<h1>Identified wastegate actuator</h1>\n<p>From {}: {rows} rows over {}, with {phases_at_rest} phases in \
         which the actuator is at rest.{} Values are given with standard errors: the larger of one for independent \
         residuals and one that treats each phase as a unit, since residuals of a phase may be correlated. No fit has \
         seen the validation data.</p>\n",
        escaped(file),
        quantity(*duration, "s"),
        noise.map_or_else(String::new, |noise| format!(
            " At rest the chamber pressure scatters by {}, the position by {}.",
            quantity(noise.chamber, "Pa"),
            quantity(noise.position, "m")
        )),
    );
    for note in notes {
        body += &format!("<p>{}</p>\n", escaped(note));
    }
    if !unidentified.is_empty() {
        body += "<h2>Parameters not determined by the data</h2>\n<table>\n<thead><tr><th>Parameter</th><th>Why</th></tr></thead>\n";
        for Unidentified { name, reason } in unidentified {
            body += &format!("<tr><td>{}</td><td>{}</td></tr>\n", escaped(name), escaped(reason));
        }
        body += "</table>\n<p>These are not in the parameter set; the plant and the fits keep the plant's values.</p>\n";
    }
    for fit in fits {
        body += &section(fit);
    }
    page("Identified wastegate actuator", STYLE, &body)
}

fn section(fit: &Fit) -> String {
    let mut text = format!(
        "<h2>{}</h2>\n<figure>\n{}<figcaption>{}</figcaption>\n</figure>\n",
        escaped(&fit.title),
        fit.drawing.html(),
        escaped(&fit.method)
    );
    text += "<div class=\"wide\">\n<table>\n<caption>Parameters</caption>\n<thead><tr><th>Parameter</th><th>Value and standard error</th>\
             <th>Unit</th><th>Plant before</th></tr></thead>\n";
    for parameter in &fit.parameters {
        text += &format!(
            "<tr><td>{}</td><td class=\"number\">{}</td><td>{}</td><td class=\"number\">{}</td></tr>\n",
            escaped(&parameter.name),
            estimate(parameter.value, parameter.standard_error),
            unit(if parameter.unit == "1" { "" } else { &parameter.unit }),
            number(parameter.plant_value)
        );
    }
    text += "</table>\n</div>\n<div class=\"wide\">\n<table>\n<caption>RMS residuals</caption>\n<thead><tr>\
             <th>Quantity</th><th>Tuning</th><th>Validation</th><th>Noise at rest</th></tr></thead>\n";
    for residuals in &fit.residuals {
        let shown = |value: Option<f64>| {
            value.map_or_else(String::new, |value| escaped(&quantity(value, &residuals.unit)))
        };
        text += &format!(
            "<tr><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td></tr>\n",
            escaped(&residuals.name),
            shown(residuals.tuning),
            shown(residuals.validation),
            shown(residuals.noise)
        );
    }
    text + "</table>\n</div>\n"
}
