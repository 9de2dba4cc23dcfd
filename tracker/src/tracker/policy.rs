//! When a frame is trusted and when it becomes the keyframe.

use super::result::{Doubt, FrameStatus};
use crate::align::{LevelOutcome, StopReason};

/// What an alignment ended with, in the terms of the decisions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Evidence {
    /// Share of the keyframe's patches in view.
    pub(super) overlap: f32,
    /// Share of the keyframe's patches in view that agree.
    pub(super) inliers: f32,
    /// Mean image motion since the keyframe, pixels.
    pub(super) flow: f32,
    /// Blur, pixels.
    pub(super) blur: f32,
    /// Share of the image with measured depth.
    pub(super) depth_share: f32,
    /// Whether a hand can have moved the camera there.
    pub(super) is_reachable: bool,
}

/// Running means of what good frames end with.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Typical {
    /// Photometric residual of the finest level.
    pub(super) residual: f32,
    /// Depth residual, 1/m.
    pub(super) depth_residual: f32,
}

impl Typical {
    /// Takes in a good frame.
    pub(super) fn learn(&mut self, outcome: &LevelOutcome) {
        if outcome.photometric_scale < COPY {
            return;
        }
        let share = if self.residual == 0.0 { 1.0 } else { LEARNT_SHARE };
        self.residual += share * (outcome.photometric_scale - self.residual);
        self.depth_residual += share * (outcome.depth_scale - self.depth_residual);
    }
}

/// Share of a new frame in the running means: they follow a change of exposure or light within ten frames.
const LEARNT_SHARE: f32 = 0.2;

/// Photometric residual of a frame that is a copy of its reference, nominal standard deviations: it tells nothing about
/// how well others can fit.
const COPY: f32 = 0.06;

/// Bounds of the brightness relative to the reference: what exposure control changes while a keyframe is in view, with a
/// factor of two to spare.
const GAIN_RANGE: core::ops::Range<f32> = 0.12..8.0;

/// Residuals below these are never bad, whatever was usual before: a frame that is compared with its own copy, or with one
/// without noise, fits better than any other ever will. Nominal standard deviations, and 1/m.
const RESIDUAL_FLOOR: f32 = 0.5;
const DEPTH_RESIDUAL_FLOOR: f32 = 5e-4;

/// Residual above this is bad, whatever was usual before, nominal standard deviations: patches that do not match differ by
/// their contrast, 30 and more. With a wrong response and jerky rows frames that match reach 16.
const RESIDUAL_CEILING: f32 = 24.0;

/// Shares of the keyframe's patches that agree: as few as the first agree by chance, and between the two a pose rests on a
/// corner of the image.
const CHANCE_INLIERS: f32 = 0.08;
const FEW_INLIERS: f32 = 0.2;

/// Points of depth that hold the six numbers of a pose where the picture does not: fifty for each.
const ENOUGH_DEPTH_POINTS: usize = 300;

/// Residual of depth up to which depth agrees with the keyframe, relative to what is usual: as a residual of the picture that
/// is weak, with room for holes and edges.
const DEPTH_AGREES: f32 = 3.0;

/// Photometric residuals relative to what is usual: from the first on another try is worth its time, from the second on the
/// frame is weak, from the third on it is lost unless depth agrees. Wrong poses begin where frames of one keyframe differ by
/// more than blur, distance and exposure make them.
const RETRIED_RESIDUAL: f32 = 2.0;
const WEAK_RESIDUAL: f32 = 2.5;
const LOST_RESIDUAL: f32 = 4.0;

/// Photometric residual relative to what is usual below which the picture fits as it always does.
const USUAL_RESIDUAL: f32 = 1.25;

/// Photometric residual relative to the contrast of the patches that agree, from which the picture is that of something else
/// while nothing is usual yet. A patch that is compared with its own mean has a residual of one contrast: what fits worse than
/// that owes nothing to the reference. Measured on recordings of which every fourth to twentieth frame was kept: wrong poses
/// have 1.2 to 9; seven in eight right ones of frames that follow each other have less than 1, and the others fit better soon.
const UNRELATED_RESIDUAL: f32 = 1.1;

/// The same where residuals have grown since. A tenth of the frames of a whole recording may have more than that, where light
/// and response are not as modelled: there that is as usual.
const FOREIGN_RESIDUAL: f32 = 2.25;

