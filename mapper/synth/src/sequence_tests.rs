//! Checks of whole sequences against what geometry and optics say about them.

use std::collections::HashSet;

use mba_tracker::geometry::RigidTransform;
use mba_tracker::photometric::InverseResponse;
use nalgebra::Vector3;

use super::sequence::SynthSequence;
use super::{CameraMotion, DepthSensor, NoiseModel, SceneName, SynthConfig, SynthError};

fn small() -> SynthConfig {
    SynthConfig { frames: 6, width: 96, height: 72, mean_blur_px: 2.0, ..SynthConfig::default() }
}

fn sequence(config: SynthConfig) -> SynthSequence {
    SynthSequence::new(config).unwrap()
}

fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

#[test]
fn number_of_threads_changes_nothing() {
    let config =
        SynthConfig { noise: Some(NoiseModel::default()), depth: DepthSensor::StructuredLight, ..small() };
    let render = |threads| with_threads(threads, || sequence(config.clone()).render_frame(3));
    let (one, three) = (render(1), render(3));
    assert_eq!(one.rgb, three.rgb);
    assert_eq!(one.depth, three.depth);
    assert_eq!(one.exposure, three.exposure);
}

#[test]
fn seeds_change_shake_and_noise() {
    let noisy = SynthConfig { mean_blur_px: 0.0, noise: Some(NoiseModel::default()), ..small() };
    let render = |seed, index| sequence(SynthConfig { seed, ..noisy.clone() }).render_frame(index).rgb;
    assert_ne!(render(1, 0), render(2, 0), "noise differs between seeds");
    assert_ne!(render(1, 0), render(1, 1), "noise differs between frames");
    let pose = |seed| sequence(SynthConfig { seed, ..small() }).world_from_camera(0.2);
    assert!(pose(1).tangent_to(&pose(2)).norm() > 0.01);
}

/// Depth in metres of the pixel nearest to where `point` is imaged, and the depth it should have.
fn seen_and_expected(
    sequence: &SynthSequence,
    depth: &[u16],
    camera_from_world: &RigidTransform,
    point: &Vector3<f64>,
) -> Option<(f64, f64)> {
    let camera = sequence.camera();
    let here = camera_from_world.transform_point(point);
    let pixel = camera.project(&here);
    let (column, row) = (pixel.x.round(), pixel.y.round());
    let inside =
        column >= 1.0 && row >= 1.0 && column < camera.width as f64 - 1.0 && row < camera.height as f64 - 1.0;
    if here.z < 0.1 || !inside {
        return None;
    }
    let stored = |column: usize, row: usize| f64::from(depth[row * camera.width + column]) / 5000.0;
    let (column, row) = (column as usize, row as usize);
    // Between the pixel centres the surface is interpolated; at edges there is none to compare with.
    let neighbours = [(column - 1, row), (column + 1, row), (column, row - 1), (column, row + 1)]
        .map(|(column, row)| stored(column, row));
    let centre = stored(column, row);
    if neighbours.iter().any(|neighbour| (neighbour - centre).abs() > 0.02 * centre) {
        return None;
    }
    let across = 0.5 * (neighbours[1] - neighbours[0]) * (pixel.x - column as f64);
    let down = 0.5 * (neighbours[3] - neighbours[2]) * (pixel.y - row as f64);
    Some((centre + across + down, here.z))
}

