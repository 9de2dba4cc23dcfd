//! What a calibration says about time and light, and calibrations that are replaced.

use std::fs;

use mba_mapper::dataset::{
    self, CalibrationSources, DatasetError, ExposureSource, Knowledge, Response, Shutter, Vignetting,
};
use nalgebra::Vector3;

use crate::folder::Folder;

fn with_keys(keys: &str) -> Folder {
    let folder = Folder::complete();
    folder.edit("calibration.toml", "readout = \"global\"\n", keys);
    folder
}

fn readout(keys: &str) -> Shutter {
    with_keys(keys).open().calibration().readout
}

#[test]
fn readout_is_global_rolling_or_rolling_in_a_known_time() {
    let rolling = |seconds| Shutter::Rolling { seconds };
    assert_eq!(readout("readout = \"rolling\"\n"), rolling(None));
    assert_eq!(readout("readout = \"rolling\"\nreadout_seconds = 0.02\n"), rolling(Some(0.02)));
    assert_eq!(readout("readout_seconds = -0.03\n"), rolling(Some(-0.03)), "the last row first");
    assert_eq!(readout("readout_seconds = 0\n"), Shutter::Global);
    assert_eq!(readout("readout = \"global\"\nreadout_seconds = 0\n"), Shutter::Global);
    let times = [Shutter::Global, rolling(None), rolling(Some(0.02))].map(Shutter::readout_seconds);
    assert_eq!(times, [Some(0.0), None, Some(0.02)]);
}

#[test]
fn every_fact_says_where_it_comes_from() {
    let bare = CalibrationSources {
        camera: Knowledge::Recorded,
        depth_scale: Knowledge::Recorded,
        ..CalibrationSources::default()
    };
    let folder = Folder::complete();
    for line in ["exposure_seconds = 0.016\n", "response = \"linear\"\n", "readout = \"global\"\n"] {
        folder.edit("calibration.toml", line, "");
    }
    assert_eq!(folder.open().calibration().sources, bare);

    let folder = with_keys(
        "readout_seconds = 0.02\nvignetting = [-0.3, 0.0]\ndepth_delay_seconds = 0.011\n\
         estimated = [\"camera\", \"readout\", \"vignetting\"]\n",
    );
    let expected = CalibrationSources {
        camera: Knowledge::Estimated,
        depth_scale: Knowledge::Recorded,
        exposure: Knowledge::Recorded,
        readout: Knowledge::Estimated,
        response: Knowledge::Recorded,
        vignetting: Knowledge::Estimated,
        depth_delay: Knowledge::Recorded,
    };
    assert_eq!(folder.open().calibration().sources, expected);

    // Exposure times of the frames may have been estimated into their own list.
    let folder = with_keys("estimated = [\"exposure\"]\n");
    folder.edit("calibration.toml", "exposure_seconds = 0.016\n", "");
    assert_eq!(folder.open().calibration().sources.exposure, Knowledge::Assumed, "there is no list");
    dataset::write_exposure_times(
        &folder.path.join("exposures.csv"),
        &[(0.0, 1.0 / 60.0), (0.033333, 0.007), (0.066667, 0.018)],
    )
    .unwrap();
    let dataset = folder.open();
    assert_eq!(dataset.calibration().exposure, ExposureSource::PerFrame);
    assert_eq!(dataset.calibration().sources.exposure, Knowledge::Estimated);
    assert_eq!([0, 1, 2].map(|k| dataset.exposure_seconds(k)), [1.0 / 60.0, 0.007, 0.018]);
}

#[test]
fn assumed_exposures_are_half_an_interval_but_never_more_than_a_thirtieth() {
    for (rate, expected) in [(60.0, 0.5 / 60.0), (30.0, 0.5 / 30.0), (15.0, 1.0 / 30.0), (1.99, 1.0 / 30.0)] {
        let folder = Folder::complete();
        folder.edit("calibration.toml", "exposure_seconds = 0.016\n", "");
        folder.edit("calibration.toml", "frame_rate = 30", &format!("frame_rate = {rate}"));
        let dataset = folder.open();
        assert!((dataset.exposure_seconds(0) - expected).abs() < 1e-12, "at {rate} frames per second");
        // A list that lacks a frame falls back on the same.
        folder.write("exposures.csv", "timestamp,exposure_s\n0.066667,0.01\n");
        assert!((folder.open().exposure_seconds(0) - expected).abs() < 1e-12, "at {rate} frames per second");
    }
    let folder = Folder::complete();
    folder.edit("calibration.toml", "exposure_seconds = 0.016\n", "");
    let line = |k: i32| format!("{0} rgb/0.png {0} depth/0.png\n", 0.5 * f64::from(k));
    folder.write("associations.txt", &(0..4).map(line).collect::<String>());
    folder.edit("calibration.toml", "frame_rate = 30\n", "");
    let expected = "exposure_seconds is not given, 0.0333 s (the longest that is assumed) is assumed";
    assert!(folder.warnings().iter().any(|warning| warning == expected), "{:?}", folder.warnings());
}

