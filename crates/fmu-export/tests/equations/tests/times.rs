//! Instants: the zeros, ticks and samples of models are as many as there are, and when they are, however an importer
//! computes its communication points and however late they are.

use fmu_export::{Integrated, Model, SampledModel, Simulation, Task, calibration};
use fmu_export_equations::{
    Alarms, Alarms3, ReadingTicks, ReadingTicks3, TickSamples, TickSamples3, Ticks, Ticks3, Waves, Waves3,
};
use fmu_terms::InstanceType::{self, CoSimulation, CoSimulationWithEvents, ModelExchange};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::Rng;

use crate::importer::Importer;

/// How an importer computes its communication points.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Clock {
    /// Start plus multiples of the step; without a start the multiples themselves.
    Multiples,
    /// Sums of the steps.
    Sums,
    /// Start plus whole nanoseconds.
    Nanoseconds,
}

const EXACT: [Clock; 2] = [Clock::Multiples, Clock::Sums];

/// The steps of an experiment, each a time and a size (s): one of a share of the size first, if that is not 0, then a
/// number of whole ones, and half of one.
fn steps(
    clock: Clock,
    (origin, size): (f64, f64),
    lead: f64,
    number: u32,
) -> impl Iterator<Item = (f64, f64)> {
    let mut sum = origin - lead * size;
    let first = (lead > 0.0).then_some((sum, lead * size));
    sum += lead * size;
    let whole = (0..=number).map(move |step| {
        let elapsed = f64::from(step) * size;
        let time = match clock {
            Clock::Multiples => origin + elapsed,
            Clock::Sums => sum,
            Clock::Nanoseconds => origin + (elapsed * 1e9).round() / 1e9,
        };
        sum += size;
        (time, if step < number { size } else { 0.5 * size })
    });
    first.into_iter().chain(whole)
}

/// The rounding of a time (s): what is computed from it in three operations, each of which rounds by half of this.
fn rounding(time: f64) -> f64 {
    1.5 * f64::EPSILON * time.abs()
}

/// Steps and starts (s) of the tests.
const SIZES: [f64; 4] = [1.0 / 1024.0, 0.1, 1.0 / 3.0, 1e-3];
const STARTS: [f64; 3] = [0.0, 1e5, 1.7e9];

/// A wave with zeros at all communication points: each is one event, at its time.
fn check_waves<M: Model>(clock: Clock, origin: f64, size: f64, number: u32) {
    let with_events = !Importer::<M>::IS_FMI2;
    let mut importer = Importer::<M>::new(if with_events { CoSimulationWithEvents } else { CoSimulation });
    importer.set(Importer::<M>::reference("distance"), size);
    importer.enter_initialization_at(origin - 0.5 * size, None);
    importer.exit_initialization();
    if with_events {
        importer.update_all();
        importer.leave_event_mode();
    }
    let mut end = origin;
    for (time, size) in steps(clock, (origin, size), 0.5, number) {
        end = time + size;
        let mut reached = time;
        while reached < end {
            let (event, time) = importer.step(reached, if reached > time { end - reached } else { size });
            reached = time;
            if event {
                importer.enter_event_mode();
                importer.update_all();
                importer.leave_event_mode();
            }
        }
    }
    let of = format!("{clock:?} from {origin} s by {size} s");
    let [zeros, error] = importer.get(["zeros", "error"]);
    // Those between start and end, which are half a step off.
    let expected = ((end - origin) / size).floor() + 1.0;
    assert!((zeros - expected).abs() < 0.5, "{zeros} of {expected} zeros: {of}");
    // The zero of the computed sine, its nominal time, and the next number after it.
    let mut most = 2.0 * rounding(end) + f64::EPSILON * end.abs();
    if clock == Clock::Nanoseconds {
        most += 0.5e-9;
    }
    assert!(error <= most, "{error} s, more than {most} s: {of}");
}

/// Each way, start and step, with this many steps or those of a day.
fn check_all_waves(number: impl Fn(f64) -> u32) {
    for clock in EXACT {
        for origin in STARTS {
            for size in SIZES {
                check_waves::<Integrated<Waves>>(clock, origin, size, number(size));
                check_waves::<Integrated<Waves3>>(clock, origin, size, number(size));
            }
        }
    }
}

/// A day of long steps, a million short ones.
fn in_a_release(size: f64) -> u32 {
    if size > 0.2 {
        259_200
    } else if size > 0.05 {
        864_000
    } else {
        1_000_000
    }
}

