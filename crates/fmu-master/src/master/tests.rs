//! What docs/simulate.md says of communication points, with the FMU of `tests/careless/strict.c`, which refuses to be read
//! between the setting of an input and the step.

use std::sync::OnceLock;

use anyhow::Result;

use crate::careless;
use crate::importer::Interface;
use crate::scenario::{Scenario, Tolerance};
use crate::{Fmu, LoadedFmus, Master, Run};

const DESCRIPTION: &str = include_str!("../../tests/careless/strict.xml");

fn library() -> &'static [u8] {
    static LIBRARY: OnceLock<Vec<u8>> = OnceLock::new();
    LIBRARY.get_or_init(|| careless::compiled("strict.c"))
}

/// Signal 1, 10, 100, 1000, 10000 at 0, 0.25, 0.5, 0.75 and 1 s.
const POWERS: &str = "{ steps = [[0, 1], [0.25, 10], [0.5, 100], [0.75, 1000], [1, 10000]] }";

/// A scenario, the FMU's members of which are in the file `it.fmu`.
fn with_scenario<T>(text: &str, then: impl FnOnce(Scenario) -> Result<T>) -> Result<T> {
    let folder = tempfile::tempdir()?;
    careless::write(&folder.path().join("it.fmu"), DESCRIPTION, library());
    then(Scenario::parse("it.toml", text, folder.path(), folder.path())?)
}

fn run(text: &str) -> Result<Run> {
    with_scenario(text, |scenario| Master::new(&scenario, &mut LoadedFmus::default())?.run(|_, _| ()))
}

/// A member of a scenario.
fn member(name: &str, interface: &str, more: &str) -> String {
    format!("[[fmu]]\nname = \"{name}\"\nfile = \"it.fmu\"\ninterface = \"{interface}\"\n{more}\n")
}

fn connection(from: &str, to: &str) -> String {
    format!("[[connection]]\nfrom = \"{from}\"\nto = \"{to}\"\n")
}

/// A column of a run.
fn values(run: &Run, name: &str) -> Vec<f64> {
    run.record.get(name).unwrap().to_vec()
}

/// The start of a scenario of steps of 0.25 s to 1 s.
fn head(record: &str) -> String {
    format!("step = 0.25\nstop_time = 1\nrecord = [{record}]\n")
}

fn refusal<T>(result: Result<T>) -> String {
    format!("{:#}", result.err().expect("it is refused"))
}

/// A sample at a point takes the input of the point in Model Exchange; in co-simulation it is part of the step.
#[test]
fn a_sample_at_a_point_takes_its_input() {
    for (interface, expected) in
        [("me", [1.0, 11.0, 111.0, 1111.0, 11111.0]), ("cs", [0.0, 1.0, 11.0, 111.0, 1111.0])]
    {
        let text = format!("{}{}[inputs]\nu = {POWERS}", head("\"sum\""), member("it", interface, ""));
        assert_eq!(values(&run(&text).unwrap(), "sum"), expected, "{interface}");
    }
}

/// A sampler that sums its times announces them up to 1.4e-12 s from the points; its samples are of the points all the same.
#[test]
fn samples_at_summed_times_take_the_input_of_the_point() {
    let text = format!(
        "step = 0.1\nstop_time = 100\nrecord = [\"sum\"]\n{}[inputs]\nu = {{ ramp = {{ from = 0, to = 1000, begin = 0, \
         end = 100 }} }}",
        member("it", "me", "values = { period = 0.1 }")
    );
    let sums = values(&run(&text).unwrap(), "sum");
    assert_eq!(sums.len(), 1001);
    for (point, sum) in sums.iter().enumerate() {
        let expected = (point * (point + 1) / 2) as f64;
        // The signal rounds in each of a thousand samples of up to 1000.
        assert!((sum - expected).abs() < 1e-9, "{sum} instead of {expected}");
    }
}

