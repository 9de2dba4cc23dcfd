//! Meshes of a map, and their figures against a true surface.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use mba_mapper::gaussians::{Gaussian, Gaussians};
use mba_mapper::mesh::{Mesh, read_mesh, write_mesh};
use mba_mapper::run::{FrameStatus, RunCamera};
use mba_mapper::trajectory_file::{TimedPose, write_trajectory};
use mba_tests::still_run;
use mba_tracker::geometry::RigidTransform;
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;
use tempfile::TempDir;

use super::{Outcome, mba};

/// Distance of the wall that the map consists of, metres.
const WALL: f64 = 2.0;

/// Three views of the wall, the last of which is lost and far away.
fn pose(frame: usize) -> TimedPose {
    let at = [[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0], [9.0, 0.0, 0.0]][frame];
    let world_from_camera = RigidTransform::new(UnitQuaternion::identity(), at.into());
    TimedPose { timestamp: 5.0 + frame as f64, world_from_camera }
}

/// Where the world of the run is in that of the truth.
fn truth_from_run() -> RigidTransform {
    RigidTransform::new(UnitQuaternion::from_euler_angles(0.4, 1.0, -2.0), Vector3::new(3.0, -1.0, 0.5))
}

/// Flat, orange Gaussians side by side.
fn wall() -> Gaussians {
    let gaussian = |k: usize| Gaussian {
        mean: [0.05 * (k % 61) as f32 - 1.5, 0.05 * (k / 61) as f32 - 1.0, WALL as f32],
        log_scale: [0.04_f32.ln(), 0.04_f32.ln(), 0.001_f32.ln()],
        rotation: [1.0, 0.0, 0.0, 0.0],
        opacity_logit: 4.0,
        colour: [1.0, 0.214_041_14, 0.0],
    };
    (0..61 * 41).map(gaussian).collect()
}

/// A folder with `run` and, in the world of the truth, `groundtruth.txt` and `points.ply`, what both views see.
fn workplace() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let status = [FrameStatus::Ok, FrameStatus::Weak, FrameStatus::Lost];
    let frames: Vec<_> = (0..3).map(|frame| (pose(frame), status[frame], true)).collect();
    still_run::write(&path("run"), Some(RunCamera::simple(81, 61, 80.0)), &frames, &wall());
    let truth = |pose: TimedPose| TimedPose {
        world_from_camera: truth_from_run().compose(&pose.world_from_camera),
        ..pose
    };
    let poses: Vec<TimedPose> = (0..3).map(|frame| truth(pose(frame))).collect();
    write_trajectory(&path("groundtruth.txt"), &poses).unwrap();
    let mut points = String::new();
    for (x, y) in (-80..=80).flat_map(|x| (-60..=60).map(move |y| (x, y))) {
        let on_wall = Vector3::new(0.01 * f64::from(x), 0.01 * f64::from(y), WALL);
        let at = truth_from_run().transform_point(&on_wall);
        writeln!(points, "{} {} {}", at.x, at.y, at.z).unwrap();
    }
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
        161 * 121
    );
    fs::write(path("points.ply"), header + &points).unwrap();
    folder
}

/// Runs a command with a file or folder of `place` behind each of the first options.
fn command(place: &Path, words: &[&str], files: &[(&str, &str)], options: &[&str]) -> Outcome {
    let files = files.iter().map(|(option, name)| [(*option).into(), place.join(name).into_os_string()]);
    let words = words.iter().chain(options).map(std::ffi::OsString::from).chain(["--json".into()]);
    mba(words.chain(files.flatten()))
}

fn mesh(place: &Path, out: &str, options: &[&str]) -> Outcome {
    let run = place.join("run").into_os_string().into_string().unwrap();
    command(place, &["mesh", &run], &[("--out", out)], options)
}

fn eval(place: &Path, estimate: &str, options: &[&str]) -> Outcome {
    let files = [("--reference", "points.ply"), ("--estimate", estimate)];
    command(place, &["eval", "mesh"], &files, options)
}

fn number(json: &Value, path: &str) -> f64 {
    json.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {path} in {json}"))
}

