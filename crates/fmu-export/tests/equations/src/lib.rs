//! Models of equations, by which the built-in integrator is tested.

use std::array::from_fn;
use std::cell::Cell;

use fmu_export::integrator::{RODAS5P, ROS34PW2};
use fmu_export::{
    Context, Equations, Error, EvaluationOf, Event, Integration, Multirate, Number, Part, Persistent, Sample,
    Sampled,
};

macro_rules! variables {
    ($($model:ident: $identifier:literal),*) => {$(
        #[allow(missing_docs)]
        pub mod $model {
            fmu_export::include_variables!($identifier);
        }
    )*};
}
variables!(decay: "decay", van_der_pol: "van_der_pol", robertson: "robertson", hires: "hires",
    bouncing_ball: "bouncing_ball", stairs: "stairs", undeclared: "undeclared", draining: "draining",
    falling: "falling", rod: "rod", field: "field", drive: "drive", furnace: "furnace", two_parts: "two_parts", nested: "nested",
    without_capabilities: "without_capabilities", ending: "fmi3/ending", vessels: "Vessels",
    tuned: "tuned", tuned_3: "fmi3/tuned", tuned_samples: "tuned_samples", tuned_samples_3: "fmi3/tuned_samples",
    tuned_ticks: "fmi3/tuned_ticks", two_clocks: "two_clocks", two_clocks_3: "fmi3/two_clocks",
    waves: "waves", waves_3: "fmi3/waves", ticks: "ticks", ticks_3: "fmi3/ticks", alarms: "alarms",
    alarms_3: "fmi3/alarms",
    gears: "gears", gears_3: "fmi3/gears", branches: "branches", branches_3: "fmi3/branches");

/// Conduction along an insulated rod, from a cosine's half wave.
#[derive(Clone, Debug, Default, Persistent)]
pub struct Rod {}

impl Equations for Rod {
    type Variables = rod::Variables;

    fn initialize<T: Number>(&self, variables: &mut rod::Variables<T>) {
        let cells = variables.states.t.len() as f64;
        for (cell, state) in variables.states.t.iter_mut().enumerate() {
            *state = T::from(((cell as f64 + 0.5) / cells * std::f64::consts::PI).cos() + 1.0);
        }
    }

    fn evaluate<T: Number>(&self, _time: T, variables: rod::Evaluation<'_, T>) {
        let rod::Evaluation { parameters, states, derivatives, .. } = variables;
        let cells = &states.t;
        let last = cells.len() - 1;
        for (cell, slope) in derivatives.t.iter_mut().enumerate() {
            let (before, after) = (cells[cell.saturating_sub(1)], cells[(cell + 1).min(last)]);
            *slope = parameters.rate * (before - cells[cell] * 2.0 + after);
        }
        derivatives.average = T::from(0.0);
        if parameters.averages {
            let sum = cells.iter().fold(T::from(0.0), |sum, &state| sum + state);
            derivatives.average = sum / T::from(cells.len() as f64);
        }
    }
}

/// A ball that falls through the ground: its event counts the impact and leaves it there.
#[derive(Clone, Debug, Default, Persistent)]
pub struct Falling {}

impl Equations for Falling {
    type Variables = falling::Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: EvaluationOf<'_, Self, T>) {
        variables.derivatives.h = variables.states.v;
        variables.derivatives.v = T::from(-9.81);
    }

    fn event_indicators(&self, _time: f64, variables: &falling::Variables, indicators: &mut [f64]) {
        indicators[0] = -variables.states.h;
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut falling::Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let impacts = &mut variables.outputs.impacts;
        *impacts = if event.is_initial { 0 } else { *impacts + 1 };
        Ok(())
    }
}

/// Arrays of each size, of which large ones are on the heap.
#[derive(Clone, Debug, Default, Persistent)]
pub struct Field {}

