//! Blurred images of a room and their gradients, by number of virtual views and threads.
//!
//! One element is a virtual view.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use mba_benches::exposure::ExposureInput;
use mba_tracker::simd::Level;

const VIEWS: [usize; 3] = [1, 5, 11];

fn exposures(c: &mut Criterion) {
    let mut group = c.benchmark_group("exposure");
    group.sample_size(10);
    let mut input = ExposureInput::room(Level::new(), 50_000);
    for views in VIEWS {
        group.throughput(Throughput::Elements(views as u64));
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
            let size = format!("{views} on {threads}");
            group.bench_function(BenchmarkId::new("forward", &size), |b| {
                pool.install(|| {
                    b.iter(|| {
                        input.forward(views);
                    });
                });
            });
            group.bench_function(BenchmarkId::new("forward+backward", &size), |b| {
                pool.install(|| b.iter(|| input.forward_backward(views)));
            });
        }
    }
}

criterion_group!(exposure, exposures);
criterion_main!(exposure);
