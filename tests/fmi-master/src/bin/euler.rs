//! Simulates an FMU of FMI 3.0 by explicit Euler in Model Exchange, as Reference-FMUs' results were made: events are at the
//! ends of steps.
//!
//! `euler FMU STEP STEPS VARIABLE...` writes the variables at the start and after each step as CSV, in numbers that read back as
//! the same doubles.

use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use fmi::EventFlags;
use fmi::fmi3::import::Fmi3Import;
use fmi::fmi3::instance::InstanceME;
use fmi::fmi3::schema::VariableType;
use fmi::fmi3::{Common, Fmi3Model, GetSet, ModelExchange};
use fmi::import::from_path;
use fmi::traits::FmiImport;

/// By how much of a step the time may be off by rounding.
const ROUNDING: f64 = 1e-9;

/// A variable that is written.
struct Column {
    name: String,
    reference: u32,
    is_integer: bool,
}

impl Column {
    fn find(import: &Fmi3Import, name: &str) -> Result<Self> {
        let variables = &import.model_description().model_variables;
        let variable =
            variables.find_by_name(name).with_context(|| format!("there is no variable {name}"))?;
        let is_integer = match variable.data_type() {
            VariableType::FmiFloat64 => false,
            VariableType::FmiInt32 => true,
            other => bail!("the variable {name} is of the type {other:?}"),
        };
        Ok(Self { name: name.to_owned(), reference: variable.value_reference(), is_integer })
    }

    fn value(&self, fmu: &mut InstanceME) -> Result<f64> {
        if self.is_integer {
            let mut values = [0];
            fmu.get_int32(&[self.reference], &mut values).context("fmi3GetInt32")?;
            return Ok(values[0].into());
        }
        let mut values = [0.0];
        fmu.get_float64(&[self.reference], &mut values).context("fmi3GetFloat64")?;
        Ok(values[0])
    }
}

/// Iterates at an event: whether the simulation goes on, and the time of the next event.
fn handle_event(fmu: &mut InstanceME) -> Result<(bool, Option<f64>)> {
    let mut flags = EventFlags::default();
    loop {
        Common::update_discrete_states(fmu, &mut flags).context("fmi3UpdateDiscreteStates")?;
        if flags.terminate_simulation || !flags.discrete_states_need_update {
            break;
        }
    }
    if !flags.terminate_simulation {
        ModelExchange::enter_continuous_time_mode(fmu).context("fmi3EnterContinuousTimeMode")?;
    }
    Ok((!flags.terminate_simulation, flags.next_event_time))
}

fn signs(fmu: &mut InstanceME, indicators: &mut [f64]) -> Result<Vec<bool>> {
    fmu.get_event_indicators(indicators).context("fmi3GetEventIndicators")?;
    Ok(indicators.iter().map(|indicator| *indicator > 0.0).collect())
}

fn run(path: &Path, step: f64, steps: u32, names: &[String], csv: &mut impl Write) -> Result<()> {
    let import: Fmi3Import = from_path(path).with_context(|| format!("cannot import {}", path.display()))?;
    let columns = names.iter().map(|name| Column::find(&import, name)).collect::<Result<Vec<_>>>()?;
    let mut fmu = import.instantiate_me("model", false, true).context("fmi3InstantiateModelExchange")?;
    let mut states = vec![0.0; fmu.get_number_of_continuous_states()?];
    let mut derivatives = states.clone();
    let mut indicators = vec![0.0; fmu.get_number_of_event_indicators()?];
    fmu.enter_initialization_mode(None, 0.0, None).context("fmi3EnterInitializationMode")?;
    fmu.exit_initialization_mode().context("fmi3ExitInitializationMode")?;
    let (mut goes_on, mut next_event) = handle_event(&mut fmu)?;

    let header: Vec<_> = columns.iter().map(|column| column.name.as_str()).collect();
    writeln!(csv, "time,{}", header.join(","))?;
    for index in 0..=steps {
        let time = f64::from(index) * step;
        if index > 0 {
            fmu.get_continuous_states(&mut states).context("fmi3GetContinuousStates")?;
            fmu.get_continuous_state_derivatives(&mut derivatives)
                .context("fmi3GetContinuousStateDerivatives")?;
            let before = signs(&mut fmu, &mut indicators)?;
            for (state, derivative) in states.iter_mut().zip(&derivatives) {
                *state += step * derivative;
            }
            fmu.set_time(time).context("fmi3SetTime")?;
            if !states.is_empty() {
                fmu.set_continuous_states(&states).context("fmi3SetContinuousStates")?;
            }
            let is_due = next_event.is_some_and(|next| time >= next - ROUNDING * step);
            if is_due || signs(&mut fmu, &mut indicators)? != before {
                Common::enter_event_mode(&mut fmu).context("fmi3EnterEventMode")?;
                (goes_on, next_event) = handle_event(&mut fmu)?;
            }
        }
        write!(csv, "{time:?}")?;
        for column in &columns {
            write!(csv, ",{:?}", column.value(&mut fmu)?)?;
        }
        writeln!(csv)?;
        if !goes_on {
            break;
        }
    }
    fmu.terminate().context("fmi3Terminate")?;
    Ok(())
}

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let parsed = match arguments.as_slice() {
        [path, step, steps, names @ ..] => {
            step.parse().ok().zip(steps.parse().ok()).map(|of| (path, of, names))
        }
        _ => None,
    };
    let Some((path, (step, steps), names)) = parsed else {
        eprintln!("usage: euler FMU STEP STEPS VARIABLE...");
        return ExitCode::from(2);
    };
    match run(Path::new(path), step, steps, names, &mut BufWriter::new(io::stdout().lock())) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