#[test]
fn depth_and_poses_of_two_frames_describe_the_same_surface() {
    for scene in SceneName::ALL {
        let sequence = sequence(SynthConfig { scene, width: 160, height: 120, ..small() });
        let (a, b) = (sequence.render_frame(0), sequence.render_frame(5));
        let camera_from_world = b.world_from_camera.inverse();
        let camera = sequence.camera();
        let mut errors = Vec::new();
        for (index, stored) in a.depth.iter().enumerate() {
            let (column, row) = (index % camera.width, index / camera.width);
            let ray = camera.ray(column as f64, row as f64);
            let point = a.world_from_camera.transform_point(&(ray * (f64::from(*stored) / 5000.0)));
            if let Some((seen, expected)) = seen_and_expected(&sequence, &b.depth, &camera_from_world, &point)
            {
                errors.push((seen - expected).abs() / expected);
            }
        }
        errors.sort_by(f64::total_cmp);
        let share = |part: f64| errors[(part * (errors.len() - 1) as f64) as usize];
        assert!(errors.len() > 8000, "{scene}: {} pixels", errors.len());
        // Rounding is 0.1 mm; what remains is occlusion and the curvature of round things.
        assert!(share(0.5) < 2e-4, "{scene}: median {}", share(0.5));
        assert!(share(0.9) < 2e-3, "{scene}: 90 % {}", share(0.9));
    }
}

#[test]
fn still_camera_gives_the_sharp_image() {
    let sequence = sequence(SynthConfig { mean_blur_px: 0.0, ..small() });
    let frame = sequence.render_frame(2);
    assert_eq!(frame.blur.mean_px, 0.0);
    assert_eq!(frame.exposure.start, frame.exposure.end);
    let still = psnr(&frame.rgb, &sequence.render_sharp(2));
    // The two differ in where within a pixel their rays pass.
    assert!(still > 30.0, "{still} dB");
    let moving = SynthSequence::new(small()).unwrap();
    let blurred = psnr(&moving.render_frame(2).rgb, &moving.render_sharp(2));
    assert!(blurred < still - 4.0, "a moving camera blurs: {blurred} dB");
}

fn psnr(a: &[u8], b: &[u8]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>();
    10.0 * (255.0_f64.powi(2) * a.len() as f64 / squares).log10()
}

/// The whole image gets the mean light of the exposure: blur moves light, it makes none.
#[test]
fn blurred_image_is_the_mean_of_sharp_ones_in_linear_light() {
    let sequence = sequence(SynthConfig { mean_blur_px: 4.0, ..small() });
    let exposure = sequence.config().exposure_seconds;
    let linear = InverseResponse::srgb();
    const VIEWS: usize = 48;
    let mut mean = vec![0.0; 3 * 96 * 72];
    for k in 0..VIEWS {
        let time = sequence.timestamp(1) + exposure * ((k as f64 + 0.5) / VIEWS as f64 - 0.5);
        let view = sequence.render_view(&sequence.world_from_camera(time));
        let light = view.iter().map(|byte| f64::from(linear.linear_light(*byte)) / VIEWS as f64);
        mean.iter_mut().zip(light).for_each(|(mean, light)| *mean += light);
    }
    let frame = sequence.render_frame(1);
    assert!(frame.blur.mean_px > 2.0, "a frame that moves: {}", frame.blur.mean_px);
    let error = |(byte, mean): (&u8, &f64)| f64::from(linear.linear_light(*byte)) - mean;
    let errors: Vec<f64> = frame.rgb.iter().zip(&mean).map(error).collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let bias = errors.iter().sum::<f64>() / errors.len() as f64;
    // 16 rays per pixel against 192: what is left is the sampling of texture finer than these large pixels.
    assert!(rms < 0.015, "{rms}");
    assert!(bias.abs() < 5e-4, "{bias}");
}

#[test]
fn blur_is_the_displacement_of_surface_points() {
    for requested in [0.3, 2.0, 4.0] {
        let sequence = sequence(SynthConfig { mean_blur_px: requested, ..small() });
        let camera = sequence.camera();
        let mut means = Vec::new();
        for index in 0..sequence.len() {
            let depth = sequence.render_frame(index).depth;
            let mid = sequence.world_from_camera(sequence.timestamp(index));
            let ends = sequence.exposure(index);
            let displacement = |pixel: usize| {
                let ray = camera.ray((pixel % 96) as f64, (pixel / 96) as f64);
                let point = mid.transform_point(&(ray * (f64::from(depth[pixel]) / 5000.0)));
                let place = |pose: &RigidTransform| camera.project(&pose.inverse().transform_point(&point));
                (place(&ends.end) - place(&ends.start)).norm()
            };
            let mean = (0..depth.len()).map(displacement).sum::<f64>() / depth.len() as f64;
            let figure = sequence.blur(index);
            assert!((figure.mean_px - mean).abs() < 0.02 * mean, "{} and {mean}", figure.mean_px);
            means.push(mean);
        }
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        assert!((mean - requested).abs() < 0.02 * requested, "{mean} for {requested}");
    }
}