impl Equations for Field {
    type Variables = field::Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: field::Evaluation<'_, T>) {
        let field::Evaluation { parameters, inputs, states, derivatives, outputs, .. } = variables;
        let field::States { x, grid, .. } = states;
        for (i, slope) in derivatives.x.iter_mut().enumerate() {
            let [left, right] = [x[i.saturating_sub(1)], x[(i + 1).min(299)]];
            *slope = inputs.gain * (left - x[i] * 2.0 + right) + inputs.heat[i];
        }
        for (i, row) in derivatives.grid.iter_mut().enumerate() {
            for (j, slope) in row.iter_mut().enumerate() {
                *slope = x[j + 1] - grid[i].iter().fold(T::from(0.0), |sum, &x| sum + x);
            }
        }
        derivatives.last = x[299];
        for (i, row) in outputs.row.iter_mut().enumerate() {
            *row = parameters.weight[i].iter().fold(grid[i][1], |sum, &weight| sum + weight);
        }
        outputs.warm = from_fn(|i| x[i] > 5.0);
    }
}

/// Exponential decay towards an input and a ramp in time, from a start value and an offset together.
#[derive(Clone, Debug, Default, Persistent)]
pub struct Decay {}

impl Equations for Decay {
    type Variables = decay::Variables;

    fn initialize<T: Number>(&self, variables: &mut decay::Variables<T>) {
        variables.states.x += variables.parameters.offset;
    }

    fn evaluate<T: Number>(&self, time: T, variables: decay::Evaluation<'_, T>) {
        let decay::Evaluation { parameters, inputs, states, derivatives, outputs, .. } = variables;
        derivatives.x = parameters.rate * (inputs.target + parameters.ramp * time - states.x);
        outputs.square = states.x * states.x;
        outputs.seconds = time;
    }
}

/// A decay whose JSON leaves out that the derivative depends on the input.
#[derive(Clone, Debug, Default, Persistent)]
pub struct Undeclared {}

impl Equations for Undeclared {
    type Variables = undeclared::Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: undeclared::Evaluation<'_, T>) {
        variables.derivatives.x = variables.inputs.target - variables.states.x;
    }
}

/// Van der Pol's oscillator.
#[derive(Clone, Debug, Default, Persistent)]
pub struct VanDerPol {}

impl Equations for VanDerPol {
    type Variables = van_der_pol::Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: EvaluationOf<'_, Self, T>) {
        let van_der_pol::Evaluation { parameters, states, derivatives, .. } = variables;
        derivatives.x0 = states.x1;
        derivatives.x1 = parameters.mu * (-states.x0 * states.x0 + 1.0) * states.x1 - states.x0;
    }
}

/// Robertson's reaction, whose rates are not numbers from a time on.
#[derive(Clone, Debug, Default, Persistent)]
pub struct Robertson {}

impl Equations for Robertson {
    type Variables = robertson::Variables;

    fn evaluate<T: Number>(&self, time: T, variables: robertson::Evaluation<'_, T>) {
        let robertson::Evaluation { parameters, states, derivatives, outputs, .. } = variables;
        let [a, b, c] = states.y;
        let (slow, fast, back) = (a * 0.04, b * b * 3e7, b * c * 1e4);
        derivatives.y = [back - slow, slow - back - fast, fast];
        if time >= parameters.fails_from {
            derivatives.y[1] = T::from(f64::NAN);
        }
        outputs.sum = a + b + c;
    }
}

/// The "high irradiance responses" of a plant to light, as eight reactions (Schäfer 1975; Hairer and Wanner, Solving
/// Ordinary Differential Equations II, section IV.10).
#[derive(Clone, Debug, Default, Persistent)]
pub struct Hires {}

impl Equations for Hires {
    type Variables = hires::Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: hires::Evaluation<'_, T>) {
        let [a, b, c, d, e, f, g, h] = variables.states.y;
        let (joined, parted) = (f * h * 280.0, g * 1.81);
        variables.derivatives.y = [
            a * -1.71 + b * 0.43 + c * 8.32 + 0.0007,
            a * 1.71 - b * 8.75,
            c * -10.03 + d * 0.43 + e * 0.035,
            b * 8.32 + c * 1.71 - d * 1.12,
            e * -1.745 + f * 0.43 + g * 0.43,
            -joined + d * 0.69 + e * 1.71 - f * 0.43 + g * 0.69,
            joined - parted,
            parted - joined,
        ];
    }
}

/// A ball that bounces, until it is so slow that it rests.
#[derive(Clone, Debug, Default, Persistent)]
pub struct BouncingBall {
    rests: bool,
}

