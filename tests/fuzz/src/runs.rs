//! RUN folders and trajectories.

use std::cell::RefCell;

use mba_mapper::dataset::open;
use mba_mapper::evaluation::{TrajectoryOptions, align_poses, evaluate_blur, evaluate_trajectory};
use mba_mapper::run::{Run, mid_pose};
use mba_mapper::self_calibration::read_back;
use mba_mapper::trajectory_file::{has_exposures, read_exposures, read_trajectory, write_trajectory};
use mba_tracker::geometry::PinholeCamera;

use super::picture::write_frames;
use super::place::{Kept, Place, in_place};

/// `summary.json`, `exposures.txt`, `frames.csv`, `calibration_estimated.toml`, `exposures_estimated.csv`.
pub fn run(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    let fill = |place: &Place| {
        write_frames(place);
        let calibration =
            "width = 32\nheight = 24\nfx = 30\nfy = 30\ncx = 15.5\ncy = 11.5\ndepth_scale = 1000\n";
        place.write("calibration.toml", calibration.as_bytes());
    };
    in_place(&KEPT, fill, |place| {
        let names = [
            "summary.json",
            "exposures.txt",
            "frames.csv",
            "calibration_estimated.toml",
            "exposures_estimated.csv",
        ];
        place.write_parts(&names, data);
        if let Ok(run) = Run::open(place.folder()) {
            for exposure in &run.exposures {
                assert!(exposure.start.is_valid() && exposure.end.is_valid(), "{exposure:?}");
                assert!(mid_pose(exposure).timestamp.is_finite());
            }
            serde_json::to_string(&run.summary).expect("a summary that was read can be written");
        }
        let dataset = open(place.folder()).expect("a good data set");
        if let Ok(dataset) = read_back(place.folder(), dataset) {
            for index in 0..dataset.len() {
                let seconds = dataset.exposure_seconds(index);
                assert!(seconds.is_finite() && seconds >= 0.0, "{seconds}");
            }
        }
    });
}

/// The two files of `mba eval trajectory`, of either kind.
pub fn trajectories(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    in_place(
        &KEPT,
        |_| (),
        |place| {
            place.write_parts(&["reference.txt", "estimate.txt"], data);
            let paths = ["reference.txt", "estimate.txt"].map(|name| place.path(name));
            let [reference, estimate] = paths.each_ref().map(|path| {
                let _ = has_exposures(path);
                let exposures = read_exposures(path).unwrap_or_default();
                let poses = read_trajectory(path);
                (exposures.clone(), poses.unwrap_or_else(|_| exposures.iter().map(mid_pose).collect()))
            });
            let options = TrajectoryOptions::default();
            if let Ok(found) = evaluate_trajectory(&reference.1, &estimate.1, &options) {
                assert!(!found.ate.rmse.is_nan(), "{found:?}");
            }
            let _ = align_poses(&reference.1, &estimate.1, options.max_dt);
            let camera = PinholeCamera { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 };
            let _ = evaluate_blur(&reference.0, &estimate.0, options.max_dt, &camera, 2.0);
            if !reference.1.is_empty() {
                let again = place.path("again.txt");
                write_trajectory(&again, &reference.1).expect("a writable folder");
                let same = read_trajectory(&again).unwrap_or_else(|error| panic!("{error}"));
                assert_eq!(same.len(), reference.1.len());
            }
        },
    );
}
