//! Checks of cameras that are not ideal, and of what goes wrong, against what geometry and optics say about them.

use mba_io::dataset::{self, ExposureSource, Knowledge, Response, Shutter, Vignetting};
use mba_tracker::photometric::InverseResponse;
use nalgebra::Vector3;

use super::sequence::SynthSequence;
use super::{Events, FrameRanges, NoiseModel, ResponseCurve, SensorModel, SynthConfig, write_dataset};

fn small() -> SynthConfig {
    SynthConfig { frames: 6, width: 96, height: 72, mean_blur_px: 2.0, ..SynthConfig::default() }
}

fn with_sensor(sensor: SensorModel) -> SynthConfig {
    SynthConfig { sensor, ..small() }
}

fn sequence(config: SynthConfig) -> SynthSequence {
    SynthSequence::new(config).unwrap()
}

fn rolling(readout_seconds: f64) -> SynthConfig {
    SynthConfig { mean_blur_px: 4.0, ..with_sensor(SensorModel { readout_seconds, ..SensorModel::IDEAL }) }
}

/// Root mean square difference in linear light of `rgb` from views of `sequence`, each row averaged over the exposure of
/// frame 1 around its own time when the rows are read out in `readout` seconds.
fn difference_from_rows(sequence: &SynthSequence, rgb: &[u8], readout: f64) -> f64 {
    const VIEWS: usize = 24;
    let linear = InverseResponse::srgb();
    let (width, height) = (sequence.camera().width, sequence.camera().height);
    let (mut squares, mut count) = (0.0, 0.0);
    for row in (3..height).step_by(13) {
        let delay = ((row as f64 + 0.5) / height as f64 - 0.5) * readout;
        let mut mean = vec![0.0; 3 * width];
        for k in 0..VIEWS {
            let share = (k as f64 + 0.5) / VIEWS as f64 - 0.5;
            let time = sequence.timestamp(1) + delay + share * sequence.exposure_seconds(1);
            let view = sequence.render_view(&sequence.world_from_camera(time));
            let light = view[3 * width * row..][..3 * width].iter().map(|byte| linear.linear_light(*byte));
            mean.iter_mut().zip(light).for_each(|(mean, light)| *mean += f64::from(light) / VIEWS as f64);
        }
        for (byte, mean) in rgb[3 * width * row..].iter().zip(&mean) {
            squares += (f64::from(linear.linear_light(*byte)) - mean).powi(2);
            count += 1.0;
        }
    }
    f64::sqrt(squares / count)
}

#[test]
fn each_row_is_exposed_around_its_own_time() {
    for readout in [0.02, -0.03] {
        let sequence = sequence(rolling(readout));
        let rgb = sequence.render_frame(1).rgb;
        let right = difference_from_rows(&sequence, &rgb, readout);
        // As for a global shutter: the sampling of texture finer than these large pixels.
        assert!(right < 0.015, "readout {readout}: {right}");
        for wrong in [0.0, -readout] {
            let error = difference_from_rows(&sequence, &rgb, wrong);
            assert!(error > 2.0 * right, "{error} for readout {wrong}, {right} for the true {readout}");
        }
    }
}

#[test]
fn truth_and_sharp_views_of_a_rolling_shutter_are_those_of_the_middle() {
    let (global, rolling) = (sequence(rolling(0.0)), sequence(rolling(0.025)));
    for index in [0, 3] {
        let frame = rolling.render_frame(index);
        assert_eq!(frame.world_from_camera, global.world_from_camera(global.timestamp(index)));
        assert_eq!(frame.exposure, global.exposure(index));
        assert_eq!(frame.depth, global.render_frame(index).depth);
        assert_eq!(rolling.render_sharp(index), global.render_sharp(index));
        assert_ne!(frame.rgb, global.render_frame(index).rgb);
    }
}