/// Whichever comes first, the sampler takes the source's output of the time of its sample.
#[test]
fn a_coupled_sampler_is_not_late_in_any_order() {
    for order in [["source", "sampler"], ["sampler", "source"]] {
        for stepping in ["in_turn", "at_once"] {
            let members = order.map(|name| member(name, "me", "")).concat();
            let text = format!(
                "stepping = \"{stepping}\"\n{}{members}{}{}[inputs]\nsignal = {POWERS}",
                head("\"source:y\", \"sampler:sum\", \"sampler:y\""),
                connection("signal", "source:u"),
                connection("source:y", "sampler:u")
            );
            let run = run(&text).unwrap();
            assert_eq!(values(&run, "sampler:sum"), [1.0, 11.0, 111.0, 1111.0, 11111.0], "{order:?}");
            assert_eq!(values(&run, "sampler:y"), values(&run, "source:y"), "{order:?}");
        }
    }
}

/// What the events of one change reaches the others at the same time.
#[test]
fn outputs_that_events_change_reach_the_others_at_the_point() {
    for order in [["one", "other"], ["other", "one"]] {
        let members = order.map(|name| member(name, "me", "")).concat();
        let text = format!(
            "{}{members}{}{}[inputs]\nsignal = {POWERS}",
            head("\"one:sum\", \"other:u\", \"other:y\""),
            connection("signal", "one:u"),
            connection("one:sum", "other:u")
        );
        let run = run(&text).unwrap();
        for name in ["one:sum", "other:u", "other:y"] {
            assert_eq!(values(&run, name), [1.0, 11.0, 111.0, 1111.0, 11111.0], "{name}");
        }
    }
}

#[test]
fn events_that_do_not_end_are_an_error() {
    let text = format!(
        "{}{}{}{}{}",
        head("\"one:y\""),
        member("one", "me", "values = { offset = 1.0 }"),
        member("other", "me", ""),
        connection("one:y", "other:u"),
        connection("other:y", "one:u")
    );
    let error = refusal(run(&text));
    assert!(error.starts_with("the events at 0 s do not end: after 1000 rounds"), "{error}");
}

/// A chain of three with direct feedthrough, under u = t.
#[test]
fn at_once_the_order_has_no_influence() {
    for order in [["a", "b", "c"], ["c", "b", "a"], ["b", "c", "a"]] {
        let members = order.map(|name| member(name, "cs", "")).concat();
        let text = format!(
            "step = 1\nstop_time = 4\nstepping = \"at_once\"\nrecord = [\"c:y\"]\n{members}{}{}{}\
             [inputs]\nu = {{ ramp = {{ from = 0, to = 4, begin = 0, end = 4 }} }}",
            connection("u", "a:u"),
            connection("a:y", "b:u"),
            connection("b:y", "c:u")
        );
        assert_eq!(values(&run(&text).unwrap(), "c:y"), [0.0, 0.0, 0.0, 0.0, 1.0], "{order:?}");
    }
}

/// A recorded input is the source's output of the row's time with the connection's noise, which is drawn once for each
/// point, and is not read back. In turn, the second FMU steps with the first one's output at the end and the same noise.
#[test]
fn a_recorded_input_is_its_connections_value() {
    let text = |stepping: &str, more: &str| {
        format!(
            "stepping = \"{stepping}\"\n{}{}{}{}{}[inputs]\nsignal = {POWERS}\n{more}",
            head("\"first:u\", \"first:y\", \"second:u\", \"second:y\""),
            member("first", "cs", ""),
            member("second", "cs", ""),
            connection("signal", "first:u"),
            connection("first:y", "second:u")
        )
    };
    for stepping in ["in_turn", "at_once"] {
        let clean = run(&text(stepping, "")).unwrap();
        assert_eq!(values(&clean, "first:u"), [1.0, 10.0, 100.0, 1000.0, 10000.0]);
        assert_eq!(values(&clean, "first:y"), [1.0, 1.0, 10.0, 100.0, 1000.0]);
        assert_eq!(values(&clean, "second:u"), values(&clean, "first:y"), "{stepping}");
        let run = run(&text(stepping, "[noise]\nu = { standard_deviation = 0.5, seed = 3 }")).unwrap();
        let [first, second, taken] = ["first:y", "second:u", "second:y"].map(|name| values(&run, name));
        assert_eq!(first, values(&clean, "first:y"), "the noise is on the other's connection");
        let noise: Vec<_> = second.iter().zip(&first).map(|(with, without)| with - without).collect();
        assert!((0..5).all(|row| noise[..row].iter().all(|other| *other != noise[row]) && noise[row] != 0.0));
        for row in 0..4 {
            let expected = match stepping {
                "in_turn" => first[row + 1] + noise[row],
                _ => second[row],
            };
            // The rounding of a sum of numbers below 10000.
            assert!((taken[row + 1] - expected).abs() < 1e-11, "{stepping}, row {row}");
        }
        // None in the initialization.
        assert_eq!(taken[0], 1.0);
    }
}

