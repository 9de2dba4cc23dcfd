//! The word of the frames themselves on what continuity suggests.

use mba_tracker::trajectory::ExposureTrajectory;

/// A frame that continuity would rather see elsewhere.
#[derive(Clone, Copy, Debug)]
pub struct Suspicion<'a> {
    /// Index of the frame.
    pub frame: usize,
    /// `world_from_camera` over the exposure as it was measured.
    pub measured: &'a ExposureTrajectory,
    /// The same as continuity suggests it.
    pub suggested: &'a ExposureTrajectory,
    /// Frames that nothing speaks against, nearest first, with their own exposures.
    pub references: &'a [(usize, ExposureTrajectory)],
}

/// How badly two exposures explain what a frame shows: mean robust costs, 0 for perfectly to 1 for not at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mismatch {
    /// Of the measured exposure.
    pub measured: f64,
    /// Of the suggested exposure.
    pub suggested: f64,
}

/// Compares two exposures by what their frame shows; `None` where that says nothing.
pub type Evidence<'a> = dyn Fn(&Suspicion<'_>) -> Option<Mismatch> + Sync + 'a;

/// How much better than the measured exposure the suggested one has to explain a frame that the tracker trusts: its
/// mismatch has to be below this share.
const CLEARLY_BETTER: f64 = 0.9;

/// Mismatches of a path and of the same path backwards that differ by less than this share are equal: blur looks the
/// same both ways.
const SAME_PICTURE: f64 = 0.02;

impl Mismatch {
    /// Whether the frame belongs where it was measured rather than where continuity suggests. `trusted` says that the
    /// tracker found nothing odd about it.
    pub(super) fn holds_place(self, trusted: bool) -> bool {
        let share = if trusted { CLEARLY_BETTER } else { 1.0 };
        self.suggested >= share * self.measured
    }

    /// Whether the picture contradicts a change of the direction of time. It can only where rows are exposed one
    /// after the other.
    pub(super) fn holds_direction(self) -> bool {
        self.suggested > (1.0 + SAME_PICTURE) * self.measured
    }
}
