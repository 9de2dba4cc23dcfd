//! Repairing what a run recorded.

use mba_mapper::continuity::{ContinuityError, ContinuitySettings, FrameVerdict};
use mba_mapper::mapping::repair_run;
use mba_mapper::run::{FrameRecord, FrameStatus};
use mba_mapper::trajectory_file::TimedExposure;
use nalgebra::Vector6;

use crate::shaken::{FRAMES, Shaken};

fn record(timestamp: f64, status: FrameStatus) -> FrameRecord {
    let residual = if status == FrameStatus::Lost { f64::NAN } else { 1.2 };
    FrameRecord { residual, blur_px: 4.0, ..FrameRecord::without_figures(timestamp, status) }
}

#[test]
fn only_faulty_exposures_of_a_run_change() {
    let mut shaken = Shaken::new(9, 6.0);
    shaken.swap(12);
    shaken.misplace(30, &Vector6::new(0.1, -0.05, 0.0, 0.1, 0.0, 0.1));
    shaken.lose(61);
    let given: Vec<TimedExposure> = shaken
        .frames
        .iter()
        .map(|frame| {
            let path = frame.world_from_camera;
            TimedExposure { timestamp: frame.timestamp, start: path.start, mid: path.mid(), end: path.end }
        })
        .collect();
    let status = |k| if k == 61 { FrameStatus::Lost } else { FrameStatus::Ok };
    let records: Vec<_> = given.iter().enumerate().map(|(k, e)| record(e.timestamp, status(k))).collect();
    let seconds = vec![shaken.frames[0].exposure_seconds; FRAMES];
    let settings = ContinuitySettings::default();

    let repaired = repair_run(&given, &records, &seconds, &settings, &|_| None).expect("a valid run");
    let verdicts = &repaired.continuity.verdicts;
    assert_eq!(
        [verdicts[12], verdicts[30], verdicts[61]],
        [FrameVerdict::Reversed, FrameVerdict::Replaced, FrameVerdict::Bridged]
    );
    for (k, (before, after)) in given.iter().zip(&repaired.exposures).enumerate() {
        assert_eq!(before == after, ![12, 30, 61].contains(&k), "frame {k}");
    }
    let back = TimedExposure { start: given[12].end, end: given[12].start, ..given[12] };
    assert_eq!(repaired.exposures[12], back);
    for k in [30, 61] {
        let error = shaken.truth[k].mid().tangent_to(&repaired.exposures[k].mid).norm();
        assert!(error < 0.005, "frame {k}: {error}");
    }

    let error =
        repair_run(&given, &records[1..], &seconds, &settings, &|_| None).expect_err("a record is missing");
    assert_eq!(error, ContinuityError::Lengths { exposures: FRAMES, records: FRAMES - 1, seconds: FRAMES });
}
