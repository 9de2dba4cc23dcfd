//! What can be chosen about the continuity of a sequence.

use super::ContinuityError;

/// Physical limits of a motion along any direction: metres (or radians) and seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionLimits {
    /// Largest acceleration, m/s² or rad/s²; positive.
    pub acceleration: f64,
    /// Largest change of the acceleration, m/s³ or rad/s³; positive.
    pub jerk: f64,
}

/// Settings of [`repair`](super::repair).
///
/// The limits are those of an arm, far above a tremor: they bound what a bridge over missing frames may do. What is
/// usual in a sequence follows from the sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContinuitySettings {
    /// Limits of the translation, in m/s² and m/s³.
    pub translation: MotionLimits,
    /// Limits of the rotation, in rad/s² and rad/s³.
    pub rotation: MotionLimits,
    /// Control points of the spline per median frame interval, 1 to 8. Two can represent both ends of every exposure.
    pub control_points_per_frame: f64,
    /// Huber width: residual norm of a frame, in its standard deviations, from which the cost grows linearly; positive.
    pub huber: f64,
    /// How much more than its typical jerk a sequence may show before bending costs, as a factor; positive.
    pub jerk_tolerance: f64,
    /// Distance of a frame's middle from what the frames around it predict, in expected errors, above which it is an
    /// outlier; positive. Expected errors follow from noise and jerk, and grow to what is typical of the sequence.
    pub outlier: f64,
    /// Evidence (half the difference of squared residual norms) that a swap of start and end has to bring; not
    /// negative.
    pub swap_evidence: f64,
    /// Longest time between usable frames that is bridged, in median frame intervals; at least 1.
    pub longest_gap: f64,
    /// Largest number of solutions, each linearised at the one before it and with the directions that follow from
    /// it; 1 to 50.
    pub rounds: usize,
}

impl Default for ContinuitySettings {
    fn default() -> Self {
        Self {
            // Fifty times gravity, and the turn that gives it a third of a metre from the axis; both build up within 5 ms.
            translation: MotionLimits { acceleration: 500.0, jerk: 100_000.0 },
            rotation: MotionLimits { acceleration: 1_500.0, jerk: 300_000.0 },
            // As many as an exposure has ends.
            control_points_per_frame: 2.0,
            // Three standard deviations: noise alone hardly ever goes beyond.
            huber: 3.0,
            jerk_tolerance: 2.0,
            // Far beyond the tails of noise, and of what is typical of the sequence.
            outlier: 10.0,
            // Odds of e^5, 150 to 1.
            swap_evidence: 5.0,
            // A third of a second at 30 Hz.
            longest_gap: 10.0,
            // An upper bound: it ends when no direction flips and turns have settled.
            rounds: 8,
        }
    }
}

impl ContinuitySettings {
    /// Checks every field.
    ///
    /// # Errors
    /// [`ContinuityError::Setting`] names the first field out of its range.
    pub fn validate(&self) -> Result<(), ContinuityError> {
        let at_least = |name, value: f64, least: f64| (name, value, value.is_finite() && value >= least);
        let positive = |name, value: f64| (name, value, value.is_finite() && value > 0.0);
        let checks = [
            positive("translation.acceleration", self.translation.acceleration),
            positive("translation.jerk", self.translation.jerk),
            positive("rotation.acceleration", self.rotation.acceleration),
            positive("rotation.jerk", self.rotation.jerk),
            at_least("control_points_per_frame", self.control_points_per_frame, 1.0),
            ("control_points_per_frame", self.control_points_per_frame, self.control_points_per_frame <= 8.0),
            positive("huber", self.huber),
            positive("jerk_tolerance", self.jerk_tolerance),
            positive("outlier", self.outlier),
            at_least("swap_evidence", self.swap_evidence, 0.0),
            at_least("longest_gap", self.longest_gap, 1.0),
            ("rounds", self.rounds as f64, (1..=50).contains(&self.rounds)),
        ];
        match checks.into_iter().find(|&(_, _, good)| !good) {
            Some((name, value, _)) => Err(ContinuityError::Setting { name, value }),
            None => Ok(()),
        }
    }
}