#[test]
fn depth_is_measured_at_its_own_time() {
    // Depth that comes a whole interval late is that of the next frame.
    let late = sequence(with_sensor(SensorModel { depth_delay_seconds: 1.0 / 30.0, ..SensorModel::IDEAL }));
    let prompt = sequence(small());
    let frame = late.render_frame(2);
    assert_eq!((frame.timestamp, frame.depth_timestamp), (prompt.timestamp(2), prompt.timestamp(3)));
    assert_eq!(frame.depth, prompt.render_frame(3).depth);
    assert_eq!(frame.rgb, prompt.render_frame(2).rgb);
    let captured = frame.into_captured(2);
    assert_eq!((captured.timestamp, captured.depth_timestamp), (prompt.timestamp(2), prompt.timestamp(3)));
}

#[test]
fn rows_of_depth_are_measured_one_after_the_other() {
    // A readout of a quarter of the interval either way: a row is that of a sequence with depth of this row's delay.
    let readout = -0.25 / 30.0;
    let rolling = sequence(with_sensor(SensorModel { depth_readout_seconds: readout, ..SensorModel::IDEAL }));
    let frame = rolling.render_frame(2);
    let (width, height) = (frame.width, frame.height);
    for row in [0, height / 2, height - 1] {
        let delay = ((row as f64 + 0.5) / height as f64 - 0.5) * readout;
        let prompt = sequence(with_sensor(SensorModel { depth_delay_seconds: delay, ..SensorModel::IDEAL }));
        let of_row = |depth: &[u16]| depth[row * width..(row + 1) * width].to_vec();
        let (found, expected) = (of_row(&frame.depth), of_row(&prompt.render_frame(2).depth));
        // Timestamps are whole microseconds, so a few of the least units may differ.
        let differs = |(a, b): (&u16, &u16)| a.abs_diff(*b) > 2;
        let wrong = found.iter().zip(&expected).filter(|pair| differs(*pair)).count();
        assert!(wrong <= width / 50, "row {row}: {wrong} of {width}");
    }
    assert_eq!(frame.depth_timestamp, frame.timestamp);
}

/// Mean linear light of an image.
fn mean_light(rgb: &[u8]) -> f64 {
    let linear = InverseResponse::srgb();
    rgb.iter().map(|byte| f64::from(linear.linear_light(*byte))).sum::<f64>() / rgb.len() as f64
}

#[test]
fn exposures_follow_the_brightness_of_the_frame_before() {
    let auto = SensorModel { auto_exposure: true, ..SensorModel::IDEAL };
    let config = SynthConfig {
        frames: 24,
        gain: 0.4,
        events: Events { black: FrameRanges::new(vec![16..=17]), ..Events::NONE },
        ..with_sensor(auto)
    };
    let sequence = sequence(config);
    let exposures: Vec<f64> = (0..24).map(|index| sequence.exposure_seconds(index)).collect();
    assert!(exposures.iter().all(|exposure| (0.007..=0.018).contains(exposure)), "{exposures:?}");
    assert!(exposures.iter().all(|exposure| ((exposure * 1e6).round() / 1e6 - exposure).abs() < 1e-15));
    assert_eq!(exposures[0], 0.018, "begins with the longest");
    assert!(exposures[15] < 0.015 && exposures[3] < exposures[0], "{exposures:?}");
    assert_eq!((exposures[17], exposures[18]), (0.018, 0.018), "darkness asks for the longest");
    assert!(exposures[23] < 0.016, "{exposures:?}");
    // The gain stays: light is proportional to time. At this gain no more than lamps are clipped.
    for index in [0, 5] {
        let usual = mean_light(&sequence.render_view(&sequence.world_from_camera(sequence.timestamp(index))));
        let ratio = mean_light(&sequence.render_sharp(index)) / usual;
        let expected = exposures[index] / 0.016;
        assert!((ratio - expected).abs() < 0.01, "frame {index}: {ratio}, expected {expected}");
        let frame = sequence.render_frame(index);
        assert_eq!(frame.exposure_seconds, exposures[index]);
        assert!((mean_light(&frame.rgb) / usual - expected).abs() < 0.02 * expected);
        // Opening and closing are as far apart as the exposure says.
        let mid = sequence.timestamp(index);
        let opening = sequence.world_from_camera(mid - 0.5 * exposures[index]);
        assert!(frame.exposure.start.tangent_to(&opening).norm() < 1e-12);
    }
    let blur = (0..24).map(|index| sequence.blur(index).mean_px).sum::<f64>() / 24.0;
    assert!((blur - 2.0).abs() < 0.04, "blur is what was asked for: {blur} px");
}

