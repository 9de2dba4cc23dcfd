//! Which run a checkpoint belongs to.

use std::fmt;

use mba_tracker::SimdLevel;
use mba_tracker::simd::level_name;
use serde::Serialize;

use crate::dataset::Dataset;

/// Length of a stored identity in bytes.
pub(super) const IDENTITY_LEN: usize = 40;

/// A 64-bit hash (FNV-1a) that is the same on all machines. It tells mistakes apart, it does not stop forgers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fingerprint(u64);

impl Fingerprint {
    /// Of any value, e.g. settings or a list of poses; equal values have equal fingerprints. A value that cannot be
    /// encoded, which no plain structure is, has the fingerprint of no bytes.
    #[must_use]
    pub fn of(value: &(impl Serialize + ?Sized)) -> Self {
        Self::of_bytes(&postcard::to_stdvec(value).unwrap_or_default())
    }

    /// Of the frames and the calibration of a data set, wherever it lies.
    pub fn of_dataset(dataset: &Dataset) -> Self {
        let stamps: Vec<f64> = (0..dataset.len()).map(|index| dataset.timestamp(index)).collect();
        Self::of(&(format!("{:?}", dataset.calibration()), stamps))
    }

    /// Of the instructions that a run computes with.
    #[must_use]
    pub fn of_simd(level: SimdLevel) -> Self {
        Self::of(level_name(level))
    }

    /// Of bytes, e.g. the content of a file.
    #[must_use]
    pub fn of_bytes(bytes: &[u8]) -> Self {
        let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        Self(bytes.iter().fold(0xcbf2_9ce4_8422_2325, step))
    }
}

impl fmt::Display for Fingerprint {
    /// 16 hexadecimal digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// Fingerprints of all that a run depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Program and version.
    pub program: Fingerprint,
    /// The data set: its frames and calibration.
    pub dataset: Fingerprint,
    /// The poses that the run started from.
    pub trajectory: Fingerprint,
    /// Options that change the result.
    pub settings: Fingerprint,
    /// The SIMD level: levels differ in the last digits of what they compute.
    pub simd: Fingerprint,
}

/// In what a checkpoint belongs to another run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Difference {
    /// See [`Identity::program`].
    Program,
    /// See [`Identity::dataset`].
    Dataset,
    /// See [`Identity::trajectory`].
    Trajectory,
    /// See [`Identity::settings`].
    Settings,
    /// See [`Identity::simd`].
    Simd,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Program => "written by another command or another version of the program",
            Self::Dataset => "of another data set",
            Self::Trajectory => "of a run that started from another trajectory",
            Self::Settings => "of a run with other settings",
            Self::Simd => "of a run with another SIMD level, see --simd",
        })
    }
}

impl Identity {
    pub(super) fn to_bytes(self) -> [u8; IDENTITY_LEN] {
        let mut bytes = [0; IDENTITY_LEN];
        for (place, part) in bytes.chunks_exact_mut(8).zip(self.parts()) {
            place.copy_from_slice(&part.to_le_bytes());
        }
        bytes
    }

    /// The first difference to the stored identity `bytes`.
    pub(super) fn difference(self, bytes: &[u8; IDENTITY_LEN]) -> Option<Difference> {
        let own = self.to_bytes();
        let different = own.chunks_exact(8).zip(bytes.chunks_exact(8)).position(|(a, b)| a != b)?;
        let kinds = [
            Difference::Program,
            Difference::Dataset,
            Difference::Trajectory,
            Difference::Settings,
            Difference::Simd,
        ];
        kinds.get(different).copied()
    }

    fn parts(self) -> [u64; 5] {
        [self.program.0, self.dataset.0, self.trajectory.0, self.settings.0, self.simd.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fingerprints_are_the_published_hash() {
        // Test vectors of the FNV reference code.
        assert_eq!(Fingerprint::of_bytes(b""), Fingerprint(0xcbf2_9ce4_8422_2325));
        assert_eq!(Fingerprint::of_bytes(b"a"), Fingerprint(0xaf63_dc4c_8601_ec8c));
        assert_eq!(Fingerprint::of_bytes(b"foobar"), Fingerprint(0x8594_4171_f739_67e8));
    }
}
