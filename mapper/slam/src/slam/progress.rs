//! Where a run of SLAM stands.

use mba_map::map::MapSize;

/// Where a run stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SlamProgress {
    /// Frames come in.
    Frames {
        /// Frames so far.
        frames: usize,
        /// Keyframes of the map.
        keyframes: usize,
        /// How large the map is.
        map: MapSize,
        /// Loops that were closed.
        loops: usize,
    },
    /// The last frame was seen, all of the map is refined.
    Refinement {
        /// Share that is done, 0 to 1.
        position: f64,
        /// PSNR of blurred renderings against captured frames in dB.
        psnr: f64,
    },
}