#[test]
fn each_zero_is_an_event() {
    check_all_waves(|_| 200);
    for origin in STARTS {
        check_waves::<Integrated<Waves>>(Clock::Nanoseconds, origin, 1.0 / 3.0, 200);
    }
}

#[test]
#[ignore = "some minutes; part of `tests/run release`"]
fn each_zero_of_a_day_is_an_event() {
    check_all_waves(in_a_release);
}

/// A run whose ticks are counted.
#[derive(Clone, Copy, Debug)]
struct Ticking {
    instance_type: InstanceType,
    clock: Clock,
    origin: f64,
    size: f64,
    period: f64,
    number: u32,
}

impl Ticking {
    /// Number of ticks, time of the last, and how late and early they were at most with respect to their steps (s).
    fn run<M: Model>(self) -> [f64; 4] {
        let Self { instance_type, clock, origin, size, period, number } = self;
        let begin = Importer::<M>::reference("begin");
        let mut importer = Importer::<M>::new(instance_type);
        importer.set(Importer::<M>::reference("period"), period);
        importer.set(begin, origin);
        importer.enter_initialization_at(origin, None);
        importer.exit_initialization();
        if instance_type != CoSimulation {
            importer.update_all();
            importer.leave_event_mode();
        }
        for (time, size) in steps(clock, (origin, size), 0.0, number) {
            importer.set(begin, time);
            match instance_type {
                CoSimulation => {
                    importer.step(time, size);
                }
                ModelExchange => {
                    // An importer that has an event at each point, and at each time that is announced.
                    let mut next = Some(time);
                    while let Some(to) = next.filter(|next| *next < time + size) {
                        importer.set_time(to);
                        importer.enter_event_mode();
                        importer.set(begin, to);
                        next = importer.update_all();
                        importer.leave_event_mode();
                    }
                }
                _ => {
                    let (end, mut reached) = (time + size, time);
                    while reached < end {
                        let (event, to) =
                            importer.step(reached, if reached > time { end - reached } else { size });
                        reached = to;
                        if event {
                            importer.enter_event_mode();
                            importer.set(begin, reached);
                            importer.update_all();
                            importer.leave_event_mode();
                        }
                    }
                }
            }
        }
        importer.get(["number", "last", "late", "early"])
    }
}

/// Ticks at each third communication point: all of them, at their very times.
fn check_ticks<M: Model>(instance_type: InstanceType, reads: bool, number: impl Fn(f64) -> u32) {
    for clock in EXACT {
        for origin in STARTS {
            for size in SIZES {
                let (number, period) = (number(size) / 3 * 3, 3.0 * size);
                let run = Ticking { instance_type, clock, origin, size, period, number };
                let [ticks, last, late, early] = run.run::<M>();
                let end = steps(clock, (origin, size), 0.0, number).last().map_or(origin, |(time, _)| time);
                // Sums of steps stray from the multiples: by half a unit in the last place each.
                let strays = match clock {
                    Clock::Sums => 0.5 * f64::EPSILON * end.abs() * f64::from(number),
                    _ => 0.0,
                };
                let expected = ((end + 0.5 * size - origin) / period).floor() + 1.0;
                assert!((ticks - expected).abs() < 0.5, "{ticks} of {expected} ticks: {run:?}");
                assert!(
                    (last - (origin + (ticks - 1.0) * period)).abs() <= 0.0,
                    "the last at {last} s: {run:?}"
                );
                // Where steps stray by more than a twentieth of one, a tick is in the step that has its time.
                let allowed = 2.0 * rounding(end) + strays;
                assert!(late <= allowed.min(2.0 * rounding(end) + 0.05 * size), "{late} s late: {run:?}");
                if reads {
                    assert!(early <= allowed.min(size), "{early} s early: {run:?}");
                }
            }
        }
    }
}

/// In all interfaces, those that sample inputs in the steps that begin at them.
fn check_all_ticks(number: impl Fn(f64) -> u32) {
    check_ticks::<Integrated<Ticks>>(CoSimulation, false, &number);
    check_ticks::<Integrated<ReadingTicks>>(CoSimulation, true, &number);
    check_ticks::<SampledModel<TickSamples>>(CoSimulation, true, &number);
    check_ticks::<Integrated<Ticks>>(ModelExchange, true, &number);
    check_ticks::<SampledModel<TickSamples>>(ModelExchange, true, &number);
    check_ticks::<Integrated<Ticks3>>(CoSimulationWithEvents, true, &number);
    check_ticks::<Integrated<ReadingTicks3>>(CoSimulationWithEvents, true, &number);
    check_ticks::<SampledModel<TickSamples3>>(CoSimulationWithEvents, true, &number);
}