#[test]
fn depth_has_its_own_time() {
    let folder = Folder::complete();
    folder.write(
        "associations.txt",
        "1 rgb/0.png 1.011 depth/0.png\n1.040 depth/1.png 1.033 rgb/1.png\n1.066 rgb/2.png 1.066 depth/2.png\n",
    );
    let times = |dataset: &dataset::Dataset| [0, 1, 2].map(|k| dataset.depth_timestamp(k));
    let dataset = folder.open();
    assert_eq!(times(&dataset), [1.011, 1.040, 1.066]);
    let frame = dataset.frame(1).unwrap();
    assert_eq!((frame.timestamp, frame.depth_timestamp), (1.033, 1.040));

    fs::rename(folder.path.join("associations.txt"), folder.path.join("kept.txt")).unwrap();
    folder.write("rgb.txt", "1 rgb/0.png\n1.033 rgb/1.png\n1.066 rgb/2.png\n");
    folder.write("depth.txt", "1.004 depth/0.png\n1.030 depth/1.png\n1.070 depth/2.png\n");
    assert_eq!(times(&folder.open()), [1.004, 1.030, 1.070]);

    // The delay of the calibration takes their place.
    folder.edit("calibration.toml", "frame_rate", "depth_delay_seconds = -0.25e-1\nframe_rate");
    let dataset = folder.open();
    for (time, expected) in times(&dataset).into_iter().zip([0.975, 1.008, 1.041]) {
        assert!((time - expected).abs() < 1e-12, "{time}");
    }
    assert!((dataset.frame(0).unwrap().depth_timestamp - 0.975).abs() < 1e-12);
}

#[test]
fn response_may_be_samples_of_the_curve() {
    let folder = Folder::complete();
    folder.edit("calibration.toml", "\"linear\"", "\"curve.csv\"");
    let rows = |curve: fn(f64) -> f64| {
        let row = |k: i32| format!("{:.6},{:.6}\n", f64::from(k) / 255.0, curve(f64::from(k) / 255.0));
        (0..256).map(row).collect::<String>()
    };
    folder.write("curve.csv", &format!("light,value\n{}", rows(|light| light.powf(0.6))));
    let inverse = folder.open().calibration().response.inverse();
    for code in [20_u8, 128, 240] {
        let expected = (f64::from(code) / 255.0).powf(1.0 / 0.6);
        assert!((f64::from(inverse.linear_light(code)) - expected).abs() < 3e-4, "code {code}");
    }
    folder.write("curve.csv", "light,value\n0,0\n0.5,0.6\n0.7,0.5\n1,1\n");
    assert_eq!(
        folder.message(),
        "curve.csv, line 4: expected rows light,value, both increasing, from 0,0 to 1,1, found \"0.7,0.5\""
    );
}

#[test]
fn light_falloff_is_that_of_the_stored_image() {
    let folder = with_keys("readout = \"global\"\nvignetting = [-0.4, 0.1]\n");
    let dataset = folder.open();
    assert_eq!(dataset.calibration().vignetting, Vignetting { a2: -0.4, a4: 0.1 });
    let falloff = dataset.light_falloff().unwrap();
    assert_eq!(falloff.len(), 48);
    assert!([0, 7, 40, 47].iter().all(|corner| (falloff[*corner] - 0.7).abs() < 1e-6));
    // Pixel (3, 2) is half a pixel from the middle both ways; the corner is sqrt(3.5^2 + 2.5^2) away.
    let near = 0.5 / 18.5;
    assert!((f64::from(falloff[19]) - (1.0 - 0.4 * near + 0.1 * near * near)).abs() < 1e-6);

    // Ideal pixel (0, 1) is taken from (0.203, 1.087), nearer to the middle than itself.
    folder.edit("calibration.toml", "depth_scale", "distortion = [-0.2, 0.0, 0.0, 0.0, 0.0]\ndepth_scale");
    let falloff = folder.open().light_falloff().unwrap();
    let s = ((3.5_f64 - 0.203).powi(2) + (2.5_f64 - 1.087).powi(2)) / 18.5;
    assert!((f64::from(falloff[8]) - (1.0 - 0.4 * s + 0.1 * s * s)).abs() < 1e-4);
    assert_eq!(Folder::complete().open().light_falloff(), None);
}