#[test]
fn gyroscope_integrates_to_the_orientation() {
    let sequence = sequence(small());
    let (from, steps, step) = (0.1, 2000, 1e-4);
    let mut rotation = sequence.world_from_camera(from).rotation;
    for k in 0..steps {
        let rate = sequence.angular_velocity(from + (f64::from(k) + 0.5) * step);
        rotation *= mba_tracker::geometry::so3::exp(&(rate * step));
    }
    let error = rotation.angle_to(&sequence.world_from_camera(from + f64::from(steps) * step).rotation);
    assert!(error < 1e-5, "{error} rad after 0.2 s");
}

#[test]
fn held_out_views_lie_between_frames_and_near_the_path() {
    let sequence = sequence(SynthConfig { frames: 90, ..small() });
    let views = sequence.heldout_poses();
    assert_eq!(views.len(), 12);
    assert!(views.windows(2).all(|pair| pair[0].timestamp < pair[1].timestamp));
    for view in &views {
        let frame = (view.timestamp - sequence.timestamp(0)) * sequence.config().frame_rate;
        assert!((frame.fract() - 0.5).abs() < 1e-3 && frame < 89.0, "at frame {frame}");
        let path = sequence.world_from_camera(view.timestamp);
        let beside = path.tangent_to(&view.world_from_camera);
        let (shift, turn) = (beside.fixed_rows::<3>(0).norm(), beside.fixed_rows::<3>(3).norm());
        assert!((0.025..0.05).contains(&shift) && (0.015..0.05).contains(&turn), "{shift} m, {turn} rad");
    }
    let still = self::sequence(SynthConfig { frames: 1, ..small() });
    assert_eq!(still.heldout_poses().len(), 1);
}

/// Share of the surface points of one frame that another one sees, and the points' share nearer than 8 m.
fn shared_and_near(sequence: &SynthSequence, from: usize, to: usize) -> (f64, f64) {
    let camera = sequence.camera();
    let [world_from_a, world_from_b] = [from, to].map(|k| sequence.world_from_camera(sequence.timestamp(k)));
    let depth = sequence.render_frame(from).depth;
    let metres = |pixel: usize| f64::from(depth[pixel]) / 5000.0;
    let is_seen = |pixel: &usize| {
        let ray = camera.ray((pixel % camera.width) as f64, (pixel / camera.width) as f64);
        let point = world_from_a.transform_point(&(ray * metres(*pixel)));
        let here = world_from_b.inverse().transform_point(&point);
        let place = camera.project(&here);
        here.z > 0.1
            && (0.0..camera.width as f64).contains(&place.x)
            && (0.0..camera.height as f64).contains(&place.y)
    };
    let near = (0..depth.len()).filter(|pixel| (0.4..8.0).contains(&metres(*pixel))).count();
    let share = |count: usize| count as f64 / depth.len() as f64;
    (share((0..depth.len()).filter(is_seen).count()), share(near))
}