#[test]
fn each_tick_is_in_the_step_that_begins_at_it() {
    check_all_ticks(|_| 999);
}

#[test]
#[ignore = "a minute; part of `tests/run release`"]
fn each_tick_of_a_day_is_in_the_step_that_begins_at_it() {
    check_all_ticks(in_a_release);
}

/// Periods and steps that have nothing in common.
fn check_random(cases: u32) {
    let mut random = Pcg64Mcg::new(58);
    let mut draw = move || random.next_u32();
    for case in 0..cases {
        let mut uniform = || (f64::from(draw()) + 0.5) / 4_294_967_296.0;
        let size = 10.0_f64.powf(-3.0 + 3.0 * uniform());
        let period = size * 10.0_f64.powf(-1.0 + 2.0 * uniform());
        let (origin, clock) = (STARTS[case as usize % 3], EXACT[case as usize / 3 % 2]);
        let number = 50 + draw() % 200;
        let run = Ticking { instance_type: CoSimulation, clock, origin, size, period, number };
        let (last, rest) = steps(clock, (origin, size), 0.0, number).last().expect("there is one");
        let share = (last + rest - origin) / period;
        let strays = 3.0 * rounding(last) + f64::from(number) * f64::EPSILON * last;
        if (share - share.round()).abs() * period < strays {
            continue; // the end cannot be told from a tick
        }
        for [ticks, _, late, early] in
            [run.run::<Integrated<ReadingTicks>>(), run.run::<SampledModel<TickSamples>>()]
        {
            assert!((ticks - share.ceil()).abs() < 0.5, "{ticks} of {} ticks: {run:?}", share.ceil());
            assert!(late <= strays && early <= size + strays, "{late} s late, {early} s early: {run:?}");
        }
    }
}

#[test]
fn random_ticks_are_in_the_steps_that_have_them() {
    check_random(60);
}

#[test]
#[ignore = "part of `tests/run release`"]
fn many_random_ticks_are_in_the_steps_that_have_them() {
    check_random(20_000);
}

/// A run's last step ends at its stop time, though its sum is later.
#[test]
fn the_last_of_summed_steps_is_within_the_experiment() {
    let (start, size, number) = (1e5, 0.1, 25_000);
    let stop = start + size * f64::from(number);
    let mut importer = Importer::<SampledModel<TickSamples>>::new(CoSimulation);
    importer.enter_initialization_at(start, Some(stop));
    importer.exit_initialization();
    let mut time = start;
    for _ in 0..number {
        importer.step(time, size);
        time += size;
    }
    assert!(time > stop + 1e-6 * size, "{time} s");
}

#[test]
fn many_regular_time_events_are_in_one_step() {
    let mut simulation = Simulation::<Integrated<Ticks>>::default();
    simulation.variables.parameters.period = 0.1;
    simulation.initialize().unwrap();
    simulation.step(20_000.0).unwrap();
    assert!((simulation.variables.outputs.number - 200_001.0).abs() < 0.5);
    // Those that accumulate are refused.
    let mut simulation = Simulation::<Integrated<Ticks>>::default();
    simulation.variables.parameters.period = 1e-9;
    simulation.initialize().unwrap();
    let error = simulation.step(1.0).unwrap_err().to_string();
    assert!(error.ends_with("are events, which come ever faster, the last caused by time events"), "{error}");
}

/// Each event has the status OK, and one tick.
#[test]
fn late_ticks_of_model_exchange_are_one_by_one() {
    fn check<M: Model>() {
        for period in [0.1, 1e-3, 1e-6] {
            let start = 1.7e9;
            let mut importer = Importer::<M>::new(ModelExchange);
            importer.set(Importer::<M>::reference("period"), period);
            importer.enter_initialization_at(start, None);
            importer.exit_initialization();
            let mut next = importer.update_all();
            importer.leave_event_mode();
            for tick in 1..1500 {
                let expected = start + f64::from(tick) * period;
                assert_eq!(next, Some(expected), "after {tick} ticks");
                let [number, last] = importer.get(["number", "last"]);
                assert_eq!((number, last), (f64::from(tick), start + f64::from(tick - 1) * period));
                importer.set_time(expected);
                importer.enter_event_mode();
                next = importer.update_all();
                importer.leave_event_mode();
            }
        }
    }
    check::<Integrated<Ticks>>();
    check::<SampledModel<TickSamples>>();
    check::<Integrated<Ticks3>>();
    check::<SampledModel<TickSamples3>>();
}

