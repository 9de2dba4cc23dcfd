//! Views of a map, from a RUN folder to images.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use image::{ImageReader, Luma, Rgb, RgbImage};
use mba_mapper::evaluation::psnr;
use mba_mapper::gaussians::Gaussian;
use mba_mapper::run::{FrameStatus, RunCamera, RunResponse};
use mba_mapper::trajectory_file::{TimedPose, write_trajectory};
use mba_tests::still_run;
use mba_tracker::geometry::RigidTransform;
use nalgebra::{UnitQuaternion, Vector3};
use tempfile::TempDir;

use super::{Outcome, mba};

const FRAMES: usize = 5;

/// Balls of 10 cm, 2 m in front of the cameras: position and linear colour.
const BALLS: [([f32; 3], [f32; 3]); 3] = [
    ([0.0, 0.0, 2.0], [0.8, 0.4, 0.2]),
    ([-0.8, 0.5, 2.0], [0.1, 0.9, 0.3]),
    ([0.7, 0.4, 2.0], [0.2, 0.3, 0.9]),
];

/// A camera that moves to the right by 4 cm per frame and turns a little.
fn pose(frame: usize) -> TimedPose {
    let k = frame as f64;
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.02 * k, 0.0, 0.01 * k));
    let world_from_camera = RigidTransform::new(rotation, Vector3::new(0.04 * k, 0.0, 0.0));
    TimedPose { timestamp: 10.0 + 0.1 * k, world_from_camera }
}

fn camera() -> RunCamera {
    let simple = RunCamera::simple(161, 121, 100.0);
    RunCamera { depth_scale: 1000.0, response: RunResponse::Linear, ..simple }
}

/// A folder with `run`, whose frame 3 is lost, and `poses.txt`, the true poses.
fn workplace(camera: Option<RunCamera>) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let frame = |frame: usize| {
        let lost = frame == 3;
        let found = TimedPose { timestamp: pose(frame).timestamp, ..pose(if lost { 0 } else { frame }) };
        (found, if lost { FrameStatus::Lost } else { FrameStatus::Ok }, false)
    };
    let ball = |(mean, colour)| Gaussian {
        mean,
        log_scale: [0.1_f32.ln(); 3],
        rotation: [1.0, 0.0, 0.0, 0.0],
        opacity_logit: 5.0,
        colour,
    };
    let frames: Vec<_> = (0..FRAMES).map(frame).collect();
    still_run::write(&run, camera, &frames, &BALLS.into_iter().map(ball).collect());
    let poses: Vec<TimedPose> = (0..FRAMES).map(pose).collect();
    write_trajectory(&folder.path().join("poses.txt"), &poses).unwrap();
    folder
}

fn render(place: &Path, poses: &str, out: &str, options: &[&str]) -> Outcome {
    let [run, poses, out] = ["run", poses, out].map(|name| place.join(name));
    let fixed = ["render".as_ref(), run.as_os_str(), "--poses".as_ref(), poses.as_os_str(), "--out".as_ref()];
    let all = fixed.into_iter().chain([out.as_os_str(), "--json".as_ref()]);
    mba(all.chain(options.iter().map(OsStr::new)))
}

fn colours(path: &Path) -> RgbImage {
    ImageReader::open(path).unwrap().decode().unwrap().into_rgb8()
}

#[test]
fn views_have_colour_and_depth_where_the_map_is() {
    let place = workplace(Some(camera()));
    let figures = render(place.path(), "poses.txt", "views", &["--threads", "1", "--fill", "off"]).json();
    assert_eq!((&figures["views"], &figures["gaussians"]), (&FRAMES.into(), &BALLS.len().into()));
    let depth = |frame: usize| {
        let path = place.path().join(format!("views/depth/{frame:06}.png"));
        image::open(path).unwrap().into_luma16()
    };
    let mut solid = 0;
    for frame in 0..FRAMES {
        let view = colours(&place.path().join(format!("views/{frame:06}.png")));
        let camera_from_world = pose(frame).world_from_camera.inverse();
        for (position, colour) in BALLS {
            let in_camera = camera_from_world.transform_point(&Vector3::from(position).cast());
            let pixel = camera().pinhole().project(&in_camera).map(|c| c.round() as u32);
            // Half a pixel off the centre of a ball of five pixels, with an opacity of 0.9933.
            let Rgb(found) = view.get_pixel(pixel.x, pixel.y);
            for (found, light) in found.iter().zip(colour) {
                let expected = 255.0 * 0.9933 * light;
                assert!(f32::from(*found) <= expected + 1.0 && f32::from(*found) > 0.98 * expected - 1.0);
            }
            let Luma([millimetres]) = *depth(frame).get_pixel(pixel.x, pixel.y);
            // A ball is densest where the ray of the pixel passes its centre.
            let ray = camera().pinhole().ray(f64::from(pixel.x), f64::from(pixel.y));
            let depth_of_peak = ray.dot(&in_camera) / ray.norm_squared();
            assert!((f64::from(millimetres) - 1000.0 * depth_of_peak).abs() < 1.0);
        }
        assert_eq!((view.get_pixel(80, 0), depth(frame).get_pixel(80, 0)), (&Rgb([0; 3]), &Luma([0])));
        solid += depth(frame).pixels().filter(|depth| depth.0[0] > 0).count();
    }
    let share = solid as f64 / (FRAMES * 161 * 121) as f64;
    assert!((figures["solid_share"].as_f64().unwrap() - share).abs() < 1e-12, "{figures}");

    let two = render(place.path(), "poses.txt", "two", &["--threads", "2", "--fill", "off"]);
    assert_eq!(two.code, Some(0));
    for name in ["000004.png", "depth/000004.png"] {
        let [one, two] = ["views", "two"].map(|out| fs::read(place.path().join(out).join(name)).unwrap());
        assert!(one == two, "{name} depends on the number of threads");
    }
}

