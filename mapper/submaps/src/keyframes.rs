//! Which frames of a run are keyframes of its submaps.

use mba_io::trajectory_file::TimedExposure;
use mba_slam::run::{FrameRecord, FrameStatus};

/// Most frames that one keyframe stands for: a camera that stands still is looked at again after a second.
const LONGEST_STRETCH: usize = 30;

/// The sharpest frame of every stretch in which the picture moves by `motion_px`, ascending; all frames that were tracked if
/// that is 0. `pixels_per` are those that the picture moves by a metre and by a radian.
pub(crate) fn choose_keyframes(
    exposures: &[TimedExposure],
    records: &[FrameRecord],
    motion_px: f64,
    pixels_per: [f64; 2],
) -> Vec<usize> {
    let tracked = (0..records.len()).filter(|&k| records[k].status != FrameStatus::Lost);
    let (mut chosen, mut stretch, mut moved): (_, Vec<usize>, f64) = (Vec::new(), Vec::new(), 0.0);
    for index in tracked {
        if let Some(&before) = stretch.last() {
            let [from, to] = [before, index].map(|k| &exposures[k].mid);
            let shift = (to.translation - from.translation).norm();
            moved += shift * pixels_per[0] + from.rotation.angle_to(&to.rotation) * pixels_per[1];
            if moved > motion_px || stretch.len() >= LONGEST_STRETCH {
                chosen.extend(sharpest(&stretch, records));
                stretch.clear();
                moved = 0.0;
            }
        }
        stretch.push(index);
    }
    chosen.extend(sharpest(&stretch, records));
    chosen
}

fn sharpest(stretch: &[usize], records: &[FrameRecord]) -> Option<usize> {
    stretch.iter().copied().min_by(|a, b| records[*a].blur_px.total_cmp(&records[*b].blur_px))
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::RigidTransform;
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn the_sharpest_of_every_stretch_is_chosen() {
        let blurs = [5.0, 2.0, 4.0, 8.0, 7.0, 1.0, 3.0];
        let record = |blur_px: &f64| {
            let status = if *blur_px == 1.0 { FrameStatus::Lost } else { FrameStatus::Ok };
            FrameRecord { blur_px: *blur_px, ..FrameRecord::without_figures(0.0, status) }
        };
        let records: Vec<FrameRecord> = blurs.iter().map(record).collect();
        let exposure = |k: usize| {
            let shift = Vector3::new(0.01 * k as f64, 0.0, 0.0);
            let pose = RigidTransform { translation: shift, ..RigidTransform::identity() };
            TimedExposure { timestamp: k as f64, start: pose, mid: pose, end: pose }
        };
        let exposures: Vec<TimedExposure> = (0..blurs.len()).map(exposure).collect();
        // A centimetre is a pixel: stretches of three frames, without the lost one.
        let chosen = |motion_px| choose_keyframes(&exposures, &records, motion_px, [100.0, 100.0]);
        assert_eq!(chosen(2.5), [1, 4, 6]);
        assert_eq!(chosen(0.0), [0, 1, 2, 3, 4, 6]);
    }
}