#[test]
fn a_wall_becomes_a_flat_coloured_mesh_of_what_was_seen() {
    let place = workplace();
    let figures = mesh(place.path(), "mesh.ply", &["--voxel-cm", "2"]).json();
    let mesh = read_mesh(&place.path().join("mesh.ply")).unwrap();
    assert_eq!(number(&figures, "/triangles"), mesh.triangles.len() as f64);
    assert_eq!(number(&figures, "/views"), 2.0, "a lost frame is of no use");
    for [x, y, z] in &mesh.vertices {
        assert!((f64::from(*z) - WALL).abs() < 0.002 && x.abs() < 1.15 && y.abs() < 0.78, "{x} {y} {z}");
    }
    // 81 columns of 2.5 cm and the 20 cm between the cameras, 61 rows.
    assert!((mesh.area() - (2.025 + 0.2) * 1.525).abs() < 0.15, "{} m2", mesh.area());
    // Linear light of 0.214 is one half of full scale in sRGB. Where Gaussians overlap little, light is scaled by alpha.
    assert!(
        mesh.colours.iter().all(|[red, green, blue]| *red > 250 && green.abs_diff(128) < 4 && *blue == 0)
    );
}

#[test]
fn a_flat_wall_needs_few_faces() {
    let place = workplace();
    let full = mesh(place.path(), "full.ply", &["--voxel-cm", "4"]).json();
    let few = mesh(place.path(), "few.ply", &["--voxel-cm", "4", "--faces", "100"]).json();
    let mesh = read_mesh(&place.path().join("few.ply")).unwrap();
    assert_eq!(number(&few, "/triangles"), mesh.triangles.len() as f64);
    assert!(mesh.triangles.len() <= 100 && number(&full, "/triangles") > 1000.0, "{full} {few}");
    assert!((number(&few, "/area_m2") - number(&full, "/area_m2")).abs() < 0.03, "{full} {few}");
    assert!(mesh.vertices.iter().all(|[_, _, z]| (f64::from(*z) - WALL).abs() < 0.003));
    assert!(mesh.colours.iter().all(|[red, _, blue]| *red > 250 && *blue == 0));
}

#[test]
fn the_ending_chooses_the_format() {
    let place = workplace();
    let truth = place.path().join("groundtruth.txt").into_os_string().into_string().unwrap();
    for name in ["mesh.ply", "mesh.glb", "mesh.obj"] {
        // What the program wrote is replaced, whatever the format.
        fs::copy(place.path().join("mesh.ply"), place.path().join(name)).ok();
        assert_eq!(mesh(place.path(), name, &["--voxel-cm", "4"]).code, Some(0), "{name}");
    }
    let expected = read_mesh(&place.path().join("mesh.ply")).unwrap();
    let obj = fs::read_to_string(place.path().join("mesh.obj")).unwrap();
    let [x, y, z] = expected.vertices[0];
    assert!(obj.lines().nth(1).unwrap().starts_with(&format!("v {x} {y} {z} 1.0000 0.")), "{obj:.200}");
    assert_eq!(obj.matches("\nf ").count(), expected.triangles.len());
    let text = |name: &str| -> Value {
        let glb = fs::read(place.path().join(name)).unwrap();
        let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        serde_json::from_slice(&glb[20..20 + length]).unwrap()
    };
    let glb = text("mesh.glb");
    assert_eq!(number(&glb, "/accessors/0/count"), expected.vertices.len() as f64);
    assert_eq!(number(&glb, "/accessors/1/count"), 3.0 * expected.triangles.len() as f64);
    // The world of a run is y-down, that of another trajectory is as it is.
    assert_eq!(number(&glb, "/nodes/0/rotation/0"), 1.0);
    assert_eq!(mesh(place.path(), "aligned.glb", &["--voxel-cm", "4", "--align", &truth]).code, Some(0));
    assert!(text("aligned.glb")["nodes"][0].get("rotation").is_none());
    for name in ["mesh.stl", "mesh.gltf"] {
        mesh(place.path(), name, &["--voxel-cm", "4"]).assert_error(2, &[name, ".ply, .glb or .obj"]);
        assert!(!place.path().join(name).exists());
    }
}