/// Noise on one FMU's input disturbs what a signal brings, for this FMU alone.
#[test]
fn noise_on_an_fmus_input_disturbs_its_signal() {
    let text = |noise: &str| {
        let members = ["sensor", "engine"].map(|name| member(name, "cs", "")).concat();
        let record = "\"sensor:u\", \"engine:u\", \"sensor:y\", \"engine:y\"";
        format!("{}{members}[inputs]\nu = {POWERS}\n[noise]\n{noise}", head(record))
    };
    let run = run(&text("\"sensor:u\" = { standard_deviation = 0.5, seed = 3 }")).unwrap();
    let [noisy, clean] = ["sensor:u", "engine:u"].map(|name| values(&run, name));
    assert_eq!(clean, [1.0, 10.0, 100.0, 1000.0, 10000.0]);
    for (index, (noisy, clean)) in noisy.iter().zip(&clean).enumerate() {
        // Five standard deviations.
        assert!(noisy != clean && (noisy - clean).abs() < 2.5, "{noisy} in row {index}");
    }
    assert_eq!(values(&run, "sensor:y")[1..], noisy[..4]);
    assert_eq!(values(&run, "engine:y")[1..], clean[..4]);
    let refused = with_scenario(&text("\"sensro:u\" = { standard_deviation = 1 }"), |scenario| {
        Master::new(&scenario, &mut LoadedFmus::default()).map(|_| ())
    });
    let message = refusal(refused);
    assert!(message.contains("no FMU gets sensro:u from another; did you mean sensor:u?"), "{message}");
}

/// A tunable parameter takes a signal of its own from the point of a change on; a fixed one is refused.
#[test]
fn a_signal_changes_a_tunable_parameter() {
    let own = |name: &str| format!("inputs = {{ {name} = {{ steps = [[0, 0], [0.5, 3]] }} }}");
    for (interface, expected) in [("me", [1.0, 1.0, 4.0, 4.0, 4.0]), ("cs", [1.0, 1.0, 1.0, 4.0, 4.0])] {
        let text = format!("{}{}[inputs]\nu = 1", head("\"y\""), member("it", interface, &own("offset")));
        assert_eq!(values(&run(&text).unwrap(), "y"), expected, "{interface}");
    }
    let text = format!("{}{}[inputs]\nu = 1", head("\"y\""), member("it", "cs", &own("period")));
    let message = refusal(run(&text));
    assert!(message.contains("no FMU has an input or a tunable parameter period"), "{message}");
}

/// A continuous input follows its signal within the step: with dx/dt = u the integral is exact, across a jump within a
/// step, too.
#[test]
fn continuous_inputs_follow_signals_in_model_exchange() {
    let cases = [
        ("{ ramp = { from = 0, to = 4, begin = 0, end = 1 } }", [0.0, 0.125, 0.5, 1.125, 2.0]),
        ("{ steps = [[0, 1], [0.3, 3]] }", [0.0, 0.25, 0.9, 1.65, 2.4]),
        ("{ steps = [[0, 1], [0.5, 3]] }", [0.0, 0.25, 0.5, 1.25, 2.0]),
    ];
    for (signal, expected) in cases {
        let text =
            format!("{}{}[inputs]\nu = {signal}", head("\"x\", \"it:u\", \"y\""), member("it", "me", ""));
        let run = run(&text).unwrap();
        for (x, expected) in values(&run, "x").iter().zip(expected) {
            // Rounding only: polynomials of the second degree are solved exactly.
            assert!((x - expected).abs() < 1e-12, "{signal}: {x}");
        }
        assert_eq!(values(&run, "it:u"), values(&run, "y"), "{signal}");
    }
}