impl Equations for BouncingBall {
    type Variables = bouncing_ball::Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: bouncing_ball::Evaluation<'_, T>) {
        let bouncing_ball::Evaluation { parameters, states, derivatives, .. } = variables;
        derivatives.h = states.v;
        derivatives.v = if self.rests { T::from(0.0) } else { -parameters.gravity };
    }

    fn event_indicators(&self, _time: f64, variables: &bouncing_ball::Variables, indicators: &mut [f64]) {
        indicators[0] = if self.rests { 0.0 } else { variables.states.h };
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut bouncing_ball::Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let bouncing_ball::Variables { parameters, states, outputs, .. } = variables;
        if states.h <= 0.0 && states.v < 0.0 {
            states.h = 0.0;
            states.v *= -parameters.restitution;
            outputs.bounces += 1;
            outputs.last_bounce = event.time;
            if states.v < parameters.smallest_velocity {
                states.v = 0.0;
                self.rests = true;
            }
        }
        Ok(())
    }
}

/// A rate that rises by 1 at multiples of an interval, and a count of the changes of an input's sign.
#[derive(Clone, Debug, Default, Persistent)]
pub struct Stairs {
    steps: i32,
    switches: i32,
}

impl Equations for Stairs {
    type Variables = stairs::Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: stairs::Evaluation<'_, T>) {
        variables.derivatives.level = T::from(f64::from(self.steps));
        variables.outputs.seen = variables.inputs.signal;
        variables.outputs.steps = self.steps;
        variables.outputs.switches = self.switches;
    }

    fn event_indicators(&self, _time: f64, variables: &stairs::Variables, indicators: &mut [f64]) {
        indicators[0] = variables.outputs.seen;
    }

    fn next_event(&self, time: f64, variables: &stairs::Variables) -> Option<f64> {
        let stairs::Parameters { interval, waits } = variables.parameters;
        Some(if waits { f64::from(self.steps + 1) * interval } else { time })
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut stairs::Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        if event.is_due {
            self.steps += 1;
            variables.outputs.last_step = event.time;
        }
        if event.indicators[0] {
            self.switches += 1;
            variables.outputs.last_switch = event.time;
        }
        Ok(())
    }
}

/// Asks for the end at 0.25 s.
#[derive(Clone, Debug, Default, Persistent)]
pub struct Ending {}

impl Equations for Ending {
    type Variables = ending::Variables;

    fn evaluate<T: Number>(&self, time: T, variables: ending::Evaluation<'_, T>) {
        variables.outputs.seconds = time;
    }

    fn next_event(&self, time: f64, _variables: &ending::Variables) -> Option<f64> {
        Some(if time < 0.25 { 0.25 } else { f64::INFINITY })
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        _variables: &mut ending::Variables,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        if event.is_due {
            context.terminate(event.time);
        }
        Ok(())
    }
}

/// A fast valve with a ripple, whose command is sampled every 0.1 s, on a slow thermal mass.
#[derive(Clone, Debug, Default, Persistent)]
pub struct Furnace {
    start_time: f64,
    /// The command as sampled, and the number of samples.
    held: f64,
    samples: u32,
}

thread_local! {
    /// The evaluations of valve and mass.
    pub static EVALUATIONS: [Cell<u32>; 2] = const { [Cell::new(0), Cell::new(0)] };
}

impl Furnace {
    fn valve<T: Number>(&self, time: T, variables: &mut furnace::Evaluation<'_, T>) {
        let (p, states) = (variables.parameters, variables.states);
        let target = p.ripple * (time * 200.0).sin() - p.feedback * states.temperature + self.held;
        variables.derivatives.opening = (target - states.opening) / p.lag;
    }
}

fn mass<T: Number>(variables: &mut furnace::Evaluation<'_, T>) {
    let (p, states) = (variables.parameters, variables.states);
    variables.derivatives.temperature = (states.opening - states.temperature) / p.time_constant;
}

impl Equations for Furnace {
    type Variables = furnace::Variables;
    const INTEGRATION: Integration<furnace::Variables> =
        Integration { samples_inputs: true, ..Integration::DEFAULT };

    fn prepare(&mut self, _: &mut furnace::Variables, context: &mut Context<'_>) -> Result<(), Error> {
        self.start_time = context.experiment.start_time;
        Ok(())
    }

