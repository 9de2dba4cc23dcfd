//! What is not on record, found from rendered sequences whose truth is known.

use mba_mapper::dataset::{self, Dataset, Knowledge, Shutter};
use mba_mapper::self_calibration::{complete, is_complete, read_back, write};
use mba_mapper::synth::{SensorModel, SynthConfig, SynthSequence, write_dataset};
use tempfile::TempDir;

/// Frames of a sequence: fewer leave a readout uncertain.
const FRAMES: usize = 40;

/// A shaken sequence on the disk of which exposure and readout are not on record.
fn unknown(sensor: SensorModel, mean_blur_px: f64) -> (TempDir, SynthSequence, Dataset) {
    let sensor = SensorModel { is_on_record: false, ..sensor };
    let config = SynthConfig {
        frames: FRAMES,
        width: 320,
        height: 240,
        mean_blur_px,
        sensor,
        ..SynthConfig::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let sequence = SynthSequence::new(config).unwrap();
    write_dataset(&sequence, folder.path(), |_, _| ()).unwrap();
    let dataset = dataset::open(folder.path()).unwrap();
    (folder, sequence, dataset)
}

fn readout(dataset: &Dataset) -> f64 {
    dataset.calibration().readout.readout_seconds().unwrap_or(0.0)
}

#[test]
fn exposure_and_readout_of_a_rolling_camera_are_found_and_kept() {
    for true_readout in [0.02, -0.015] {
        let sensor = SensorModel { readout_seconds: true_readout, ..SensorModel::IDEAL };
        let (_folder, sequence, dataset) = unknown(sensor, 8.0);
        assert!(!is_complete(&dataset));
        let (completed, findings) = complete(dataset.clone()).unwrap();
        let found = readout(&completed);
        // Small pictures of so few frames leave a readout uncertain by an eighth; the sign and the order are never in doubt.
        assert!((found / true_readout - 1.0).abs() < 0.2, "readout {found}, true {true_readout}");
        let mut ratios: Vec<f64> =
            (0..FRAMES).map(|k| completed.exposure_seconds(k) / sequence.exposure_seconds(k)).collect();
        ratios.sort_by(f64::total_cmp);
        assert!((ratios[FRAMES / 2] - 1.0).abs() < 0.1, "exposure times over true ones: {ratios:?}");
        assert!(findings.iter().all(|finding| finding.knowledge == Knowledge::Estimated), "{findings:?}");
        assert!(is_complete(&completed));

        let run = tempfile::tempdir().unwrap();
        write(run.path(), &completed).unwrap();
        let again = read_back(run.path(), dataset).unwrap();
        assert_eq!(again.calibration(), completed.calibration());
        assert!((0..FRAMES).all(|k| again.exposure_seconds(k) == completed.exposure_seconds(k)));
    }
}

#[test]
fn when_depth_was_measured_is_found_from_edges() {
    // A camera whose depth comes 18 ms early and claims to be of the time of colour: with rows of colour one after the
    // other, and with those of depth as well.
    for depth_readout_seconds in [0.0, 0.02] {
        let sensor = SensorModel {
            readout_seconds: 0.02,
            depth_delay_seconds: -0.018,
            depth_readout_seconds,
            ..SensorModel::IDEAL
        };
        let (folder, _, _) = unknown(sensor, 4.0);
        let list = folder.path().join("associations.txt");
        let text = std::fs::read_to_string(&list).unwrap();
        let claimed = |line: &str| {
            let words: Vec<&str> = line.split_whitespace().collect();
            format!("{0} {1} {0} {2}\n", words[0], words[1], words[3])
        };
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        std::fs::write(&list, lines.map(claimed).collect::<String>()).unwrap();
        let dataset = dataset::open(folder.path()).unwrap();
        assert_eq!(dataset.depth_timestamp(3), dataset.timestamp(3));

        let (completed, findings) = complete(dataset).unwrap();
        let delay = completed.depth_timestamp(3) - completed.timestamp(3);
        assert!((delay + 0.018).abs() < 0.002, "delay {delay}, {findings:?}");
        assert_eq!(completed.calibration().sources.depth_delay, Knowledge::Estimated);
        // The jumps tell the rows of colour where depth has none. Where it has, motion may: these small pictures are allowed to
        // say that they do not know.
        let found = readout(&completed);
        let is_unknown = found == 0.0 && depth_readout_seconds != 0.0;
        assert!(is_unknown || (found / 0.02 - 1.0).abs() < 0.15, "readout {found}, {findings:?}");
    }
}

#[test]
fn a_still_camera_tells_nothing_and_is_taken_for_sharp() {
    let (_folder, _, dataset) = unknown(SensorModel::IDEAL, 0.0);
    let (completed, findings) = complete(dataset).unwrap();
    assert!(findings.iter().all(|finding| finding.value.is_none()), "{findings:?}");
    assert_eq!(completed.calibration().sources.exposure, Knowledge::Assumed);
    assert_eq!((completed.exposure_seconds(5), readout(&completed)), (1e-4, 0.0));
    assert!(!matches!(completed.calibration().readout, Shutter::Rolling { seconds: Some(_) }));
}
