//! One trajectory from both ways.

use mba_adjust::pose_graph::{PoseGraph, PoseGraphEdge, PoseGraphError, PoseGraphSettings};
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::geometry::RigidTransform;

use super::backwards::SeenBackwards;
use crate::tracking::Measured;

/// Least standard deviations of a measured motion, metres and radians: what no alignment is better than.
const LEAST_SIGMA: [f64; 2] = [2e-4, 1e-4];

/// How much more uncertain a measured motion is than its alignment says: what moves several frames alike, as a keyframe whose
/// rows were put right a little wrongly, is in no residual.
const DEPENDENCE: f64 = 3.0;

/// How much more uncertain yet what was aligned with a first keyframe is, whose path was learnt from a single other frame.
pub(super) const FIRST_KEYFRAME: f64 = 4.0;

/// The motion from a frame's reference to the frame, as one way measured it; `factor` times as uncertain as usual. What is
/// `doubted` is left out where it contradicts the rest.
pub(super) fn edge(
    frame: usize,
    measured: &Measured,
    world_from_mid: impl Fn(usize) -> RigidTransform,
    factor: f64,
    doubted: bool,
) -> Option<PoseGraphEdge> {
    let is_measured = measured.reference != frame && measured.sigma.iter().all(|sigma| *sigma > 0.0);
    let [translation_sigma, rotation_sigma] =
        [0, 1].map(|kind| measured.sigma[kind].max(LEAST_SIGMA[kind]) * DEPENDENCE * factor);
    (is_measured && (translation_sigma + rotation_sigma).is_finite()).then(|| PoseGraphEdge {
        from: measured.reference,
        to: frame,
        from_from_to: world_from_mid(measured.reference).inverse().compose(&world_from_mid(frame)),
        translation_sigma,
        rotation_sigma,
        robust: doubted,
    })
}

/// Mid poses that agree best with what both ways measured.
pub(super) fn joined_poses(
    world_from_mid: Vec<RigidTransform>,
    edges: Vec<PoseGraphEdge>,
) -> Result<Vec<RigidTransform>, PoseGraphError> {
    let mut graph = PoseGraph { world_from_keyframe: world_from_mid, edges };
    graph.optimise(&PoseGraphSettings::default())?;
    Ok(graph.world_from_keyframe)
}

/// The exposure around `world_from_mid` that lies between those of both ways.
pub(super) fn joined_exposure(
    forwards: &TimedExposure,
    backwards: Option<&SeenBackwards>,
    world_from_mid: &RigidTransform,
) -> TimedExposure {
    let around = |exposure: &TimedExposure| {
        let mid_from_world = exposure.mid.inverse();
        [exposure.start, exposure.end].map(|end| mid_from_world.compose(&end))
    };
    let mut ends = around(forwards);
    if let Some(backwards) = backwards {
        let others = around(&backwards.exposure);
        ends = [0, 1].map(|k| ends[k].perturbed(&(ends[k].tangent_to(&others[k]) * 0.5)));
    }
    let [start, end] = ends.map(|end| world_from_mid.compose(&end));
    TimedExposure { timestamp: forwards.timestamp, start, mid: *world_from_mid, end }
}

#[cfg(test)]
mod tests {
    use mba_tracker::FrameStatus;
    use nalgebra::Vector3;

    use super::*;

    fn at(x: f64) -> RigidTransform {
        RigidTransform { translation: Vector3::new(x, 0.0, 0.0), ..RigidTransform::identity() }
    }

    fn measured(reference: usize) -> Measured {
        Measured { reference, sigma: [1e-3, 1e-3] }
    }

    /// Both ways along a line of four frames, where the way back has frame 2 at `x`.
    fn joined(x: f64) -> Vec<f64> {
        let forwards = [0.0, 1.0, 2.0, 3.004].map(at);
        let backwards = [0.0, 1.0, x, 3.0].map(at);
        let mut edges = Vec::new();
        for frame in 1..4 {
            edges.extend(edge(frame, &measured(0), |k| forwards[k], 1.0, false));
        }
        for frame in 0..3 {
            edges.extend(edge(frame, &measured(3), |k| backwards[k], 1.0, true));
        }
        let poses = joined_poses(forwards.to_vec(), edges).unwrap();
        poses.iter().map(|pose| pose.translation.x).collect()
    }

    #[test]
    fn both_ways_share_what_they_differ_by() {
        let poses = joined(2.0);
        // Three ways lead from frame 0 to frame 3: one of 3.004, and by frames 1 and 2 and straight back, of 3.000.
        assert!((3.0..3.003).contains(&poses[3]), "{poses:?}");
        assert!(poses[3] > 3.0005, "{poses:?}");
    }

    #[test]
    fn a_frame_that_the_way_back_mistook_stays_where_it_was() {
        let poses = joined(2.3);
        assert!((poses[2] - 2.0).abs() < 0.01, "{poses:?}");
        assert!((poses[3] - 3.0).abs() < 0.01, "{poses:?}");
    }

    #[test]
    fn a_frame_that_was_not_aligned_measures_nothing() {
        let own = Measured { reference: 2, sigma: [1e-3, 1e-3] };
        let none = Measured { reference: 1, sigma: [0.0, 0.0] };
        assert!(edge(2, &own, |_| at(0.0), 1.0, false).is_none());
        assert!(edge(2, &none, |_| at(0.0), 1.0, false).is_none());
    }

    #[test]
    fn exposures_meet_in_the_middle_around_the_joined_pose() {
        let exposure = |start: f64, mid: f64, end: f64| TimedExposure {
            timestamp: 1.0,
            start: at(start),
            mid: at(mid),
            end: at(end),
        };
        let back = SeenBackwards {
            status: FrameStatus::Ok,
            exposure: exposure(6.8, 7.0, 7.2),
            blur_px: 3.0,
            measured: measured(0),
        };
        let joined = joined_exposure(&exposure(1.9, 2.0, 2.1), Some(&back), &at(3.0));
        assert_eq!(joined.timestamp, 1.0);
        assert!((joined.start.translation.x - 2.85).abs() < 1e-12);
        assert!((joined.end.translation.x - 3.15).abs() < 1e-12);
    }
}