#[test]
fn a_calibration_can_be_replaced() {
    let folder = Folder::complete();
    folder.edit("calibration.toml", "response = \"linear\"\n", "");
    let dataset = folder.open();
    assert_eq!(folder.warnings(), ["response is not given, \"srgb\" is assumed"]);
    let mut better = dataset.calibration().clone();
    better.distortion.k1 = -0.2;
    better.response = Response::Linear;
    better.sources.response = Knowledge::Estimated;
    better.depth_delay_seconds = Some(0.01);
    better.exposure = ExposureSource::Constant { seconds: 0.012 };
    let dataset = dataset.with_calibration(better.clone()).unwrap();
    assert_eq!(dataset.calibration(), &better);
    assert!(dataset.warnings().is_empty(), "{:?}", dataset.warnings());
    assert_eq!((dataset.len(), dataset.exposure_seconds(2)), (3, 0.012));
    assert!((dataset.depth_timestamp(1) - 0.043333).abs() < 1e-12);
    // As in the test of undistortion.
    assert_eq!(dataset.frame(0).unwrap().rgb[3 * 8..][..3], [2, 22, 200]);

    let mut absurd = better.clone();
    absurd.vignetting.a2 = -1.0;
    let message = dataset.clone().with_calibration(absurd).unwrap_err().to_string();
    assert_eq!(
        message,
        "the calibration is not valid: vignetting is [-1, 0], expected [a2, a4], each from -10 to 10, with 1 + a2 r^2 + a4 r^4 above 0 \
         for r from 0 to 1"
    );
    let mut wider = better.clone();
    wider.camera.width = 9;
    assert!(matches!(dataset.clone().with_calibration(wider), Err(DatasetError::SizeMismatch { .. })));
    let per_frame = dataset::Calibration { exposure: ExposureSource::PerFrame, ..better };
    let message = dataset.with_calibration(per_frame).unwrap_err().to_string();
    assert!(message.contains("exposure_seconds is per frame, expected one number"), "{message}");
}

#[test]
fn estimated_exposures_take_the_place_of_others() {
    let folder = Folder::complete();
    folder.edit("calibration.toml", "exposure_seconds = 0.016\n", "");
    let mut dataset = folder.open();
    assert_eq!(dataset.warnings().len(), 1);
    dataset.set_exposures(vec![0.007, 0.01, 0.018]).unwrap();
    assert_eq!(dataset.calibration().exposure, ExposureSource::PerFrame);
    assert_eq!(dataset.calibration().sources.exposure, Knowledge::Estimated);
    assert_eq!(dataset.frame(2).unwrap().exposure_seconds, 0.018);
    assert!(dataset.warnings().is_empty(), "{:?}", dataset.warnings());

    let message = dataset.set_exposures(vec![0.01; 2]).unwrap_err().to_string();
    assert_eq!(message, "2 exposure times for 3 frames");
    let message = dataset.set_exposures(vec![0.01, 0.0, 0.01]).unwrap_err().to_string();
    assert!(
        message.starts_with("the calibration is not valid: exposure_seconds is 0, expected"),
        "{message}"
    );
    assert_eq!(dataset.exposure_seconds(1), 0.01, "nothing has changed");

    let constant = dataset::Calibration {
        exposure: ExposureSource::Constant { seconds: 0.02 },
        ..dataset.calibration().clone()
    };
    assert_eq!(dataset.with_calibration(constant).unwrap().exposure_seconds(0), 0.02);
}

#[test]
fn the_imu_may_be_turned_against_the_camera() {
    for rows in ["[0, -1, 0, 1, 0, 0, 0, 0, 1]", "[[0, -1, 0], [1, 0, 0], [0, 0, 1]]"] {
        let folder = with_keys(&format!("readout = \"global\"\nimu_from_camera = {rows}\n"));
        let rotation = folder.open().calibration().imu_from_camera.unwrap();
        assert_eq!(rotation * Vector3::x(), Vector3::y(), "{rows}");
    }
    // Two decimals of a rotation by 0.3 rad about z are accepted and made a rotation.
    let rounded =
        with_keys("readout = \"global\"\nimu_from_camera = [0.96, -0.30, 0, 0.30, 0.96, 0, 0, 0, 1]\n");
    let rotation = rounded.open().calibration().imu_from_camera.unwrap();
    assert!(
        (rotation.matrix() * rotation.matrix().transpose() - nalgebra::Matrix3::identity()).amax() < 1e-12
    );
    assert!((rotation.angle() - 0.3).abs() < 0.01);
}