#[test]
fn aligned_meshes_are_where_the_truth_is() {
    let place = workplace();
    let truth = place.path().join("groundtruth.txt").into_os_string().into_string().unwrap();
    let run = place.path().join("run").into_os_string().into_string().unwrap();
    let align = ["--align", &truth];
    let figures = mesh(place.path(), "aligned.ply", &[&["--voxel-cm", "2"], &align[..]].concat()).json();
    assert!(number(&figures, "/alignment/translation_rms_m") < 1e-6);
    assert_eq!(mesh(place.path(), "own.ply", &["--voxel-cm", "2"]).code, Some(0));
    let options = ["--threshold-cm", "1,5", "--samples", "100000"];
    let aligned = eval(place.path(), "aligned.ply", &options).json();
    let moved =
        eval(place.path(), "own.ply", &[&options[..], &align, &["--trajectory", &run]].concat()).json();
    for figures in [&aligned, &moved] {
        assert!(number(figures, "/thresholds/0/recall") > 0.99, "{figures}");
        // The mesh reaches beyond the points, which are 1.6 m by 1.2 m; 1 cm around them counts too.
        let inside = 1.62 * 1.22 / (2.225 * 1.525);
        assert!((number(figures, "/thresholds/0/precision") - inside).abs() < 0.04, "{figures}");
        assert!(number(figures, "/completion_cm/mean") < 0.6, "{figures}");
    }
    let far = eval(place.path(), "own.ply", &options).json();
    assert_eq!((number(&far, "/thresholds/1/f1"), far.get("icp")), (0.0, None));
}

#[test]
fn icp_moves_the_estimate_onto_the_reference() {
    let place = workplace();
    let text = fs::read_to_string(place.path().join("points.ply")).unwrap();
    let normal = truth_from_run().rotation * Vector3::new(0.0, 0.0, 0.03);
    let (header, body) = text.split_at(text.find("end_header\n").unwrap() + 11);
    let shifted = body.lines().map(|line| {
        let at: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        format!("{} {} {}\n", at[0] + normal.x, at[1] + normal.y, at[2] + normal.z)
    });
    fs::write(place.path().join("shifted.ply"), header.to_owned() + &shifted.collect::<String>()).unwrap();
    let plain = eval(place.path(), "shifted.ply", &["--threshold-cm", "2.9"]).json();
    assert_eq!(number(&plain, "/thresholds/0/recall"), 0.0);
    assert!((number(&plain, "/accuracy_cm/mean") - 3.0).abs() < 1e-3);
    let refined = eval(place.path(), "shifted.ply", &["--threshold-cm", "0.1", "--icp"]).json();
    assert_eq!(number(&refined, "/thresholds/0/f1"), 1.0);
    assert!((number(&refined, "/icp/translation_cm") - 3.0).abs() < 1e-2, "{refined}");
}