/// Before an event inputs are those of the step that ended.
#[test]
fn rows_before_events_have_the_inputs_of_the_step() {
    let text = format!(
        "{}{}{}{}{}[inputs]\nsignal = {POWERS}",
        head("\"sampler:u\", \"sampler:sum\""),
        member("source", "cs", ""),
        member("sampler", "me", ""),
        connection("signal", "source:u"),
        connection("source:y", "sampler:u")
    );
    let record = with_scenario(&text, |scenario| {
        let mut master = Master::new(&scenario, &mut LoadedFmus::default())?;
        master.record_events();
        Ok(master.run(|_, _| ())?.record)
    });
    let record = record.unwrap();
    assert_eq!(record.time(), [0.0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.0, 1.0]);
    assert_eq!(record.get("sampler:u").unwrap(), [1.0, 1.0, 1.0, 1.0, 10.0, 10.0, 100.0, 100.0, 1000.0]);
    assert_eq!(record.get("sampler:sum").unwrap(), [1.0, 1.0, 2.0, 2.0, 12.0, 12.0, 112.0, 112.0, 1112.0]);
}

/// An input that follows a signal has the value before its jump in the row before an event there, at a communication point
/// and within a step.
#[test]
fn rows_before_events_have_the_value_before_a_jump_of_the_signal() {
    for step in [0.25, 0.5] {
        let text = format!(
            "step = {step}\nstop_time = 1\nrecord = [\"u\", \"sum\"]\n{}[inputs]\nu = {POWERS}",
            member("it", "me", "")
        );
        let record = with_scenario(&text, |scenario| {
            let mut master = Master::new(&scenario, &mut LoadedFmus::default())?;
            master.record_events();
            Ok(master.run(|_, _| ())?.record)
        });
        let record = record.unwrap();
        assert_eq!(record.time(), [0.0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1.0, 1.0]);
        let of_u = [1.0, 1.0, 10.0, 10.0, 100.0, 100.0, 1000.0, 1000.0, 10000.0];
        assert_eq!(record.get("u").unwrap(), of_u, "{step}");
        let of_sum = [1.0, 1.0, 11.0, 11.0, 111.0, 111.0, 1111.0, 1111.0, 11111.0];
        assert_eq!(record.get("sum").unwrap(), of_sum, "{step}");
    }
}

/// At 1.7e9 s doubles are 2.4e-7 s apart, and so is a point from the time that it means.
#[test]
fn late_points_take_the_signals_of_their_times() {
    let text = format!(
        "start_time = 1700000000\nstop_time = 1700000000.4\nstep = 0.1\nrecord = [\"u\", \"sum\"]\n{}[inputs]\n\
         u = {{ steps = [[1700000000, 1], [1700000000.1, 10], [1700000000.2, 100], [1700000000.3, 1000], \
         [1700000000.4, 10000]] }}",
        member("it", "cs", "")
    );
    let run = run(&text).unwrap();
    assert_eq!(values(&run, "u"), [1.0, 10.0, 100.0, 1000.0, 10000.0]);
    assert_eq!(values(&run, "sum"), [0.0, 1.0, 11.0, 111.0, 1111.0]);
}

/// What the end of a run-in sets belongs to the start's SET: nothing is read between it and the step.
#[test]
fn what_a_run_in_sets_at_its_end_is_set_after_the_reading() {
    let run_in = "run_in = { duration = 0.5, after = { offset = 2.0 } }";
    for (interface, expected) in [("cs", [3.0, 5.0, 5.0, 5.0, 5.0]), ("me", [5.0; 5])] {
        let text = format!("{}{}[inputs]\nu = 3.0", head("\"y\""), member("it", interface, run_in));
        assert_eq!(values(&run(&text).unwrap(), "y"), expected, "{interface}");
    }
}

