//! A page that runs plant and controller live in a browser, as embedded WebAssembly modules, with the paper's
//! experiments and the laboratory's results.
//!
//! The scripts: `fmu.js` calls a module, `master.js` couples two as [`fmu_master`] does, `figures.js` computes the
//! lines of the paper's figures from records, `plots.js` and `engine.js` display the run, `controls.js` makes the
//! controls of `controls.json` from the FMUs' declarations, `page.js` runs the simulation.

use std::path::Path;

use anyhow::{Context, Result, bail};
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use fmu_io::reading;
use fmu_package::{FmuDescription, MODEL_DESCRIPTION, ParameterSet, Value};
use serde_json::{Value as Json, json};
use wasmparser::{Parser, Payload};

use crate::reproduce::{CLAIMS_STYLE, PaperFigure, Reproduced, Run, claims_table, count, shipped};
use fmu_master::scenario::{Assignment, Course, Input, Member, Scenario, Signal};
use fmu_plot::{Figure, Report, escaped};

/// The closed loop with which the page starts; the user changes its constant inputs.
pub const LOOP: (&str, &str) = shipped!("live.toml");

const STYLE: &str = include_str!("style.css");
const BODY: &str = include_str!("body.html");
const ENGINE: &str = include_str!("engine.svg");
const CONTROLS: &str = include_str!("controls.json");
const SCRIPTS: [&str; 7] = [
    include_str!("fmu.js"),
    include_str!("master.js"),
    include_str!("figures.js"),
    include_str!("plots.js"),
    include_str!("engine.js"),
    include_str!("controls.js"),
    include_str!("page.js"),
];

/// An FMU as a WebAssembly module.
pub struct Module {
    bytes: Vec<u8>,
    pub description: FmuDescription,
}

impl Module {
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = reading::bytes(path).context("`boost-fmu export --wasm` writes the modules")?;
        let description = Self::description(&bytes);
        let description = description
            .with_context(|| format!("{} is not a module of `boost-fmu export --wasm`", path.display()))?;
        Ok(Self { bytes, description })
    }

    fn description(bytes: &[u8]) -> Result<FmuDescription> {
        for payload in Parser::new(0).parse_all(bytes) {
            if let Payload::CustomSection(section) = payload?
                && section.name() == MODEL_DESCRIPTION
            {
                let description = FmuDescription::parse(std::str::from_utf8(section.data())?)?;
                if !description.attribute("fmiVersion").starts_with("2.") {
                    bail!("it has FMI {}; the page calls FMI 2.0", description.attribute("fmiVersion"));
                }
                return Ok(description);
            }
        }
        bail!("it has no section {MODEL_DESCRIPTION}")
    }
}

/// The page: plant and controller, the plants to choose from in addition to the default, [`LOOP`] with its plot, and the
/// paper's experiments as run by the laboratory.
pub fn html(
    [plant, controller]: [&Module; 2],
    plants: &[ParameterSet],
    (closed_loop, plot): &(Run, Figure),
    experiments: &[Reproduced],
) -> Result<String> {
    let template = |class: &str, html: &str| format!("<template class=\"{class}\">\n{html}</template>\n");
    let mut templates = template("plots", &plot.html());
    let mut buttons = String::new();
    for experiment in experiments {
        let Reproduced { figure: PaperFigure { number, title, .. }, evidence, claims, .. } = experiment;
        let plots: String = evidence.plots().map(|plot| plot.clone().without_points().html()).collect();
        let (counted, _) = count(std::slice::from_ref(experiment));
        templates += &template("plots", &plots);
        let results = format!("<h3>Fig. {number}: {counted}.</h3>\n{}", claims_table(claims).html());
        templates += &template("results", &results);
        buttons += &format!("<button type=\"button\"><b>Fig. {number}</b> {}</button>\n", escaped(title));
    }
    let encoded = |module: &Module| BASE64_STANDARD.encode(&module.bytes);
    let data = json!({
        "modules": { "plant": encoded(plant), "controller": encoded(controller) },
        "controls": serde_json::from_str::<Json>(CONTROLS)?,
        "plants": plants.iter().map(|set| plant_json(set, &plant.description)).collect::<Result<Vec<_>>>()?,
        "loop": run_json(closed_loop),
        "experiments": experiments.iter().map(|experiment| json!({
            "number": experiment.figure.number,
            "runs": experiment.runs.iter().map(run_json).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
    });
    // Escaped so that no `<` ends the script.
    let data = data.to_string().replace('<', "\\u003c");
    let body = BODY
        .replace("{engine}", ENGINE)
        .replace("{templates}", &templates)
        .replace("{experiments}", &buttons);
    let mut report = Report::new("Boost pressure control, live");
    report.html(&format!("{body}<script type=\"application/json\" id=\"laboratory\">{data}</script>\n"));
    // In a block, the scripts' names do not meet others'.
    report.script(&format!("\"use strict\";\n{{\n{}}}\n", SCRIPTS.join("\n")), &["'wasm-unsafe-eval'"]);
    Ok(report.page(&format!("{STYLE}{CLAIMS_STYLE}")))
}

/// A parameter set in the plant's units.
fn plant_json(set: &ParameterSet, plant: &FmuDescription) -> Result<Json> {
    let fitted = set.fit(plant).with_context(|| format!("the parameter set '{}'", set.name))?;
    let values =
        fitted.parameters.iter().map(|parameter| json!([parameter.name, value_json(&parameter.value)]));
    Ok(json!({
        "name": set.name.replace('_', " "),
        "description": set.description,
        "values": values.collect::<Vec<_>>(),
    }))
}

fn run_json(Run { scenario, names }: &Run) -> Json {
    let Scenario { title, step, start_time, steps, fmus, inputs, .. } = scenario;
    json!({
        "title": title, "step": step, "start": start_time, "steps": steps, "record": names,
        "fmus": fmus.iter().map(member_json).collect::<Vec<_>>(), "inputs": inputs_json(inputs),
    })
}

fn member_json(member: &Member) -> Json {
    json!({
        "name": member.name, "values": values_json(&member.values), "inputs": inputs_json(&member.inputs),
        "runIn": member.run_in.as_ref().map(|run_in| json!({
            "duration": run_in.duration, "steps": run_in.steps,
            "during": values_json(&run_in.during), "after": values_json(&run_in.after),
        })),
    })
}

fn values_json(values: &[Assignment]) -> Json {
    values.iter().map(|assignment| json!([assignment.name, value_json(&assignment.value)])).collect()
}

fn value_json(value: &Value) -> Json {
    match value {
        Value::Real(value, _) => json!(value),
        Value::Integer(value) => json!(value),
        Value::Boolean(value) => json!(value),
        Value::String(text) | Value::Enumeration(text) => json!(text),
    }
}

fn inputs_json(inputs: &[Input]) -> Json {
    let course = |input: &Input| match &input.course {
        Course::Signal(signal) => signal_json(signal),
        Course::Measured(_) => unreachable!("the paper's experiments have no measured data"),
    };
    inputs.iter().map(|input| json!([input.name, course(input)])).collect()
}

fn signal_json(signal: &Signal) -> Json {
    match signal {
        Signal::Constant(value) => json!({ "constant": value }),
        Signal::Steps(points) => json!({ "steps": points }),
        Signal::Lines(points) => json!({ "lines": points }),
        Signal::Sine { mean, amplitude, frequency, phase } => {
            json!({ "mean": mean, "amplitude": amplitude, "frequency": frequency, "phase": phase })
        }
    }
}
