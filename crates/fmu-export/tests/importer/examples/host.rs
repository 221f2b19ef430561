//! A process with FMUs of FMI 2.0, whose memory and floating-point environment are looked at from outside; on Linux.
//!
//! - `host run ENVIRONMENT FMU...` loads FMUs side by side, steps them in turn, saves, restores and resets them, and makes
//!   wrong calls. Prints the bytes of their states. ENVIRONMENT is `default`, or what the process has set: `traps`, `upward`.
//! - `host cycle CYCLES KEEP LEAK FMU` loads, runs and unloads a library again and again; with KEEP it stays loaded. Prints,
//!   after each quarter of the cycles, the bytes that are allocated and the number of mappings. LEAK bytes are lost in each
//!   cycle; where LEAK is `instance`, an instance is.

use std::ffi::c_int;
use std::path::Path;
use std::{env, fs, mem};

use fmu_importer::arguments::reference;
use fmu_importer::{Argument, Fmu, Instance, State, Status, Whim};
use fmu_terms::InstanceType;

/// glibc's `mallinfo2`.
#[repr(C)]
struct Allocated {
    _before: [usize; 4],
    hblkhd: usize,
    _between: [usize; 2],
    uordblks: usize,
    _after: [usize; 2],
}

#[link(name = "m")]
unsafe extern "C" {
    safe fn mallinfo2() -> Allocated;
    safe fn feenableexcept(traps: c_int) -> c_int;
    safe fn fegetexcept() -> c_int;
    safe fn fesetround(rounding: c_int) -> c_int;
    safe fn fegetround() -> c_int;
}

/// `FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW` and `FE_UPWARD` of x86-64.
const TRAPS: c_int = 0x4 | 0x1 | 0x8;
const UPWARD: c_int = 0x800;

fn open(path: &str) -> Fmu {
    Fmu::open(Path::new(""), path)
}

fn steps(instance: &mut Instance<'_>, count: usize) {
    for _ in 0..count {
        instance.ok("DoStep");
    }
}

/// Each call is an error. The second number traps where it is compared with `FE_INVALID` enabled.
fn provoke(instance: &mut Instance<'_>) {
    let input = instance
        .fmu
        .variables("Real")
        .find(|variable| variable.causality == fmu_terms::Causality::Input)
        .map(reference);
    for bits in [f64::NAN.to_bits(), 0x7ff0_0000_0000_0001] {
        let arguments = [Argument::of(&[input.unwrap()]), Argument::Whole(1), Argument::of(&[bits])];
        assert_eq!(instance.call(instance.fmu.function("SetReal"), &arguments).0, Status::Error);
    }
    let late = [Argument::Number(1e3), Argument::Number(0.125), Argument::Whole(1)];
    assert_eq!(instance.call(instance.fmu.function("DoStep"), &late).0, Status::Error);
    assert_eq!(instance.call_with("EnterInitializationMode", &mut Whim::none()).0, Status::Error);
    let damaged = [&instance.snapshot().0[..], b"abc"].concat();
    assert_eq!(instance.deserialize(&damaged), Err(Status::Error));
}

/// From the start to a number of steps, and once back to a state saved halfway: the bytes of the last state.
fn run(instances: &mut [Instance<'_>], count: usize) -> Vec<Vec<u8>> {
    for instance in &mut *instances {
        for function in ["SetupExperiment", "EnterInitializationMode", "ExitInitializationMode"] {
            instance.ok(function);
        }
    }
    let in_turn = |instances: &mut [Instance<'_>], count: usize| {
        for _ in 0..count {
            for instance in &mut *instances {
                steps(instance, 1);
            }
        }
    };
    in_turn(instances, count / 2);
    let halfway: Vec<_> = instances.iter_mut().map(Instance::snapshot).collect();
    let mut ends = [vec![], vec![]];
    for end in &mut ends {
        in_turn(instances, count - count / 2);
        *end = instances.iter_mut().map(|instance| instance.snapshot().0).collect();
        for (instance, state) in instances.iter_mut().zip(&halfway) {
            instance.restore(state);
        }
    }
    assert!(ends[0] == ends[1]);
    mem::take(&mut ends[0])
}

fn side_by_side(environment: &str, paths: &[String]) {
    let (traps, rounding) = match environment {
        "traps" => (TRAPS, 0),
        "upward" => (0, UPWARD),
        _ => (0, 0),
    };
    let fmus: Vec<_> = paths.iter().map(|path| open(path)).collect();
    feenableexcept(traps);
    fesetround(rounding);
    let mut instances: Vec<_> =
        fmus.iter().map(|fmu| Instance::new(fmu, InstanceType::CoSimulation)).collect();
    let ends = run(&mut instances, 40);
    for instance in &mut instances {
        provoke(instance);
        instance.ok("Reset");
    }
    assert!(run(&mut instances, 40) == ends);
    // FMI 2.0.5, section 2.1.1: an FMU does not change these settings.
    assert_eq!((fegetexcept(), fegetround()), (traps, rounding));
    for instance in &mut instances {
        instance.ok("Terminate");
        // Freed with the instance (section 2.1.5, fmi2FreeInstance).
        instance.save();
    }
    for bytes in ends {
        println!("{bytes:?}");
    }
}

/// A library that is not loaded has no mapping.
fn report(fmu: &Fmu, is_loaded: bool) {
    let maps = fs::read_to_string("/proc/self/maps").unwrap();
    assert_eq!(
        maps.contains(fmu.path.file_name().unwrap().to_str().unwrap()),
        is_loaded,
        "found in the process"
    );
    let heap = mallinfo2();
    println!("{} {}", heap.uordblks + heap.hblkhd, maps.lines().count());
}

fn cycle(cycles: usize, keep: bool, leak: &str, path: &str) {
    let mut fmu = open(path);
    for index in 1..=cycles {
        let mut instance = Instance::in_state(&fmu, InstanceType::CoSimulation, State::StepComplete).unwrap();
        steps(&mut instance, 2);
        let saved = instance.snapshot();
        steps(&mut instance, 1);
        instance.restore(&saved);
        provoke(&mut instance);
        instance.save();
        if leak == "instance" {
            mem::forget(instance);
        } else {
            drop(instance);
            mem::forget(vec![1_u8; leak.parse().unwrap()]);
        }
        if !keep {
            fmu.unload();
        }
        if index % (cycles / 4) == 0 {
            report(&fmu, keep);
        }
        if !keep {
            fmu.load();
        }
    }
}

fn main() {
    let arguments: Vec<String> = env::args().skip(1).collect();
    match &arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["run", environment, ..] => side_by_side(environment, &arguments[2..]),
        ["cycle", cycles, keep, leak, fmu] => cycle(cycles.parse().unwrap(), *keep == "1", leak, fmu),
        _ => panic!("usage: see host.rs"),
    }
}
