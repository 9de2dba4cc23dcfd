//! One step of bundle adjustment at full resolution with five virtual views, by image size and threads.
//!
//! One element is a virtual view.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use mba_benches::bundle::{BundleInput, VIEWS};
use mba_tracker::simd::Level;

const SIZES: [[usize; 2]; 2] = [[320, 240], [640, 480]];

fn steps(c: &mut Criterion) {
    let mut group = c.benchmark_group("bundle step");
    group.sample_size(20);
    group.throughput(Throughput::Elements(VIEWS as u64));
    for [width, height] in SIZES {
        let mut input = BundleInput::room(Level::new(), width, height).expect("a valid size");
        println!("{width}x{height}: {} keyframes, {} Gaussians", input.keyframes(), input.gaussians());
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
            let id = BenchmarkId::new(format!("{width}x{height}"), threads);
            group.bench_function(id, |b| pool.install(|| b.iter(|| input.step())));
        }
    }
}

criterion_group!(bundle, steps);
criterion_main!(bundle);
