//! The file: header, checksum, payload.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::identity::IDENTITY_LEN;
use super::{CheckpointError, Identity};
use crate::BinaryFileError;
use crate::binary_file::{check_checksum, check_length, check_version};
use crate::whole_file::{read, write_durably};

/// What every checkpoint starts with.
const MAGIC: [u8; 8] = *b"MBACKPT\n";

/// Version of the layout.
const VERSION: u32 = 2;

const VERSION_AT: usize = MAGIC.len();
const IDENTITY_AT: usize = VERSION_AT + 4;
const LENGTH_AT: usize = IDENTITY_AT + IDENTITY_LEN;
const CHECKSUM_AT: usize = LENGTH_AT + 8;
const HEADER_LEN: usize = CHECKSUM_AT + 4;

/// Writes `value` as the checkpoint of the run `identity`. The file is on the disk when this returns, and is never
/// half a checkpoint: an older one is replaced at once or not at all.
///
/// # Errors
/// [`CheckpointError::File`], [`CheckpointError::Unencodable`].
pub fn save(path: &Path, identity: &Identity, value: &impl Serialize) -> Result<(), CheckpointError> {
    let unencodable = |reason| CheckpointError::Unencodable { path: path.to_owned(), reason };
    let mut bytes = postcard::to_extend(value, vec![0; HEADER_LEN]).map_err(unencodable)?;
    let length = (bytes.len() - HEADER_LEN) as u64;
    bytes[..VERSION_AT].copy_from_slice(&MAGIC);
    bytes[VERSION_AT..IDENTITY_AT].copy_from_slice(&VERSION.to_le_bytes());
    bytes[IDENTITY_AT..LENGTH_AT].copy_from_slice(&identity.to_bytes());
    bytes[LENGTH_AT..CHECKSUM_AT].copy_from_slice(&length.to_le_bytes());
    let checksum = checksum(&bytes[IDENTITY_AT..CHECKSUM_AT], &bytes[HEADER_LEN..]);
    bytes[CHECKSUM_AT..HEADER_LEN].copy_from_slice(&checksum.to_le_bytes());
    Ok(write_durably(path, &bytes)?)
}

/// Reads the checkpoint of the run `identity`.
///
/// # Errors
/// All of [`CheckpointError`] but `Unencodable`; of several defects the one that explains the others.
pub fn load<T: DeserializeOwned>(path: &Path, identity: &Identity) -> Result<T, CheckpointError> {
    let bytes = read(path, &MAGIC)?;
    let content = |reason| CheckpointError::Content { path: path.to_owned(), reason };
    match postcard::take_from_bytes(payload(path, identity, &bytes)?) {
        Ok((value, [])) => Ok(value),
        Ok(_) => Err(content(postcard::Error::DeserializeBadEncoding)),
        Err(reason) => Err(content(reason)),
    }
}

/// The payload of a whole checkpoint of the run `identity`.
fn payload<'a>(path: &Path, identity: &Identity, bytes: &'a [u8]) -> Result<&'a [u8], CheckpointError> {
    let found = bytes.len() as u64;
    if !bytes.starts_with(&MAGIC[..MAGIC.len().min(bytes.len())]) {
        return Err(CheckpointError::NotACheckpoint { path: path.to_owned() });
    }
    let Some((header, payload)) = bytes.split_first_chunk::<HEADER_LEN>() else {
        let (path, expected) = (path.to_owned(), HEADER_LEN as u64);
        return Err(BinaryFileError::Length { path, expected, found }.into());
    };
    check_version(path, "the checkpoint layout", VERSION, u32::from_le_bytes(field(header, VERSION_AT)))?;
    // Cut or damaged files are told from those of other runs before anything is decoded.
    let expected = u64::from_le_bytes(field(header, LENGTH_AT)).saturating_add(HEADER_LEN as u64);
    check_length(path, expected, found)?;
    let expected = u32::from_le_bytes(field(header, CHECKSUM_AT));
    check_checksum(path, expected, checksum(&header[IDENTITY_AT..CHECKSUM_AT], payload))?;
    match identity.difference(&field(header, IDENTITY_AT)) {
        Some(difference) => Err(CheckpointError::Foreign { path: path.to_owned(), difference }),
        None => Ok(payload),
    }
}

/// The `N` bytes of a header from byte `at`, which lie within it.
fn field<const N: usize>(header: &[u8; HEADER_LEN], at: usize) -> [u8; N] {
    core::array::from_fn(|k| header[at + k])
}

