//! Runs in the formats of other programs, read back by the conventions of those.

use std::fs;
use std::path::{Path, PathBuf};

use mba_mapper::mesh::read_mesh;
use mba_mapper::run::Run;
use mba_tests::tree::tree;
use nalgebra::{Matrix4, Quaternion, UnitQuaternion, Vector3, Vector4};
use serde_json::Value;
use tempfile::TempDir;

use super::{Outcome, mba};

/// Columns and rows of the images.
const SIZE: [usize; 2] = [240, 180];

/// A folder with a short sequence of a room in `data` and what the tracker made of it in `run`.
fn workplace() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--frames", "6", "--size", "240x180", "--blur", "4", "--noise", "off", "--depth", "exact"];
    command(folder.path(), &[&["synth", "--out", ":data"], &options[..]].concat()).json();
    let run = command(folder.path(), &["track", ":data", "--out", ":run"]).json();
    assert_eq!(run["frames"]["lost"], 0);
    folder
}

/// Runs a command; words with a colon in front are paths in the folder.
fn command(folder: &Path, words: &[&str]) -> Outcome {
    let word = |word: &&str| match word.strip_prefix(':') {
        Some(path) => folder.join(path),
        None => PathBuf::from(word),
    };
    mba(words.iter().map(word).chain(["--json".into()]))
}

fn export(folder: &Path, format: &str, options: &[&str]) -> Value {
    let out = format!(":{format}");
    let words = ["export", ":run", "--to", format, "--out", &out];
    command(folder, &[&words[..], options].concat()).json()
}

/// Numbers of all lines that are no comments.
fn rows(path: &Path, separator: char) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
    // The names of images are no numbers.
    lines.map(|line| line.split(separator).filter_map(|word| word.parse().ok()).collect()).collect()
}

/// The matrix of a position and a quaternion with w first.
fn pose([p, q]: [&[f64]; 2]) -> Matrix4<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
    let mut matrix = rotation.to_homogeneous();
    matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&Vector3::from_row_slice(p));
    matrix
}

fn matrix(numbers: impl Iterator<Item = f64>) -> Matrix4<f64> {
    let numbers: Vec<f64> = numbers.chain([0.0, 0.0, 0.0, 1.0]).take(16).collect();
    Matrix4::from_row_slice(&numbers)
}

/// Poses from the camera, which looks along z, to the world, by a `transforms.json`.
fn poses_of_transforms(transforms: &Value) -> Vec<Matrix4<f64>> {
    let frames = transforms["frames"].as_array().unwrap().iter();
    let opengl = |frame: &Value| {
        let rows = frame["transform_matrix"].as_array().unwrap().iter();
        matrix(rows.flat_map(|row| row.as_array().unwrap().iter().map(|value| value.as_f64().unwrap())))
    };
    let flip = Matrix4::from_diagonal(&Vector4::new(1.0, -1.0, -1.0, 1.0));
    frames.map(|frame| opengl(frame) * flip).collect()
}

fn transforms(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("transforms.json")).unwrap()).unwrap()
}

#[test]
fn every_format_has_the_poses_of_the_run() {
    let place = workplace();
    let at = |name: &str| place.path().join(name);
    let run = Run::open(&at("run")).unwrap();
    for format in ["tum", "euroc", "kitti"] {
        let written = export(place.path(), format, &[]);
        assert_eq!((&written["frames"], &written["lost"]), (&6.into(), &0.into()));
    }
    for format in ["nerfstudio", "colmap"] {
        export(place.path(), format, &["--images", "all"]);
    }
    let expected: Vec<_> = run.exposures.iter().map(|exposure| exposure.mid).collect();
    let tum = rows(&at("tum"), ' ').into_iter();
    let tum = tum.map(|row| pose([&row[1..4], &[row[7], row[4], row[5], row[6]]])).collect();
    let euroc = rows(&at("euroc"), ',').into_iter().map(|row| pose([&row[1..4], &row[4..8]])).collect();
    let kitti = rows(&at("kitti/poses.txt"), ' ').into_iter().map(|row| matrix(row.into_iter())).collect();
    let colmap = rows(&at("colmap/sparse/0/images.txt"), ' ').into_iter();
    let colmap = colmap.map(|row| pose([&row[5..8], &row[1..5]]).try_inverse().unwrap()).collect();
    let nerfstudio = poses_of_transforms(&transforms(&at("nerfstudio")));
    let all: [(&str, Vec<Matrix4<f64>>); 5] =
        [("tum", tum), ("euroc", euroc), ("kitti", kitti), ("colmap", colmap), ("nerfstudio", nerfstudio)];
    for (format, poses) in all {
        assert_eq!(poses.len(), expected.len(), "{format}");
        for (found, expected) in poses.iter().zip(&expected) {
            let [p, q] = [expected.translation.as_slice(), &{
                let q = expected.rotation;
                [q.w, q.i, q.j, q.k]
            }];
            assert!((found - pose([p, q])).amax() < 1e-9, "{format}: {found}");
        }
    }
    for (index, exposure) in run.exposures.iter().enumerate() {
        assert_eq!(rows(&at("kitti/times.txt"), ' ')[index], [exposure.timestamp]);
        assert_eq!(rows(&at("tum"), ' ')[index][0], exposure.timestamp);
        assert!((rows(&at("euroc"), ',')[index][0] - 1e9 * exposure.timestamp).abs() < 1.0);
    }
}

