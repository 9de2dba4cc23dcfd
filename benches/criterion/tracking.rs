//! The tracker's stages and a whole frame, at 640x480 and the instruction set that the CPU offers.

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, criterion_group, criterion_main};
use mba_benches::recording::Recording;
use mba_tracker::align::depth_term::DepthProblem;
use mba_tracker::deblur::DeblurScratch;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::image::GreyPyramid;
use mba_tracker::keyframe::Keyframe;
use mba_tracker::photometric::{LuminanceTable, Vignetting};
use mba_tracker::surface::InverseDepthMap;
use mba_tracker::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming};
use mba_tracker::transfer::RowBand;
use mba_tracker::workspace::Arena;
use mba_tracker::{FrameStatus, SimdLevel, Tracker, TrackerConfig};
use nalgebra::Vector6;

/// Bytes for a pyramid, a depth map, a keyframe and the deblurring.
const MEMORY: usize = 24 << 20;

fn keyframe<'m>(arena: &mut Arena<'m>, config: &TrackerConfig) -> Keyframe<'m> {
    Keyframe::carve(arena, &config.camera, config.levels, config.surface_level).expect("memory")
}

fn stages(c: &mut Criterion) {
    let recording = Recording::new(2).expect("valid settings");
    let config = &recording.config;
    let frame = recording.view(0, 0.0).expect("a frame");
    let luminance = LuminanceTable::new(&config.response);
    let mut memory = vec![0; MEMORY];
    let mut arena = Arena::new(&mut memory);
    let mut pyramid = GreyPyramid::carve(&mut arena, &config.camera, config.levels).expect("memory");
    let mut depth = InverseDepthMap::carve(&mut arena, &config.camera, config.surface_level).expect("memory");
    let mut keyframe = keyframe(&mut arena, config);
    c.bench_function("pyramid fill", |b| {
        b.iter(|| pyramid.fill(&frame.colour, &luminance, &Vignetting::NONE))
    });
    c.bench_function("depth block mean", |b| {
        b.iter(|| depth.fill(SimdLevel::new(), &frame.depth, config.metres_per_unit))
    });
    keyframe.pyramid.fill(&frame.colour, &luminance, &Vignetting::NONE);
    keyframe.depth.fill(SimdLevel::new(), &frame.depth, config.metres_per_unit);
    c.bench_function("plane fit", |b| b.iter(|| keyframe.restart_surface(SimdLevel::new())));
    c.bench_function("keypoint selection, all levels", |b| {
        b.iter(|| keyframe.select(SimdLevel::new(), 0.02, config.align.dark_intensity, config.region));
    });
    let next = recording.view(1, 0.0).expect("a frame");
    depth.fill(SimdLevel::new(), &next.depth, config.metres_per_unit);
    let problem = DepthProblem {
        current: &depth,
        keyframe: &keyframe.depth,
        planes: &keyframe.planes,
        camera: config.camera.at_level(config.surface_level),
        stride: 2,
        gate: 0.02,
        band: RowBand::whole(depth.height),
    };
    let pose = RigidTransform::identity();
    c.bench_function("depth term linearisation, stride 2", |b| {
        b.iter(|| problem.linearise(SimdLevel::new(), black_box(&pose), 0.001, 1.345));
    });
}

/// Flow, four Richardson-Lucy iterations and the new coarse levels.
fn deblurring(c: &mut Criterion) {
    let recording = Recording::new(1).expect("valid settings");
    let config = &recording.config;
    let frame = recording.view(0, 0.0).expect("a frame");
    let mut memory = vec![0; MEMORY];
    let mut arena = Arena::new(&mut memory);
    let mut keyframe = keyframe(&mut arena, config);
    keyframe.pyramid.fill(&frame.colour, &LuminanceTable::new(&config.response), &Vignetting::NONE);
    keyframe.depth.fill(SimdLevel::new(), &frame.depth, config.metres_per_unit);
    keyframe.restart_surface(SimdLevel::new());
    let mut scratch =
        DeblurScratch::carve(&mut arena, config.camera.width, config.camera.height).expect("memory");
    scratch.capture(keyframe.pyramid.levels[0].pixels);
    // Ten pixels sideways.
    let motion = Vector6::new(0.0, 0.0, 0.0, 0.0, 10.0 / config.camera.fx, 0.0);
    let exposure = ExposureTrajectory::from_mid_and_motion(&RigidTransform::identity(), &motion);
    let path = BowedTrajectory::without_bow(exposure);
    c.bench_function("deblur a keyframe, 10 px", |b| {
        b.iter(|| {
            let longest = scratch.flow.fill(
                &path,
                &FrameTiming::GLOBAL,
                &config.camera,
                &keyframe.planes,
                config.surface_level,
                0.5,
            );
            let sharp = &mut keyframe.pyramid.levels[0];
            scratch.deblur(SimdLevel::new(), longest, config.deblur_iterations, sharp.pixels);
            keyframe.pyramid.reduce();
        });
    });
}

/// Frames of a recording that runs to and fro, keyframes and their deblurring included.
fn whole_frame(c: &mut Criterion) {
    let recording = Recording::new(30).expect("valid settings");
    let mut memory = vec![0; recording.config.workspace_len()];
    let mut tracker = Tracker::new(&recording.config, SimdLevel::new(), &mut memory).expect("memory");
    let mut k = 0;
    let mut track = || {
        let frame = recording.view(recording.to_and_fro(k), k as f64 / 30.0).expect("a frame");
        k += 1;
        let begin = Instant::now();
        let result = tracker.track(&frame).expect("a valid frame");
        (begin.elapsed(), result.status)
    };
    let mut times = Vec::new();
    for _ in 0..120 {
        let (time, status) = track();
        assert_ne!(status, FrameStatus::Lost, "the figures of a lost tracker mean nothing");
        times.push(time);
    }
    times.sort_unstable();
    println!("frame: median {:?}, 99th percentile {:?} of {}", times[60], times[118], times.len());
    c.bench_function("frame", |b| {
        b.iter_custom(|count| (0..count).map(|_| track().0).sum::<Duration>());
    });
}

criterion_group!(tracking, stages, deblurring, whole_frame);
criterion_main!(tracking);
