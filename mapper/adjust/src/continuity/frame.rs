//! What is known of one frame.

use mba_tracker::geometry::RigidTransform;
use mba_tracker::trajectory::ExposureTrajectory;

use super::ContinuityError;
use super::scales::Sample;

/// How exactly the pose at either end of an exposure was measured: standard deviations along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseNoise {
    /// Of the position, metres; positive.
    pub translation: f64,
    /// Of the rotation, radians; positive.
    pub rotation: f64,
}

/// Noise of a frame whose image is hardly blurred.
const STILL_NOISE: PoseNoise = PoseNoise { translation: 1e-3, rotation: 5e-4 };

/// Share of the motion during the exposure by which its ends are uncertain: lengths of blur are typically found within
/// some percent.
const BLUR_SHARE: f64 = 0.04;

impl PoseNoise {
    /// What is typical of tracked blurred frames: a millimetre and half a milliradian, and a share of the motion.
    #[must_use]
    pub fn typical(exposure: &ExposureTrajectory) -> Self {
        let path = (exposure.end.translation - exposure.start.translation).norm();
        let turn = exposure.rotation_vector().norm();
        Self {
            translation: STILL_NOISE.translation.hypot(BLUR_SHARE * path),
            rotation: STILL_NOISE.rotation.hypot(BLUR_SHARE * turn),
        }
    }

    /// The noise times `factor` (positive).
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { translation: self.translation * factor, rotation: self.rotation * factor }
    }

    fn is_valid(&self) -> bool {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        positive(self.translation) && positive(self.rotation)
    }
}

/// One frame of a sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContinuityFrame {
    /// Mid exposure, seconds; increasing over the frames.
    pub timestamp: f64,
    /// Time the shutter was open, seconds, not negative.
    pub exposure_seconds: f64,
    /// `world_from_camera` over the exposure. Of a lost frame any valid pose.
    pub world_from_camera: ExposureTrajectory,
    /// Noise of the measured ends; `None` for a lost frame, whose poses measure nothing.
    pub noise: Option<PoseNoise>,
    /// Whether the tracker found nothing odd about the frame: then what it shows has to speak clearly for another pose.
    pub trusted: bool,
}

impl ContinuityFrame {
    /// The pose at mid exposure with its time.
    pub(super) fn sample(&self) -> Sample {
        Sample { timestamp: self.timestamp, world_from_camera: self.world_from_camera.mid() }
    }

    /// Times of shutter opening and closing, seconds.
    pub(super) fn shutter(&self) -> [f64; 2] {
        let half = 0.5 * self.exposure_seconds;
        [self.timestamp - half, self.timestamp + half]
    }
}

/// Checks every frame and the order of their times.
pub(super) fn validate(frames: &[ContinuityFrame]) -> Result<(), ContinuityError> {
    let mut before = f64::NEG_INFINITY;
    for (index, frame) in frames.iter().enumerate() {
        validate_frame(index, frame, before)?;
        before = frame.timestamp;
    }
    Ok(())
}

fn validate_frame(index: usize, frame: &ContinuityFrame, before: f64) -> Result<(), ContinuityError> {
    let timestamp = frame.timestamp;
    if !timestamp.is_finite() || timestamp <= before {
        return Err(ContinuityError::Timestamp { frame: index, timestamp });
    }
    let seconds = frame.exposure_seconds;
    if !seconds.is_finite() || seconds < 0.0 {
        return Err(ContinuityError::Exposure { frame: index, seconds });
    }
    let pose = |pose: &RigidTransform, end| {
        if pose.is_valid() { Ok(()) } else { Err(ContinuityError::Pose { frame: index, end }) }
    };
    pose(&frame.world_from_camera.start, "opening")?;
    pose(&frame.world_from_camera.end, "closing")?;
    match frame.noise {
        Some(noise) if !noise.is_valid() => Err(ContinuityError::Noise {
            frame: index,
            translation: noise.translation,
            rotation: noise.rotation,
        }),
        _ => Ok(()),
    }
}
