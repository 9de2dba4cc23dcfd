//! Which frames become keyframes of the map.

use crate::run::{FrameRecord, FrameStatus};

/// Indices of at most `most` frames, ascending: all that were tracked, or the sharpest of each of `most` stretches of
/// about equally many tracked frames.
pub(super) fn choose_keyframes(records: &[FrameRecord], most: usize) -> Vec<usize> {
    let tracked: Vec<usize> =
        (0..records.len()).filter(|&k| records[k].status != FrameStatus::Lost).collect();
    let most = most.max(1);
    if tracked.len() <= most {
        return tracked;
    }
    let stretch = |k: usize| &tracked[k * tracked.len() / most..(k + 1) * tracked.len() / most];
    let sharpest = |stretch: &[usize]| {
        stretch.iter().copied().min_by(|a, b| records[*a].blur_px.total_cmp(&records[*b].blur_px))
    };
    (0..most).filter_map(|k| sharpest(stretch(k))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(status: FrameStatus, blur_px: f64) -> FrameRecord {
        FrameRecord { blur_px, ..FrameRecord::without_figures(0.0, status) }
    }

    #[test]
    fn lost_frames_are_never_chosen_and_few_frames_all() {
        let records = [
            record(FrameStatus::Ok, 9.0),
            record(FrameStatus::Lost, f64::NAN),
            record(FrameStatus::Weak, 3.0),
        ];
        assert_eq!(choose_keyframes(&records, 100), [0, 2]);
        assert_eq!(choose_keyframes(&records[1..2], 100), [0; 0]);
    }

    #[test]
    fn the_sharpest_of_each_stretch_is_chosen() {
        let blurs = [5.0, 2.0, 4.0, 8.0, 7.0, 9.0, 1.0, 6.0, 3.0];
        let records: Vec<_> = blurs.iter().map(|blur| record(FrameStatus::Ok, *blur)).collect();
        assert_eq!(choose_keyframes(&records, 3), [1, 4, 6]);
        assert_eq!(choose_keyframes(&records, 2).len(), 2);
    }
}