fn checksum(header: &[u8], payload: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(header);
    hasher.update(payload);
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::{Difference, Fingerprint, exact_floats};
    use super::*;
    use crate::FileError;

    #[derive(Debug, serde::Serialize, serde::Deserialize)]
    struct Sample {
        iteration: u64,
        points: Vec<[f32; 3]>,
        #[serde(with = "exact_floats")]
        moments: Vec<f32>,
    }

    fn identity() -> Identity {
        let part = |name: &str| Fingerprint::of(name);
        Identity {
            program: part("mba"),
            dataset: part("room"),
            trajectory: part("run"),
            settings: part("default"),
            simd: part("avx2"),
        }
    }

    fn sample() -> Sample {
        let odd = [f32::from_bits(0x7fc1_2345), f32::from_bits(0xff80_0001), -0.0, f32::MIN_POSITIVE / 2.0];
        Sample { iteration: 1 << 40, points: vec![[0.5, -1.0, 3.0]; 14], moments: odd.to_vec() }
    }

    fn saved() -> (tempfile::TempDir, std::path::PathBuf, Vec<u8>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        save(&path, &identity(), &sample()).unwrap();
        let bytes = fs::read(&path).unwrap();
        (folder, path, bytes)
    }

    fn refusal(path: &Path, bytes: &[u8]) -> CheckpointError {
        fs::write(path, bytes).unwrap();
        load::<Sample>(path, &identity()).unwrap_err()
    }

    #[test]
    fn a_checkpoint_returns_bit_for_bit() {
        let (folder, path, _) = saved();
        let back: Sample = load(&path, &identity()).unwrap();
        assert_eq!((back.iteration, &back.points), (1 << 40, &sample().points));
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&back.moments), bits(&sample().moments));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no partial file is left");
    }

    #[test]
    fn every_cut_is_noticed() {
        let (_folder, path, bytes) = saved();
        for length in 0..bytes.len() {
            let error = refusal(&path, &bytes[..length]);
            let expected = if length < HEADER_LEN { HEADER_LEN } else { bytes.len() } as u64;
            let CheckpointError::Unsound(BinaryFileError::Length { expected: announced, found, .. }) = error
            else {
                panic!("{length} bytes: {error}")
            };
            assert_eq!((announced, found), (expected, length as u64));
        }
        let longer = [&bytes[..], &[0]].concat();
        assert!(matches!(refusal(&path, &longer), CheckpointError::Unsound(BinaryFileError::Length { .. })));
    }

    #[test]
    fn every_flipped_byte_is_noticed() {
        let (_folder, path, bytes) = saved();
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            let error = refusal(&path, &damaged);
            use CheckpointError::{NotACheckpoint, Unsound};
            let right = match at {
                ..VERSION_AT => matches!(error, NotACheckpoint { .. }),
                VERSION_AT..IDENTITY_AT => {
                    matches!(error, Unsound(BinaryFileError::Version { expected: 2, .. }))
                }
                LENGTH_AT..CHECKSUM_AT => matches!(error, Unsound(BinaryFileError::Length { .. })),
                _ => matches!(error, Unsound(BinaryFileError::Damaged { .. })),
            };
            assert!(right, "byte {at}: {error}");
        }
    }

    #[test]
    fn a_checkpoint_of_another_run_is_named() {
        let (_folder, path, _) = saved();
        let other = Fingerprint::of("other");
        let cases = [
            (Identity { program: other, ..identity() }, Difference::Program),
            (Identity { dataset: other, settings: other, ..identity() }, Difference::Dataset),
            (Identity { trajectory: other, ..identity() }, Difference::Trajectory),
            (Identity { settings: other, ..identity() }, Difference::Settings),
            (Identity { simd: other, ..identity() }, Difference::Simd),
        ];
        for (identity, expected) in cases {
            let error = load::<Sample>(&path, &identity).unwrap_err();
            assert!(
                matches!(error, CheckpointError::Foreign { difference, .. } if difference == expected),
                "{error}"
            );
        }
    }

    #[test]
    fn another_type_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        save(&path, &identity(), &(7_u64, true)).unwrap();
        let error = load::<u64>(&path, &identity()).unwrap_err();
        assert!(matches!(error, CheckpointError::Content { .. }), "a byte is left over: {error}");
        let error = load::<(u64, bool, u64)>(&path, &identity()).unwrap_err();
        assert!(matches!(error, CheckpointError::Content { .. }), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_leaves_the_last_checkpoint() {
        let (folder, path, _) = saved();
        std::os::unix::fs::symlink("/dev/full", folder.path().join("checkpoint.partial")).unwrap();
        let error = save(&path, &identity(), &sample()).unwrap_err();
        assert!(matches!(error, CheckpointError::File(FileError::Unwritable { .. })), "{error}");
        assert_eq!(load::<Sample>(&path, &identity()).unwrap().iteration, 1 << 40);
    }
}
