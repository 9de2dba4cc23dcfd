//! How uncertain poses are relative to the first frame.

use mba_io::statistics::quantile;
use mba_tracker::FrameResult;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Adds up the uncertainty of each frame relative to its keyframe and that of the keyframe.
///
/// A frame is as uncertain relative to its keyframe as the alignment says, times how far picture and depth contradict each
/// other beyond their noise (the ratio of Birge, as in averages of measurements that do not agree). A keyframe that is turned
/// wrongly displaces what is far from it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Uncertainty {
    frames: Vec<Pose>,
    /// How far picture and depth contradict each other in each frame.
    disagreements: Vec<f64>,
}

/// Uncertainty of one frame relative to the first.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Pose {
    /// Variance of the position, all axes together, square metres.
    position: f64,
    /// Variance of the rotation, all axes together, square radians.
    rotation: f64,
    /// World, metres.
    place: [f64; 3],
    measured: Measured,
}

/// What a frame was aligned with, and how uncertain it is relative to that.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Index of the frame that it was aligned with; its own where there is none.
    pub reference: usize,
    /// Standard deviations along one axis, metres, and about one, radians; 0 for a frame that was not aligned.
    pub sigma: [f64; 2],
}

impl Measured {
    /// The same with the reference as a frame of the recording, of which the tracker was `given` some.
    fn of_recording(self, given: &[usize]) -> Self {
        Self { reference: given.get(self.reference).copied().unwrap_or(0), ..self }
    }
}

impl Uncertainty {
    /// Median over the frames of how far picture and depth contradict each other: below 1 where only noise sets them apart.
    pub(crate) fn disagreement(&self) -> f64 {
        quantile(&self.disagreements, 0.5).unwrap_or(0.0)
    }

    /// What each frame was aligned with; `given` are the frames of the recording that were taken in.
    pub(crate) fn measured(&self, given: &[usize]) -> Vec<Measured> {
        self.frames.iter().map(|frame| frame.measured.of_recording(given)).collect()
    }

    /// What the last frame was aligned with.
    pub(crate) fn last_measured(&self, given: &[usize]) -> Measured {
        self.frames.last().map(|frame| frame.measured.of_recording(given)).unwrap_or_default()
    }

    /// Takes in the next frame and returns the standard deviation of its position, metres: all axes together, at mid exposure,
    /// relative to the first frame. None where the frame was not aligned.
    pub(crate) fn add(&mut self, result: &FrameResult) -> Option<f64> {
        self.disagreements.push(result.disagreement);
        let place = result.world_from_mid.translation;
        let start = Pose { place: place.into(), ..Pose::default() };
        let reference = self.frames.get(result.reference_index).copied().unwrap_or(start);
        let own = variances(result);
        let [position, rotation] = own.unwrap_or_default();
        // A small turn moves a point at distance d by d times its share across the line to it: two of three axes.
        let lever = (place - Vector3::from(reference.place)).norm_squared() * reference.rotation * 2.0 / 3.0;
        let pose = Pose {
            position: reference.position + lever + position,
            rotation: reference.rotation + rotation,
            place: place.into(),
            measured: Measured {
                reference: result.reference_index,
                sigma: [position, rotation].map(along_one_axis),
            },
        };
        self.frames.push(pose);
        let is_first = self.frames.len() == 1;
        (own.is_some() || is_first).then(|| pose.position.sqrt()).filter(|sigma| sigma.is_finite())
    }
}

/// Variances of position, square metres, and rotation, square radians, of a frame relative to what it was aligned with, all axes
/// together; none where it was not aligned.
fn variances(result: &FrameResult) -> Option<[f64; 2]> {
    let covariance = result.information.try_inverse()?;
    let variance = |first: usize| (first..first + 3).map(|i| covariance[(i, i)]).sum::<f64>();
    Some([variance(0), variance(3)].map(|variance| variance * result.disagreement.max(1.0)))
}

/// Three axes share a variance.
fn along_one_axis(variance: f64) -> f64 {
    (variance / 3.0).sqrt()
}

/// The standard deviations of [`Measured`].
pub(crate) fn sigma_of(result: &FrameResult) -> Option<[f64; 2]> {
    variances(result).map(|variances| variances.map(along_one_axis))
}
