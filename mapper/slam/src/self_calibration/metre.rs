//! Depth units per metre: poses from depth are as long as the depth camera's metre, an accelerometer has the true one.

use mba_io::dataset::{Dataset, Knowledge};
use mba_io::imu::{InertialFit, inertial_fit};

use super::finding::{Finding, Value};
use super::window::{Guess, Recording, Resolution, Tracked};
use crate::tracking::TrackingOptions;

/// Error of the metre from what is not modelled: the accelerometer's own scale, its place beside the camera.
const SYSTEMATIC: f64 = 0.002;

/// Relative standard deviation from which on nothing is told.
const MAX_SIGMA: f64 = 0.03;

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
        Some(fit) => judged(&fit, recorded),
        None => {
            let note = "the accelerometer felt too little to measure a metre".to_owned();
            (Finding { fact: "depth_scale", knowledge: Knowledge::Recorded, value: None, note }, None)
        }
    })
}

fn with_systematic(fit: InertialFit) -> InertialFit {
    InertialFit { metre_sigma: fit.metre_sigma.hypot(SYSTEMATIC), ..fit }
}

/// A pose that is `metre` true metres long per metre was made with too many units per metre, by that factor.
fn judged(fit: &InertialFit, recorded: f64) -> (Finding, Option<f64>) {
    let found = recorded / fit.metre;
    let value = Value { value: found, sigma: fit.metre_sigma * found, printed: (1.0, "units per metre") };
    let differs = (fit.metre - 1.0).abs() > CERTAINTY * fit.metre_sigma;
    let percent = 100.0 * (found / recorded - 1.0);
    let (knowledge, note) = if differs {
        (Knowledge::Estimated, format!("{percent:+.2} % of what the calibration says, by the accelerometer"))
    } else {
        (Knowledge::Recorded, format!("agrees with the calibration, {percent:+.2} %"))
    };
    (Finding { fact: "depth_scale", knowledge, value: Some(value), note }, differs.then_some(found))
}

/// The longest stretch of frames that were all found.
fn longest_found(tracked: &[Tracked]) -> &[Tracked] {
    tracked.split(|frame| !frame.is_found).max_by_key(|stretch| stretch.len()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::RigidTransform;
    use mba_tracker::trajectory::ExposureTrajectory;
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn a_longer_metre_means_fewer_units_in_one() {
        let fit = |metre| InertialFit { metre, metre_sigma: 0.003, up: Vector3::y_axis(), up_sigma: 0.01 };
        let (finding, scale) = judged(&fit(1.02), 5100.0);
        assert!((scale.unwrap() - 5000.0).abs() < 1e-9);
        assert_eq!(finding.knowledge, Knowledge::Estimated);
        let said = "depth scale 5000.00 +- 15.00 units per metre (-1.96 % of what the calibration says, by the accelerometer)";
        assert_eq!(finding.to_string(), said);
        let (finding, scale) = judged(&fit(1.005), 5000.0);
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