#[test]
fn corners_are_darker_by_the_fall_off() {
    let lens = Vignetting { a2: -0.5, a4: 0.1 };
    let dim = SynthConfig { gain: 0.5, response: ResponseCurve::Linear, ..small() };
    let sensor = SensorModel { vignetting: lens, ..SensorModel::IDEAL };
    let (plain, dark) = (sequence(dim.clone()), sequence(SynthConfig { sensor, ..dim }));
    let (plain, dark) = (plain.render_sharp(0), dark.render_sharp(0));
    for (index, (plain, dark)) in plain.iter().zip(&dark).enumerate() {
        let (u, v) = ((index / 3 % 96) as f64, (index / 3 / 96) as f64);
        let expected = f64::from(*plain) * lens.falloff_at(96, 72, u, v);
        // Rounding to bytes on both sides; clipped pixels are lighter than their byte says.
        assert!(*plain == 255 || (f64::from(*dark) - expected).abs() <= 1.0, "{dark} for {expected}");
    }
    let corner = |rgb: &[u8]| rgb[..3].iter().map(|byte| f64::from(*byte)).sum::<f64>();
    assert!(corner(&dark) < 0.63 * corner(&plain) && corner(&plain) > 30.0);
}

#[test]
fn number_of_threads_changes_nothing_in_a_real_camera() {
    let sensor = SensorModel { readout_seconds: 0.02, auto_exposure: true, ..SensorModel::IDEAL };
    let config = SynthConfig { noise: Some(NoiseModel::default()), ..with_sensor(sensor) };
    let render = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| sequence(config.clone()).render_frame(3))
    };
    let (one, three) = (render(1), render(3));
    assert_eq!((one.rgb, one.exposure_seconds), (three.rgb, three.exposure_seconds));
}

/// A written sequence with an IMU, read back.
fn recorded(config: SynthConfig) -> (SynthSequence, dataset::Dataset, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let sequence = sequence(config);
    write_dataset(&sequence, folder.path(), |_, _| ()).unwrap();
    let dataset = dataset::open(folder.path()).unwrap();
    (sequence, dataset, folder)
}

#[test]
fn a_written_imu_turns_as_the_camera_and_feels_up() {
    let sensor = SensorModel { imu: true, ..SensorModel::IDEAL };
    let (sequence, dataset, _folder) = recorded(SynthConfig { seed: 5, ..with_sensor(sensor) });
    assert!(dataset.warnings().is_empty(), "{:?}", dataset.warnings());
    let [rate_bias, force_bias] = super::inertial::biases(5);
    assert!((0.001..0.02).contains(&rate_bias.norm()) && (0.005..0.1).contains(&force_bias.norm()));
    let imu = dataset.imu().unwrap().without_bias(&rate_bias, &force_bias);

    // The 0.2 s from frame 0 to frame 5 hold 40 samples of 0.002 rad/s noise: 6e-5 rad about each axis.
    let (from, to) = (sequence.timestamp(0), sequence.timestamp(5));
    let orientation = |time: f64| sequence.world_from_camera(time).rotation;
    let turned = orientation(from) * imu.rotation_between(from, to).unwrap();
    let error = turned.angle_to(&orientation(to));
    let motion = orientation(from).angle_to(&orientation(to));
    assert!(error < 1e-3 && motion > 20.0 * error, "{error} rad off, {motion} rad turned");

    // Integrated in the world, specific force less gravity is the change of velocity.
    let velocity = |time: f64| {
        let place = |time: f64| sequence.world_from_camera(time).translation;
        (place(time + 1e-4) - place(time - 1e-4)) / 2e-4
    };
    // From one sample to another, by the trapezoidal rule.
    let (from, to) = (0.1, 0.3);
    let is_within = |time: f64| (from - 1e-6..to + 1e-6).contains(&time);
    let samples: Vec<_> = imu.specific_forces().iter().filter(|sample| is_within(sample.time)).collect();
    assert_eq!(samples.len(), 41);
    let acceleration = |k: usize| orientation(samples[k].time) * samples[k].value - Vector3::y() * 9.806_65;
    let change: Vector3<f64> = (0..40).map(|k| (acceleration(k) + acceleration(k + 1)) * (0.5 / 200.0)).sum();
    let expected = velocity(to) - velocity(from);
    // Noise: 0.02 m/s^2 times 5 ms times the root of 40 is 6e-4 m/s.
    let error = (change - expected).norm();
    assert!(error < 3e-3 && expected.norm() > 0.05, "{error} m/s off, {expected}");

    let still = SynthConfig { mean_blur_px: 0.0, ..with_sensor(sensor) };
    let (sequence, dataset, _folder) = recorded(still);
    let force = dataset.imu().unwrap().mean_specific_force(0.1, 0.2).unwrap();
    let up = sequence.world_from_camera(0.15).rotation * force;
    assert!((up - Vector3::y() * 9.806_65).norm() < 0.15, "a camera at rest feels up: {up}");
    assert!(force.y < -9.0, "and up is -y in an upright camera: {force}");
}

