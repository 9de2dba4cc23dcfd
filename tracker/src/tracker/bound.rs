//! The most that a frame can take.

use super::bootstrap::BOOTSTRAP_ROUNDS;
use super::coarse_to_fine::{COMPETING_LEVELS, COMPETING_STRIDE, FINALISTS, FINE_STRIDE, MAX_GUESSES};
use super::config::{ReferenceMode, TrackerConfig};
use crate::keyframe::max_keypoints;
use crate::transfer::MAX_VIRTUAL_VIEWS;
use crate::work::Work;

/// Alignments from all guesses: a frame that fits badly is tried once more as if nothing were known of its motion, and one
/// that is still not found is looked for among earlier keyframes and aligned again.
const FULL_ALIGNMENTS: u64 = 3;

/// First guesses from which an earlier keyframe is tried.
const RECOVERY_GUESSES: usize = 2;

/// Deblurrings: of the first keyframe once its motion is known, and of the frame if it becomes the next.
const DEBLURRINGS: u64 = 2;

impl TrackerConfig {
    /// The most work that any frame can take, whatever is in it: keypoints x pixels x virtual views x linearisations,
    /// with every alignment that one frame can need. Frames take a small part of it: never are all guesses followed
    /// to the limit, with the longest blur, on full levels.
    #[must_use]
    pub fn work_bound(&self) -> Work {
        let pixels = (self.camera.width * self.camera.height) as u64;
        let mut bound = self.alignment_bound(0, MAX_GUESSES).times(FULL_ALIGNMENTS);
        let apart = self.readout.colour_rolls() || self.readout.depth_is_apart();
        // The second frame, and where rows or depth are apart each of the first two with the other in turn.
        let exchanges = if apart { 2 * BOOTSTRAP_ROUNDS as u64 } else { 0 };
        bound += self.alignment_bound(0, 1).times(1 + exchanges);
        let recovery = self.alignment_bound(self.surface_level, RECOVERY_GUESSES);
        bound += recovery.times(self.recent_keyframes as u64);
        let deblurrings = DEBLURRINGS + exchanges;
        bound.image_pixels = pixels * (1 + deblurrings);
        if self.reference == ReferenceMode::Deblurred {
            let blurs = (self.deblur_iterations as u64).saturating_mul(2).saturating_add(1);
            bound.blur_taps = blurs.saturating_mul(deblurrings * MAX_VIRTUAL_VIEWS as u64 * pixels);
        }
        bound
    }

    /// The most that an alignment on the levels from `finest` on can take.
    fn alignment_bound(&self, finest: usize, guesses: usize) -> Work {
        (finest..self.levels).fold(Work::none(), |sum, level| {
            let starts = match self.levels.saturating_sub(level + 1) {
                0 => guesses,
                above if above < COMPETING_LEVELS => guesses.min(FINALISTS),
                _ => 1,
            };
            sum + self.linearisation_bound(level).times(starts as u64).times(self.align.max_iterations as u64)
        })
    }

    /// The most that a linearisation on `level` can take, with the measurement of noise before it.
    fn linearisation_bound(&self, level: usize) -> Work {
        let camera = self.camera.at_level(level);
        let views = self.align.max_views.clamp(3, MAX_VIRTUAL_VIEWS);
        let patches = Work::of_patches(max_keypoints(camera.width, camera.height, level), views);
        let map = self.camera.at_level(self.surface_level);
        let competing = level + COMPETING_LEVELS >= self.levels;
        let stride = if competing { COMPETING_STRIDE } else { FINE_STRIDE };
        let mut bound = patches.times(2);
        if self.align.depth_term {
            bound += Work::of_depth(map.width, map.height, stride);
            bound += Work::of_depth(map.width, map.height, 2 * stride);
        }
        Work { linearisations: 1, ..bound }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::PinholeCamera;
    use crate::photometric::InverseResponse;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 160, height: 120, fx: 140.0, fy: 140.0, cx: 79.5, cy: 59.5 };

    #[test]
    fn bound_is_the_product_of_its_factors() {
        let config = TrackerConfig::compact(CAMERA, 0.001, InverseResponse::linear());
        // Keypoints: 7x5 cells on level 0, 6x5 on level 1, 5x4 on level 2. Linearisations: three times 12, 8 and 1
        // starts of 8 on levels 2, 1 and 0, once 1, 1 and 1; each with two predictions of every patch.
        let patches = 2 * 8 * (3 * (12 * 20 + 8 * 30 + 35) + 20 + 30 + 35);
        // The map of 80x60 with every fourth point and, for the noise, every eighth; second and fourth on level 0.
        let (coarse, fine) = (20 * 15 + 10 * 8, 40 * 30 + 20 * 15);
        let expected = Work {
            linearisations: 8 * (3 * (12 + 8 + 1) + 3),
            patches,
            view_pixels: patches * 32 * 32,
            depth_points: 8 * (3 * (20 * coarse + fine) + 2 * coarse + fine),
            blur_taps: 0,
            image_pixels: 3 * 160 * 120,
        };
        assert_eq!(config.work_bound(), expected);
    }

    #[test]
    fn deblurring_and_recovery_add_their_share() {
        let compact = TrackerConfig::compact(CAMERA, 0.001, InverseResponse::linear());
        let deblurring = TrackerConfig { reference: ReferenceMode::Deblurred, ..compact.clone() };
        // Four iterations of two blurs and one before them, twice.
        assert_eq!(deblurring.work_bound().blur_taps, 2 * 9 * 32 * 160 * 120);
        // Two guesses on level 2 and one, both going on, on level 1, for each of three keyframes.
        let recovering = TrackerConfig { recent_keyframes: 3, ..compact.clone() };
        let more = recovering.work_bound().linearisations - compact.work_bound().linearisations;
        assert_eq!(more, 3 * 8 * (2 + 2));
    }
}
