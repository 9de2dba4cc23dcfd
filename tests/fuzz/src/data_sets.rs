//! The files of data sets, in all layouts that are read: whatever they hold, opening ends with a data set that can be
//! used or with an error.

use std::cell::RefCell;
use std::fs;

use mba_mapper::dataset::{
    Dataset, open, read_calibration, read_exposure_times, read_response, survey, write_calibration,
    write_exposure_times,
};

use super::picture::{GREY_4X3, write_frames};
use super::place::{Kept, Place, in_place};

const CALIBRATION: &str = "width = 32\nheight = 24\nfx = 30.0\nfy = 30.0\ncx = 15.5\ncy = 11.5\ndepth_scale = 1000\n\
     frame_rate = 30\nexposure_seconds = 0.01\nresponse = \"linear\"\nreadout = \"global\"\n";

/// Largest number of pixels for which everything that is derived from a calibration is computed.
const FEW_PIXELS: usize = 1 << 14;

/// Four frames of 32x24 pixels with everything that a data set needs.
fn fill(place: &Place) {
    write_frames(place);
    place.write("calibration.toml", CALIBRATION.as_bytes());
}

/// Opens the data set and looks at all of it but the images.
fn look(place: &Place) -> Option<Dataset> {
    let dataset = match open(place.folder()) {
        Ok(dataset) => dataset,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return None;
        }
    };
    dataset.warnings().iter().for_each(|warning| assert!(!warning.to_string().is_empty()));
    assert!(!dataset.is_empty());
    for index in 0..dataset.len() {
        assert!(dataset.timestamp(index).is_finite());
        let (exposure, depth) = (dataset.exposure_seconds(index), dataset.depth_timestamp(index));
        assert!(exposure.is_finite() && exposure >= 0.0, "{exposure}");
        assert!(depth.is_finite(), "{depth}");
    }
    if dataset.calibration().camera.width * dataset.calibration().camera.height < FEW_PIXELS {
        let falloff = dataset.light_falloff().unwrap_or_default();
        assert!(falloff.iter().all(|share| share.is_finite()), "{:?}", dataset.calibration());
    }
    Some(dataset)
}

/// `rgb.txt`, `depth.txt`, `associations.txt`.
pub fn lists(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    in_place(&KEPT, fill, |place| {
        place.write_parts(&["rgb.txt", "depth.txt", "associations.txt"], data);
        look(place);
    });
}

/// `calibration.toml`, and what follows from it.
pub fn calibration(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    in_place(&KEPT, fill, |place| {
        let path = place.write("calibration.toml", data);
        let Some(dataset) = look(place) else { return };
        let pixels = dataset.calibration().camera.width * dataset.calibration().camera.height;
        assert!(pixels == 32 * 24, "images of another size were let through");
        let _ = survey(&dataset, 2);
        let Ok(read) = read_calibration(&path) else { return };
        // What was read can be written, and reads as the same.
        let again = place.path("again.toml");
        write_calibration(&again, &read).expect("a writable folder");
        let same = read_calibration(&again).unwrap_or_else(|error| panic!("{read:?}: {error}"));
        assert_eq!(same.camera, read.camera);
        assert_eq!(same.readout, read.readout);
    });
}

/// `exposures.csv`.
pub fn exposure_times(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    in_place(&KEPT, fill, |place| {
        let path = place.write("exposures.csv", data);
        look(place);
        let Ok((times, exposures)) = read_exposure_times(&path) else { return };
        let rows: Vec<(f64, f64)> = times.iter().copied().zip(exposures.iter().copied()).collect();
        let again = place.path("again.csv");
        write_exposure_times(&again, &rows).expect("a writable folder");
    });
}

/// `response.txt`, a table of either form.
pub fn response(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    in_place(
        &KEPT,
        |_| (),
        |place| {
            let path = place.write("response.txt", data);
            let Ok(response) = read_response(&path) else { return };
            let lights: Vec<f32> = (0..=255).map(|code| response.linear_light(code)).collect();
            assert!(lights.windows(2).all(|pair| pair[0] < pair[1]) && lights[255] == 1.0, "{lights:?}");
        },
    );
}

/// `imu.csv`, `imu0/data.csv`, `gyro.csv`, `accelerometer.txt`.
pub fn inertial(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    let fill = |place: &Place| {
        fill(place);
        fs::create_dir(place.path("imu0")).expect("a folder");
    };
    in_place(&KEPT, fill, |place| {
        place.write_parts(&["imu.csv", "imu0/data.csv", "gyro.csv", "accelerometer.txt"], data);
        let Some(dataset) = look(place) else { return };
        let Some(imu) = dataset.imu() else { return };
        for (from, to) in [(1.0, 1.033), (1.1, 1.0), (-1e300, 1e300), (f64::NAN, 1.0), (1.05, 1.05)] {
            let _ = (imu.mean_angular_velocity(from, to), imu.mean_specific_force(from, to));
            let _ = imu.rotation_between(from, to);
        }
    });
}

/// `groundtruth.txt`, `groundtruth_exposure.txt`.
pub fn ground_truth(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    in_place(&KEPT, fill, |place| {
        place.write_parts(&["groundtruth.txt", "groundtruth_exposure.txt"], data);
        let Some(dataset) = look(place) else { return };
        for pose in dataset.ground_truth() {
            assert!(pose.world_from_camera.is_valid() && pose.timestamp.is_finite(), "{pose:?}");
        }
    });
}

/// `cam_params.json`, `traj.txt` of Replica.
pub fn replica(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    let fill = |place: &Place| {
        fs::create_dir(place.path("results")).expect("a folder");
        for k in 0..2 {
            place.write(&format!("results/frame{k:06}.png"), GREY_4X3);
            place.write(&format!("results/depth{k:06}.png"), GREY_4X3);
        }
    };
    in_place(&KEPT, fill, |place| {
        place.write_parts(&["cam_params.json", "traj.txt"], data);
        look(place);
    });
}

/// `intrinsic/intrinsic_color.txt`, `intrinsic/intrinsic_depth.txt`, `pose/0.txt`, `pose/1.txt` of ScanNet.
pub fn scannet(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    let fill = |place: &Place| {
        for folder in ["color", "depth", "pose", "intrinsic"] {
            fs::create_dir(place.path(folder)).expect("a folder");
        }
        for k in 0..2 {
            place.write(&format!("color/{k}.png"), GREY_4X3);
            place.write(&format!("depth/{k}.png"), GREY_4X3);
        }
    };
    in_place(&KEPT, fill, |place| {
        let names =
            ["intrinsic/intrinsic_color.txt", "intrinsic/intrinsic_depth.txt", "pose/0.txt", "pose/1.txt"];
        place.write_parts(&names, data);
        look(place);
    });
}
