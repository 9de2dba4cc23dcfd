//! A lost tracker's search among its recent keyframes.

use super::frame::Frame;
use super::history::Motion;
use super::track::Tracker;
use crate::align::FrameData;
use crate::trajectory::FrameTiming;

impl Tracker<'_> {
    /// Looks for the current view among the keyframes; on success the motion starts anew from where it was found.
    pub(super) fn recover(&mut self, frame: &Frame, motion: &Motion) -> bool {
        let region = self.config.region;
        let skip = self.config.surface_level;
        let view = FrameData {
            levels: &self.pyramid.levels[skip..],
            depth: &self.depth,
            depth_level: 0,
            region: region.at_level(skip),
            timing: FrameTiming::GLOBAL,
        };
        let camera = self.config.camera.at_level(skip);
        let found = self.recent.find(
            self.simd,
            &camera,
            view,
            &self.config.align,
            motion,
            frame.timestamp,
            &mut self.scratch,
            &mut self.work,
        );
        match found {
            Some(world_from_mid) => {
                self.motion = Some(Motion {
                    timestamp: motion.timestamp,
                    ..Motion::still(frame.timestamp, world_from_mid)
                });
                true
            }
            None => false,
        }
    }
}
