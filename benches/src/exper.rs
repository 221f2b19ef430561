//! Throw-away: errors and instructions of the plant on the experiments.
use boost_fmu::plant::BoostPlant;
use benches::direct::Direct;
use benches::experiment::{Experiment, STEP};
use benches::plant::Plant;
use benches::bench::{FULL_SCALES, OUTPUT_FULL_SCALES, numbers, reference_outputs, reference_states};
use benches::random_experiment::RandomExperiment;

#[inline(never)]
fn counted(plant: &mut Direct<BoostPlant>, inputs: &boost_fmu::plant::variables::Inputs, size: f64) {
    Plant::set(plant, inputs);
    plant.step(size);
}

fn compare(plant: &Direct<BoostPlant>, expected: &[f64], e: &mut [f64; 36]) {
    let found = [&reference_states(&plant.variables.states)[..], &reference_outputs(&plant.variables)].concat();
    for (i, ((f, x), s)) in found.iter().zip(expected).zip(FULL_SCALES.iter().chain(&OUTPUT_FULL_SCALES)).enumerate() {
        let d = (f - x).abs() / s;
        if !(d <= e[i]) { e[i] = d; }
    }
}

fn report(name: &str, e: &[f64; 36]) {
    let (mut m, mut w) = (0.0, 0);
    for (i, &x) in e.iter().enumerate() { if i != 3 && i != 4 && !(x <= m) { m = x; w = i; } }
    println!("{name}: rod {:.4} friction {:.4} others {:.5} (quantity {w})", 100.0 * e[3], 100.0 * e[4], 100.0 * m);
}

fn main() {
    let area: f64 = std::env::var("AREA").map_or(0.0, |x| x.parse().unwrap());
    let which = std::env::args().nth(1).unwrap_or("recorded".into());
    if which == "recorded" || which == "all" {
        let recorded = Experiment::recorded();
        let text = include_str!("../../tests/data/plant_trace.csv");
        let rows: Vec<Vec<f64>> = text.lines().skip(1).map(|l| numbers(l, ',')).filter(|r| !r.is_empty()).collect();
        let mut plant = Direct::<BoostPlant>::given(&recorded.states, &recorded.inputs[0], area);
        let mut e = [0.0; 36];
        for row in &rows {
            let inputs = benches::bench::inputs_of(&row[1..11]);
            let size = row[0] - plant.time;
            counted(&mut plant, &inputs, size);
            compare(&plant, &row[11..], &mut e);
        }
        report("recorded", &e);
    }
    if which != "recorded" {
        let (mut most, mut sum) = ([0.0_f64; 36], 0);
        for number in RandomExperiment::NUMBERS {
            if which != "all" && which != "random" && which != number.to_string() { continue; }
            let x = RandomExperiment::read(number);
            let experiment = Experiment::random(number);
            let mut plant = Direct::<BoostPlant>::given(&experiment.states, &experiment.inputs[0], area);
            let mut rows = x.reference.lines().skip(1).map(|l| numbers(l, ',')).filter(|r| !r.is_empty());
            let mut next = rows.next();
            let mut e = [0.0; 36];
            let mut step = 0;
            while let Some(row) = next.take() {
                while plant.time < row[0] - 1e-9 {
                    let inputs = x.inputs(step);
                    step += 1;
                    let size = f64::from(step) * STEP - plant.time;
                    counted(&mut plant, &inputs, size);
                }
                compare(&plant, &row[1..], &mut e);
                next = rows.next();
            }
            sum += step;
            if std::env::var("EACH").is_ok() { report(&format!("random {number}"), &e); }
            for (m, e) in most.iter_mut().zip(e) { if !(e <= *m) { *m = e; } }
        }
        report(&format!("random ({sum} steps)"), &most);
    }
}