/// Alone, an FMU that ends within a step has a row of that time; of several, the last row is one that all have reached.
#[test]
fn an_fmu_that_ends_within_a_step_has_no_row_of_others_times() {
    for interface in ["cs", "me"] {
        let ending = member("ending", interface, "values = { ends = 0.6 }");
        let alone = run(&format!("{}{ending}", head("\"sum\""))).unwrap();
        assert_eq!(
            (alone.record.time(), alone.ended.map(|end| end.time)),
            (&[0.0, 0.25, 0.5, 0.6][..], Some(0.6))
        );
        for has_other_first in [false, true] {
            let other = member("other", "cs", "");
            let members = if has_other_first { [&other, &ending] } else { [&ending, &other] };
            let text = format!("{}{}{}", head("\"other:x\""), members[0], members[1]);
            let text = format!("{text}[inputs]\nu = 1.0");
            let run = run(&text).unwrap();
            assert_eq!(
                (run.record.time(), run.ended.unwrap().time),
                (&[0.0, 0.25, 0.5][..], 0.6),
                "{interface}"
            );
            assert_eq!(run.record.get("other:x").unwrap(), [0.0, 0.25, 0.5]);
        }
    }
    // At a point that all reach.
    let text = format!(
        "{}{}{}",
        head("\"other:x\""),
        member("ending", "me", "values = { ends = 0.5 }"),
        member("other", "cs", "")
    );
    let run = run(&format!("{text}[inputs]\nu = 1.0")).unwrap();
    assert_eq!((run.record.get("other:x").unwrap(), run.ended.unwrap().time), (&[0.0, 0.25, 0.5][..], 0.5));
}

/// FMUs learn that no state before the present point is restored, unless one is saved.
#[test]
fn steps_say_that_nothing_goes_back() {
    for interface in [Interface::CoSimulation, Interface::ModelExchange] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("it.fmu");
        careless::write(&path, DESCRIPTION, library());
        let mut instance = Fmu::open_with(&path, Some(interface)).unwrap().instantiate("it").unwrap();
        instance.initialize(0.0, None).unwrap();
        instance.step(0.0, 0.2).unwrap();
        assert_eq!(instance.get("goes_back").unwrap(), 0.0, "{interface:?}");
        let saved = [instance.save().unwrap(), instance.save().unwrap()];
        instance.step(0.2, 0.02).unwrap();
        let [one, other] = saved;
        drop(one);
        instance.step(0.22, 0.02).unwrap();
        let told = instance.get("goes_back").unwrap();
        assert!(told >= 2.0, "{interface:?}");
        drop(other);
        instance.step(0.24, 0.001).unwrap();
        assert_eq!(instance.get("goes_back").unwrap(), told, "{interface:?}");
    }
}

/// The FMU refuses to step beyond its stop time by any rounding: 0.1 + 0.2 exceeds 0.3.
#[test]
fn the_stop_time_is_told_and_never_exceeded() {
    for (step, stop, count) in
        [(0.1, 0.3, 4), (0.1, 0.7, 8), (0.3, 1.0, 5), (0.7, 2.1, 4), (1e-3, 0.999, 1000)]
    {
        let text =
            format!("step = {step:?}\nstop_time = {stop:?}\nrecord = [\"stop\"]\n{}", member("it", "cs", ""));
        let run = run(&text).unwrap();
        assert_eq!(values(&run, "stop").last(), Some(&stop));
        assert_eq!(
            (run.record.time().len(), run.record.time().last()),
            (count, Some(&stop)),
            "{step}, {stop}"
        );
    }
    // Who steps by himself may go on.
    let text = format!("{}{}", head("\"stop\""), member("it", "cs", ""));
    with_scenario(&text, |scenario| {
        let mut master = Master::new(&scenario, &mut LoadedFmus::default())?;
        master.initialize()?;
        for _ in 0..6 {
            master.step()?;
        }
        assert_eq!((master.time(), master.record().get("stop")?[0]), (1.5, f64::INFINITY));
        Ok(())
    })
    .unwrap();
}