#[test]
fn covered_and_flooded_frames_show_nothing_and_a_jump_shows_the_beginning_again() {
    let events = Events {
        black: FrameRanges::new(vec![1..=2]),
        saturated: FrameRanges::new(vec![3..=3]),
        jump: Some(4),
    };
    let config = SynthConfig { noise: Some(NoiseModel::default()), events, ..small() };
    let (disturbed, plain) = (sequence(config), sequence(small()));
    for (index, value) in [(1, 0), (2, 0), (3, 255)] {
        let frame = disturbed.render_frame(index);
        assert!(frame.rgb.iter().all(|byte| *byte == value) && frame.depth.iter().all(|depth| *depth == 0));
        assert_eq!(frame.rgb.len(), 3 * 96 * 72);
        assert!(disturbed.seen_points(index).is_empty());
    }
    assert_eq!(disturbed.seen_points(0).len(), 96 * 72);
    // The mean blur is now that of frames 0 to 3, 0 and 1, so the shake is a little stronger or weaker.
    let [first, again, second, later] =
        [0, 4, 1, 5].map(|index| disturbed.render_frame(index).world_from_camera);
    assert!(first.tangent_to(&again).norm() < 1e-5 && second.tangent_to(&later).norm() < 1e-5);
    assert!(first.tangent_to(&second).norm() > 1e-3);
    let pose = disturbed.world_from_camera(disturbed.timestamp(4));
    assert!(pose.tangent_to(&again).norm() < 1e-12, "poses by time jump as well");
    let before = disturbed.world_from_camera(disturbed.timestamp(4) - 0.6 / 30.0);
    assert!(before.tangent_to(&first).norm() > 5.0 * again.tangent_to(&first).norm() + 1e-3);
    assert_eq!(disturbed.timestamp(4), plain.timestamp(4));
    assert_ne!(disturbed.render_frame(4).rgb, disturbed.render_frame(0).rgb, "noise is its own");
}

