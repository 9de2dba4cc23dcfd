//! The stages of the rasterizer, whole passes by size and threads, and the cost of a pair of tile and splat.
//!
//! Stages and pairs run on one thread. One element is a Gaussian, for the pixel stages a (tile, splat) pair; a tile
//! has 16x16 pixels.

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use mba_benches::raster::RasterInput;
use mba_mapper::raster::RasterScratch;
use mba_tracker::simd::{Level, level_name, levels_up_to};

const SIZES: [usize; 3] = [10_000, 50_000, 200_000];

/// Standard deviations in pixels; at 24 nearly all pixels of a tile are touched.
const SIGMAS: [f64; 4] = [1.0, 2.0, 3.0, 24.0];

fn with_threads<R: Send>(threads: usize, run: impl FnOnce() -> R + Send) -> R {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
    pool.install(run)
}

/// One stage on a room of 50 000 Gaussians.
fn stage(c: &mut Criterion, name: &str, per_pair: bool, run: impl Fn(&mut RasterInput) + Sync) {
    let mut group = c.benchmark_group(format!("raster {name}"));
    for level in levels_up_to(Level::new()) {
        let mut input = RasterInput::room(level, 50_000);
        let elements = if per_pair { input.scratch.pairs() } else { input.gaussians.len() };
        group.throughput(Throughput::Elements(elements as u64));
        group.bench_function(level_name(level), |b| {
            with_threads(1, || b.iter(|| run(&mut input)));
        });
    }
}

fn stages(c: &mut Criterion) {
    stage(c, "project", false, |i| i.rasterizer.project(&i.gaussians, &i.view, &mut i.scratch));
    stage(c, "order", false, |i| i.rasterizer.order(&mut i.scratch));
    stage(c, "bin", true, |i| i.rasterizer.bin(&i.view, &mut i.scratch));
    stage(c, "composite", true, |i| i.rasterizer.composite(&mut i.scratch));
    stage(c, "store image", true, |i| i.rasterizer.store_image(&i.scratch, &mut i.image));
    stage(c, "replay", true, |i| i.rasterizer.replay(&i.grad_image, &mut i.scratch));
    stage(c, "reduce and project backward", false, |i| {
        i.rasterizer.project_backward(&i.gaussians, &mut i.scratch, &mut i.gradients);
    });
}

/// Whole passes by number of Gaussians and threads.
fn passes(c: &mut Criterion) {
    let mut group = c.benchmark_group("raster pass");
    group.sample_size(20);
    for count in SIZES {
        let mut input = RasterInput::room(Level::new(), count);
        for threads in [1, 2] {
            let size = format!("{count} on {threads}");
            group.bench_function(BenchmarkId::new("forward", &size), |b| {
                with_threads(threads, || b.iter(|| input.forward()));
            });
            group.bench_function(BenchmarkId::new("forward+backward", &size), |b| {
                with_threads(threads, || b.iter(|| input.forward_backward()));
            });
        }
    }
}

/// The first view of a map pays for its memory.
fn cold(c: &mut Criterion) {
    let input = RasterInput::room(Level::new(), 50_000);
    c.bench_function("raster forward with new memory", |b| {
        b.iter_batched(
            RasterScratch::default,
            |mut scratch| {
                let mut image = input.image.clone();
                input.rasterizer.forward(&input.gaussians, &input.view, &mut scratch, &mut image);
                scratch
            },
            BatchSize::LargeInput,
        );
    });
}

/// Nanoseconds per pair by size of the splats.
fn pairs(c: &mut Criterion) {
    let mut group = c.benchmark_group("raster pair");
    group.sample_size(20);
    for level in levels_up_to(Level::new()) {
        for sigma in SIGMAS {
            let mut input = RasterInput::cloud(level, 20_000, sigma);
            group.throughput(Throughput::Elements(input.scratch.pairs() as u64));
            let id = |pass: &str| BenchmarkId::new(format!("{pass} {}", level_name(level)), sigma);
            group.bench_function(id("forward"), |b| {
                with_threads(1, || b.iter(|| input.rasterizer.composite(&mut input.scratch)));
            });
            group.bench_function(id("backward"), |b| {
                with_threads(1, || b.iter(|| input.rasterizer.replay(&input.grad_image, &mut input.scratch)));
            });
        }
    }
}

criterion_group!(raster, stages, passes, cold, pairs);
criterion_main!(raster);