#[test]
fn the_tolerance_of_the_default_experiment_is_told() {
    let text = format!("{}{}", head("\"tolerance\""), member("it", "cs", ""));
    for (tolerance, told, notes) in
        [(Tolerance::OfFmu, 1e-7, 1), (Tolerance::Undefined, 0.0, 0), (Tolerance::Given(1e-3), 1e-3, 0)]
    {
        with_scenario(&text, |mut scenario| {
            scenario.tolerance = tolerance;
            let master = Master::new(&scenario, &mut LoadedFmus::default())?;
            assert_eq!(master.notes().len(), notes);
            assert_eq!(values(&master.run(|_, _| ())?, "tolerance")[0], told);
            Ok(())
        })
        .unwrap();
    }
}

#[test]
fn a_name_of_several_fmus_is_refused_and_a_pattern_means_all() {
    let members = member("a", "cs", "values = { offset = 7.0 }") + &member("b", "cs", "");
    let recorded = |record: &str| {
        let run = run(&format!("{}{members}", head(record)))?;
        Ok(run.record.columns().iter().map(|column| column.name.clone()).collect::<Vec<_>>())
    };
    for name in ["offset", "y", "u"] {
        let error = refusal(recorded(&format!("\"{name}\"")));
        assert_eq!(
            error,
            format!("it.toml, line 3, record[1]: several FMUs have {name}: use a:{name} or b:{name}")
        );
    }
    assert_eq!(recorded("\"a:y\", \"b:y\"").unwrap(), ["a:y", "b:y"]);
    assert_eq!(recorded("\"o*\"").unwrap(), ["a:offset", "b:offset"]);
    assert_eq!(recorded("\"b:s*\"").unwrap(), ["b:sum", "b:stop"]);
    assert_eq!(recorded("\"*\"").unwrap().len(), 2 * 14);
}

/// What an input takes of a signal with one value after the other, and the error for what it does not take.
#[test]
fn numbers_into_integers_booleans_and_enumerations_fit_or_are_refused() {
    let text = |input: &str, second: f64, more: &str| {
        format!(
            "step = 1\nstop_time = 2\nrecord = [\"{input}\"]\n{}[[connection]]\nfrom = \"s\"\nto = \"it:{input}\"\n{more}\n\
             [inputs]\ns = {{ steps = [[0, 1], [1, {second:?}]] }}",
            member("it", "cs", "")
        )
    };
    for (input, second, more, expected) in [
        ("count", -3.0, "", Ok(-3.0)),
        ("count", 2.7, "", Err("2.7 is not a whole number")),
        ("count", 4e9, "", Err("4000000000 is not within -2147483648..2147483647")),
        ("count", 1.5, "factor = 2", Ok(3.0)),
        ("flag", 0.0, "", Ok(0.0)),
        (
            "flag",
            0.9,
            "",
            Err("0.9 is neither 0 nor 1; a connection's threshold makes it true from there on"),
        ),
        ("flag", 0.9, "threshold = 0.5", Ok(1.0)),
        ("flag", 0.4, "threshold = 0.5", Ok(0.0)),
        ("flag", 5.0, "table = [[5, 0]]", Ok(0.0)),
        ("gear", 7.0, "", Ok(7.0)),
        ("gear", 0.0, "", Err("0 is no item: 1 (park), 2 (reverse), 7 (drive)")),
    ] {
        let result = run(&text(input, second, more));
        match expected {
            Ok(taken) => assert_eq!(values(&result.unwrap(), input)[1], taken, "{input}, {second}"),
            Err(reason) => {
                assert_eq!(refusal(result), format!("s to it:{input} at 1 s: {reason}"), "{input}, {second}");
            }
        }
    }
    let error = refusal(run(&text("u", 1.0, "threshold = 0.5")));
    assert!(error.ends_with("a threshold is for a Boolean; u is of the type Real"), "{error}");
}
