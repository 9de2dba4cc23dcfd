//! Which way is up in the world of a run.

use serde::{Deserialize, Serialize};

/// How it came to be known that the z axis of a run's world points up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Upright {
    /// What said so.
    pub source: UpSource,
    /// Standard deviation of the direction, degrees; none where it was given.
    pub sigma_degrees: Option<f64>,
}

/// What can say where up is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UpSource {
    /// Gravity, as an accelerometer felt it along the poses.
    Accelerometer,
    /// Whoever started the run.
    Given,
}