#[test]
fn poses_are_carried_from_the_frame_of_the_aligned_trajectory() {
    let place = workplace(Some(camera()));
    // Another world: turned and far away. The camera's path is straight, so positions alone would not align it.
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(1.0, -2.0, 0.5));
    let other_from_map = RigidTransform::new(turn, Vector3::new(30.0, -4.0, 7.0));
    let carry = |frame| TimedPose {
        world_from_camera: other_from_map.compose(&pose(frame).world_from_camera),
        ..pose(frame)
    };
    write_trajectory(&place.path().join("truth.txt"), &(0..FRAMES).map(carry).collect::<Vec<_>>()).unwrap();
    assert_eq!(render(place.path(), "poses.txt", "expected", &[]).code, Some(0));
    let truth = place.path().join("truth.txt");
    let figures = render(place.path(), "truth.txt", "found", &["--align", truth.to_str().unwrap()]).json();
    // The lost frame does not count.
    assert_eq!(figures["alignment"]["matches"], FRAMES - 1);
    assert!(figures["alignment"]["translation_rms_m"].as_f64().unwrap() < 1e-7, "{figures}");
    for frame in 0..FRAMES {
        let [expected, found] = ["expected", "found"]
            .map(|out| colours(&place.path().join(out).join(format!("{frame:06}.png"))).into_raw());
        // Poses in files have nine decimals: only roundings of bytes may differ.
        assert!(psnr(&expected, &found).unwrap() > 60.0, "frame {frame}");
    }
}

#[test]
fn size_focal_length_and_names_can_be_chosen() {
    let place = workplace(None);
    let refused = render(place.path(), "poses.txt", "views", &["--size", "80x60"]);
    refused.assert_error(2, &["run does not tell its camera"]);
    let options = ["--size", "80x60", "--focal", "50", "--names", "timestamp"];
    assert_eq!(render(place.path(), "poses.txt", "views", &options).code, Some(0));
    for name in ["10.000000.png", "10.400000.png", "depth/10.200000.png"] {
        assert_eq!(
            image::image_dimensions(place.path().join("views").join(name)).unwrap(),
            (80, 60),
            "{name}"
        );
    }
    let absurd = render(place.path(), "poses.txt", "views", &["--size", "0x60", "--focal", "50"]);
    absurd.assert_error(2, &["width is 0"]);
}

#[test]
fn the_report_shows_the_map() {
    let place = workplace(Some(camera()));
    let run = place.path().join("run");
    let page = || {
        assert_eq!(mba([Path::new("report"), &run]).code, Some(0));
        fs::read_to_string(run.join("report.html")).unwrap()
    };
    let shown = page();
    assert!(shown.contains("3 Gaussians, 0.0 MB"), "{shown}");
    // Without keyframes, the first, the middle and the last frame.
    for frame in [0, 2, 4] {
        assert!(shown.contains(&format!("Rendered from frame {frame}.")), "frame {frame}");
    }
    assert!(shown.contains("class=\"viewer\"") && shown.contains("\"focal\":"), "{shown}");
    fs::write(run.join("map.ply"), "not a map").unwrap();
    assert!(page().contains("is not a PLY file"));
    fs::remove_file(run.join("map.ply")).unwrap();
    assert!(!page().contains("<h2>Map</h2>"));
}

#[test]
fn a_page_with_the_map_asks_for_nothing_else() {
    let place = workplace(Some(camera()));
    let run = place.path().join("run");
    let view = |run: &Path| mba([Path::new("view"), run, Path::new("--no-open")]);
    assert_eq!(view(&run).code, Some(0));
    let page = fs::read_to_string(run.join("view.html")).unwrap();
    for element in ["<title>data · mba</title>", "class=\"gaussians\">", "\"up\":[", "\"exposures\":[["] {
        assert!(page.contains(element), "{element}");
    }
    for outside in ["http:", "https:", "src=\"/", "href=", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    fs::write(run.join("view.html"), "my own").unwrap();
    view(&run).assert_error(2, &["view.html", "did not write"]);
    view(place.path()).assert_error(2, &["summary.json"]);
}

#[test]
fn what_cannot_be_rendered_is_named() {
    let place = workplace(Some(camera()));
    let write = |name: &str, text: &str| fs::write(place.path().join(name), text).unwrap();
    write("empty.txt", "# no pose\n");
    render(place.path(), "empty.txt", "views", &[]).assert_error(2, &["empty.txt holds no poses"]);
    write("bad.txt", "0 0 0 0 0 0 0 1\n1 0 0 zero 0 0 0 1\n");
    render(place.path(), "bad.txt", "views", &[]).assert_error(2, &["bad.txt, line 2", "zero"]);
    render(place.path(), "absent.txt", "views", &[]).assert_error(2, &["absent.txt"]);
    write("late.txt", "99 0 0 0 0 0 0 1\n");
    let late = place.path().join("late.txt");
    render(place.path(), "poses.txt", "views", &["--align", late.to_str().unwrap()])
        .assert_error(2, &["none of 4 estimated poses"]);
    write("file", "");
    render(place.path(), "poses.txt", "file/views", &[]).assert_error(2, &["file/views"]);
    write("run/map.ply", "ply\nformat ascii 1.0\nelement vertex 1\nend_header\n");
    render(place.path(), "poses.txt", "views", &[]).assert_error(2, &["map.ply"]);
    fs::remove_file(place.path().join("run/map.ply")).unwrap();
    render(place.path(), "poses.txt", "views", &[]).assert_error(2, &["run has no map"]);
}