    fn evaluate<T: Number>(&self, time: T, mut variables: furnace::Evaluation<'_, T>) {
        self.valve(time, &mut variables);
        mass(&mut variables);
    }

    fn next_event(&self, _: f64, variables: &furnace::Variables) -> Option<f64> {
        Some(self.start_time + variables.parameters.period * f64::from(self.samples))
    }

    fn event(
        &mut self,
        event: &Event<'_>,
        variables: &mut furnace::Variables,
        _: &mut Context<'_>,
    ) -> Result<(), Error> {
        if event.is_due {
            self.held = variables.inputs.command;
            self.samples += 1;
        }
        Ok(())
    }
}

impl Multirate for Furnace {
    fn evaluate_part(&self, part: Part, time: f64, mut variables: furnace::Evaluation<'_>) {
        EVALUATIONS.with(|counts| counts[part as usize].update(|count| count + 1));
        match part {
            Part::Fast => self.valve(time, &mut variables),
            Part::Slow => mass(&mut variables),
        }
    }

    fn is_coupled(&self, variables: &furnace::Variables) -> bool {
        variables.parameters.feedback != 0.0
    }
}

thread_local! {
    /// The evaluations of the models of two parts.
    pub static PARTS_EVALUATIONS: Cell<u32> = const { Cell::new(0) };
}

macro_rules! two_parts {
    ($($model:ident: $variables:ident, $method:expr;)*) => {$(
        /// Two linear systems, of which the first drives the second, forced by time and an input.
        #[derive(Clone, Debug, Default, Persistent)]
        pub struct $model {}

        impl Equations for $model {
            type Variables = $variables::Variables;
            const INTEGRATION: Integration<$variables::Variables> =
                Integration { method: &$method, ..Integration::DEFAULT };

            fn evaluate<T: Number>(&self, time: T, variables: $variables::Evaluation<'_, T>) {
                PARTS_EVALUATIONS.with(|count| count.update(|count| count + 1));
                let $variables::Evaluation { parameters: p, inputs, states, derivatives, .. } = variables;
                let product = |row: &[T; 2], states: &[T; 2]| row[0] * states[0] + row[1] * states[1];
                let force = p.swing * time.cos() + inputs.u;
                derivatives.fast = from_fn(|i| product(&p.fast_rates[i], &states.fast) + p.forcing[i] * force);
                derivatives.slow =
                    from_fn(|i| product(&p.slow_rates[i], &states.slow) + product(&p.drive[i], &states.fast));
            }
        }

        impl Multirate for $model {}
    )*};
}
two_parts! {
    TwoParts: two_parts, RODAS5P;
    TwoPartsWithoutCapabilities: without_capabilities, RODAS5P;
    KeptTwoParts: two_parts, ROS34PW2;
    KeptTwoPartsWithoutCapabilities: without_capabilities, ROS34PW2;
}

