//! The layouts that mba reads as they are: those of TUM, Bonn, ETH3D, Replica and ScanNet, and its own.

use std::path::Path;

use mba_io::dataset::{DepthCamera, ExposureSource, Knowledge, is_data_set, open};
use mba_tracker::geometry::{Distortion, RigidTransform};

use crate::ImportError;
use crate::destination::Destination;
use crate::facts::Facts;
use crate::format::{Format, Reading, first_file, stem};
use crate::picture::Picture;
use crate::time::Time;

pub(crate) const FORMAT: Format = Format {
    name: "TUM, Bonn, ETH3D, Replica or ScanNet",
    looked_for: "rgb.txt and depth.txt, associations.txt, traj.txt and results/, or color/, depth/, pose/ and intrinsic/",
    recognise: is_data_set,
    read,
};

fn read(reading: &Reading<'_>, destination: &mut Destination) -> Result<Facts, ImportError> {
    let folder = reading.path;
    let dataset = open(folder)?;
    dataset.warnings().iter().for_each(|warning| destination.note(warning.to_string()));
    let calibration = dataset.calibration();
    let indices: Vec<usize> = (0..dataset.len()).collect();
    let time = |seconds: f64| {
        Time::from_seconds(seconds)
            .ok_or_else(|| ImportError::damaged(folder, format!("{seconds} s is no time")))
    };
    let is_per_frame = calibration.exposure == ExposureSource::PerFrame;
    reading.each(&indices, |&index| {
        let [colour, depth] = dataset.image_paths(index);
        let at = time(dataset.timestamp(index))?;
        let name = destination.add_colour(at, &Picture::File(colour.to_owned()), colour)?;
        if let Some(mask) = beside(folder, &["mask", "masks"], colour) {
            destination.add_mask(&name, &Picture::File(mask.clone()), &mask)?;
        }
        let depth_at = time(dataset.depth_timestamp(index))?;
        let name = destination.add_depth(depth_at, &Picture::File(depth.to_owned()), depth)?;
        if let Some(confidence) = beside(folder, &["confidence"], depth) {
            destination.add_confidence(&name, &Picture::File(confidence.clone()), &confidence)?;
        }
        if is_per_frame {
            destination.exposures.push((at, dataset.exposure_seconds(index)));
        }
        Ok(())
    })?;
    for pose in dataset.ground_truth() {
        destination.poses.push((time(pose.timestamp)?, pose.world_from_camera));
    }
    if let Some(imu) = dataset.imu() {
        // In the axes of the camera already.
        for (from, to) in [
            (imu.angular_velocities(), &mut destination.rates),
            (imu.specific_forces(), &mut destination.forces),
        ] {
            for sample in from {
                to.push((time(sample.time)?, sample.value.into()));
            }
        }
    }
    let stored = dataset.stored_colour_camera();
    let mut facts = Facts::new(stored, calibration.depth_scale);
    facts.distortion = calibration.distortion;
    facts.depth_camera = calibration.depth_camera.or_else(|| {
        (stored != calibration.camera).then(|| DepthCamera {
            camera: calibration.camera,
            distortion: Distortion::default(),
            colour_from_depth: RigidTransform::identity(),
        })
    });
    facts.frame_rate = Some(calibration.frame_rate);
    if let ExposureSource::Constant { seconds } = calibration.exposure {
        facts.exposure_seconds = Some(seconds);
    }
    let sources = &calibration.sources;
    facts.readout = (sources.readout != Knowledge::Assumed).then_some(calibration.readout);
    facts.response = (sources.response != Knowledge::Assumed).then(|| calibration.response.clone());
    facts.vignetting = (sources.vignetting != Knowledge::Assumed).then_some(calibration.vignetting);
    facts.depth_readout_seconds = calibration.depth_readout_seconds;
    Ok(facts)
}

/// The image of the same name in one of these folders.
fn beside(folder: &Path, names: &[&str], image: &Path) -> Option<std::path::PathBuf> {
    let name = image.file_name()?.to_string_lossy().into_owned();
    let candidates = names.iter().flat_map(|inner| {
        [format!("{}.png", stem(image)), format!("{name}.png"), name.clone()]
            .map(|name| folder.join(inner).join(name))
    });
    first_file(candidates)
}
