//! The text files of a data set.

use std::fmt::Write as _;

use mba_tracker::geometry::RigidTransform;

use crate::time::Time;

/// Something with its time.
pub(crate) type Timed<T> = (Time, T);

/// Sorts by time and takes out what has the time of another to the microsecond, by which readers of lists tell them apart;
/// returns what was taken out.
pub(crate) fn in_order<T>(timed: &mut Vec<Timed<T>>) -> Vec<T> {
    timed.sort_by_key(|(time, _)| *time);
    let microsecond = |time: Time| (time.seconds() * 1e6).round();
    let mut latest = f64::NEG_INFINITY;
    let (kept, doubled) = std::mem::take(timed).into_iter().partition::<Vec<_>, _>(|(time, _)| {
        let is_new = microsecond(*time) != latest;
        latest = microsecond(*time);
        is_new
    });
    *timed = kept;
    doubled.into_iter().map(|(_, value)| value).collect()
}

/// `rgb.txt` or `depth.txt`.
pub(crate) fn images(images: &[Timed<String>]) -> String {
    let mut text = String::from("# timestamp filename\n");
    for (time, name) in images {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{time} {name}");
    }
    text
}

/// `exposures.csv`.
pub(crate) fn exposures(exposures: &[Timed<f64>]) -> String {
    let mut text = String::from("timestamp,exposure_s\n");
    for (time, seconds) in exposures {
        let _ = writeln!(text, "{time},{seconds}");
    }
    text
}

/// `groundtruth.txt`.
pub(crate) fn poses(poses: &[Timed<RigidTransform>]) -> String {
    let mut text = String::from("# timestamp tx ty tz qx qy qz qw (camera-to-world at mid exposure)\n");
    for (time, pose) in poses {
        let _ = write!(text, "{time}");
        for value in pose.translation.iter().chain(pose.rotation.coords.iter()) {
            let _ = write!(text, " {value}");
        }
        text.push('\n');
    }
    text
}

/// Names and contents of the files of an IMU: one if both sensors have the same times, else one for each.
pub(crate) fn inertia(rates: &[Timed<[f64; 3]>], forces: &[Timed<[f64; 3]>]) -> Vec<(&'static str, String)> {
    const RATES: &str = "wx_rad_s,wy_rad_s,wz_rad_s";
    const FORCES: &str = "ax_m_s2,ay_m_s2,az_m_s2";
    let times = |samples: &[Timed<[f64; 3]>]| samples.iter().map(|(time, _)| *time).collect::<Vec<_>>();
    let table = |header: &str, samples: &[Timed<[f64; 3]>]| {
        let row = |(time, [x, y, z]): &Timed<[f64; 3]>| format!("{time},{x},{y},{z}\n");
        format!("timestamp,{header}\n{}", samples.iter().map(row).collect::<String>())
    };
    if !rates.is_empty() && times(rates) == times(forces) {
        let row = |((time, [wx, wy, wz]), (_, [ax, ay, az])): (&Timed<[f64; 3]>, &Timed<[f64; 3]>)| {
            format!("{time},{wx},{wy},{wz},{ax},{ay},{az}\n")
        };
        let rows: String = rates.iter().zip(forces).map(row).collect();
        return vec![("imu.csv", format!("timestamp,{RATES},{FORCES}\n{rows}"))];
    }
    let mut files = Vec::new();
    if !forces.is_empty() {
        files.push(("imu.csv", table(FORCES, forces)));
    }
    if !rates.is_empty() {
        files.push(("gyro.csv", table(RATES, rates)));
    }
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Time {
        Time::from_seconds(seconds).unwrap()
    }

    #[test]
    fn what_has_the_time_of_another_is_taken_out() {
        let mut timed =
            vec![(at(2.0), 'c'), (at(1.0), 'a'), (at(2.000_000_1), 'd'), (at(1.5), 'b'), (at(1.0), 'e')];
        assert_eq!(in_order(&mut timed), ['e', 'd']);
        assert_eq!(timed, [(at(1.0), 'a'), (at(1.5), 'b'), (at(2.0), 'c')]);
    }

    #[test]
    fn sensors_of_the_same_times_share_a_file() {
        let samples = [(at(1.0), [1.0, 2.0, 3.5]), (at(2.0), [0.0, -1e-9, 4.0])];
        let joint = inertia(&samples, &samples);
        assert_eq!((joint.len(), joint[0].1.lines().count()), (1, 3));
        assert_eq!(joint[0].1.lines().nth(2), Some("2.000000000,0,-0.000000001,4,0,-0.000000001,4"));
        let apart = inertia(&samples, &samples[..1]);
        assert_eq!(apart.iter().map(|(name, _)| *name).collect::<Vec<_>>(), ["imu.csv", "gyro.csv"]);
        assert!(inertia(&[], &[]).is_empty());
    }
}
