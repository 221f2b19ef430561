//! FMUs that ask for the end, names of several FMUs, and what FMUs are told, with the FMU of `strict.c`.

use crate::{Bench, careless, last};

const DESCRIPTION: &str = include_str!("../../../fmu-master/tests/careless/strict.xml");

/// A folder with the FMU, alone in a scenario, under u = 1.
fn bench() -> Bench {
    let bench = Bench(tempfile::tempdir().unwrap());
    careless::write(&bench.path("careless.fmu"), DESCRIPTION, &careless::compiled("strict.c"));
    bench.scenario(1.0, "[inputs]\nu = 1.0\n");
    bench
}

/// As dx/dt = 1, the last row of a run that ends at 0.6 s has x = 0.6.
#[test]
fn a_run_that_its_fmu_ends_is_a_row_with_measures_of_what_there_is() {
    let bench = bench();
    bench.write(
        "study.toml",
        "scenario = \"scenario.toml\"\n[grid]\n\"alone:ends\" = [0.6, 1e9]\n[measures]\nlast = { final = \"x\" }\n\
         mean = { mean = \"x\", to = 0.25 }\nlate = { maximum = \"x\", from = 0.75 }\n",
    );
    bench.succeeds(&["sweep", "study.toml", "--out", "out"]);
    let results = bench.read("out/results.csv");
    let rows: Vec<_> = results.lines().filter(|line| !line.starts_with('#')).skip(1).collect();
    assert_eq!(
        rows,
        ["0,0.6,0.6,0.125,,,alone: ended at 0.6 s", "1,1000000000.0,1.0,0.125,1.0,,"],
        "{results}"
    );
}

/// A measure of what two FMUs have would be the first one's.
#[test]
fn a_measure_of_several_fmus_is_refused() {
    let bench = bench();
    bench.scenario(1.0, "[[fmu]]\nname = \"other\"\nfile = \"careless.fmu\"\n[inputs]\nu = 1.0\n");
    let study = "scenario = \"scenario.toml\"\n[grid]\n\"other:offset\" = [1.0, 2.0]\n[measures]\nlast = { final = \"y\" }\n";
    bench.write("study.toml", study);
    let refused = bench.refusal(&["sweep", "study.toml", "--out", "out"]);
    assert!(refused.contains("several FMUs have y: use alone:y or other:y"), "{refused}");
    bench.write("study.toml", &study.replace("final = \"y\"", "final = \"other:y\""));
    bench.succeeds(&["sweep", "study.toml", "--out", "out"]);
    assert!(bench.read("out/results.csv").lines().any(|line| line.starts_with("1,2.0,3.0")));
}

#[test]
fn the_tolerance_of_the_default_experiment_is_passed_with_a_note() {
    let bench = bench();
    for (option, told, has_note) in
        [(None, 1e-7, true), (Some("none"), 0.0, false), (Some("1e-3"), 1e-3, false)]
    {
        let mut arguments = vec!["simulate", "careless.fmu", "--record", "tolerance", "--out", "a.csv"];
        arguments.extend(option.into_iter().flat_map(|option| ["--tolerance", option]));
        let printed = String::from_utf8(bench.command(&arguments).output().unwrap().stderr).unwrap();
        assert_eq!(printed.contains("tolerance 1e-7, of the DefaultExperiment"), has_note, "{printed}");
        assert_eq!(last(&bench.read("a.csv")).to_bits(), f64::to_bits(told), "{option:?}");
    }
}
