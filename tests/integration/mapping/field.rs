//! A tri-plane field as the map.

use mba_mapper::map::{FIELD_FILE, MAP_FILE, MapKind};
use mba_mapper::mapping::MapSettings;
use mba_mapper::run::Merit;
use mba_mapper::synth::SynthConfig;
use mba_mapper::triplane::read_field;
use mba_tests::blurred_sequence::{BlurredSequence, names};

/// Frames of the sequence.
const FRAMES: usize = 6;

#[test]
fn a_field_is_sharp_where_frames_are_blurred_and_keeps_the_middles() {
    let sequence = BlurredSequence::new(SynthConfig {
        frames: FRAMES,
        width: 96,
        height: 72,
        mean_blur_px: 4.0,
        ..SynthConfig::default()
    });
    let run = sequence.run_of("run", sequence.truth());
    let settings = MapSettings { kind: MapKind::Field, ..MapSettings::default() };
    std::fs::create_dir_all(sequence.path("mapped")).unwrap();
    std::fs::write(sequence.path("mapped").join(MAP_FILE), "an earlier map").unwrap();
    // What makes the folder that of a run.
    let summary = r#"{"format": 1, "complete": true, "program": "mba", "frames": {}}"#;
    std::fs::write(sequence.path("mapped").join("summary.json"), summary).unwrap();
    let summary = sequence.map(&run, "mapped", &settings);
    let figures = summary.map.expect("figures of the map");
    println!("{figures:?}");
    let gain = figures.keyframe_psnr.unwrap() - figures.keyframe_psnr_captured.unwrap();
    assert!(gain > 1.0, "{gain} dB");
    assert!(figures.heldout_psnr.unwrap() > 24.0, "new views: {:?} dB", figures.heldout_psnr);

    let merit = Merit::of(&run.exposures, &sequence.dataset);
    let [before, after] = [merit.trajectory, summary.trajectory].map(|all| all.unwrap().ate_m.rmse);
    assert!(after < before + 1e-3, "{before} m, then {after} m");

    let folder = sequence.path("mapped");
    let field = read_field(&folder.join(FIELD_FILE)).unwrap();
    let size = std::fs::metadata(folder.join(FIELD_FILE)).unwrap().len();
    assert_eq!(size, figures.map_file_bytes);
    // The generator's room has about 5 m x 5 m x 3 m.
    assert!((10.0..200.0).contains(&field.region().volume()), "{} m3", field.region().volume());
    assert!(!folder.join(MAP_FILE).exists(), "the map of the other kind is gone");
    assert_eq!(names(&folder.join("depth")).len(), FRAMES);
}
