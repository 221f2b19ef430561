//! `linearize`: the linear equations of FMUs at an operating point, their poles and frequency responses, and the margins
//! of a loop.

mod loop_gain;
mod report;
mod response;

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use fmu_io::terminal::{complain, print};
use fmu_master::scenario::{Recorded, Scenario};
use fmu_master::{Instance, Interface, Linearization, LoadedFmus, Master, column_of};
use fmu_package::{FmuVariable, ValueType};
use fmu_record::Column;
use fmu_record::numbers::{number, quantity};
use fmu_terms::{Causality, like};
use nalgebra::Complex;
use serde_json::{Value, json};

use self::loop_gain::{Margins, Point, margins, measure, periods};
use self::response::{MOST_STATES, StateSpace, frequencies};
use super::experiment::{End, Experiment, TrialExport};
use super::{finite, number_in, positive, progress_bar, write_file};

/// The sine added to a loop, relative to the connection's signal: far above integrator tolerances, and small enough to
/// keep most loops at their operating points.
const AMPLITUDE: f64 = 1e-3;
/// A loop with more distortion than this is not linear.
const MOST_DISTORTION: f64 = 0.1;

/// Linearize FMUs at an operating point: matrices, poles, frequency response, and a loop's margins
#[derive(Args, Debug)]
#[group(skip)]
pub struct Linearize {
    #[command(flatten)]
    experiment: Experiment,
    /// The operating point: where a run is at this time (s) [default: the start, after initialization]
    #[arg(long, value_name = "SECONDS", value_parser = finite())]
    at: Option<f64>,
    /// The FMU of a system or scenario to linearize [default: each that has states]
    #[arg(long, value_name = "NAME")]
    of: Option<String>,
    /// Inputs of the linear equations [default: all real ones]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    inputs: Option<Vec<String>>,
    /// Outputs of the linear equations [default: all real ones]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    outputs: Option<Vec<String>>,
    /// The frequency response to show [default: the first output to the first input]
    #[arg(long, value_name = "INPUT,OUTPUT", num_args = 1, value_delimiter = ',')]
    path: Option<Vec<String>>,
    /// Measure the gain of the loop cut open at this input, which gets its value from another FMU, by sines
    #[arg(long = "loop", value_name = "[FMU:]INPUT")]
    cut: Option<String>,
    /// Amplitude of the sines, in the input's unit [default: a thousandth of its value]
    #[arg(long, value_name = "NUMBER", requires = "cut", value_parser = positive())]
    amplitude: Option<f64>,
    /// Range of frequencies (Hz) [default: about the poles; for a loop, periods of 4 to 1000 steps]
    #[arg(long, value_name = "FROM,TO", num_args = 1, value_delimiter = ',', value_parser = number_in(1e-9..=1e9, "a frequency in Hz"))]
    frequencies: Option<Vec<f64>>,
    /// Write everything as JSON
    #[arg(long, value_name = "FILE.json")]
    out: Option<PathBuf>,
    /// Write a page with Bode and Nyquist plots
    #[arg(long, value_name = "FILE.html")]
    plot: Option<PathBuf>,
}

/// What was found.
struct Found {
    title: String,
    /// The time of the operating point (s).
    time: f64,
    fmus: Vec<Linear>,
    cut: Option<Loop>,
}

/// An FMU's linear equations.
struct Linear {
    name: String,
    equations: Linearization,
    /// Names and units of states, inputs and outputs.
    states: Vec<Column>,
    inputs: Vec<Column>,
    outputs: Vec<Column>,
    /// The poles, unless there are too many states or the iterations do not converge.
    poles: Option<Vec<Complex<f64>>>,
    path: Option<Path>,
}

/// The frequency response of an output to an input.
struct Path {
    input: usize,
    output: usize,
    /// The frequencies (Hz).
    frequencies: Vec<f64>,
    /// The response at each frequency, in the declared units.
    response: Vec<Complex<f64>>,
}

/// A loop cut open at an input.
struct Loop {
    input: String,
    amplitude: f64,
    points: Vec<Point>,
    margins: Margins,
}

