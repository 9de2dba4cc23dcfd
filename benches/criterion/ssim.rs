//! Structural similarity of three channels of 640x480 pixels and its gradient, by level and threads.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use mba_benches::ssim::SsimInput;
use mba_tracker::simd::{Level, level_name, levels_up_to};

fn value_and_gradient(c: &mut Criterion) {
    let mut group = c.benchmark_group("ssim value+gradient");
    group.sample_size(20);
    for level in levels_up_to(Level::new()) {
        let mut input = SsimInput::new(level);
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
            group.bench_function(BenchmarkId::new(level_name(level), threads), |b| {
                pool.install(|| b.iter(|| input.run()));
            });
        }
    }
}

criterion_group!(ssim, value_and_gradient);
criterion_main!(ssim);