/// How far the pose can be trusted, and why no further.
pub(super) fn judge(
    outcome: &LevelOutcome,
    evidence: &Evidence,
    typical: &Typical,
) -> (FrameStatus, Option<Doubt>) {
    let lost = |doubt| (FrameStatus::Lost, Some(doubt));
    let weak = |doubt| (FrameStatus::Weak, Some(doubt));
    let aligned = !matches!(outcome.stop, StopReason::NoData | StopReason::Singular);
    let measured = evidence.inliers > CHANCE_INLIERS || outcome.depth_points > ENOUGH_DEPTH_POINTS;
    if !(aligned && measured) {
        return lost(Doubt::NoMatch);
    }
    if !evidence.is_reachable {
        return lost(Doubt::Speed);
    }
    if !GAIN_RANGE.contains(&outcome.estimate.brightness.gain) {
        return lost(Doubt::Brightness);
    }
    let residual = ratio(outcome.photometric_scale, typical.residual, RESIDUAL_FLOOR);
    let depth_residual = ratio(outcome.depth_scale, typical.depth_residual, DEPTH_RESIDUAL_FLOOR);
    let depth_agrees = outcome.depth_points > ENOUGH_DEPTH_POINTS && depth_residual < DEPTH_AGREES;
    if residual > LOST_RESIDUAL && !depth_agrees {
        return lost(Doubt::Residual);
    }
    let is_as_usual = residual < USUAL_RESIDUAL && depth_residual < DEPTH_AGREES;
    let is_foreign = match typical.residual > 0.0 {
        // Only what the picture itself shows can tell.
        false => exceeds_contrast(outcome, UNRELATED_RESIDUAL),
        true => !is_as_usual && exceeds_contrast(outcome, FOREIGN_RESIDUAL),
    };
    if residual > WEAK_RESIDUAL || outcome.photometric_scale > RESIDUAL_CEILING || is_foreign {
        return weak(Doubt::Residual);
    }
    if evidence.inliers < FEW_INLIERS { weak(Doubt::Inliers) } else { (FrameStatus::Ok, None) }
}

/// Whether the patches differ from the reference by more than so many of their contrasts.
fn exceeds_contrast(outcome: &LevelOutcome, contrasts: f32) -> bool {
    outcome.photometric_scale > (contrasts * outcome.contrast).max(RESIDUAL_FLOOR)
}

/// Whether an image shows nothing that could be aligned: its coarsest level is as flat as a lens cap or a light.
pub(super) fn is_blind(coarsest: &[f32]) -> bool {
    let count = coarsest.len().max(1) as f32;
    let mean = coarsest.iter().sum::<f32>() / count;
    let variance = coarsest.iter().map(|light| (light - mean) * (light - mean)).sum::<f32>() / count;
    // Half a step of an 8-bit image near black, and of one near white.
    let (dark, bright) = (mean < BLACK, mean > WHITE);
    (dark || bright) && variance < FLAT * FLAT
}

/// Mean light below which an image is that of a covered lens, and above which it is saturated; and the standard deviation
/// of the coarsest level from which it shows something after all.
const BLACK: f32 = 2e-3;
const WHITE: f32 = 0.97;
const FLAT: f32 = 2e-3;

/// Whether an alignment fits so much worse than usual that another try from other guesses is worth its time.
pub(super) fn fits_badly(outcome: &LevelOutcome, typical: &Typical) -> bool {
    ratio(outcome.photometric_scale, typical.residual, RESIDUAL_FLOOR) > RETRIED_RESIDUAL
}

/// A value relative to what is usual, which is `floor` at the least; 1 while nothing is usual.
fn ratio(value: f32, typical: f32, floor: f32) -> f32 {
    if typical > 0.0 { value / typical.max(floor) } else { 1.0 }
}