impl Linearize {
    /// Linearizes.
    ///
    /// # Errors
    /// When it cannot be run, there is nothing to linearize, or a file cannot be read or written.
    pub fn run(&self, export: TrialExport<'_>) -> Result<()> {
        if let Some(plot) = self.plot.as_ref().filter(|plot| plot.extension().is_none_or(|end| end != "html"))
        {
            bail!("{}: the page must end with .html", plot.display());
        }
        self.range()?;
        let subject = self.experiment.subject(export)?;
        let outputs: Vec<_> = self.out.iter().chain(&self.plot).cloned().collect();
        let end = End { time: self.at, option: "at" };
        let found = self.experiment.run(&subject, end, &outputs, |scenario, loaded| {
            let name = subject.file_stem().unwrap_or_default().to_string_lossy();
            let title = scenario.title.clone().unwrap_or_else(|| name.into_owned());
            self.find(title, scenario, loaded)
        })?;
        print(&found.text())?;
        if let Some(out) = &self.out {
            let text = serde_json::to_string_pretty(&found.json())? + "\n";
            write_file(out, text.as_bytes())?;
        }
        if let Some(plot) = &self.plot {
            write_file(plot, report::html(&found).as_bytes())?;
        }
        Ok(())
    }

    /// The range of frequencies (Hz).
    fn range(&self) -> Result<Option<(f64, f64)>> {
        match self.frequencies.as_deref() {
            None => Ok(None),
            Some(&[from, to]) if from < to => Ok(Some((from, to))),
            Some(_) => bail!("--frequencies: expected two frequencies in Hz, the lower first"),
        }
    }

    fn find(&self, title: String, mut scenario: Scenario, loaded: &mut LoadedFmus) -> Result<Found> {
        let names: Vec<_> = scenario.fmus.iter().map(|member| member.name.clone()).collect();
        if let Some(unknown) = self.of.as_ref().filter(|of| !names.contains(of)) {
            bail!("--of {unknown}: there is no such FMU{}", like(unknown, names.iter().map(String::as_str)));
        }
        // Noise would disturb the measurement, and records are not needed.
        (scenario.noise, scenario.measurement_noise) = (vec![], vec![]);
        (scenario.record, scenario.panels) = (Some(Vec::<Recorded>::new()), None);
        for member in &mut scenario.fmus {
            let fmu = loaded.get(member)?;
            let description = fmu.description();
            let has_states = description.continuous_states().is_ok_and(|states| !states.is_empty());
            let is_exchange = description.interface(Interface::ModelExchange).is_some();
            if member.interface.is_none() && has_states && !fmu.can_be_linearized() && is_exchange {
                member.interface = Some(Interface::ModelExchange);
            }
        }
        let mut master = Master::new(&scenario, loaded)?;
        if let Some(cut) = &self.cut {
            master.tap(cut).with_context(|| format!("--loop {cut}"))?;
        }
        master.initialize()?;
        if self.at.is_some() {
            master.step_to_end(|_, _| ())?;
        }
        let time = master.time();
        let mut fmus = vec![];
        for name in &names {
            let is_wanted = self.of.as_ref().is_none_or(|of| of == name);
            if is_wanted && let Some(linear) = self.linear(master.instance(name)?)? {
                fmus.push(linear);
            }
        }
        if let (Some(path), true) = (&self.path, fmus.iter().all(|linear| linear.path.is_none())) {
            bail!("--path {}: no linearized FMU has this input and output", path.join(","));
        }
        master.hold_signals();
        let cut =
            self.cut.as_ref().map(|input| self.loop_at(input, &mut master, scenario.step)).transpose()?;
        for name in &names {
            for message in master.instance(name)?.take_warnings() {
                complain(&format!("warning: {}", message.of(name)));
            }
        }
        if fmus.is_empty() && cut.is_none() {
            bail!(
                "nothing to linearize: {} no continuous states with derivatives; --loop measures a loop of any FMUs",
                names.join(" and ") + if names.len() == 1 { " has" } else { " have" }
            );
        }
        Ok(Found { title, time, fmus, cut })
    }

