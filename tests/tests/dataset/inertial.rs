//! Recordings of an IMU in their files.

use std::fs;

use mba_mapper::imu::ImuRecording;
use nalgebra::Vector3;

use crate::folder::Folder;

/// Lines at 200 Hz around the three frames, times in the unit given, with the rest of each line.
fn lines(per_second: f64, separator: &str, rest: &str) -> String {
    (-20..40).map(|k| format!("{}{separator}{rest}\n", per_second * f64::from(k) / 200.0)).collect()
}

fn vectors(imu: &ImuRecording) -> (Option<Vector3<f64>>, Option<Vector3<f64>>) {
    (imu.mean_angular_velocity(0.01, 0.0612), imu.mean_specific_force(0.01, 0.0612))
}

fn assert_vectors(folder: &Folder, rate: Option<[f64; 3]>, force: Option<[f64; 3]>) {
    assert!(folder.warnings().is_empty(), "{:?}", folder.warnings());
    let dataset = folder.open();
    let found = vectors(dataset.imu().expect("a recording"));
    for (found, expected) in [(found.0, rate), (found.1, force)] {
        let error = found.zip(expected).map(|(found, expected)| (found - Vector3::from(expected)).norm());
        assert!(error.is_none_or(|error| error < 1e-9), "{found:?}, expected {expected:?}");
        assert_eq!(found.is_some(), expected.is_some());
    }
}

#[test]
fn the_header_of_imu_csv_decides() {
    let folder = Folder::complete();
    assert!(folder.open().imu().is_none());
    let header = "timestamp,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2\n";
    folder.write("imu.csv", &[header, &lines(1.0, ",", "0.1,0.2,0.3,1,-9,2")].concat());
    assert_vectors(&folder, Some([0.1, 0.2, 0.3]), Some([1.0, -9.0, 2.0]));
    let header = "# from a telephone\nwz_rad_s , temperature,wx_rad_s,wy_rad_s,timestamp\n";
    let row = |k: i32| format!("0.3,20.5,0.1,0.2,{}\n", f64::from(k) / 100.0);
    folder.write("imu.csv", &[header, &(-2..20).map(row).collect::<String>()].concat());
    assert_vectors(&folder, Some([0.1, 0.2, 0.3]), None);
    folder.write("imu.csv", &["timestamp,ax_m_s2,ay_m_s2,az_m_s2\n", &lines(1.0, ",", "1,-9,2")].concat());
    assert_vectors(&folder, None, Some([1.0, -9.0, 2.0]));
    // An older gyroscope adds what is lacking.
    let header = "timestamp,wx_rad_s,wy_rad_s,wz_rad_s\n";
    folder.write("gyro.csv", &[header, &lines(1.0, ",", "0.4,0.5,0.6")].concat());
    assert_vectors(&folder, Some([0.4, 0.5, 0.6]), Some([1.0, -9.0, 2.0]));
}

#[test]
fn vectors_are_brought_into_the_axes_of_the_camera() {
    let folder = Folder::complete();
    let header = "timestamp,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2\n";
    folder.write("imu.csv", &[header, &lines(1.0, ",", "0.1,0.2,0.3,1,-9,2")].concat());
    // The camera's x axis is the y axis of the IMU, its y axis minus the x axis.
    folder.edit(
        "calibration.toml",
        "frame_rate",
        "imu_from_camera = [0, -1, 0, 1, 0, 0, 0, 0, 1]\nframe_rate",
    );
    assert_vectors(&folder, Some([0.2, -0.1, 0.3]), Some([-9.0, -1.0, 2.0]));
}

#[test]
fn euroc_counts_nanoseconds() {
    for name in ["imu0", "mav0/imu0"] {
        let folder = Folder::complete();
        fs::create_dir_all(folder.path.join(name)).unwrap();
        let header = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],\
             a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
        let text = [header, &lines(1e9, ",", "0.1,0.2,0.3,9.1,0.5,-3.0")].concat();
        folder.write(&format!("{name}/data.csv"), &text);
        assert_vectors(&folder, Some([0.1, 0.2, 0.3]), Some([9.1, 0.5, -3.0]));
    }
}

#[test]
fn the_accelerometer_of_the_kinect_has_its_own_axes() {
    let folder = Folder::complete();
    // Each reading twice, as the driver polls.
    let once = lines(1.0, " ", "-4.8 6.1 -6.0");
    let twice: String = once.lines().flat_map(|line| [line, "\n", line, "\n"]).collect();
    folder.write("accelerometer.txt", &format!("# accelerometer data\n# timestamp ax ay az\n{twice}"));
    assert_vectors(&folder, None, Some([4.8, -6.1, -6.0]));
    folder.edit(
        "calibration.toml",
        "frame_rate",
        "imu_from_camera = [1, 0, 0, 0, 1, 0, 0, 0, 1]\nframe_rate",
    );
    assert_vectors(&folder, None, Some([-4.8, 6.1, -6.0]));
}

#[test]
fn a_damaged_recording_is_left_out_with_a_word_about_it() {
    for (text, expected) in [
        (
            "time,wx_rad_s,wy_rad_s,wz_rad_s\n0,1,2,3\n",
            "imu.csv, line 1: expected a header line with timestamp and wx_rad_s,wy_rad_s,wz_rad_s or \
             ax_m_s2,ay_m_s2,az_m_s2 or both, found \"time,wx_rad_s,wy_rad_s,wz_rad_s\"; the IMU is left out",
        ),
        (
            "timestamp,wx_rad_s,wy_rad_s,wz_rad_s\n0,1,2,3\n0.01,1,2\n",
            "imu.csv, line 3: expected as many finite numbers as the header has columns, found \"0.01,1,2\"; \
             the IMU is left out",
        ),
        (
            "timestamp,wx_rad_s,wy_rad_s,wz_rad_s\n0,1,inf,3\n",
            "imu.csv, line 2: inf is not a finite number; the IMU is left out",
        ),
        (
            "timestamp,wx_rad_s,wy_rad_s,wz_rad_s\n0.1,1,2,3\n0.05,1,2,3\n",
            "imu.csv, line 3: timestamp 0.05 comes after 0.1; sort the lines by time, or move the file away if it is \
             not needed; the IMU is left out",
        ),
        (
            "timestamp,wx_rad_s,wy_rad_s,wz_rad_s\n50,1,2,3\n50.005,1,2,3\n",
            "the recording of the IMU covers none of the frames' times and is left out; do both use the same clock?",
        ),
    ] {
        let folder = Folder::complete();
        folder.write("imu.csv", text);
        assert_eq!(folder.warnings(), [expected]);
        let dataset = folder.open();
        assert!(dataset.imu().is_none() && dataset.frame(0).is_ok());
    }
    let folder = Folder::complete();
    folder.write("imu.csv", "");
    assert!(folder.warnings()[0].starts_with("imu.csv, line 1: expected a header line"));
}
