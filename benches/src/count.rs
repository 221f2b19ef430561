//! Runs each benchmark once under valgrind, which counts the instructions; `benches/run` does so.
//!
//! Prints group, implementation and repetitions, in the order in which [`counted`] returns.

use std::hint::black_box;

use benches::benchmarks::{Subject, all};

/// Valgrind counts the instructions in calls of this function, and no others.
#[inline(never)]
fn counted(subject: &mut dyn Subject) {
    subject.run();
    black_box(subject);
}

fn main() {
    for benchmark in all().into_iter().filter(|benchmark| benchmark.counted) {
        let mut subject = benchmark.make();
        // A warm-up for what is done on first use.
        subject.prepare();
        subject.run();
        subject.prepare();
        counted(&mut *subject);
        println!("{},{},{}", benchmark.group, benchmark.by, benchmark.elements);
    }
}