    /// The linear equations of an FMU, if it has states and can be linearized.
    fn linear(&self, instance: &mut Instance) -> Result<Option<Linear>> {
        let fmu = std::sync::Arc::clone(instance.fmu());
        let is_possible = fmu.can_be_linearized();
        if !is_possible && self.of.is_none() {
            return Ok(None);
        }
        // A discrete input acts at events, which finite differences do not include.
        let is_continuous = |variable: &&FmuVariable| {
            variable.value_type() == ValueType::Real
                && (fmu.has_directional_derivatives() || !variable.is_discrete())
        };
        let chosen = |causality, names: &Option<Vec<String>>| -> Vec<String> {
            let all = || fmu.description().of_causality(causality).filter(is_continuous);
            names.clone().unwrap_or_else(|| all().map(|variable| variable.name.clone()).collect())
        };
        let [inputs, outputs] =
            [chosen(Causality::Input, &self.inputs), chosen(Causality::Output, &self.outputs)];
        let [by, of] = [&inputs, &outputs].map(|names| names.iter().map(String::as_str).collect::<Vec<_>>());
        let equations = instance.linearize(&by, &of)?;
        let columns = |names: &[(String, f64)]| -> Result<Vec<Column>> {
            let column =
                |(name, _): &(String, f64)| Ok(column_of(name, fmu.variable(name)?, fmu.description()));
            names.iter().map(column).collect()
        };
        let (poles, path) = if equations.states.len() > MOST_STATES {
            complain(&format!(
                "note: {}: it has {} states; poles and frequency responses are computed for at most {MOST_STATES}",
                instance.name(),
                equations.states.len()
            ));
            (None, None)
        } else {
            let space = StateSpace::new(&equations);
            let poles = space.poles();
            if poles.is_none() {
                complain(&format!("warning: {}: the eigenvalues of A do not converge", instance.name()));
            }
            let path = self.path(&space, &equations, poles.as_deref().unwrap_or_default())?;
            (poles, path)
        };
        Ok(Some(Linear {
            name: instance.name().to_owned(),
            states: columns(&equations.states)?,
            inputs: columns(&equations.inputs)?,
            outputs: columns(&equations.outputs)?,
            path,
            poles,
            equations,
        }))
    }

    /// The wanted frequency response, if the FMU has its variables.
    fn path(
        &self,
        space: &StateSpace,
        equations: &Linearization,
        poles: &[Complex<f64>],
    ) -> Result<Option<Path>> {
        let place = |names: &[(String, f64)], name: &str| names.iter().position(|(known, _)| known == name);
        let (input, output) = match self.path.as_deref() {
            None => (
                Some(0).filter(|_| !equations.inputs.is_empty()),
                Some(0).filter(|_| !equations.outputs.is_empty()),
            ),
            Some([input, output]) => (place(&equations.inputs, input), place(&equations.outputs, output)),
            Some(_) => bail!("--path: expected an input and an output"),
        };
        let (Some(input), Some(output)) = (input, output) else { return Ok(None) };
        let mut frequencies = frequencies(poles, self.range()?);
        let bar = progress_bar(frequencies.len() as u64, "{pos} of {len} frequencies")?;
        let mut response = vec![];
        // At an undamped pole the response is infinite.
        frequencies.retain(|&frequency| {
            bar.inc(1);
            let found = space.response(input, output, frequency);
            response.extend(found);
            found.is_some()
        });
        bar.finish_and_clear();
        Ok(Some(Path { input, output, frequencies, response }))
    }

    /// Measures the tapped loop.
    fn loop_at(&self, input: &str, master: &mut Master<'_>, step: f64) -> Result<Loop> {
        let value = master.step_adding(0.0)?;
        let amplitude =
            self.amplitude.unwrap_or(if value == 0.0 { AMPLITUDE } else { AMPLITUDE * value.abs() });
        let periods = periods(step, self.range()?);
        if periods.is_empty() {
            bail!("--frequencies: a loop can only be measured below {}", quantity(0.25 / step, "Hz"));
        }
        let bar = progress_bar(periods.len() as u64, "{pos} of {len} frequencies")?;
        let points = measure(master, step, amplitude, &periods, || bar.inc(1))?;
        bar.finish_and_clear();
        let settled = points.iter().filter(|point| point.is_settled);
        let gains: Vec<_> = settled.map(|point| (point.frequency, point.gain)).collect();
        for point in &points {
            let at = quantity(point.frequency, "Hz");
            if !point.is_settled {
                complain(&format!("warning: at {at} the response did not settle"));
            } else if point.distortion > MOST_DISTORTION {
                let share = quantity(100.0 * point.distortion, "%");
                complain(&format!(
                    "warning: at {at} the loop is not linear: {share} of its signal is at other frequencies; try \
                     another --amplitude"
                ));
            }
        }
        Ok(Loop { input: input.to_owned(), amplitude, margins: margins(&gains), points })
    }
}

impl Linear {
    /// How the FMU was linearized.
    fn origin(&self) -> &'static str {
        if self.equations.is_exact { "from its directional derivatives" } else { "from finite differences" }
    }
}

