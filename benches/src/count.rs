//! Runs what is measured once each, for valgrind to count the instructions; `benches/run` does so.
//!
//! Prints group, who did it and how often, in the order in which [`counted`] is left.

use std::hint::black_box;

use benches::benchmarks::{Subject, all};

/// What valgrind is told to count: everything below this function, and nothing else.
#[inline(never)]
fn counted(subject: &mut dyn Subject) {
    subject.run();
    black_box(subject);
}

fn main() {
    for benchmark in all().into_iter().filter(|benchmark| benchmark.counted) {
        let mut subject = benchmark.make();
        // Once before, for what is done on first use.
        subject.prepare();
        subject.run();
        subject.prepare();
        counted(&mut *subject);
        println!("{},{},{}", benchmark.group, benchmark.by, benchmark.elements);
    }
}
