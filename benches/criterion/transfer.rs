//! Pixel transfer per SIMD level and number of virtual views, and the normal equations per patch.
//!
//! One element is one sample, i.e. one pixel of one virtual view; for the normal equations it is one patch.

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use mba_benches::transfer::{RESIDUAL_MODEL, TransferInput};
use mba_tracker::simd::{Level, level_name, levels_up_to};
use mba_tracker::transfer::{
    PATCH_PIXELS, PatchCost, PatchRows, PatchSite, PatchValues, accumulate_rows, evaluate_cost, linearize,
    transfer_rows, transfer_values,
};

const VIEW_COUNTS: [usize; 5] = [1, 4, 8, 16, 32];

/// Patches whose outputs stay in the first-level cache, as they do in an evaluation.
const RESIDENT_PATCHES: usize = 10;

/// Runs `call` on every problem size at every level; it gets the sites of one call.
fn per_sample(c: &mut Criterion, name: &str, mut call: impl FnMut(Level, &TransferInput, &[PatchSite])) {
    let mut group = c.benchmark_group(name);
    for views in VIEW_COUNTS {
        let input = TransferInput::new(views);
        group.throughput(Throughput::Elements((views * PATCH_PIXELS * input.sites.len()) as u64));
        for level in levels_up_to(Level::new()) {
            group.bench_function(BenchmarkId::new(level_name(level), views), |b| {
                b.iter(|| input.sites.chunks(RESIDENT_PATCHES).for_each(|sites| call(level, &input, sites)));
            });
        }
    }
}

fn value(c: &mut Criterion) {
    let mut out = vec![PatchValues::default(); RESIDENT_PATCHES];
    per_sample(c, "transfer value", |level, input, sites| {
        transfer_values(level, &input.problem(), sites, &mut out);
    });
}

fn value_and_row(c: &mut Criterion) {
    let mut out = vec![PatchRows::default(); RESIDENT_PATCHES];
    per_sample(c, "transfer value+row", |level, input, sites| {
        transfer_rows(level, &input.problem(), sites, &mut out);
    });
}

/// Throughput in patches.
fn per_patch<'c>(c: &'c mut Criterion, name: &str, input: &TransferInput) -> BenchmarkGroup<'c, WallTime> {
    let mut group = c.benchmark_group(name);
    group.throughput(Throughput::Elements(input.sites.len() as u64));
    group
}

fn normal_equations(c: &mut Criterion) {
    let input = TransferInput::new(1);
    let mut rows = vec![PatchRows::default(); input.sites.len()];
    transfer_rows(Level::new(), &input.problem(), &input.sites, &mut rows);
    let mut patches = vec![PatchCost::default(); input.sites.len()];
    let mut group = per_patch(c, "normal equations", &input);
    for level in levels_up_to(Level::new()) {
        group.bench_function(level_name(level), |b| {
            b.iter(|| {
                accumulate_rows(level, &input.problem(), &input.sites, &rows, &RESIDUAL_MODEL, &mut patches)
            });
        });
    }
}

/// What one iteration of the alignment calls, with eight virtual views.
fn evaluation(c: &mut Criterion) {
    let input = TransferInput::new(8);
    let mut patches = vec![PatchCost::default(); input.sites.len()];
    let mut group = per_patch(c, "evaluation of 300 patches, 8 views", &input);
    for level in levels_up_to(Level::new()) {
        let (problem, sites) = (input.problem(), &input.sites);
        group.bench_function(BenchmarkId::new("cost", level_name(level)), |b| {
            b.iter(|| evaluate_cost(level, &problem, sites, &RESIDUAL_MODEL, &mut patches));
        });
        group.bench_function(BenchmarkId::new("linearize", level_name(level)), |b| {
            b.iter(|| linearize(level, &problem, sites, &RESIDUAL_MODEL, &mut patches));
        });
    }
}

criterion_group!(transfer, value, value_and_row, normal_equations, evaluation);
criterion_main!(transfer);