/// Whether the frame should replace a keyframe that was blurred by `keyframe_blur` pixels.
///
/// A keyframe is chosen for being sharp, not only for distance: a frame that is much sharper is taken at once, one
/// that is far is taken if it is not blurred more, and only when the view is about to be lost is any frame taken. Where
/// `rolling` rows make the velocity an unknown that only overlap can tell, a new view is worth more blur.
pub(super) fn wants_keyframe(
    evidence: &Evidence,
    keyframe_blur: f32,
    image_width: usize,
    rolling: bool,
) -> bool {
    let width = image_width as f32;
    let usable = evidence.depth_share > KEYFRAME_DEPTH_SHARE;
    // A pixel less, so that frames without blur do not take turns.
    let much_sharper = evidence.blur + 1.0 < MUCH_SHARPER * keyframe_blur;
    let far = evidence.overlap < FAR_OVERLAP || evidence.flow > FAR_FLOW * width;
    let sharp = if rolling { SHARP_ROLLING } else { SHARP } * width;
    let as_sharp = evidence.blur < (AS_SHARP * keyframe_blur).max(sharp);
    let leaving = evidence.overlap < LEAVING_OVERLAP || evidence.flow > LEAVING_FLOW * width;
    usable && (much_sharper || (far && as_sharp) || leaving)
}

/// Share of the image with depth that a keyframe needs: with less, most of what it shows has no place in space.
const KEYFRAME_DEPTH_SHARE: f32 = 0.15;

/// Blur relative to the keyframe's: below the first a frame is much sharper, below the second as sharp.
const MUCH_SHARPER: f32 = 0.6;
const AS_SHARP: f32 = 1.2;

/// Blur that is none, as a share of the width: 4 pixels of 640, and twice that for rolling rows.
const SHARP: f32 = 0.006;
const SHARP_ROLLING: f32 = 0.012;

/// Shares of the patches in view and of the width that the image has moved, from which a frame is far from the keyframe, and
/// from which its view is about to be lost: half of the patches still have to hold the next frame.
const FAR_OVERLAP: f32 = 0.6;
const FAR_FLOW: f32 = 0.2;
const LEAVING_OVERLAP: f32 = 0.45;
const LEAVING_FLOW: f32 = 0.3;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::align::Estimate;
    use crate::geometry::RigidTransform;
    use crate::trajectory::ExposureTrajectory;

    #[test]
    fn covered_and_saturated_images_are_blind_and_dim_ones_are_not() {
        assert!(is_blind(&[0.0; 64]));
        assert!(is_blind(&[1.0; 64]));
        let dim: [f32; 64] = core::array::from_fn(|k| 0.001 + 0.006 * (k % 2) as f32);
        assert!(!is_blind(&dim));
        assert!(!is_blind(&[0.5; 64]), "a grey wall has depth");
    }

    /// What comes of an alignment with a residual and a contrast where a residual of `usual` is usual.
    fn judged(residual: f32, contrast: f32, usual: f32) -> FrameStatus {
        let still = ExposureTrajectory::still(RigidTransform::identity());
        let mut outcome = LevelOutcome::unchanged(Estimate::linear(still));
        outcome.stop = StopReason::SmallStep;
        (outcome.photometric_scale, outcome.contrast) = (residual, contrast);
        let evidence = Evidence {
            overlap: 0.9,
            inliers: 0.8,
            flow: 5.0,
            blur: 5.0,
            depth_share: 0.9,
            is_reachable: true,
        };
        judge(&outcome, &evidence, &Typical { residual: usual, depth_residual: 0.0 }).0
    }

    #[test]
    fn a_picture_of_something_else_is_no_match_unless_that_is_usual() {
        // Nothing is usual yet.
        assert_eq!(judged(3.0, 3.0, 0.0), FrameStatus::Ok);
        assert_eq!(judged(4.0, 3.0, 0.0), FrameStatus::Weak);
        // Light that is not as modelled.
        assert_eq!(judged(9.0, 3.0, 8.0), FrameStatus::Ok);
        assert_eq!(judged(9.0, 3.0, 5.0), FrameStatus::Weak);
        // A flat and noiseless picture.
        assert_eq!(judged(0.4, 0.0, 0.0), FrameStatus::Ok);
    }

    #[test]
    fn residuals_below_the_floor_are_never_bad() {
        let values =
            [ratio(0.45, 0.05, RESIDUAL_FLOOR), ratio(3.0, 1.0, RESIDUAL_FLOOR), ratio(9.0, 0.0, 1.0)];
        assert_eq!(values, [0.9, 3.0, 1.0]);
    }
}