/// A pixel of an image where the centre of the first is (0.5, 0.5), with the depth there in metres.
fn depth_at(depth: &image::DynamicImage, [x, y]: [f64; 2]) -> Option<f64> {
    let image = depth.as_luma16().unwrap();
    let is_inside = x >= 0.0 && y >= 0.0 && x < SIZE[0] as f64 && y < SIZE[1] as f64;
    let raw = is_inside.then(|| image.get_pixel(x as u32, y as u32).0[0])?;
    (raw != 0).then(|| 0.001 * f64::from(raw))
}

#[test]
fn depth_of_a_frame_is_where_another_frame_sees_it() {
    let place = workplace();
    let written = export(place.path(), "nerfstudio", &["--images", "all"]);
    let out = place.path().join("nerfstudio");
    let file = transforms(&out);
    let [fx, fy, cx, cy] = ["fl_x", "fl_y", "cx", "cy"].map(|key| file[key].as_f64().unwrap());
    // The middle of an image of 240 x 180 pixels, from its corner.
    assert_eq!((cx, cy), (120.0, 90.0));
    assert_eq!(file["depth_unit_scale_factor"], 0.001);
    let poses = poses_of_transforms(&file);
    let depth = |frame: usize| {
        image::open(out.join(file["frames"][frame]["depth_file_path"].as_str().unwrap())).unwrap()
    };
    let project = |x: Vector4<f64>| [fx * x.x / x.z + cx, fy * x.y / x.z + cy];
    let (first, last) = (depth(0), depth(5));
    let last_from_first = poses[5].try_inverse().unwrap() * poses[0];
    let (mut moved, mut errors) = (0.0_f64, Vec::new());
    for (u, v) in (0..SIZE[0]).flat_map(|u| (0..SIZE[1]).map(move |v| (u as f64 + 0.5, v as f64 + 0.5))) {
        let Some(z) = depth_at(&first, [u, v]) else { continue };
        let x = last_from_first * Vector4::new((u - cx) / fx * z, (v - cy) / fy * z, z, 1.0);
        if let Some(seen) = depth_at(&last, project(x)) {
            moved = moved.max((project(x)[0] - u).abs());
            errors.push((x.z - seen).abs());
        }
    }
    errors.sort_by(f64::total_cmp);
    let [median, most] = [errors[errors.len() / 2], errors[errors.len() * 9 / 10]];
    println!("{} pixels, moved by up to {moved:.1}, median {median:.5} m, 90 % {most:.5} m", errors.len());
    assert!(errors.len() > SIZE[0] * SIZE[1] / 2 && moved > 5.0, "{} pixels, {moved}", errors.len());
    // Within half a pixel a wall that is seen at a slant is about as much nearer or farther.
    assert!(median < 0.004 && most < 0.02, "{median} m, {most} m");

    // The points come from depth, since there is no map.
    let points = read_mesh(&out.join(file["ply_file_path"].as_str().unwrap())).unwrap();
    assert_eq!(written["points"], points.vertices.len());
    assert_seen(&points.vertices, &poses[0], project, &first);
}

/// Asserts that a depth image shows the first points.
fn assert_seen(
    points: &[[f32; 3]],
    world_from_camera: &Matrix4<f64>,
    project: impl Fn(Vector4<f64>) -> [f64; 2],
    depth: &image::DynamicImage,
) {
    let camera_from_world = world_from_camera.try_inverse().unwrap();
    for point in &points[..1000] {
        let [x, y, z] = point.map(f64::from);
        let x = camera_from_world * Vector4::new(x, y, z, 1.0);
        let [u, v] = project(x);
        // The points of the first frame lie in the middle of its pixels.
        assert!((u.fract() - 0.5).abs() < 1e-3 && (v.fract() - 0.5).abs() < 1e-3, "{u} {v}");
        assert!((x.z - depth_at(depth, [u, v]).unwrap()).abs() < 1e-5);
    }
}