/// Defines models of FMI 2.0 and 3.0 with everything that can follow from a tunable parameter.
macro_rules! tuned {
    ($($name:ident, $samples:ident: $module:ident, $of_samples:ident;)*) => {$(
        /// A model of equations.
        #[derive(Clone, Debug, Default, Persistent)]
        pub struct $name {
            #[persistent(skip)]
            field: f64,
        }

        impl $name {
            fn compute<T: Number>(variables: &mut $module::Evaluation<'_, T>) {
                let (calculated, states) = (variables.calculated_parameters, variables.states);
                variables.outputs.y = calculated.scaled;
                variables.outputs.z = if calculated.strong { calculated.plain } else { -calculated.plain };
                variables.derivatives.x = calculated.scaled - states.x;
                variables.derivatives.held = T::from(0.0);
            }
        }

        impl Equations for $name {
            type Variables = $module::Variables;

            fn check_parameters(variables: &$module::Variables) -> Result<(), Error> {
                let gain = variables.parameters.gain;
                if gain > 50.0 { Err(Error::new(format!("gain is {gain:?}"))) } else { Ok(()) }
            }

            fn calculate_parameters<T: Number>(
                &self,
                parameters: &$module::Parameters<T>,
                calculated: &mut $module::CalculatedParameters<T>,
            ) {
                calculated.scaled = parameters.gain * 10.0;
                calculated.plain = calculated.scaled + parameters.gain;
                calculated.strong = parameters.gain > 3.0;
            }

            fn take_parameters(&mut self, variables: &$module::Variables) {
                self.field = variables.calculated_parameters.scaled;
            }

            fn initialize<T: Number>(&self, variables: &mut $module::Variables<T>) {
                variables.states.held = variables.calculated_parameters.scaled;
            }

            fn evaluate<T: Number>(&self, _time: T, mut variables: $module::Evaluation<'_, T>) {
                Self::compute(&mut variables);
                variables.outputs.of_field = variables.parameters.gain * 10.0;
            }

            fn evaluate_values(&self, _time: f64, mut variables: $module::Evaluation<'_>) {
                Self::compute(&mut variables);
                variables.outputs.of_field = self.field;
            }

            fn next_event(&self, time: f64, variables: &$module::Variables) -> Option<f64> {
                Some(variables.calculated_parameters.scaled).filter(|due| time < *due)
            }

            #[allow(clippy::cast_possible_truncation, reason = "they are small whole numbers")]
            fn event(
                &mut self,
                _event: &Event<'_>,
                variables: &mut $module::Variables,
                _context: &mut Context<'_>,
            ) -> Result<(), Error> {
                variables.outputs.seen = variables.calculated_parameters.scaled as i32;
                Ok(())
            }
        }

        /// A sampled model, with a sample each second.
        #[derive(Clone, Debug, Default, Persistent)]
        pub struct $samples {}

        impl Sampled for $samples {
            type Variables = $of_samples::Variables;

            fn period(_variables: &$of_samples::Variables) -> f64 {
                1.0
            }

            fn calculate_parameters(
                &self,
                parameters: &$of_samples::Parameters,
                calculated: &mut $of_samples::CalculatedParameters,
            ) {
                calculated.scaled = parameters.gain * 10.0;
                calculated.plain = calculated.scaled + parameters.gain;
            }

            fn sample(
                &mut self,
                _sample: Sample,
                variables: &mut $of_samples::Variables,
                _context: &mut Context<'_>,
            ) -> Result<(), Error> {
                variables.outputs.seen = variables.calculated_parameters.scaled;
                Ok(())
            }
        }
    )*};
}
tuned! {
    Tuned, TunedSamples: tuned, tuned_samples;
    Tuned3, TunedSamples3: tuned_3, tuned_samples_3;
}

/// A sampled model with a clock that reads what follows from a tunable parameter.
#[derive(Clone, Debug, Default, Persistent)]
pub struct TunedTicks {}

impl Sampled for TunedTicks {
    type Variables = tuned_ticks::Variables;

    fn calculate_parameters(
        &self,
        parameters: &tuned_ticks::Parameters,
        calculated: &mut tuned_ticks::CalculatedParameters,
    ) {
        calculated.scaled = parameters.gain * 10.0;
        calculated.plain = calculated.scaled + parameters.gain;
    }

    fn sample(
        &mut self,
        _sample: Sample,
        variables: &mut tuned_ticks::Variables,
        _context: &mut Context<'_>,
    ) -> Result<(), Error> {
        variables.outputs.seen = variables.calculated_parameters.scaled;
        Ok(())
    }
}