#[test]
fn every_pixel_sees_a_surface_point_nearby_and_none_is_twice_there() {
    let sequence = sequence(SynthConfig { depth: DepthSensor::Exact, ..small() });
    let points = sequence.surface_points();
    let cell = |point: &[f32; 3]| point.map(|x| (x / 0.01).floor() as i32);
    let cells: HashSet<[i32; 3]> = points.iter().map(cell).collect();
    assert_eq!(cells.len(), points.len());
    let camera = sequence.camera();
    for index in [0, sequence.len() - 1] {
        let frame = sequence.render_frame(index);
        for pixel in (0..camera.width * camera.height).step_by(97) {
            let ray = camera.ray((pixel % camera.width) as f64, (pixel / camera.width) as f64);
            let depth = f64::from(frame.depth[pixel]) / 5000.0;
            let expected = frame.world_from_camera.transform_point(&(ray * depth));
            let distance = |point: &[f32; 3]| (Vector3::from(point.map(f64::from)) - expected).norm();
            let nearest = points.iter().map(distance).fold(f64::INFINITY, f64::min);
            // The diagonal of a cell, and a step of the stored depth.
            assert!(nearest < 0.01 * 3.0_f64.sqrt() + 3e-4, "{nearest} m");
        }
    }
}

#[test]
fn a_loop_ends_where_it_began_and_sees_nothing_of_that_half_way() {
    for scene in SceneName::ALL {
        let config = SynthConfig {
            scene,
            motion: CameraMotion::Loop,
            frames: 41,
            frame_rate: 5.0,
            mean_blur_px: 3.0,
            ..small()
        };
        let sequence = sequence(config);
        let path = |time: f64| sequence.world_from_camera(time);
        let ends = path(sequence.timestamp(0)).tangent_to(&path(sequence.timestamp(40)));
        // Twice the play of the hand.
        assert!(ends.fixed_rows::<3>(0).norm() < 0.3, "{scene}: {ends}");
        assert!(shared_and_near(&sequence, 40, 0).0 > 0.5, "{scene}");
        assert!(shared_and_near(&sequence, 20, 0).0 < 0.02, "{scene}");
        for frame in (0..40).step_by(4) {
            let (next, near) = shared_and_near(&sequence, frame, frame + 1);
            assert!(next > 0.3 && near > 0.7, "{scene}, frame {frame}: {next} shared, {near} near");
        }
        let mean = (0..41).map(|index| sequence.blur(index).mean_px).sum::<f64>() / 41.0;
        assert!((mean - 3.0).abs() < 0.05, "{scene}: {mean} px");
    }
}

#[test]
fn a_walk_comes_back_to_its_first_room_and_sees_another_one_in_between() {
    let config = SynthConfig {
        motion: CameraMotion::Walk,
        frames: 700,
        frame_rate: 20.0,
        mean_blur_px: 3.0,
        ..small()
    };
    let walk = sequence(config.clone());
    // Seven metres from room to room.
    let room = |frame: usize| {
        let time = walk.timestamp(frame);
        (walk.world_from_camera(time).translation.x / 7.0).round()
    };
    assert_eq!([0, 120, 300, 420, 690].map(room), [0.0, 0.0, 1.0, 1.0, 0.0]);
    for frame in (0..690).step_by(30) {
        let (next, _) = shared_and_near(&walk, frame, frame + 1);
        assert!(next > 0.4, "frame {frame}: {next} shared");
    }
    let error = SynthSequence::new(SynthConfig { scene: SceneName::Hall, ..config }).err().unwrap();
    assert_eq!(error.to_string(), "the scene hall has no doors to walk through; the room has");
}

#[test]
fn a_loop_cannot_have_less_blur_than_its_way() {
    let hasty = SynthConfig { motion: CameraMotion::Loop, frames: 30, mean_blur_px: 0.5, ..small() };
    let error = SynthSequence::new(hasty.clone()).err().unwrap();
    let SynthError::BlurOfTheWay { requested, least } = error else { panic!("{error}") };
    // A turn of 360 degrees in 29 intervals, 16 ms of 33.3 ms each: 0.104 rad, at 75 px and more away from the middle.
    assert!(requested == 0.5 && (7.5..14.0).contains(&least), "{least}");
    let still = sequence(SynthConfig { mean_blur_px: 0.0, ..hasty });
    let blur = (0..30).map(|index| still.blur(index).mean_px).sum::<f64>() / 30.0;
    assert!((blur - least).abs() < 0.2, "without shake there is the way: {blur} px");
    let ends = still.world_from_camera(0.1).tangent_to(&still.world_from_camera(0.1 + 29.0 / 30.0));
    assert!(ends.norm() < 1e-4, "{ends}");
}

