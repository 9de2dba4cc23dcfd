//! What can be wrong with a sequence of exposures.

/// A sequence cannot be checked for continuity.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContinuityError {
    /// A timestamp is not finite or not above the one before it.
    #[error("frame {frame}: timestamp {timestamp} s does not follow the one before it")]
    Timestamp {
        /// Index of the frame.
        frame: usize,
        /// Its timestamp, seconds.
        timestamp: f64,
    },
    /// An exposure time is negative or not finite.
    #[error("frame {frame}: exposure of {seconds} s")]
    Exposure {
        /// Index of the frame.
        frame: usize,
        /// The exposure time, seconds.
        seconds: f64,
    },
    /// A pose has a number that is not finite, or a quaternion that is not of unit length.
    #[error("frame {frame}: its pose at shutter {end} is not a finite rigid motion")]
    Pose {
        /// Index of the frame.
        frame: usize,
        /// "opening" or "closing".
        end: &'static str,
    },
    /// A standard deviation is not positive and finite.
    #[error(
        "frame {frame}: standard deviations {translation} m and {rotation} rad, both have to be positive"
    )]
    Noise {
        /// Index of the frame.
        frame: usize,
        /// Standard deviation of the position, metres.
        translation: f64,
        /// Standard deviation of the rotation, radians.
        rotation: f64,
    },
    /// A setting is out of its range.
    #[error("continuity setting {name} = {value} is out of range")]
    Setting {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// Lists that describe the same frames have different lengths.
    #[error(
        "{exposures} exposures, {records} records and {seconds} exposure times: one of each per frame is needed"
    )]
    Lengths {
        /// Number of exposures.
        exposures: usize,
        /// Number of frame records.
        records: usize,
        /// Number of exposure times.
        seconds: usize,
    },
    /// The cone program of one part of the sequence was not solved.
    #[error("the path through frames {first} to {last} was not found: the conic solver says {status}")]
    Unsolved {
        /// First frame of the part.
        first: usize,
        /// Last frame of the part.
        last: usize,
        /// The solver's word.
        status: String,
    },
}
