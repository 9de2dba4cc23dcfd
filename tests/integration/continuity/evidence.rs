//! What frames show decides where continuity is only surprised.

use std::sync::LazyLock;

use mba_mapper::continuity::{
    Continuity, ContinuityFrame, ContinuitySettings, FramePicture, FrameVerdict, Mismatch, PoseNoise,
    Suspicion, compare_exposures, repair, repair_by_evidence,
};
use mba_mapper::exposure::RowTimes;
use mba_tests::handheld::{RenderedFrame, Shake, camera_of_width};
use mba_tests::plane_scene::{DEPTH_SCALE, PlaneScene};
use mba_tests::transfer_scene::Uniform;
use mba_tracker::geometry::{PinholeCamera, RigidTransform, so3};
use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::{Vector3, Vector6};

use crate::shaken::gross_offset;

const FRAMES: usize = 24;
const INTERVAL: f64 = 1.0 / 30.0;
const EXPOSURE: f64 = 0.016;

/// The frame that is exposed while the hand jerks.
const JERK: usize = 12;
/// Furthest turn of the jerk in radians, its time there and back in seconds, and the share of it before the frame.
const JERK_TURN: f64 = 0.09;
const JERK_SECONDS: f64 = 0.05;
const JERK_BEFORE: f64 = 0.35;

static FILMED: LazyLock<Filmed> = LazyLock::new(Filmed::new);

/// A calm hand with one jerk, filmed.
#[derive(Clone)]
struct Filmed {
    camera: PinholeCamera,
    frames: Vec<ContinuityFrame>,
    truth: Vec<ExposureTrajectory>,
    pictures: Vec<FramePicture>,
}

/// The pose at `t` seconds: calm, but for a jerk to one side and back.
fn pose(t: f64) -> RigidTransform {
    let calm = Shake { metres: 0.06, radians: 0.06, hertz: 0.5 }.pose(t);
    let share = ((t - JERK as f64 * INTERVAL) / JERK_SECONDS + JERK_BEFORE).clamp(0.0, 1.0);
    let jerk = JERK_TURN * (core::f64::consts::PI * share).sin().powi(2);
    let turn = so3::exp(&Vector3::new(0.4 * jerk, jerk, 0.0));
    RigidTransform::new(calm.rotation * turn, calm.translation + Vector3::new(0.6, 0.3, 0.0) * jerk)
}

impl Filmed {
    fn new() -> Self {
        let camera = camera_of_width(240);
        let scene = PlaneScene::corner(1, 0.12);
        let mut draw = Uniform::new(3);
        let time = |k: usize| k as f64 * INTERVAL;
        let truth: Vec<ExposureTrajectory> = (0..FRAMES)
            .map(|k| ExposureTrajectory {
                start: pose(time(k) - 0.5 * EXPOSURE),
                end: pose(time(k) + 0.5 * EXPOSURE),
            })
            .collect();
        let picture = |(k, exposure): (usize, &ExposureTrajectory)| {
            let rendered = RenderedFrame::new(&scene, &camera, time(k), EXPOSURE, *exposure);
            FramePicture {
                camera,
                light: rendered.grey.iter().map(|&byte| f32::from(byte) / 255.0).collect(),
                depth: rendered.depth.iter().map(|&raw| f32::from(raw) / DEPTH_SCALE as f32).collect(),
                times: RowTimes::GLOBAL,
            }
        };
        let pictures = truth.iter().enumerate().map(picture).collect();
        let mut noise = || Vector6::from_fn(|row, _| draw.within(-1.0, 1.0) * [8e-4, 4e-4][row / 3]);
        let mut measured = |truth: &ExposureTrajectory| ExposureTrajectory {
            start: truth.start.perturbed(&noise()),
            end: truth.end.perturbed(&noise()),
        };
        let frames = truth.iter().enumerate().map(|(k, exposure)| {
            let world_from_camera = measured(exposure);
            ContinuityFrame {
                timestamp: time(k),
                exposure_seconds: EXPOSURE,
                world_from_camera,
                noise: Some(PoseNoise::typical(&world_from_camera)),
                trusted: true,
            }
        });
        Self { camera, frames: frames.collect(), truth, pictures }
    }

    fn compare(&self, suspicion: &Suspicion<'_>) -> Option<Mismatch> {
        let references: Vec<_> =
            suspicion.references.iter().map(|&(k, path)| (&self.pictures[k], path)).collect();
        let picture = &self.pictures[suspicion.frame];
        compare_exposures(picture, [suspicion.measured, suspicion.suggested], &references)
    }

    fn repaired(&self) -> Continuity {
        let settings = ContinuitySettings::default();
        repair_by_evidence(&self.frames, &settings, &|suspicion| self.compare(suspicion))
            .expect("valid frames")
    }

