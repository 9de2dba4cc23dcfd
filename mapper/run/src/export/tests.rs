//! A tiny run, exported as a whole.

use std::fs;
use std::path::Path;

use mba_io::output::{ExportFolder, Permission};
use mba_io::trajectory_file::TimedExposure;
use mba_mesh::read_mesh;
use mba_raster::gaussians::{Gaussian, Gaussians};
use mba_tracker::geometry::RigidTransform;
use nalgebra::{UnitQuaternion, Vector3};
use tempfile::TempDir;

use super::*;
use crate::run::{FrameRecord, FrameStatus, Run, RunCamera, RunResponse, RunSettings, RunWriter};

/// Columns and rows.
const SIZE: [usize; 2] = [4, 2];

/// Three frames at (k, 0, 0): a keyframe with its images in the run, a lost one, and one that is no keyframe.
fn tiny_run() -> (TempDir, Run) {
    let place = tempfile::tempdir().unwrap();
    let camera = RunCamera { depth_scale: 500.0, ..RunCamera::simple(SIZE[0], SIZE[1], 2.0) };
    let camera = Some(RunCamera { response: RunResponse::Linear, ..camera });
    let (program, dataset) = ("mba test".to_owned(), "nowhere".to_owned());
    let settings = RunSettings { program, dataset, frame_rate: 2.0, camera, options: Default::default() };
    let mut writer = RunWriter::create_in(&place.path().join("run"), settings).unwrap();
    let statuses = [FrameStatus::Ok, FrameStatus::Lost, FrameStatus::Weak];
    for (k, status) in statuses.into_iter().enumerate() {
        let timestamp = 0.5 * k as f64;
        let pose = RigidTransform::new(UnitQuaternion::identity(), Vector3::new(k as f64, 0.0, 0.0));
        let keyframe = u8::from(k == 0);
        let record = FrameRecord { keyframe, ..FrameRecord::without_figures(timestamp, status) };
        writer.push(TimedExposure { timestamp, start: pose, mid: pose, end: pose }, record).unwrap();
    }
    writer.write_deblurred(0, SIZE, (0..24).collect()).unwrap();
    // Two metres, and the farthest, which is 131 m.
    writer.write_depth(0, SIZE, &[0, 0, 0, 0, 0, 0, 1000, u16::MAX]).unwrap();
    writer.finish(|_| ()).unwrap();
    let run = Run::open(&place.path().join("run")).unwrap();
    (place, run)
}

/// Exports the keyframes of the run to `out`; returns the number of points.
fn export(run: &Run, layout: SceneLayout, map: Option<&Gaussians>, out: &Path) -> usize {
    let export = SceneExport::new(run, layout, ExportedImages::Keyframes, map).unwrap();
    assert_eq!((export.frames().len(), export.lost(), export.needs_data_set()), (1, 1, false));
    let mut folder = ExportFolder::claim(out, &Permission::default(), export.names()).unwrap();
    let points = export.write(None, &mut folder, || ()).unwrap();
    folder.finish().unwrap();
    points
}

#[test]
fn frames_without_a_pose_are_counted() {
    let (_place, run) = tiny_run();
    let posed = PosedFrames::of(&run).unwrap();
    assert_eq!(posed.lost, 1);
    let frames: Vec<_> =
        posed.frames.iter().map(|frame| (frame.index, frame.timestamp, frame.is_keyframe)).collect();
    assert_eq!(frames, [(0, 0.0, true), (2, 1.0, false)]);
    assert_eq!(format_kitti_times(&posed.frames), "0.000000\n1.000000\n");
    let short = Run { frames: run.frames[..2].to_vec(), ..run };
    let message = PosedFrames::of(&short).unwrap_err().to_string();
    assert!(message.ends_with("run has 3 rows in exposures.txt and 2 in frames.csv"), "{message}");
}

#[test]
fn nerfstudio_gets_images_depth_in_millimetres_and_points() {
    let (place, run) = tiny_run();
    let out = place.path().join("out");
    assert_eq!(export(&run, SceneLayout::Nerfstudio, None, &out), 1);
    let image = |name: &str| image::open(out.join(name)).unwrap();
    assert_eq!(image("images/000000.png").into_rgb8().into_raw(), (0..24).collect::<Vec<u8>>());
    // What is farther than 16 bits reach is missing.
    assert_eq!(image("depth/000000.png").into_luma16().into_raw(), [0, 0, 0, 0, 0, 0, 2000, 0]);
    let points = read_mesh(&out.join(POINTS_FILE)).unwrap();
    // Pixel (2, 1) from the middle (1.5, 0.5), at a focal length of 2 pixels and 2 m.
    assert_eq!((points.vertices, points.colours), (vec![[0.5, 0.5, 2.0]], vec![[18, 19, 20]]));
    let found: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(out.join(TRANSFORMS_FILE)).unwrap()).unwrap();
    assert_eq!(found["frames"].as_array().map(Vec::len), Some(1));
    assert_eq!((&found["cx"], &found["cy"]), (&2.0.into(), &1.0.into()));
}

#[test]
fn colmap_gets_images_and_the_points_of_the_map() {
    let (place, run) = tiny_run();
    let out = place.path().join("out");
    let gaussian = Gaussian {
        mean: [1.0, 2.0, 3.5],
        opacity_logit: 3.0,
        colour: [1.0, 0.2, 0.0],
        ..Gaussian::default()
    };
    let map: Gaussians = [gaussian].into_iter().collect();
    assert_eq!(export(&run, SceneLayout::Colmap, Some(&map), &out), 1);
    let last = |name: &str| {
        let text = fs::read_to_string(out.join(name)).unwrap();
        text.trim_end().lines().last().unwrap().to_owned()
    };
    assert_eq!(last(CAMERAS_FILE), "1 PINHOLE 4 2 2 2 2 1");
    let zero = "0.000000000000";
    let pose = last(IMAGES_FILE).replace("-0.0", "0.0");
    assert_eq!(pose, format!("1 1.000000000000 {zero} {zero} {zero} {zero} {zero} {zero} 1 000000.png"));
    // The camera stores light as it is: a fifth of 255.
    assert_eq!(last(POINTS3D_FILE), "1 1 2 3.5 255 51 0 0");
    assert!(out.join("images/000000.png").is_file() && !out.join("depth").exists());
}

#[test]
fn what_the_run_lacks_is_named() {
    let (place, run) = tiny_run();
    let all = SceneExport::new(&run, SceneLayout::Colmap, ExportedImages::All, None).unwrap();
    assert!(all.needs_data_set());
    let out = place.path().join("out");
    let mut folder = ExportFolder::claim(&out, &Permission::default(), all.names()).unwrap();
    let message = all.write(None, &mut folder, || ()).unwrap_err().to_string();
    assert_eq!(message, "frame 2 is in the data set, which is not there");
    drop(folder);
    assert!(!out.exists());
    fs::copy(run.folder.join("deblurred/000000.png"), run.folder.join("depth/000000.png")).unwrap();
    let export = SceneExport::new(&run, SceneLayout::Nerfstudio, ExportedImages::Keyframes, None).unwrap();
    let mut folder = ExportFolder::claim(&out, &Permission::default(), export.names()).unwrap();
    let message = export.write(None, &mut folder, || ()).unwrap_err().to_string();
    assert!(message.contains("000000.png has pixels of type Rgb8, expected 16-bit grey"), "{message}");
}