#[test]
fn settings_out_of_range_are_named() {
    let message = |config| SynthSequence::new(config).err().unwrap().to_string();
    assert_eq!(message(SynthConfig { frames: 0, ..small() }), "frames 0: expected 1 to 100000");
    assert_eq!(
        message(SynthConfig { mean_blur_px: f64::NAN, ..small() }),
        "mean blur NaN: expected 0 to an eighth of the image width in pixels"
    );
    assert_eq!(
        message(SynthConfig { exposure_seconds: 0.05, ..small() }),
        "exposure 0.05: expected 1e-6 seconds to the frame interval"
    );
    let unreachable = SynthConfig { exposure_seconds: 1e-5, ..small() };
    assert!(matches!(SynthSequence::new(unreachable), Err(SynthError::BlurOutOfReach { .. })));
    let name = "attic".parse::<SceneName>().unwrap_err().to_string();
    assert_eq!(name, "unknown scene \"attic\"; known are room, hall and wall");
}

#[test]
fn written_sequence_opens_as_a_data_set() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room");
    let sequence = sequence(SynthConfig { frames: 3, ..small() });
    let counted = std::sync::Mutex::new(Vec::new());
    let count = |done, all| counted.lock().unwrap().push((done, all));
    let summary = super::write_dataset(&sequence, &path, count).unwrap();
    assert!((summary.mean_blur_px - 2.0).abs() < 0.01, "{summary:?}");
    let mut counted = counted.into_inner().unwrap();
    counted.sort_unstable();
    assert_eq!(counted, [(1, 3), (2, 3), (3, 3)]);

    let dataset = mba_io::dataset::open(&path).unwrap();
    assert!(dataset.warnings().is_empty(), "{:?}", dataset.warnings());
    assert_eq!(dataset.calibration().camera, sequence.camera());
    assert_eq!(dataset.len(), 3);
    let (read, rendered) = (dataset.frame(2).unwrap(), sequence.render_frame(2));
    assert_eq!(read.timestamp, rendered.timestamp);
    let truth = dataset.ground_truth_exposures()[2];
    assert!(truth.start.tangent_to(&rendered.exposure.start).norm() < 1e-8);
    assert!(truth.mid.tangent_to(&rendered.world_from_camera).norm() < 1e-8);
    let stored = image::open(path.join("rgb/000002.png")).unwrap().into_rgb8();
    assert_eq!(stored.into_raw(), rendered.rgb);
    let stored = image::open(path.join("depth/000002.png")).unwrap().into_luma16();
    assert_eq!(stored.into_raw(), rendered.depth);

    let [view] = mba_io::trajectory_file::read_trajectory(&path.join("heldout_views/poses.txt"))
        .unwrap()
        .try_into()
        .expect("one view for three frames");
    let stored = image::open(path.join("heldout_views/000000.png")).unwrap().into_rgb8();
    let ratio = psnr(&stored, &sequence.render_view(&view.world_from_camera));
    assert!(ratio > 60.0, "the pose has nine decimals: {ratio} dB");

    let again = super::write_dataset(&sequence, &path, |_, _| ()).unwrap_err();
    assert!(matches!(again, SynthError::FolderNotEmpty { .. }), "{again}");
}

#[test]
fn a_sequence_that_was_stopped_leaves_nothing() {
    use std::ops::ControlFlow;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room");
    let sequence = sequence(SynthConfig { frames: 3, ..small() });
    let stop = |done, _| if done < 2 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
    let stopped = super::write_dataset_while(&sequence, &path, stop).unwrap_err();
    assert!(matches!(stopped, SynthError::Stopped), "{stopped}");
    assert!(!path.exists());
    super::write_dataset(&sequence, &path, |_, _| ()).unwrap();
}