#[test]
fn a_model_of_a_map_has_its_points_and_deblurred_keyframes() {
    let place = workplace();
    let at = |name: &str| place.path().join(name);
    let map = ["map", ":data", "--trajectory", ":run", "--out", ":mapped", "--time-budget", "0.5"];
    let mapped = command(place.path(), &map).json();
    let words = ["export", ":mapped", "--to", "colmap", "--out", ":model"];
    let written = command(place.path(), &words).json();
    let run = Run::open(&at("mapped")).unwrap();
    let keyframes: Vec<usize> = (0..6).filter(|index| run.frames[*index].keyframe != 0).collect();
    assert_eq!(written["frames"], keyframes.len());
    assert_eq!(rows(&at("model/sparse/0/cameras.txt"), ' ')[0][1..3], [240.0, 180.0]);
    let points = rows(&at("model/sparse/0/points3D.txt"), ' ');
    assert_eq!(written["points"], points.len());
    let gaussians = mapped["map"]["gaussians"].as_u64().unwrap() as usize;
    assert!(points.len() > gaussians / 2 && points.len() <= gaussians, "{} of {gaussians}", points.len());
    // All of the room is in front of the first camera.
    let in_front = points.iter().filter(|point| point[3] > 0.0 && point[3] < 10.0).count();
    assert!(in_front > points.len() * 9 / 10, "{in_front} of {}", points.len());
    for index in keyframes {
        let name = format!("{index:06}.png");
        let [exported, deblurred] = ["model/images", "mapped/deblurred"]
            .map(|folder| image::open(at(folder).join(&name)).unwrap().into_rgb8());
        assert!(exported == deblurred, "{name}");
    }
}

#[test]
fn what_is_there_does_not_depend_on_threads_and_is_replaced() {
    let place = workplace();
    let at = |name: &str| place.path().join(name);
    for (out, threads) in [(":one", "1"), (":two", "2")] {
        let words = ["export", ":run", "--to", "nerfstudio", "--out", out, "--threads", threads];
        assert_eq!(command(place.path(), &words).code, Some(0));
    }
    assert!(tree(&at("one")) == tree(&at("two")), "the files depend on the number of threads");
    let colmap = ["export", ":run", "--to", "colmap", "--out", ":one"];
    assert_eq!(command(place.path(), &colmap).code, Some(0));
    assert!(!at("one/transforms.json").exists() && !at("one/depth").exists());
    assert!(at("one/sparse/0/images.txt").is_file());
}

#[test]
fn what_is_missing_is_named_and_lost_frames_are_counted() {
    let place = workplace();
    let at = |name: &str| place.path().join(name);
    let nerfstudio = ["export", ":run", "--to", "nerfstudio", "--out", ":out"];
    fs::rename(at("data"), at("moved")).unwrap();
    let before = tree(place.path());
    let refused = command(place.path(), &nerfstudio);
    refused.assert_error(2, &["run", "needs its data set", "data"]);
    assert!(refused.stderr.contains("--dataset"), "{}", refused.stderr);
    assert!(tree(place.path()) == before);
    let moved = command(place.path(), &[&nerfstudio[..], &["--dataset", ":moved"]].concat());
    assert_eq!(moved.code, Some(0), "{}", moved.stderr);
    let tum = ["export", ":run", "--to", "tum", "--out", ":poses"];
    command(place.path(), &[&tum[..], &["--images", "all"]].concat())
        .assert_error(2, &["--images all", "tum"]);

    let table = fs::read_to_string(at("run/frames.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    let lost = |line: &str| line.replacen(",ok,", ",lost,", 1).replacen(",weak,", ",lost,", 1);
    let third = [&lines[..3], &[lost(lines[3]).as_str()], &lines[4..]].concat().join("\n");
    fs::write(at("run/frames.csv"), third).unwrap();
    let written = command(place.path(), &tum).json();
    assert_eq!((&written["frames"], &written["lost"]), (&5.into(), &1.into()));
    assert_eq!(rows(&at("poses"), ' ').len(), 5);
    let all: Vec<String> = lines.iter().map(|line| lost(line)).collect();
    fs::write(at("run/frames.csv"), all.join("\n")).unwrap();
    command(place.path(), &tum).assert_error(2, &["run", "no frame with a pose", "6"]);
    fs::write(at("run/frames.csv"), lines[..5].join("\n")).unwrap();
    command(place.path(), &tum).assert_error(2, &["run", "6 rows in exposures.txt", "4 in frames.csv"]);
}

#[test]
fn the_files_of_a_run_are_not_written_over() {
    let place = workplace();
    let before = tree(place.path());
    for name in ["trajectory.txt", "exposures.txt", "summary.json"] {
        let out = format!(":run/{name}");
        let words = ["export", ":run", "--to", "tum", "--force", "--out", &out];
        command(place.path(), &words).assert_error(2, &[name, "the command reads it"]);
    }
    for format in ["kitti", "colmap"] {
        let words = ["export", ":run", "--to", format, "--force", "--out", ":run"];
        command(place.path(), &words).assert_error(2, &["run", "the command reads it"]);
    }
    assert!(tree(place.path()) == before);
}
