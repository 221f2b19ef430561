//! Times: `cargo bench --profile fmu-library --package benches`, after
//! `cargo run -- export`; an argument selects benchmarks by a part of the name.

use std::time::{Duration, Instant};

use benches::benchmarks::{Subject, all};
use criterion::{Criterion, SamplingMode, Throughput};

fn main() {
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
        .sample_size(30)
        .configure_from_args();
    for benchmark in all() {
        let mut group = criterion.benchmark_group(&benchmark.group);
        group.throughput(Throughput::Elements(benchmark.elements));
        group.sampling_mode(SamplingMode::Flat);
        if matches!(&*benchmark.group, "plant 12.5 ms whole" | "closed loop") {
            // One run is long enough.
            group.sample_size(10);
        }
        let mut made: Option<Box<dyn Subject>> = None;
        group.bench_function(benchmark.by, |bencher| {
            let subject = made.get_or_insert_with(|| benchmark.make());
            bencher.iter_custom(|iterations| {
                let mut time = Duration::ZERO;
                for _ in 0..iterations {
                    subject.prepare();
                    let start = Instant::now();
                    subject.run();
                    time += start.elapsed();
                }
                time
            });
        });
        group.finish();
    }
    criterion.final_summary();
}