#[test]
fn a_period_that_is_lost_in_the_rounding_of_the_start_is_refused() {
    for (start, shown) in [(1e300, "1e300"), (-1e300, "-1e300"), (1e17, "1e17")] {
        let mut simulation = Simulation::<SampledModel<TickSamples>>::default();
        simulation.experiment.start_time = start;
        assert_eq!(
            simulation.initialize().unwrap_err().to_string(),
            format!("the sample period is 1 s, which is lost in the rounding of the start time {shown} s")
        );
    }
}

/// However often the period of a task changes between two samples, the next one is the present period after the last one.
/// Periods are powers of 2, so that times have no rounding.
#[test]
#[allow(clippy::float_cmp, reason = "as computed without rounding")]
fn the_samples_of_a_task_follow_all_changes_of_the_period() {
    let mut log = |_: &'static str, _: core::fmt::Arguments<'_>| {};
    let mut task = Task::<TickSamples>::default();
    let mut page: Vec<_> = calibration::page(&task.variables).collect();
    let before = page.clone();
    task.variables.parameters.period = 0.125;
    let cell =
        calibration::page(&task.variables).zip(&before).position(|(one, other)| one != *other).unwrap();
    page[cell] = 0.125_f64.to_bits();
    task.initialize(&mut log).unwrap();
    let mut random = Pcg64Mcg::new(5);
    let mut below = |most: u32| random.next_u32() % most;
    let (mut last, mut period) = (None, 0.125);
    for number in 0..10_000 {
        for _ in 0..below(4) {
            period = 0.5_f64.powi(below(6).cast_signed());
            page[cell] = period.to_bits();
            task.take_page(&page).unwrap();
        }
        let expected = last.map_or(0.0, |last: f64| last + period);
        task.sample(&mut log).unwrap();
        assert_eq!(task.variables.outputs.last, expected, "{number}");
        last = Some(expected);
    }
    // What is no period is refused, and changes nothing.
    for wrong in [0.0, -1.0, f64::NAN] {
        page[cell] = f64::to_bits(wrong);
        assert!(task.take_page(&page).is_err());
    }
    task.sample(&mut log).unwrap();
    assert_eq!(task.variables.outputs.last, last.unwrap() + period);
}

/// When the ticks of a period come that changes (s): a new period after the last one, or at once if that has passed.
fn retimed(changes: &[(f64, f64)], end: f64) -> Vec<f64> {
    let (mut period, mut ticks) = (0.125, vec![0.0]);
    let mut changes = changes.iter().peekable();
    loop {
        let mut next = ticks[ticks.len() - 1] + period;
        while let Some((at, to)) = changes.next_if(|(at, _)| *at <= next) {
            // A tick that is due as the period changes comes first.
            if next <= *at {
                ticks.push(next);
            }
            period = *to;
            next = (ticks[ticks.len() - 1] + period).max(*at);
        }
        if next > end {
            return ticks;
        }
        ticks.push(next);
    }
}

/// Times and periods are sums of powers of 2, computed without rounding.
#[test]
#[allow(clippy::float_cmp, reason = "as computed without rounding")]
fn a_sample_period_follows_a_tunable_parameter() {
    fn check<M: Model>(instance_type: InstanceType) {
        const STEP: f64 = 1.0 / 128.0;
        let changes =
            [(1.0 + 1.0 / 64.0, 0.0625), (2.0 + 5.0 / 128.0, 1.0 / 64.0), (2.5, 0.25), (2.6875, 0.375)];
        let expected = retimed(&changes, 4.0);
        assert!([1.0625, 2.0 + 5.0 / 128.0, 2.75, 3.0625].iter().any(|tick| expected.contains(tick)));
        let mut importer = Importer::<M>::new(instance_type);
        let period = Importer::<M>::reference("period");
        importer.set(period, 0.125);
        importer.enter_initialization_at(0.0, None);
        importer.exit_initialization();
        if instance_type != CoSimulation {
            importer.update_all();
            importer.leave_event_mode();
        }
        for step in 0..512 {
            let (time, end) = (f64::from(step) * STEP, f64::from(step + 1) * STEP);
            let change = changes.iter().find(|(at, _)| *at == time).map(|(_, to)| *to);
            if instance_type == ModelExchange {
                importer.set_time(time);
                importer.enter_event_mode();
                // What is due comes first.
                importer.update_all();
                if let Some(change) = change {
                    assert!(importer.set(period, change));
                    importer.update_all();
                }
                importer.leave_event_mode();
            } else {
                if let Some(change) = change {
                    assert!(importer.set(period, change));
                }
                let mut reached = time;
                while reached < end {
                    let (event, to) = importer.step(reached, end - reached);
                    reached = to;
                    if event {
                        importer.enter_event_mode();
                        importer.update_all();
                        importer.leave_event_mode();
                    }
                }
            }
            // A sample at the end of a step belongs to the next one, unless it is an event.
            let is_had = |tick: &&f64| match instance_type {
                CoSimulation => **tick < end,
                ModelExchange => **tick <= time,
                // A change at the end moves a sample there.
                _ => **tick < end || **tick == end && changes.iter().all(|(at, _)| *at != end),
            };
            let had: Vec<_> = expected.iter().filter(is_had).collect();
            let [number, last] = importer.get(["number", "last"]);
            assert_eq!(
                (number, last),
                (had.len() as f64, *had[had.len() - 1]),
                "{instance_type:?} at {time} s"
            );
        }
    }
    check::<SampledModel<TickSamples>>(CoSimulation);
    check::<SampledModel<TickSamples3>>(CoSimulation);
    check::<SampledModel<TickSamples>>(ModelExchange);
    check::<SampledModel<TickSamples3>>(ModelExchange);
    check::<SampledModel<TickSamples3>>(CoSimulationWithEvents);
}

