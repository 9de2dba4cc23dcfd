//! Depth images of another camera as the colour camera sees them.

use mba_tracker::SimdLevel;
use mba_tracker::geometry::{Distortion, PinholeCamera, RigidTransform};
use mba_tracker::image::{SourcePosition, fill_source_map, remap_nearest};
use nalgebra::Vector3;

use super::DepthCamera;

/// Largest ratio of depths that are taken for one surface between neighbouring pixels, and interpolated.
const ONE_SURFACE: f64 = 1.05;

/// How a stored depth image becomes one of the colour camera.
#[derive(Clone, Debug)]
pub(super) enum DepthView {
    /// Pixel by pixel.
    Stored,
    /// Each pixel has one of the stored image.
    Nearest(Vec<SourcePosition>),
    /// From the same place, with other pixels.
    Interpolated(Vec<SourcePosition>),
    /// From another place.
    Moved(Box<MovedView>),
}

impl DepthView {
    /// The view of `depth` from the place of the colour `camera`, both without distortion. `depth_scale` is in raw units
    /// per metre.
    pub(super) fn of(depth: &DepthCamera, camera: &PinholeCamera, depth_scale: f64) -> Self {
        if !depth.is_in_place() {
            let undistorted = (!depth.distortion.is_none())
                .then(|| source_map(&depth.camera, &depth.camera, &depth.distortion));
            return Self::Moved(Box::new(MovedView {
                undistorted,
                depth: depth.camera,
                colour: *camera,
                colour_from_depth: depth.colour_from_depth,
                depth_scale,
            }));
        }
        if depth.camera == *camera && depth.distortion.is_none() {
            return Self::Stored;
        }
        Self::Interpolated(source_map(camera, &depth.camera, &depth.distortion))
    }

    /// The depth that the colour camera sees, of a stored image of `size` (width, height), raw units.
    pub(super) fn seen(&self, simd: SimdLevel, stored: Vec<u16>, size: (usize, usize)) -> Vec<u16> {
        match self {
            Self::Stored => stored,
            Self::Nearest(map) => nearest(simd, &stored, size, map),
            Self::Interpolated(map) => map.iter().map(|at| interpolate(&stored, size, *at)).collect(),
            Self::Moved(view) => view.seen(simd, stored),
        }
    }
}

/// Positions in `captured`, with its distortion, of the pixels of `ideal`.
fn source_map(
    ideal: &PinholeCamera,
    captured: &PinholeCamera,
    distortion: &Distortion,
) -> Vec<SourcePosition> {
    let mut map = vec![[0.0; 2]; ideal.width * ideal.height];
    let filled = fill_source_map(ideal, captured, distortion, &mut map);
    debug_assert_eq!(filled, Ok(()), "the map has the size of the camera");
    map
}

fn nearest(
    simd: SimdLevel,
    stored: &[u16],
    (width, height): (usize, usize),
    map: &[SourcePosition],
) -> Vec<u16> {
    let mut target = vec![0; map.len()];
    let mapped = remap_nearest(simd, stored, width, height, map, &mut target);
    debug_assert_eq!(mapped, Ok(()), "the decoder checked the size");
    target
}

/// Depth between pixels: inverse depth is linear over a plane. Depths of two surfaces are never mixed, the nearest pixel
/// counts there.
fn interpolate(stored: &[u16], (width, height): (usize, usize), [u, v]: SourcePosition) -> u16 {
    // Written so that NaN is refused.
    if !(u >= 0.0 && v >= 0.0 && u <= (width - 1) as f32 && v <= (height - 1) as f32) {
        return 0;
    }
    let (column, row) = (u as usize, v as usize);
    let (right, below) = ((column + 1).min(width - 1), (row + 1).min(height - 1));
    let (x, y) = (f64::from(u) - column as f64, f64::from(v) - row as f64);
    let corners = [(row, column), (row, right), (below, column), (below, right)]
        .map(|(row, column)| stored[row * width + column]);
    let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
    let (least, most) = (corners.iter().min().copied(), corners.iter().max().copied());
    let (least, most) = (f64::from(least.unwrap_or(0)), f64::from(most.unwrap_or(0)));
    if least == 0.0 || most > ONE_SURFACE * least {
        let (row, column) = (if y < 0.5 { row } else { below }, if x < 0.5 { column } else { right });
        return stored[row * width + column];
    }
    let inverse: f64 = corners.iter().zip(weights).map(|(depth, weight)| weight / f64::from(*depth)).sum();
    // Between the corners, so within 16 bits.
    inverse.recip().round() as u16
}

/// A depth camera that looks from another place.
#[derive(Clone, Debug)]
pub(super) struct MovedView {
    /// Takes out the distortion of the depth images.
    undistorted: Option<Vec<SourcePosition>>,
    depth: PinholeCamera,
    colour: PinholeCamera,
    colour_from_depth: RigidTransform,
    depth_scale: f64,
}

