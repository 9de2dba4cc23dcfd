//! Depth units per metre: poses from depth are as long as the depth camera's metre, an accelerometer has the true one.

use mba_io::dataset::{Dataset, Knowledge};
use mba_io::imu::{InertialFit, inertial_fit};

use super::finding::{Finding, Value};
use super::window::{Guess, Recording, Resolution, Tracked};
use crate::tracking::TrackingOptions;

/// Error of the metre from what is not modelled: the accelerometer's own scale, its place beside the camera.
const SYSTEMATIC: f64 = 0.002;

/// Relative standard deviation from which on nothing is told.
pub(super) const MAX_SIGMA: f64 = 0.03;

/// Standard deviations by which the metre has to differ from the one on record to be taken in its place.
const CERTAINTY: f64 = 2.5;

/// Looks for the depth units per metre of a data set with an accelerometer; returns what was found, none without an
/// accelerometer, and the depth scale if it differs from the one on record.
#[must_use]
pub fn depth_scale(dataset: &Dataset) -> Option<(Finding, Option<f64>)> {
    let imu = dataset.imu().filter(|imu| !imu.specific_forces().is_empty())?;
    let options = TrackingOptions::default();
    let recording = Recording { dataset, options: &options };
    let (window, probe) = recording.liveliest(Guess::of(dataset));
    let tracked = window.probe(Resolution::Fine, probe.guess).tracked;
    let poses: Vec<_> =
        longest_found(&tracked).iter().map(|frame| (frame.timestamp, frame.world_from_mid)).collect();
    let recorded = dataset.calibration().depth_scale;
    Some(match inertial_fit(imu, &poses).map(with_systematic).filter(|fit| fit.metre_sigma < MAX_SIGMA) {
        Some(fit) => judged((fit.metre, fit.metre_sigma), recorded, "the accelerometer"),
        None => {
            let note = "the accelerometer felt too little to measure a metre".to_owned();
            (Finding { fact: "depth_scale", knowledge: Knowledge::Recorded, value: None, note }, None)
        }
    })
}

pub(super) fn with_systematic(fit: InertialFit) -> InertialFit {
    InertialFit { metre_sigma: fit.metre_sigma.hypot(SYSTEMATIC), ..fit }
}

/// Error of a measured length, metres: a tape, and where in the camera it is held.
const TAPE_SIGMA: f64 = 0.003;

/// Error of the distance between two tracked poses, metres.
const POSE_SIGMA: f64 = 0.003;

/// Why a measured length tells nothing.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DistanceError {
    /// One of the frames is not in the data set, or was not found.
    #[error("frame {0} was not tracked, so its distance to another is unknown")]
    NotTracked(usize),
    /// The camera hardly moved between the frames.
    #[error("frames {} and {} were tracked {metres:.3} m apart, too little to tell a scale", frames[0], frames[1])]
    TooNear {
        /// The frames.
        frames: [usize; 2],
        /// Their distance, metres of the depth camera.
        metres: f64,
    },
}

/// The depth units per metre by a measured distance between the places of the camera at two frames: what was found, and
/// the scale if it differs from the one on record.
///
/// # Errors
/// [`DistanceError`] if the frames cannot tell.
pub fn depth_scale_by_distance(
    dataset: &Dataset,
    frames: [usize; 2],
    metres: f64,
) -> Result<(Finding, Option<f64>), DistanceError> {
    let options = TrackingOptions::default();
    let tracked = Recording { dataset, options: &options }.track_everything(&Guess::of(dataset));
    let place = |index: usize| {
        let frame = tracked.iter().find(|frame| frame.index == index && frame.is_found);
        frame.map(|frame| frame.world_from_mid.translation).ok_or(DistanceError::NotTracked(index))
    };
    let seen = (place(frames[0])? - place(frames[1])?).norm();
    let sigma = TAPE_SIGMA.hypot(POSE_SIGMA) / seen;
    if sigma.is_nan() || sigma > MAX_SIGMA {
        return Err(DistanceError::TooNear { frames, metres: seen });
    }
    let metre = metres / seen;
    Ok(judged((metre, metre * sigma), dataset.calibration().depth_scale, "the measured length"))
}

/// A pose that is `metre` true metres long per metre was made with too many units per metre, by that factor.
fn judged((metre, sigma): (f64, f64), recorded: f64, by: &str) -> (Finding, Option<f64>) {
    let found = recorded / metre;
    let value = Value { value: found, sigma: sigma / metre * found, printed: (1.0, "units per metre") };
    let differs = (metre - 1.0).abs() > CERTAINTY * sigma;
    let percent = 100.0 * (found / recorded - 1.0);
    let (knowledge, note) = if differs {
        (Knowledge::Estimated, format!("{percent:+.2} % of what the calibration says, by {by}"))
    } else {
        (Knowledge::Recorded, format!("agrees with the calibration, {percent:+.2} %"))
    };
    (Finding { fact: "depth_scale", knowledge, value: Some(value), note }, differs.then_some(found))
}

/// The longest stretch of frames that were all found.
pub(super) fn longest_found(tracked: &[Tracked]) -> &[Tracked] {
    tracked.split(|frame| !frame.is_found).max_by_key(|stretch| stretch.len()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::RigidTransform;
    use mba_tracker::trajectory::ExposureTrajectory;

    use super::*;

    #[test]
    fn a_longer_metre_means_fewer_units_in_one() {
        let (finding, scale) = judged((1.02, 0.003), 5100.0, "the accelerometer");
        assert!((scale.unwrap() - 5000.0).abs() < 1e-9);
        assert_eq!(finding.knowledge, Knowledge::Estimated);
        let said = "depth scale 5000.00 +- 14.71 units per metre (-1.96 % of what the calibration says, by the accelerometer)";
        assert_eq!(finding.to_string(), said);
        let (finding, scale) = judged((1.005, 0.003), 5000.0, "the accelerometer");
        assert_eq!((scale, finding.knowledge), (None, Knowledge::Recorded));
    }

    #[test]
    fn the_longest_stretch_without_a_lost_frame_counts() {
        let pose = RigidTransform::identity();
        let frame = |index: usize| Tracked {
            index,
            timestamp: index as f64,
            is_found: index != 2 && index != 8,
            world_from_mid: pose,
            world_from_camera: ExposureTrajectory::still(pose),
            reference: 0,
            gain: 1.0,
            residual: 1.0,
        };
        let tracked: Vec<Tracked> = (0..12).map(frame).collect();
        let indices: Vec<usize> = longest_found(&tracked).iter().map(|frame| frame.index).collect();
        assert_eq!(indices, [3, 4, 5, 6, 7]);
        assert!(longest_found(&[]).is_empty());
    }
}