/// Alarms at times that a parameter and an input determine, which are set between steps of half a second: when each is
/// set, and to what (s), and when it must come.
#[test]
#[allow(clippy::float_cmp, reason = "as computed without rounding")]
fn a_time_event_moves_with_what_determines_it() {
    fn check<M: Model>(
        instance_type: InstanceType,
        names: [&str; 2],
        settings: &[(f64, f64)],
        expected: f64,
    ) {
        let [name, since] = names;
        let variable = Importer::<M>::reference(name);
        for reads in [true, false] {
            let mut importer = Importer::<M>::new(instance_type);
            importer.initialize();
            if instance_type != CoSimulation {
                importer.update_all();
                importer.leave_event_mode();
            }
            let (mut time, mut next) = (0.0, None);
            while time < 10.0 {
                let setting = settings.iter().find(|(at, _)| *at == time);
                if instance_type == ModelExchange {
                    if setting.is_some() || next == Some(time) {
                        importer.enter_event_mode();
                        if let Some((_, to)) = setting {
                            assert!(importer.set(variable, *to));
                        }
                        next = importer.update_all();
                        importer.leave_event_mode();
                    }
                    let at = settings.iter().map(|(at, _)| *at).chain(next).filter(|at| *at > time);
                    time = at.fold(10.0, f64::min);
                    importer.set_time(time);
                    continue;
                }
                if let Some((_, to)) = setting {
                    assert!(importer.set(variable, *to));
                    if reads {
                        importer.get(["x"]);
                    }
                    importer = importer.restored();
                }
                let end = (2.0 * time).floor() / 2.0 + 0.5;
                let (event, reached) = importer.step(time, end - time);
                time = reached;
                if event {
                    importer.enter_event_mode();
                    importer.update_all();
                    importer.leave_event_mode();
                }
            }
            let of = format!("{names:?} {settings:?} in {instance_type:?}");
            assert_eq!(importer.get([since]), [expected], "{of}");
            if instance_type != ModelExchange {
                // The rate is 1 from the parameter's alarm on, which is at 6 s unless it is moved.
                let on = if name == "when" { expected } else { 6.0 };
                assert!((importer.get(["x"])[0] - (10.0 - on)).abs() < 1e-6, "{of}");
            }
        }
    }
    /// The alarm of the parameter, and that of the input.
    const ALARMS: [[&str; 2]; 2] = [["when", "since"], ["when_in", "since_in"]];
    for names in ALARMS {
        for (settings, expected) in [
            (&[(1.0, 2.25)][..], 2.25),
            (&[(1.0, 2.0)], 2.0),
            (&[(1.0, 9.25)], 9.25),
            // To now, and to before.
            (&[(3.0, 3.0)], 3.0),
            (&[(4.5, 2.0)], 4.5),
            (&[(1.0, 7.0), (2.0, 3.25), (3.0, 5.0)], 5.0),
        ] {
            check::<Integrated<Alarms>>(CoSimulation, names, settings, expected);
            check::<Integrated<Alarms3>>(CoSimulation, names, settings, expected);
            check::<Integrated<Alarms3>>(CoSimulationWithEvents, names, settings, expected);
            check::<Integrated<Alarms>>(ModelExchange, names, settings, expected);
            check::<Integrated<Alarms3>>(ModelExchange, names, settings, expected);
        }
    }
}