impl MovedView {
    /// Every depth pixel as a square that faces the depth camera; the nearest one counts where several cover a pixel.
    fn seen(&self, simd: SimdLevel, stored: Vec<u16>) -> Vec<u16> {
        let size = (self.depth.width, self.depth.height);
        let stored = match &self.undistorted {
            Some(map) => nearest(simd, &stored, size, map),
            None => stored,
        };
        let mut target = vec![0_u16; self.colour.width * self.colour.height];
        for (index, raw) in stored.iter().enumerate().filter(|(_, raw)| **raw != 0) {
            let (u, v) = ((index % size.0) as f64, (index / size.0) as f64);
            let metres = f64::from(*raw) / self.depth_scale;
            let point = |u: f64, v: f64| self.moved(u, v, metres);
            // Corners of the depth pixel in the picture: what lies between them is covered, so that nothing shows through.
            let (Some(first), Some(last)) =
                (self.pixel(point(u - 0.5, v - 0.5)), self.pixel(point(u + 0.5, v + 0.5)))
            else {
                continue;
            };
            let seen = (point(u, v).z * self.depth_scale).round();
            if (1.0..f64::from(u16::MAX)).contains(&seen) {
                self.cover(&mut target, first, last, seen as u16);
            }
        }
        target
    }

    /// The point of a depth pixel in the axes of the colour camera, metres.
    fn moved(&self, u: f64, v: f64, metres: f64) -> Vector3<f64> {
        self.colour_from_depth.transform_point(&(self.depth.ray(u, v) * metres))
    }

    /// Where the colour camera sees a point in front of it.
    fn pixel(&self, point: Vector3<f64>) -> Option<[f64; 2]> {
        let pixel = self.colour.project(&point);
        (point.z > 0.0).then_some([pixel.x, pixel.y])
    }

    /// Gives the pixels whose centres lie between two corners the depth `raw`, unless they have a nearer one.
    fn cover(&self, target: &mut [u16], first: [f64; 2], last: [f64; 2], raw: u16) {
        // A camera that is turned may see the corners in another order.
        let range = |axis: usize, side: usize| {
            let (low, high) = (first[axis].min(last[axis]), first[axis].max(last[axis]));
            // The end is not part of it: squares that meet do not share pixels.
            let bound = |edge: f64| edge.ceil().clamp(0.0, side as f64) as usize;
            bound(low)..bound(high)
        };
        for row in range(1, self.colour.height) {
            for column in range(0, self.colour.width) {
                let pixel = &mut target[row * self.colour.width + column];
                if *pixel == 0 || raw < *pixel {
                    *pixel = raw;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    fn camera(width: usize, height: usize, focal: f64) -> PinholeCamera {
        let centre = |side: usize| (side as f64 - 1.0) / 2.0;
        PinholeCamera { width, height, fx: focal, fy: focal, cx: centre(width), cy: centre(height) }
    }

    #[test]
    fn depth_of_a_smaller_camera_is_interpolated_on_a_plane_and_not_across_edges() {
        let colour = camera(16, 12, 14.0);
        let depth = DepthCamera::same_view(&colour, (8, 6));
        assert_eq!(depth.camera, camera(8, 6, 7.0));
        // A slanted plane: inverse depth is linear in the column.
        let inverse = |u: f64| 1.0 / 2000.0 + 1e-6 * u;
        let mut stored: Vec<u16> =
            (0..48).map(|index| inverse(f64::from(index % 8)).recip().round() as u16).collect();
        let view = DepthView::of(&depth, &colour, 1000.0);
        let seen = view.seen(SimdLevel::new(), stored.clone(), (8, 6));
        // Column 5 of colour is column 2.25 of depth.
        assert!((f64::from(seen[16 * 5 + 5]) - inverse(2.25).recip()).abs() <= 1.0);
        // Half a depth pixel at the border lies outside of all centres.
        assert_eq!((seen[0], seen[16 * 5]), (0, 0));
        // A step to twice the depth, and a hole.
        (0..6).for_each(|row| stored[8 * row + 3] = 4000);
        stored[8 * 2 + 5] = 0;
        let seen = view.seen(SimdLevel::new(), stored, (8, 6));
        assert_eq!((seen[16 * 5 + 6], seen[16 * 5 + 7]), (4000, 4000), "columns 2.75 and 3.25");
        assert_eq!(seen[16 * 5 + 11], 0, "column 5.25 of row 2.25");
    }

    #[test]
    fn depth_from_another_place_moves_by_its_parallax_and_near_hides_far() {
        let colour = camera(40, 30, 30.0);
        let depth = DepthCamera {
            camera: camera(40, 30, 30.0),
            distortion: Distortion::default(),
            // The depth camera is 0.1 m to the right.
            colour_from_depth: RigidTransform::new(UnitQuaternion::identity(), Vector3::new(0.1, 0.0, 0.0)),
        };
        let view = DepthView::of(&depth, &colour, 1000.0);
        let mut stored = vec![3000_u16; 40 * 30];
        // 3 px of parallax at 1 m, 1 px at 3 m.
        stored[15 * 40 + 20] = 1000;
        let seen = view.seen(SimdLevel::new(), stored, (40, 30));
        assert_eq!(seen[15 * 40 + 23], 1000);
        assert_eq!(seen[15 * 40 + 22], 3000);
        assert_eq!(seen[15 * 40 + 21], 0, "what only the colour camera sees behind the near point");
        assert_eq!(seen[0], 0, "beyond the view of the depth camera");
        assert_eq!(seen.iter().filter(|raw| **raw == 3000).count(), 30 * 39 - 2);
    }
}