impl Loop {
    /// What the margins are, in words.
    fn lines(&self) -> [String; 2] {
        let decibels = |factor: f64| 20.0 * factor.log10();
        let at = |frequency: f64| quantity(frequency, "Hz");
        let gain = self.margins.gain.map_or("none".to_owned(), |(factor, frequency)| {
            let more = number(factor);
            format!("{} at {} (factor {more})", quantity(decibels(factor), "dB"), at(frequency))
        });
        let phase = self.margins.phase.map_or("none".to_owned(), |(angle, frequency)| {
            let delay = quantity(angle / 360.0 / frequency, "s");
            format!("{}\u{b0} at {} (a delay of {delay})", number(angle), at(frequency))
        });
        [format!("gain margin {gain}"), format!("phase margin {phase}")]
    }
}

/// A pole in words: its place, and its time constant, or for a pair the frequency and damping.
fn describe(pole: &Complex<f64>) -> [String; 3] {
    let sign = if pole.im < 0.0 { '\u{2212}' } else { '+' };
    let place = match pole.im {
        0.0 => number(pole.re),
        imaginary => format!("{} {sign} {}j", number(pole.re), number(imaginary.abs())),
    };
    let frequency = quantity(pole.norm() / std::f64::consts::TAU, "Hz");
    let nature = match (pole.re, pole.im) {
        (0.0, 0.0) => "integrates".to_owned(),
        (0.0, _) => "undamped".to_owned(),
        (real, 0.0) => format!("time constant {}", quantity(-1.0 / real, "s")),
        (real, _) => format!("damping {}", number(-real / pole.norm())),
    };
    [place, frequency, nature]
}

impl Found {
    fn text(&self) -> String {
        let mut text = String::new();
        for linear in &self.fmus {
            let Linear { name, poles, states, inputs, outputs, .. } = linear;
            let _ = writeln!(
                text,
                "{name} at {}, {}: {} states, {} inputs, {} outputs",
                quantity(self.time, "s"),
                linear.origin(),
                states.len(),
                inputs.len(),
                outputs.len()
            );
            for [place, frequency, nature] in poles.iter().flatten().map(describe) {
                let _ = writeln!(text, "  pole {place:>18} 1/s  {frequency:>10}  {nature}");
            }
        }
        if let Some(cut) = &self.cut {
            let _ = writeln!(
                text,
                "loop at {}, {} frequencies\n  {}",
                cut.input,
                cut.points.len(),
                cut.lines().join("\n  ")
            );
        }
        text
    }

    fn json(&self) -> Value {
        let pair = |number: &Complex<f64>| json!([number.re, number.im]);
        let operating = |columns: &[Column], values: &[(String, f64)]| -> Vec<Value> {
            let both = columns.iter().zip(values);
            both.map(|(column, (name, value))| json!({ "name": name, "unit": column.unit, "value": value }))
                .collect()
        };
        let fmus = self.fmus.iter().map(|linear| {
            let Linear { name, equations, poles, .. } = linear;
            let path = linear.path.as_ref().map(|path| {
                json!({
                    "input": linear.inputs[path.input].name,
                    "output": linear.outputs[path.output].name,
                    "frequencies": path.frequencies,
                    "response": path.response.iter().map(pair).collect::<Vec<_>>(),
                })
            });
            json!({
                "name": name,
                "is_exact": equations.is_exact,
                "states": operating(&linear.states, &equations.states),
                "derivatives": equations.derivatives,
                "inputs": operating(&linear.inputs, &equations.inputs),
                "outputs": operating(&linear.outputs, &equations.outputs),
                "A": equations.a, "B": equations.b, "C": equations.c, "D": equations.d,
                "poles": poles.as_ref().map(|poles| poles.iter().map(pair).collect::<Vec<_>>()),
                "path": path,
            })
        });
        let of_margin = |margin: Option<(f64, f64)>, name: &str| {
            margin.map(|(value, frequency)| json!({ name: value, "frequency": frequency }))
        };
        let cut = self.cut.as_ref().map(|cut| {
            let of_points = |value: fn(&Point) -> Value| cut.points.iter().map(value).collect::<Vec<_>>();
            json!({
                "input": cut.input,
                "amplitude": cut.amplitude,
                "frequencies": of_points(|point| json!(point.frequency)),
                "gain": of_points(|point| json!([point.gain.re, point.gain.im])),
                "distortion": of_points(|point| json!(point.distortion)),
                "is_settled": of_points(|point| json!(point.is_settled)),
                "gain_margin": of_margin(cut.margins.gain, "factor"),
                "phase_margin": of_margin(cut.margins.phase, "degrees"),
            })
        });
        json!({ "title": self.title, "time": self.time, "fmus": fmus.collect::<Vec<_>>(), "loop": cut })
    }
}
