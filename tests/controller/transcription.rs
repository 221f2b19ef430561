//! An independent transcription of the published law, with the strategy by speed, compared with the controller over random inputs.

use boost_fmu::controller::variables::{ControlMode, FeedbackStructure, Inputs, Parameters};

use crate::bench::Bench;
use crate::random::Random;

/// The controller in mode boost.
#[derive(Default)]
struct Transcription {
    started: bool,
    y_prev: f64,
    y_m: f64,
    y_d: Option<f64>,
    i: f64,
    d: f64,
    pump: f64,
    bypass: bool,
    i_lp: Option<f64>,
}

/// The results of a tick.
struct Tick {
    pwm: f64,
    pump: f64,
    lp_wastegate: f64,
    bypass: f64,
    u: f64,
    y_m: f64,
}

/// Bilinear interpolation in a table, clamped at its edges.
fn table(p: &Parameters, values: &[[f64; 7]; 16], pressure: f64, speed: f64) -> f64 {
    let rows = &p.schedule.boost_reference;
    let columns = &p.schedule.engine_speed;
    let r = pressure.clamp(rows[0], rows[15]);
    let n = speed.clamp(columns[0], columns[6]);
    let mut i = 0;
    while i < 14 && r > rows[i + 1] {
        i += 1;
    }
    let mut j = 0;
    while j < 5 && n > columns[j + 1] {
        j += 1;
    }
    let a = (r - rows[i]) / (rows[i + 1] - rows[i]);
    let b = (n - columns[j]) / (columns[j + 1] - columns[j]);
    values[i][j] * (1.0 - a) * (1.0 - b)
        + values[i][j + 1] * (1.0 - a) * b
        + values[i + 1][j] * a * (1.0 - b)
        + values[i + 1][j + 1] * a * b
}

impl Transcription {
    fn tick(&mut self, p: &Parameters, inputs: &Inputs) -> Option<Tick> {
        let ts = p.sample_time;
        let (y, n) = (inputs.boost_pressure, inputs.engine_speed);
        let r = inputs.boost_reference.min(p.boost_limit);
        if !self.started {
            if y < 20_000.0 {
                return None;
            }
            self.started = true;
            self.y_prev = y;
            self.y_m = y;
        }
        let g = if p.compensate_voltage {
            p.nominal_voltage / inputs.supply_voltage_measured.max(6.0)
        } else {
            1.0
        };
        if inputs.tank_pressure > p.tank_pressure_on {
            self.pump = 1.0;
        }
        if inputs.tank_pressure < p.tank_pressure_off {
            self.pump = 0.0;
        }
        if n >= p.lp_wastegate_open_above {
            self.bypass = true;
        } else if n <= p.lp_wastegate_open_above - p.stage_hysteresis {
            self.bypass = false;
        }
        if self.bypass {
            self.y_prev = y;
            self.y_m = y;
            self.y_d = None;
            self.i = 0.0;
            self.d = 0.0;
            let e = y - r;
            let k = p.low_pressure_gain;
            let i_lp = self.i_lp.unwrap_or(-k * e);
            let w = k * e + i_lp;
            let w_clipped = w.clamp(0.0, 1.0);
            let t_lp = p.low_pressure_integral_time;
            self.i_lp = Some(i_lp + k * ts / t_lp * e + (ts / t_lp) * (w_clipped - w));
            let pwm = (p.pwm_max * g).min(100.0);
            let (pump, u) = (self.pump, p.pwm_max);
            return Some(Tick { pwm, pump, lp_wastegate: w_clipped, bypass: 1.0, u, y_m: y });
        }
        self.i_lp = None;
        let s = &p.schedule;
        let (kp, t, l) =
            (table(p, &s.gain, r, n), table(p, &s.time_constant, r, n), table(p, &s.delay, r, n));
        let k = (l / 2.0 + t) / ((l / 2.0 + p.lambda) * kp);
        let ti = t + l / 2.0;
        let td = t * l / (l + 2.0 * t);
        let nf = p.derivative_filter;
        let a = td / (td + nf * ts);
        self.d = a * self.d - k * nf * a * (y - self.y_prev);
        self.y_prev = y;
        let lo = p.pwm_min;
        let hi = p.pwm_max.min(100.0 / g);
        let clip = |u: f64| {
            if u > hi {
                hi
            } else if u < lo {
                lo.min(hi)
            } else {
                u
            }
        };
        let ttr = (ti * td).sqrt().max(4.0 * ts);
        let lp = (n - p.lp_wastegate_close_below) / (p.lp_wastegate_open_above - p.lp_wastegate_close_below);
        let (u, y_m) = match p.structure {
            FeedbackStructure::Paper => {
                let e = r - y;
                let u = table(p, &s.feedforward, r, n) + k * e + self.i + self.d;
                self.i += k * ts / ti * e + ts / ttr * (clip(u) - u);
                (u, r)
            }
            FeedbackStructure::ModelReference => {
                let y_m = self.y_m;
                let tm = table(p, &s.time_constant, y_m, n);
                let km = table(p, &s.gain, y_m, n);
                let u_m = table(p, &s.feedforward, y_m, n);
                let ff = u_m + (tm / km) * (r - y_m) / p.lambda;
                let e = match self.y_d {
                    Some(y_d) => y_d - y,
                    None => 0.0,
                };
                let u = ff + k * e + self.i + self.d;
                self.i += k * ts / ti * e + ts / ttr * (clip(u) - u);
                let y_d = self.y_d.unwrap_or(y_m);
                self.y_d = Some(y_d + ts / l.max(ts) * (y_m - y_d));
                self.y_m += ts * (clip(ff) - u_m) * km / tm;
                (u, y_m)
            }
        };
        let pwm = (clip(u) * g).min(100.0);
        Some(Tick { pwm, pump: self.pump, lp_wastegate: lp.clamp(0.0, 1.0), bypass: 0.0, u, y_m })
    }
}