/// Writes a part of the plane of depth `z` in the world of the run, from x = `left` to 3 m, moved by `moved`.
fn write_plane(place: &Path, name: &str, left: f32, z: f64, moved: &RigidTransform) {
    let z = z as f32;
    let mut plane = Mesh {
        vertices: vec![[left, -3.0, z], [3.0, -3.0, z], [3.0, 3.0, z], [left, 3.0, z]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    plane.transform(moved);
    write_mesh(&place.join(name), &plane).unwrap();
}

/// `mba eval mesh` with `reference` and `estimate` in views from the poses of `views`.
fn eval_views(place: &Path, names: [&str; 3], options: &[&str]) -> Outcome {
    let files = [("--reference", names[0]), ("--estimate", names[1]), ("--views", names[2])];
    command(place, &["eval", "mesh", "--samples", "1000"], &files, options)
}

#[test]
fn depth_is_compared_as_cameras_see_it() {
    let place = workplace();
    let place = place.path();
    write_plane(place, "truth.ply", -3.0, WALL, &truth_from_run());
    // In the world of the run: views have to be made after it is aligned.
    write_plane(place, "behind.ply", 0.1, WALL + 0.02, &RigidTransform::identity());
    let [truth, run] =
        ["groundtruth.txt", "run"].map(|name| place.join(name).into_os_string().into_string().unwrap());
    let align = ["--align", &truth, "--trajectory", &run];
    let figures = eval_views(place, ["truth.ply", "behind.ply", "groundtruth.txt"], &align).json();
    assert_eq!(number(&figures, "/depth/views"), 3.0);
    assert!((number(&figures, "/depth/l1_cm") - 2.0).abs() < 1e-3, "{figures}");
    // The third camera sees nothing. To the left of the estimate are for the first x < 0.2 / 2.02 and for the second
    // x < 0 at unit depth, with a focal length of 160 / tan 30 degrees and 159.5 in the middle: 187 and 160 columns.
    let expected = f64::from(133 + 160) / 640.0;
    assert!((number(&figures, "/depth/covered_share") - expected).abs() < 1e-12, "{figures}");
    let plain = eval(place, "behind.ply", &[]).json();
    assert_eq!(plain.get("depth"), None);
}

#[test]
fn views_that_cannot_be_made_are_named() {
    let place = workplace();
    let place = place.path();
    write_plane(place, "truth.ply", -3.0, WALL, &truth_from_run());
    let refused = |names: [&str; 3], parts: &[&str]| eval_views(place, names, &[]).assert_error(2, parts);
    refused(["points.ply", "truth.ply", "groundtruth.txt"], &["points.ply has no triangles"]);
    refused(["truth.ply", "points.ply", "groundtruth.txt"], &["points.ply has no triangles"]);
    refused(["truth.ply", "truth.ply", "absent.txt"], &["absent.txt"]);
    fs::write(place.join("views.txt"), "# none\n").unwrap();
    refused(["truth.ply", "truth.ply", "views.txt"], &["views.txt holds no poses"]);
    fs::write(place.join("views.txt"), "0 99 99 99 0 0 0 1\n").unwrap();
    refused(["truth.ply", "truth.ply", "views.txt"], &["the reference is in none of 1 views"]);
    fs::write(place.join("views.txt"), "0 0 0 0 0 0 0 2\n").unwrap();
    refused(["truth.ply", "truth.ply", "views.txt"], &["views.txt, line 1", "length 2"]);
}

#[test]
fn what_cannot_be_meshed_is_named() {
    let place = workplace();
    mesh(place.path(), "absent/mesh.ply", &["--voxel-cm", "5"]).assert_error(2, &["absent/mesh.ply"]);
    let fine = mesh(place.path(), "mesh.ply", &["--voxel-cm", "0.001"]);
    fine.assert_error(2, &["voxels of 0.001 cm need more than"]);
    assert!(fine.stderr.contains("--voxel-cm") && !place.path().join("mesh.ply").exists());
    assert_eq!(mesh(place.path(), "mesh.ply", &["--voxel-cm", "0"]).code, Some(2));
    fs::write(place.path().join("late.txt"), "99 0 0 0 0 0 0 1\n").unwrap();
    let late = place.path().join("late.txt");
    let refused = mesh(place.path(), "mesh.ply", &["--align", late.to_str().unwrap()]);
    refused.assert_error(2, &["late.txt", "none of 2 estimated poses"]);
    fs::remove_file(place.path().join("run/map.ply")).unwrap();
    mesh(place.path(), "mesh.ply", &[]).assert_error(2, &["run has no map"]);
}

#[test]
fn what_cannot_be_compared_is_named() {
    let place = workplace();
    let refused = |content: &str, parts: &[&str]| {
        fs::write(place.path().join("bad.ply"), content).unwrap();
        eval(place.path(), "bad.ply", &[]).assert_error(2, parts);
    };
    refused("solid", &["bad.ply is not a PLY file"]);
    let header =
        "ply\nformat ascii 1.0\nelement vertex 9000000000000000000\nproperty float x\nproperty float y\n";
    refused(&format!("{header}end_header\n"), &["bad.ply", "vertices have no property \"z\""]);
    refused(&format!("{header}property float z\nend_header\n1 2 3\n"), &["bad.ply", "the file ends after 1"]);
    let empty = header.replace("9000000000000000000", "0");
    refused(&format!("{empty}property float z\nend_header\n"), &["bad.ply has no surface"]);
    eval(place.path(), "absent.ply", &[]).assert_error(2, &["absent.ply"]);
    let alone = eval(place.path(), "points.ply", &["--align", "groundtruth.txt"]);
    assert_eq!(alone.code, Some(2), "{}", alone.stderr);
    assert!(alone.stderr.contains("--trajectory"), "{}", alone.stderr);
    assert_eq!(eval(place.path(), "points.ply", &["--threshold-cm", "1,-2"]).code, Some(2));
}
