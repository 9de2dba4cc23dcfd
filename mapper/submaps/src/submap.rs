//! `submap.json`: what the map of one group says of itself.

use std::collections::BTreeMap;
use std::path::Path;

use mba_io::checkpoint::Fingerprint;
use mba_io::run_layout::{EXPOSURES_FILE, FRAMES_FILE, SUBMAP_FILE};
use mba_io::whole_file::{read, read_text, write_durably};
use mba_map::map::MAP_FILE;
use mba_slam::mapping::MappedKeyframe;
use mba_tracker::geometry::RigidTransform;
use nalgebra::{Matrix6, Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::{Job, SubmapError};

/// Version of the layout.
const FORMAT: u32 = 1;

/// Files whose content the submap stands for, each with what it starts with.
const FILES: [(&str, &[u8]); 3] = [(MAP_FILE, b"ply"), (EXPOSURES_FILE, b""), (FRAMES_FILE, b"")];

/// What the map of one group says of itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Submap {
    format: u32,
    /// Fingerprint of the plan that it was mapped for.
    job: String,
    /// Number of the group.
    group: usize,
    /// Fingerprints of files by name.
    files: BTreeMap<String, String>,
    /// All keyframes that it was mapped with, ascending by frame.
    pub keyframes: Vec<SubmapKeyframe>,
}

/// Where the map of a group has a keyframe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SubmapKeyframe {
    /// Index of the frame in the data set.
    pub frame: usize,
    /// Camera-to-world at mid exposure in the group's world: metres, then the quaternion x, y, z, w.
    pose: [f64; 7],
    /// Logarithm of the gain on the light of the group's map that gives the frame's.
    pub log_gain: f64,
    /// Inverse covariance of the pose in the camera frame, six rows.
    information: [[f64; 6]; 6],
}

impl SubmapKeyframe {
    /// Camera-to-world at mid exposure, in the world of the group.
    #[must_use]
    pub fn world_from_camera(&self) -> RigidTransform {
        let [x, y, z, qx, qy, qz, qw] = self.pose;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
        RigidTransform::new(rotation, Vector3::new(x, y, z))
    }

    /// Inverse covariance of the pose: translation in metres and rotation in radians, both in the camera frame.
    #[must_use]
    pub fn information(&self) -> Matrix6<f64> {
        Matrix6::from_fn(|row, column| self.information[row][column])
    }

    fn is_sound(&self) -> bool {
        let length = self.pose[3..].iter().map(|q| q * q).sum::<f64>();
        let numbers = self.pose.iter().chain(self.information.iter().flatten());
        // A quaternion has length 1 to the digits that are written.
        (length - 1.0).abs() < 1e-3 && self.log_gain.is_finite() && numbers.into_iter().all(|x| x.is_finite())
    }
}

impl From<&MappedKeyframe> for SubmapKeyframe {
    fn from(mapped: &MappedKeyframe) -> Self {
        let (t, q) = (mapped.world_from_camera.translation, mapped.world_from_camera.rotation.coords);
        Self {
            frame: mapped.index,
            pose: [t.x, t.y, t.z, q.x, q.y, q.z, q.w],
            log_gain: mapped.log_gain,
            information: [0, 1, 2, 3, 4, 5].map(|row| mapped.information.row(row).transpose().into()),
        }
    }
}

impl Submap {
    /// One without files.
    #[cfg(test)]
    pub(crate) fn of_keyframes(keyframes: &[MappedKeyframe]) -> Self {
        let (job, files) = (String::new(), BTreeMap::new());
        let keyframes = keyframes.iter().map(SubmapKeyframe::from).collect();
        Self { format: FORMAT, job, group: 0, files, keyframes }
    }

    /// Writes what group `group` of a job came to, after all its other files.
    pub(crate) fn write(job: &Job, group: usize, keyframes: &[MappedKeyframe]) -> Result<(), SubmapError> {
        let folder = job.group_folder(group);
        let submap = Self {
            format: FORMAT,
            job: job.digest().to_owned(),
            group,
            files: file_digests(&folder)?,
            keyframes: keyframes.iter().map(SubmapKeyframe::from).collect(),
        };
        let path = folder.join(SUBMAP_FILE);
        let text = serde_json::to_string_pretty(&submap)
            .map_err(|error| SubmapError::Malformed { path: path.clone(), message: error.to_string() })?;
        Ok(write_durably(&path, (text + "\n").as_bytes())?)
    }

    /// Reads what group `group` of a job came to, and checks that it belongs there and that its files are whole.
    ///
    /// # Errors
    /// [`SubmapError::Missing`], [`SubmapError::Foreign`], [`SubmapError::Damaged`] or what is wrong with the file.
    pub fn read(job: &Job, group: usize) -> Result<Self, SubmapError> {
        let folder = job.group_folder(group);
        let path = folder.join(SUBMAP_FILE);
        if !path.is_file() {
            return Err(SubmapError::Missing { folder });
        }
        let malformed = |message| SubmapError::Malformed { path: path.clone(), message };
        let submap: Self =
            serde_json::from_str(&read_text(&path)?).map_err(|error| malformed(error.to_string()))?;
        if submap.format != FORMAT {
            return Err(malformed(format!("format is {}, this version reads {FORMAT}", submap.format)));
        }
        let foreign = |what: String| SubmapError::Foreign { path: path.clone(), what };
        if submap.job != job.digest() {
            return Err(foreign("it was mapped for another plan, or the plan has changed since".to_owned()));
        }
        if submap.group != group {
            return Err(foreign(format!("it is the map of group {}, not {group}", submap.group)));
        }
        let part = job.plan.groups[group].part();
        let is_asked_for = |pose: &SubmapKeyframe| part.keyframes.binary_search(&pose.frame).is_ok();
        let is_ascending = submap.keyframes.windows(2).all(|pair| pair[0].frame < pair[1].frame);
        if let Some(pose) = submap.keyframes.iter().find(|pose| !pose.is_sound() || !is_asked_for(pose)) {
            return Err(malformed(format!("keyframe {} makes no sense", pose.frame)));
        }
        if !is_ascending {
            return Err(malformed("keyframes must ascend".to_owned()));
        }
        for (name, digest) in file_digests(&folder)? {
            if submap.files.get(&name) != Some(&digest) {
                return Err(SubmapError::Damaged { path: folder.join(name) });
            }
        }
        Ok(submap)
    }
}

fn file_digests(folder: &Path) -> Result<BTreeMap<String, String>, SubmapError> {
    let digest = |&(name, magic): &(&str, &[u8])| {
        let path = folder.join(name);
        let content = if magic.is_empty() { read_text(&path)?.into_bytes() } else { read(&path, magic)? };
        Ok((name.to_owned(), Fingerprint::of_bytes(&content).to_string()))
    };
    FILES.iter().map(digest).collect()
}
