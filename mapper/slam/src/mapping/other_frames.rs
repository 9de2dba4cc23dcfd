//! Frames between keyframes: fitted to the finished map.

use mba_adjust::bundle::{BundleAdjustment, MapKeyframe, NOTICEABLE, PathPrior, Placed, log_brightness};
use mba_io::dataset::Dataset;
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::geometry::RigidTransform;

use super::MapSettings;
use super::observations::{observation, sensor};
use super::part::MapPart;
use super::prepare::Frames;
use crate::run::FrameStatus;

/// Steps per frame.
const STEPS: usize = 24;

/// Which frames between keyframes are fitted to the map; the others are moved along with the keyframes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    /// All that were tracked.
    Tracked,
    /// Those without a pose that can be trusted: the others were tracked in the map's own world.
    Doubtful,
}

impl Fit {
    fn includes(self, status: FrameStatus) -> bool {
        match self {
            Self::Tracked => status != FrameStatus::Lost,
            Self::Doubtful => status != FrameStatus::Ok,
        }
    }
}

/// Which frames are fitted, of the part of the run that is mapped; `None` for all of it.
#[derive(Clone, Copy)]
pub(super) struct Fitted<'a> {
    pub(super) fit: Fit,
    pub(super) part: Option<&'a MapPart>,
}

impl Fitted<'_> {
    fn includes(&self, index: usize, status: FrameStatus) -> bool {
        self.fit.includes(status) && self.part.is_none_or(|part| part.frames.contains(&index))
    }
}

/// What the fit of the frames between keyframes gave.
pub(super) struct AllFrames {
    /// Exposure and logarithm of the gain of every frame.
    pub(super) exposures: Vec<(TimedExposure, f64)>,
    /// How well the map predicts those that it was not made of.
    pub(super) predicted: Prediction,
}

/// How well a finished map predicts captured pictures that it was not made of.
#[derive(Clone, Copy, Default)]
pub(super) struct Prediction {
    /// Sum of the PSNR of all frames, dB.
    sum: f64,
    /// Number of frames.
    pub(super) frames: usize,
}

impl Prediction {
    /// Adds a frame by the mean squared difference of display values (0 to 1).
    fn add(&mut self, mean_square: f64) {
        // Beyond 8-bit pictures that agree in every pixel nothing is told apart.
        const FINEST: f64 = 1e-7;
        self.sum -= 10.0 * mean_square.max(FINEST).log10();
        self.frames += 1;
    }

    /// Mean PSNR in dB; `None` without frames.
    pub(super) fn psnr(&self) -> Option<f64> {
        (self.frames > 0).then(|| self.sum / self.frames as f64)
    }
}

/// Exposures and logarithms of the gains of all frames: those of keyframes as they were refined, those of the others
/// starting from the tracked ones moved along with the keyframe next to them and, as `fitted` says, fitted to the map. Frames
/// that cannot be read are only moved along. Where all tracked frames are fitted, their pictures are compared with what the
/// map predicts.
pub(super) fn all_exposures(
    dataset: &Dataset,
    bundle: &mut BundleAdjustment,
    frames: &Frames,
    settings: &MapSettings,
    fitted: Fitted<'_>,
) -> AllFrames {
    let keyframes: Vec<usize> = bundle.frames.iter().map(|frame| frame.keyframe.index).collect();
    let sensor = sensor(dataset);
    let mut all = Vec::with_capacity(dataset.len());
    let mut predicted = Prediction::default();
    for index in 0..frames.exposures.len() {
        // Keyframes were refined themselves.
        let next = keyframes.partition_point(|keyframe| *keyframe < index).min(keyframes.len() - 1);
        if keyframes[next] == index {
            let state = &bundle.frames[next].state;
            all.push((frames.exposure_of(index, state), state.log_gain));
            continue;
        }
        // Others move along with the keyframe next to them, as far as it was moved.
        let nearest = nearest(&keyframes, next, index);
        let before = &frames.exposures[keyframes[nearest]].mid;
        let reference = &bundle.frames[nearest];
        let moved: RigidTransform = reference.state.path.mid().compose(&before.inverse());
        let mut state = frames.state(index, settings);
        state.path = state.path.seen_from(&moved);
        state.log_gain = reference.state.log_gain;
        if fitted.includes(index, frames.records[index].status)
            && let Ok(observation) = observation(dataset, &sensor, index)
        {
            let unmapped = MapKeyframe::new(
                index,
                observation,
                PathPrior { middle: state.path.ends.mid(), ..frames.priors[index] },
            );
            // The gain from the same surfaces in both pictures, where exposure control changed it noticeably.
            let here = Placed { seen: unmapped.observation.level(1), world_from_camera: state.path.mid() };
            if let Some(ratio) = log_brightness(&sensor.inverse_response, reference.placed(1), here)
                && ratio.abs() > NOTICEABLE
            {
                state.log_gain += ratio;
            }
            // The map stays, the path follows its picture.
            bundle.fit_frame(&unmapped, &mut state, STEPS);
            if fitted.fit == Fit::Tracked {
                predicted.add(bundle.prediction_error(&unmapped, &state));
            }
        }
        all.push((frames.exposure_of(index, &state), state.log_gain));
    }
    AllFrames { exposures: all, predicted }
}

/// Which keyframe is nearest to frame `index`, `next` being the first after it.
fn nearest(keyframes: &[usize], next: usize, index: usize) -> usize {
    match next.checked_sub(1) {
        Some(previous) if index - keyframes[previous] < keyframes[next].abs_diff(index) => previous,
        _ => next,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn predictions_are_averaged_in_decibel() {
        let mut predicted = Prediction::default();
        assert_eq!(predicted.psnr(), None);
        [1e-2, 1e-4, 0.0].into_iter().for_each(|mean_square| predicted.add(mean_square));
        assert!((predicted.psnr().unwrap() - (20.0 + 40.0 + 70.0) / 3.0).abs() < 1e-9);
        assert_eq!(predicted.frames, 3);
    }

    #[test]
    fn the_nearest_keyframe_may_be_on_either_side() {
        let keyframes = [4, 10];
        assert_eq!(nearest(&keyframes, 0, 1), 0);
        assert_eq!(nearest(&keyframes, 1, 5), 0);
        assert_eq!(nearest(&keyframes, 1, 9), 1);
        assert_eq!(nearest(&keyframes, 1, 15), 1);
    }
}