/// Relative to the value or, near 0, to a hundredth of full scale, since sums round by the size of their terms. Both
/// round differently, by a few 1e-16 in each operation, and differences decay with the law's time constants.
fn assert_close(what: &str, tick: u32, actual: f64, expected: f64, full_scale: f64) {
    let scale = expected.abs().max(full_scale / 100.0);
    assert!(
        (actual - expected).abs() <= 1e-12 * scale,
        "{what} at tick {tick}: {actual} instead of {expected} (off by {:e})",
        (actual - expected).abs() / scale
    );
}

/// Inputs that drift slowly with some jumps, across every limit of the law.
fn wander(inputs: &mut Inputs, random: &mut Random) {
    if random.between(0.0, 1.0) < 0.01 {
        inputs.boost_reference = random.between(9e4, 2.7e5);
    }
    if random.between(0.0, 1.0) < 0.01 {
        inputs.engine_speed = random.between(700.0, 4200.0);
    }
    if random.between(0.0, 1.0) < 0.02 {
        inputs.supply_voltage_measured = random.between(3.0, 16.0);
    }
    inputs.engine_speed = (inputs.engine_speed + random.between(-20.0, 20.0)).clamp(0.0, 8000.0);
    let pull = 0.02 * (inputs.boost_reference - inputs.boost_pressure);
    inputs.boost_pressure = (inputs.boost_pressure + pull + random.between(-1e3, 1e3)).clamp(0.0, 1e6);
    inputs.tank_pressure = random.between(2.8e4, 3.7e4);
}

fn compare(seed: u64, change: impl Fn(&mut Parameters)) {
    let mut random = Random(seed);
    let mut inputs = Inputs::default();
    let mut bench = Bench::by_speed(&inputs, change);
    let mut transcription = Transcription::default();
    inputs.boost_pressure = 0.0;
    let mut bypassed = 0;
    let mut saturated = 0;
    for tick in 0..20_000 {
        if tick == 3 {
            inputs.boost_pressure = 1.1e5;
        }
        if tick >= 3 {
            wander(&mut inputs, &mut random);
        }
        let before = bench.variables.outputs;
        let outputs = bench.sample(tick, &inputs);
        let Some(expected) = transcription.tick(&bench.variables.parameters, &inputs) else {
            assert_eq!(outputs, before);
            continue;
        };
        let locals = &bench.variables.locals;
        assert_close("hp_wastegate_pwm", tick, outputs.hp_wastegate_pwm, expected.pwm, 100.0);
        assert_close("unsaturated_pwm", tick, locals.unsaturated_pwm, expected.u, 100.0);
        assert_close("reference_model_pressure", tick, locals.reference_model_pressure, expected.y_m, 1e5);
        assert_close("lp_wastegate", tick, outputs.lp_wastegate, expected.lp_wastegate, 1.0);
        assert_eq!((outputs.vacuum_pump, outputs.hp_bypass), (expected.pump, expected.bypass), "{tick}");
        bypassed += u32::from(outputs.hp_bypass > 0.0);
        saturated += u32::from(locals.saturated);
    }
    // The inputs did lead through all branches.
    assert!((1000..19_000).contains(&bypassed), "{bypassed} ticks with the high-pressure stage bypassed");
    assert!((1000..19_000).contains(&saturated), "{saturated} ticks at a limit");
}

#[test]
fn model_reference_agrees_with_the_transcription() {
    for seed in 1..=5 {
        compare(seed, |_| {});
        compare(seed, |parameters| parameters.compensate_voltage = false);
    }
}

#[test]
fn paper_structure_agrees_with_the_transcription() {
    for seed in 11..=15 {
        compare(seed, |parameters| parameters.structure = FeedbackStructure::Paper);
        compare(seed, |parameters| {
            parameters.structure = FeedbackStructure::Paper;
            parameters.compensate_voltage = false;
        });
    }
}

#[test]
fn other_settings_agree_with_the_transcription() {
    for structure in [FeedbackStructure::Paper, FeedbackStructure::ModelReference] {
        compare(21, |parameters| {
            parameters.structure = structure;
            parameters.sample_time = 0.03;
            parameters.lambda = 0.7;
            parameters.derivative_filter = 3.0;
            parameters.nominal_voltage = 14.0;
            parameters.pwm_min = 30.0;
            parameters.pwm_max = 60.0;
            parameters.boost_limit = 2e5;
            parameters.tank_pressure_on = 34e3;
            parameters.tank_pressure_off = 31e3;
            parameters.lp_wastegate_close_below = 1500.0;
            parameters.lp_wastegate_open_above = 3000.0;
            parameters.stage_hysteresis = 250.0;
            parameters.low_pressure_gain = 5e-5;
            parameters.low_pressure_integral_time = 0.4;
            parameters.schedule.delay = [[0.0; 7]; 16];
            assert_eq!(parameters.mode, ControlMode::Boost);
        });
    }
}