/// Defines models of instants, of FMI 2.0 and 3.0.
macro_rules! instants {
    ($($waves:ident, $ticks:ident, $reading:ident, $samples:ident, $alarms:ident: $of_waves:ident, $of_ticks:ident, $of_alarms:ident;)*) => {$(
        /// Notes the zeros of a wave.
        #[derive(Clone, Debug, Default, Persistent)]
        pub struct $waves {}

        impl Equations for $waves {
            type Variables = $of_waves::Variables;

            fn evaluate<T: Number>(&self, _time: T, variables: $of_waves::Evaluation<'_, T>) {
                variables.derivatives.clock = T::from(1.0);
            }

            fn event_indicators(&self, time: f64, variables: &$of_waves::Variables, indicators: &mut [f64]) {
                indicators[0] = (std::f64::consts::PI / variables.parameters.distance * time).sin();
            }

            fn event(
                &mut self,
                event: &Event<'_>,
                variables: &mut $of_waves::Variables,
                _context: &mut Context<'_>,
            ) -> Result<(), Error> {
                let ($of_waves::Parameters { distance }, outputs) = (&variables.parameters, &mut variables.outputs);
                if event.indicators[0] && !event.is_initial {
                    outputs.zeros += 1.0;
                    let zero = (event.time / distance).round() * distance;
                    outputs.error = outputs.error.max((event.time - zero).abs());
                }
                Ok(())
            }
        }

        impl $of_ticks::Outputs {
            /// Notes a tick at a time in the step that began at another (s).
            fn note(&mut self, time: f64, begin: f64) {
                self.number += 1.0;
                self.last = time;
                self.late = self.late.max(begin - time);
                self.early = self.early.max(time - begin);
            }
        }

        instants!(@ticks $ticks, $of_ticks, false);
        instants!(@ticks $reading, $of_ticks, true);

        /// A sampled model whose samples are the ticks.
        #[derive(Clone, Debug, Default, Persistent)]
        pub struct $samples {}

        impl Sampled for $samples {
            type Variables = $of_ticks::Variables;

            fn period(variables: &$of_ticks::Variables) -> f64 {
                variables.parameters.period
            }

            fn sample(
                &mut self,
                sample: Sample,
                variables: &mut $of_ticks::Variables,
                _context: &mut Context<'_>,
            ) -> Result<(), Error> {
                variables.outputs.note(sample.time, variables.inputs.begin);
                Ok(())
            }
        }

        /// Switches a rate on.
        #[derive(Clone, Debug, Default, Persistent)]
        pub struct $alarms {}

        impl Equations for $alarms {
            type Variables = $of_alarms::Variables;

            fn evaluate<T: Number>(&self, _time: T, variables: $of_alarms::Evaluation<'_, T>) {
                variables.derivatives.x = T::from(if variables.outputs.on { 1.0 } else { 0.0 });
            }

            fn next_event(&self, _time: f64, variables: &$of_alarms::Variables) -> Option<f64> {
                let $of_alarms::Variables { parameters, inputs, outputs, .. } = variables;
                let times = [(parameters.when, outputs.on), (inputs.when_in, outputs.on_in)];
                times.into_iter().filter(|(_, is_on)| !is_on).map(|(when, _)| when).reduce(f64::min)
            }

            fn event(
                &mut self,
                event: &Event<'_>,
                variables: &mut $of_alarms::Variables,
                _context: &mut Context<'_>,
            ) -> Result<(), Error> {
                let $of_alarms::Variables { parameters, inputs, outputs, .. } = variables;
                if !outputs.on && event.time >= parameters.when {
                    (outputs.on, outputs.since) = (true, event.time);
                }
                if !outputs.on_in && event.time >= inputs.when_in {
                    (outputs.on_in, outputs.since_in) = (true, event.time);
                }
                Ok(())
            }
        }
    )*};
    (@ticks $ticks:ident, $of_ticks:ident, $samples_inputs:literal) => {
        /// Ticks as time events.
        #[derive(Clone, Debug, Default, Persistent)]
        pub struct $ticks {
            start: f64,
        }

        impl Equations for $ticks {
            type Variables = $of_ticks::Variables;
            const INTEGRATION: Integration<$of_ticks::Variables> =
                Integration { samples_inputs: $samples_inputs, ..Integration::DEFAULT };

            fn prepare(
                &mut self,
                _variables: &mut $of_ticks::Variables,
                context: &mut Context<'_>,
            ) -> Result<(), Error> {
                self.start = context.experiment.start_time;
                Ok(())
            }

            fn evaluate<T: Number>(&self, _time: T, _variables: $of_ticks::Evaluation<'_, T>) {}

            fn next_event(&self, _time: f64, variables: &$of_ticks::Variables) -> Option<f64> {
                Some(self.start + variables.outputs.number * variables.parameters.period)
            }

            fn event(
                &mut self,
                event: &Event<'_>,
                variables: &mut $of_ticks::Variables,
                _context: &mut Context<'_>,
            ) -> Result<(), Error> {
                if event.is_due {
                    variables.outputs.note(event.time, variables.inputs.begin);
                }
                Ok(())
            }
        }
    };
}
instants! {
    Waves, Ticks, ReadingTicks, TickSamples, Alarms: waves, ticks, alarms;
    Waves3, Ticks3, ReadingTicks3, TickSamples3, Alarms3: waves_3, ticks_3, alarms_3;
}
