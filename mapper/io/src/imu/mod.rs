//! What an inertial measurement unit beside the camera recorded: how it turned, and what it felt.
//!
//! All vectors are in the camera's axes (x right, y down, z forward), radians per second and metres per second
//! squared. The second is specific force: an IMU at rest feels the support that carries it, about 9.81 m/s^2
//! *upward*. Biases are still in it.
//!
//! These files of a data set are read; where several have the same sensor, the first counts:
//!
//! * `imu.csv`: a header with `timestamp` and the columns `wx_rad_s,wy_rad_s,wz_rad_s` or `ax_m_s2,ay_m_s2,az_m_s2`
//!   or both, seconds;
//! * `imu0/data.csv`, `mav0/imu0/data.csv`: as EuRoC has it (Burri et al., IJRR 2016), nanoseconds, then rates and
//!   specific forces;
//! * `gyro.csv`: a header, then rates, as in `imu.csv`;
//! * `accelerometer.txt`: as the TUM RGB-D benchmark has it (Sturm et al., IROS 2012), seconds and specific forces.
//!
//! `imu_from_camera` of `calibration.toml` takes the axes of the camera to those of the files. Without it they are
//! the same, but for `accelerometer.txt`: the Kinect's accelerometer has x left, y up, z forward.

mod gravity;
mod read;
mod recording;

pub use gravity::{InertialFit, inertial_fit};
pub(crate) use read::read_folder;
pub use recording::{ImuRecording, LONGEST_GAP, TimedVector};