    /// Blur of a frame in pixels.
    fn blur(&self, k: usize) -> f64 {
        mba_mapper::exposure::blur_length(&self.truth[k], &self.camera, 2.5)
    }
}

#[test]
fn a_frame_that_was_tracked_right_stays_though_the_hand_jerked() {
    let filmed = &*FILMED;
    let (calm, jerk) = (filmed.blur(JERK - 1), filmed.blur(JERK));
    assert!(calm < 2.0 && jerk > 12.0, "{calm} px, then {jerk} px");
    let by_prior = repair(&filmed.frames, &ContinuitySettings::default()).expect("valid frames");
    let replaced = by_prior.frames_with(FrameVerdict::Replaced);
    assert!(!replaced.is_empty(), "a jerk that surprises nobody tests nothing");
    let result = filmed.repaired();
    assert_eq!(result.frames_with(FrameVerdict::Kept).len(), FRAMES, "{:?}", result.verdicts);
    assert!(filmed.frames.iter().zip(&result.exposures).all(|(frame, e)| frame.world_from_camera == *e));
}

#[test]
fn misplaced_frames_are_repaired_beside_a_jerk_that_was_tracked_right() {
    let mut filmed = FILMED.clone();
    let mut draw = Uniform::new(7);
    // A fifth of the frames.
    let (misplaced, swapped) = ([4, 9, 18], [6, 20]);
    for k in misplaced {
        let offset = gross_offset(&mut draw);
        let path = &mut filmed.frames[k].world_from_camera;
        *path = ExposureTrajectory { start: path.start.perturbed(&offset), end: path.end.perturbed(&offset) };
    }
    for k in swapped {
        filmed.frames[k].world_from_camera = filmed.frames[k].world_from_camera.reversed();
    }
    let result = filmed.repaired();
    assert_eq!(result.frames_with(FrameVerdict::Replaced), misplaced);
    assert_eq!(result.frames_with(FrameVerdict::Reversed), swapped);
    for k in misplaced {
        let apart = filmed.truth[k].mid().tangent_to(&result.exposures[k].mid()).norm();
        assert!(apart < 0.01, "frame {k}: {apart}");
    }
}

#[test]
fn the_better_exposure_has_the_smaller_mismatch() {
    let filmed = &*FILMED;
    let truth = filmed.truth[JERK];
    let references: Vec<_> =
        [JERK - 1, JERK + 1].iter().map(|&k| (&filmed.pictures[k], filmed.truth[k])).collect();
    let compare = |other: ExposureTrajectory| {
        compare_exposures(&filmed.pictures[JERK], [&truth, &other], &references).expect("shared points")
    };
    let moved = |offset: Vector6<f64>| ExposureTrajectory {
        start: truth.start.perturbed(&offset),
        end: truth.end.perturbed(&offset),
    };
    // A centimetre aside or ahead, a third of a degree, and half of the motion.
    for offset in [
        Vector6::new(0.01, 0.0, 0.0, 0.0, 0.0, 0.0),
        Vector6::new(0.0, 0.0, 0.02, 0.0, 0.0, 0.0),
        Vector6::new(0.0, 0.0, 0.0, 0.0, 0.006, 0.0),
    ] {
        let Mismatch { measured, suggested } = compare(moved(offset));
        assert!(suggested > 1.1 * measured, "{offset:?}: {measured} and {suggested}");
    }
    let shorter = ExposureTrajectory::from_mid_and_motion(&truth.mid(), &(truth.motion() * 0.5));
    let Mismatch { measured, suggested } = compare(shorter);
    assert!(suggested > 1.1 * measured, "shorter: {measured} and {suggested}");
    // Blur looks the same both ways.
    let Mismatch { measured, suggested } = compare(truth.reversed());
    assert!((suggested / measured - 1.0).abs() < 1e-6, "reversed: {measured} and {suggested}");
}

#[test]
fn frames_that_share_nothing_say_nothing() {
    let filmed = &*FILMED;
    let aside = |k: usize| {
        let about = RigidTransform::new(so3::exp(&Vector3::new(0.0, 3.0, 0.0)), Vector3::zeros());
        filmed.truth[k].seen_from(&about)
    };
    let [one, other] = [filmed.truth[2], filmed.truth[3]];
    let compare = |references: &[(&FramePicture, ExposureTrajectory)]| {
        compare_exposures(&filmed.pictures[2], [&one, &other], references)
    };
    assert_eq!(compare(&[]), None);
    assert_eq!(compare(&[(&filmed.pictures[5], aside(5))]), None);
    assert!(compare(&[(&filmed.pictures[5], filmed.truth[5])]).is_some());
}