#[test]
fn what_is_not_on_record_is_in_the_truth() {
    let table = std::array::from_fn(|code| (code as f32 / 255.0).powf(1.9) + 2e-4 * code as f32);
    let measured = InverseResponse::from_table(&table).unwrap();
    let sensor = SensorModel {
        readout_seconds: 0.02,
        depth_delay_seconds: 0.011,
        depth_readout_seconds: 0.01,
        auto_exposure: true,
        vignetting: Vignetting { a2: -0.35, a4: 0.05 },
        imu: false,
        is_on_record: true,
    };
    let config = SynthConfig {
        frames: 3,
        response: ResponseCurve::Measured(Box::new(measured.clone())),
        ..with_sensor(sensor)
    };
    let (sequence, known, _folder) = recorded(config.clone());
    assert!(known.warnings().is_empty(), "{:?}", known.warnings());
    let calibration = known.calibration();
    assert_eq!(calibration.readout, Shutter::Rolling { seconds: Some(0.02) });
    assert_eq!(calibration.response, Response::Table(Box::new(measured.clone())));
    assert_eq!(calibration.vignetting, sensor.vignetting);
    assert_eq!(calibration.depth_readout_seconds, 0.01);
    assert_eq!(calibration.exposure, ExposureSource::PerFrame);
    for index in 0..3 {
        assert_eq!(known.exposure_seconds(index), sequence.exposure_seconds(index));
        assert_eq!(known.depth_timestamp(index), sequence.depth_timestamp(index));
        assert!((known.depth_timestamp(index) - known.timestamp(index) - 0.011).abs() < 1e-9);
    }

    let unknown = SensorModel { is_on_record: false, ..sensor };
    let (_, silent, folder) = recorded(SynthConfig { sensor: unknown, ..config });
    let found = silent.calibration();
    assert_eq!(found.readout, Shutter::Rolling { seconds: None });
    assert_eq!((&found.response, found.vignetting), (&Response::Srgb, Vignetting::NONE));
    let sources = found.sources;
    assert_eq!([sources.exposure, sources.response, sources.vignetting], [Knowledge::Assumed; 3]);
    assert_eq!(silent.frame(1).unwrap().rgb, known.frame(1).unwrap().rgb, "the pictures are the same");
    assert_eq!(silent.depth_timestamp(1), known.depth_timestamp(1));

    let truth = folder.path().join("truth");
    let told = dataset::read_calibration(&truth.join("calibration.toml")).unwrap();
    assert_eq!((told.readout, told.vignetting), (calibration.readout, calibration.vignetting));
    assert_eq!(told.response, calibration.response);
    // The curve has six decimals; its steep foot makes that the light of a code to some 1e-3.
    let curve = dataset::read_response(&truth.join("response.csv")).unwrap();
    for code in 0..=255 {
        let error = (curve.linear_light(code) - measured.linear_light(code)).abs();
        assert!(error < 2e-3, "code {code}: {error}");
    }
    let exposures = std::fs::read_to_string(truth.join("exposures.csv")).unwrap();
    assert!(
        exposures.starts_with("frame,timestamp,exposure_s\n0,0.100000,0.018000\n1,0.133333,"),
        "{exposures}"
    );
    assert!(!folder.path().join("exposures.csv").exists());
}

#[test]
fn sensors_and_events_out_of_range_are_named() {
    let message = |config| SynthSequence::new(config).err().unwrap().to_string();
    let sensor = |sensor: SensorModel| message(with_sensor(sensor));
    let ideal = SensorModel::IDEAL;
    assert_eq!(
        sensor(SensorModel { readout_seconds: -0.04, ..ideal }),
        "readout -0.04: expected seconds of at most 0.1 and the frame interval, either way"
    );
    assert_eq!(
        sensor(SensorModel { depth_delay_seconds: f64::NAN, ..ideal }),
        "depth delay NaN: expected -0.2 to 0.2 seconds"
    );
    for (a2, a4, value) in [(-1.5, 0.5, "0"), (f64::NAN, 0.0, "NaN"), (0.0, f64::INFINITY, "NaN")] {
        assert_eq!(
            sensor(SensorModel { vignetting: Vignetting { a2, a4 }, ..ideal }),
            format!("least light of the fall-off {value}: expected 0.001 to 1")
        );
    }
    let event = |events: Events| message(SynthConfig { events, ..small() });
    assert_eq!(
        event(Events { saturated: FrameRanges::new(vec![2..=6]), ..Events::NONE }),
        "saturated frame 6: expected frames of the sequence, counted from 0"
    );
    for index in [0, 6] {
        assert_eq!(
            event(Events { jump: Some(index), ..Events::NONE }),
            format!("jump at frame {index}: expected a frame of the sequence after the first")
        );
    }
    let felt = SynthConfig {
        events: Events { jump: Some(3), ..Events::NONE },
        ..with_sensor(SensorModel { imu: true, ..ideal })
    };
    assert_eq!(message(felt), "jump at frame 3: expected none with an IMU, which would have to feel it");
}
