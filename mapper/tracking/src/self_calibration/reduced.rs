//! Frames of less resolution: what is looked for moves the picture by many pixels, so a quarter of them tells as much.

use mba_tracker::geometry::PinholeCamera;

use mba_io::dataset::RgbdFrame;

/// Least width of a reduced picture, pixels.
const WIDTH: usize = 300;

/// How often the resolution is halved before a recording of this camera is looked at.
pub(super) fn usual_level(camera: &PinholeCamera) -> usize {
    let mut level = 0;
    while camera.width >> (level + 1) >= WIDTH {
        level += 1;
    }
    level
}

/// The frame with its resolution halved `level` times, for [`PinholeCamera::at_level`].
pub(super) fn reduced(frame: RgbdFrame, level: usize) -> RgbdFrame {
    (0..level).fold(frame, |frame, _| halved(&frame))
}

/// Each pixel is the mean of four in colour, and one of them in depth.
fn halved(frame: &RgbdFrame) -> RgbdFrame {
    let (width, height) = (frame.width / 2, frame.height / 2);
    let corners = |u: usize, v: usize| {
        let at = 2 * v * frame.width + 2 * u;
        [at, at + 1, at + frame.width, at + frame.width + 1]
    };
    let mut rgb = Vec::with_capacity(3 * width * height);
    let mut depth = Vec::with_capacity(width * height);
    for v in 0..height {
        for u in 0..width {
            let corners = corners(u, v);
            for channel in 0..3 {
                let sum: u16 = corners.iter().map(|at| u16::from(frame.rgb[3 * at + channel])).sum();
                rgb.push(((sum + 2) / 4) as u8);
            }
            depth.push(middle_depth(corners.map(|at| frame.depth[at])));
        }
    }
    RgbdFrame { width, height, rgb, depth, ..*frame }
}

/// The nearer of the two middle depths of those that were measured: between surfaces there is nothing to see, and a single
/// wrong one does not count. 0 where fewer than two were measured.
fn middle_depth(mut depths: [u16; 4]) -> u16 {
    depths.sort_unstable();
    let missing = depths.iter().filter(|depth| **depth == 0).count();
    if missing > 2 { 0 } else { depths[missing + (3 - missing) / 2] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_is_the_mean_of_four_and_its_depth_one_of_them() {
        let frame = RgbdFrame {
            index: 3,
            timestamp: 1.0,
            depth_timestamp: 1.5,
            exposure_seconds: 0.01,
            width: 3,
            height: 2,
            rgb: (0..18).map(|k| 10 * k).collect(),
            depth: vec![900, 0, 1, 500, 700, 1],
        };
        let half = reduced(frame, 1);
        assert_eq!((half.width, half.height, half.index), (1, 1, 3));
        // Pixels 0, 1 of the first row and of the second, which begins with value 90: the mean of 0, 30, 90, 120.
        assert_eq!(half.rgb, [60, 70, 80]);
        assert_eq!(half.depth, [700]);
    }

    #[test]
    fn depth_is_of_a_surface() {
        assert_eq!(middle_depth([500, 900, 510, 910]), 510);
        assert_eq!(middle_depth([0, 900, 0, 910]), 900);
        assert_eq!(middle_depth([0, 0, 0, 910]), 0);
        assert_eq!(middle_depth([0; 4]), 0);
    }

    #[test]
    fn cameras_come_to_a_like_width() {
        let camera = |width| PinholeCamera { width, height: 100, fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0 };
        let levels = [160, 320, 599, 640, 1280, 1920].map(|width| usual_level(&camera(width)));
        assert_eq!(levels, [0, 0, 0, 1, 2, 2]);
    }
}
