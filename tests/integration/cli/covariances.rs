//! `covariances.txt` of a tracked run.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use nalgebra::{Matrix3, Matrix6};

use super::{Workplace, mba};

/// The matrices of a run by their timestamps as they are written.
fn covariances(run: &Path) -> BTreeMap<String, Matrix6<f64>> {
    let text = fs::read_to_string(run.join("covariances.txt")).unwrap();
    let of_line = |line: &str| {
        let (timestamp, numbers) = line.split_once(' ').unwrap();
        let numbers: Vec<f64> = numbers.split(' ').map(|number| number.parse().unwrap()).collect();
        assert_eq!(numbers.len(), 36, "{line}");
        (timestamp.to_owned(), Matrix6::from_row_slice(&numbers))
    };
    text.lines().filter(|line| !line.starts_with('#')).map(of_line).collect()
}

/// Timestamp and standard deviation of the position of every frame, where there is one.
fn sigmas(run: &Path) -> Vec<(String, Option<f64>)> {
    let table = fs::read_to_string(run.join("frames.csv")).unwrap();
    let column = table.lines().next().unwrap().split(',').position(|name| name == "sigma_m").unwrap();
    let of_line = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        (cells[0].to_owned(), cells[column].parse().ok())
    };
    table.lines().skip(1).map(of_line).collect()
}

#[test]
fn every_covariance_is_one_and_agrees_with_the_table_of_frames() {
    let place = Workplace::new();
    // Without depth and colour a frame is not tracked.
    fs::write(place.path("data/rgb/000004.png"), "no image").unwrap();
    assert_eq!(place.track().code, Some(0));
    let (found, frames) = (covariances(&place.path("run")), sigmas(&place.path("run")));
    for (index, (timestamp, sigma)) in frames.iter().enumerate() {
        let covariance = found.get(timestamp);
        // The first frame is what the others are relative to.
        assert_eq!(covariance.is_some(), sigma.is_some() && index > 0, "frame {index}");
        let Some(covariance) = covariance else { continue };
        assert_eq!(*covariance, covariance.transpose(), "frame {index}");
        assert!(covariance.cholesky().is_some(), "frame {index}: {covariance}");
        let position = covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
        // The table has six decimals.
        assert!((position - sigma.unwrap()).abs() <= 0.501e-6, "frame {index}: {position} {sigma:?}");
        assert!(position > 1e-6 && position < 0.1, "frame {index}: {position}");
    }
    assert_eq!((found.len(), frames[4].1), (frames.len() - 2, None));
}

#[test]
fn covariances_are_in_the_axes_of_the_world_of_the_run() {
    let place = Workplace::new();
    let [data, own, upright] = ["data", "own", "upright"].map(|name| place.path(name));
    for (run, up) in [(&own, &[] as &[&str]), (&upright, &["--up", "-y"])] {
        let call = ["track", data.to_str().unwrap(), "--out", run.to_str().unwrap()];
        assert_eq!(mba(call.iter().chain(up)).code, Some(0));
    }
    // The first camera's x right, y down, z ahead become -y, -z and x.
    let turn = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let (own, upright) = (covariances(&own), covariances(&upright));
    assert_eq!(own.len(), upright.len());
    for (timestamp, own) in own {
        let upright = upright[&timestamp];
        let block = |matrix: &Matrix6<f64>, row, column| matrix.fixed_view::<3, 3>(row, column).into_owned();
        let tolerance = 1e-8 * own.amax();
        for (row, column, expected) in [
            (0, 0, turn * block(&own, 0, 0) * turn.transpose()),
            (0, 3, turn * block(&own, 0, 3)),
            (3, 3, block(&own, 3, 3)),
        ] {
            let difference = (block(&upright, row, column) - expected).amax();
            assert!(difference < tolerance, "{timestamp}: {difference} at {row}, {column}");
        }
    }
}
