//! The estimated motion of an exposure, drawn into the frame that it blurred.

use image::{Rgb, RgbImage};
use mba_mapper::dataset::RgbdFrame;
use mba_mapper::exposure::ExposurePath;
use mba_mapper::trajectory_file::TimedExposure;
use mba_tracker::geometry::PinholeCamera;

/// Lines side by side and above one another.
const GRID: [usize; 2] = [7, 5];
/// Points of a line.
const POINTS: usize = 17;
/// Half the width of a line and of the rim that sets it off, pixels.
const WIDTHS: [(f64, Rgb<u8>); 2] = [(2.6, Rgb([25, 20, 10])), (1.3, Rgb([255, 196, 0]))];
/// How much wider the end at shutter opening is.
const OPENING: f64 = 2.0;

/// Where a point of the scene was imaged while the shutter was open, from opening to closing, pixels.
type Line = Vec<[f64; 2]>;

/// The lines of points on a grid that have depth in `frame`, whose camera moved as `exposure` says. The points are
/// where they are imaged at mid exposure.
pub(super) fn motion_lines(
    frame: &RgbdFrame,
    camera: &PinholeCamera,
    depth_scale: f64,
    exposure: &TimedExposure,
) -> Vec<Line> {
    let path = ExposurePath::through(exposure);
    let (columns, rows) = (GRID[0], GRID[1]);
    let points = (0..columns * rows).map(|k| {
        let across = |k: usize, count: usize, size: usize| (2 * k + 1) * size / (2 * count);
        [across(k % columns, columns, frame.width), across(k / columns, rows, frame.height)]
    });
    let line = |[u, v]: [usize; 2]| {
        let raw = *frame.depth.get(v * frame.width + u).filter(|raw| **raw > 0)?;
        let in_camera = camera.ray(u as f64, v as f64) * (f64::from(raw) / depth_scale);
        let in_world = exposure.mid.transform_point(&in_camera);
        let seen = |k: usize| {
            let point = path.at(k as f64 / (POINTS - 1) as f64).inverse().transform_point(&in_world);
            let pixel = camera.project(&point);
            (point.z > 0.0 && pixel.iter().all(|x| x.is_finite())).then_some([pixel.x, pixel.y])
        };
        (0..POINTS).map(seen).collect::<Option<Line>>()
    };
    points.filter_map(line).collect()
}

/// Draws lines that are given in the pixels of an image `scale` times as large. The end at shutter opening is thick.
pub(super) fn draw(image: &mut RgbImage, lines: &[Line], scale: f64) {
    for line in lines {
        // The centre of the first pixel is (0, 0) in images of both sizes.
        let line: Line = line.iter().map(|p| p.map(|x| (x + 0.5) / scale - 0.5)).collect();
        let Some(opening) = line.first() else { continue };
        for (half_width, colour) in WIDTHS {
            line.windows(2).for_each(|ends| stroke(image, [ends[0], ends[1]], half_width, colour));
            stroke(image, [*opening; 2], half_width + OPENING, colour);
        }
    }
}

/// A straight stroke with round ends.
fn stroke(image: &mut RgbImage, ends: [[f64; 2]; 2], half_width: f64, colour: Rgb<u8>) {
    let size = [image.width(), image.height()].map(f64::from);
    let range = |axis: usize| {
        let (a, b) = (ends[0][axis], ends[1][axis]);
        let inside = |x: f64| x.clamp(0.0, size[axis]) as u32;
        inside((a.min(b) - half_width - 1.0).floor())..inside((a.max(b) + half_width + 2.0).ceil())
    };
    for y in range(1) {
        for x in range(0) {
            // Half a pixel around the edge is blended, which is what makes it smooth.
            let cover = half_width + 0.5 - distance([f64::from(x), f64::from(y)], ends);
            let pixel = image.get_pixel_mut(x, y);
            for (value, ink) in pixel.0.iter_mut().zip(colour.0) {
                let mixed = f64::from(*value) + cover.clamp(0.0, 1.0) * (f64::from(ink) - f64::from(*value));
                *value = mixed.round() as u8;
            }
        }
    }
}

/// Distance of a point from a stroke's axis.
fn distance(point: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let from_a = [point[0] - a[0], point[1] - a[1]];
    let length = along[0] * along[0] + along[1] * along[1];
    let share = if length > 0.0 { (along[0] * from_a[0] + along[1] * from_a[1]) / length } else { 0.0 };
    let share = share.clamp(0.0, 1.0);
    (from_a[0] - share * along[0]).hypot(from_a[1] - share * along[1])
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::RigidTransform;
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    /// A wall at 2 m before a camera that moves 4 cm to the right: everything moves 10 pixels to the left.
    #[test]
    fn lines_are_as_long_as_the_blur_and_run_with_time() {
        let camera = PinholeCamera { width: 140, height: 100, fx: 500.0, fy: 500.0, cx: 69.5, cy: 49.5 };
        let at = |x: f64| RigidTransform::new(UnitQuaternion::identity(), Vector3::new(x, 0.0, 0.0));
        let exposure = TimedExposure { timestamp: 0.0, start: at(-0.02), mid: at(0.0), end: at(0.02) };
        let mut frame = RgbdFrame {
            index: 0,
            timestamp: 0.0,
            depth_timestamp: 0.0,
            exposure_seconds: 0.01,
            width: 140,
            height: 100,
            rgb: vec![0; 3 * 140 * 100],
            depth: vec![2000; 140 * 100],
        };
        let lines = motion_lines(&frame, &camera, 1000.0, &exposure);
        assert_eq!(lines.len(), GRID[0] * GRID[1]);
        for line in &lines {
            let (first, last) = (line[0], line[POINTS - 1]);
            assert!(
                (first[0] - last[0] - 10.0).abs() < 1e-9 && (first[1] - last[1]).abs() < 1e-9,
                "{line:?}"
            );
        }
        frame.depth.fill(0);
        assert!(
            motion_lines(&frame, &camera, 1000.0, &exposure).is_empty(),
            "nothing is known of their distance"
        );
    }

    #[test]
    fn a_stroke_covers_its_axis_and_nothing_far_from_it() {
        let mut image = RgbImage::new(20, 20);
        draw(&mut image, &[vec![[10.5, 20.5], [30.5, 20.5], [1e9, 20.5]]], 2.0);
        assert_eq!(image.get_pixel(15, 10), &WIDTHS[1].1);
        assert_eq!(image.get_pixel(15, 14), &Rgb([0; 3]));
        assert_ne!(image.get_pixel(5, 13), &Rgb([0; 3]), "the end at opening is thick");
    }
}
