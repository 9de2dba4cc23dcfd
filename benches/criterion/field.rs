//! The tri-plane field: loss and all gradients of some blurred pixels, the one by the path among them.
//!
//! In `field sample` every sample has geometry and colour and one element is a sample, one thread: the time per element is
//! that of one sample forward and backward with everything around it. In `field rays` one element is a ray, samples that
//! nobody would see have no colour, as in training.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use mba_benches::field::{FieldInput, PIXELS, VIEWS};
use mba_tracker::simd::{Level, level_name, levels_up_to};

fn samples(c: &mut Criterion) {
    let mut group = c.benchmark_group("field sample");
    group.sample_size(20);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread starts");
    for level in levels_up_to(Level::new()) {
        let mut input = FieldInput::room(level).expect("a valid size");
        input.evaluate(0, true);
        let [samples, colours] = input.samples();
        assert_eq!(samples, colours, "every sample has a colour");
        group.throughput(Throughput::Elements(samples as u64));
        group.bench_function(level_name(level), |b| pool.install(|| b.iter(|| input.evaluate(0, true))));
    }
}

fn rays(c: &mut Criterion) {
    let mut group = c.benchmark_group("field rays");
    group.sample_size(20);
    group.throughput(Throughput::Elements((PIXELS * VIEWS) as u64));
    let mut input = FieldInput::room(Level::new()).expect("a valid size");
    input.evaluate(0, false);
    println!("samples {:?}, {:.0} bytes per cubic metre", input.samples(), input.bytes_per_cubic_metre());
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        let id = BenchmarkId::from_parameter(threads);
        group.bench_function(id, |b| pool.install(|| b.iter(|| input.evaluate(0, false))));
    }
}

criterion_group!(field, samples, rays);
criterion_main!(field);
