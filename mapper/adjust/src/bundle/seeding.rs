//! New Gaussians from a frame with depth, where the map has nothing yet: flat ones that lie on the surface.
//!
//! Balls would be a fog of the thickness of a square, in front of which the surface is never seen.

use mba_map::infill;
use mba_raster::gaussians::{Gaussian, Gaussians};
use mba_raster::sensor::Observation;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::photometric::InverseResponse;
use nalgebra::{Matrix3, Vector3};

use super::disc::Disc;
use super::seed_view::{DepthSource, SeedView};
use super::smooth_depth::smooth_depth;

/// Side of the largest square that becomes one Gaussian, pixels.
const LARGEST: usize = 16;
/// Side of the smallest.
const SMALLEST: usize = 2;
/// Standard deviation of display values, 1 is full scale, above which a square is divided.
const DETAIL: f32 = 0.03;
/// Ratio of the largest to the smallest depth above which a square is divided.
const STEP: f32 = 1.05;
/// Standard deviation of the picture of a Gaussian, as a fraction of the side of its square.
const SPREAD: f32 = 0.5;
/// Pixels to each side over which the slope of the surface is found, for squares that reach less far.
const SLOPE_RADIUS: usize = 6;
/// Depths that differ from that of a square by less than this share of it belong to its surface.
const SAME_SURFACE: f32 = 0.05;
/// Opacity of a new Gaussian.
const OPACITY: f32 = 0.9;
/// A pixel is covered where the map's alpha is larger.
pub(super) const COVERED: f32 = 0.5;

/// Largest squares that have a pixel which is not covered, row by row.
fn open_blocks(seen: &Observation, alpha: &[f32]) -> Vec<bool> {
    let (width, height) = (seen.camera.width, seen.camera.height);
    let across = width.div_ceil(LARGEST);
    let mut open = vec![false; across * height.div_ceil(LARGEST)];
    for (pixel, _) in alpha.iter().enumerate().filter(|(_, alpha)| **alpha < COVERED) {
        open[pixel / width / LARGEST * across + pixel % width / LARGEST] = true;
    }
    open
}

/// Depth in metres, without noise where `is_open` and, if asked for, without holes.
fn depth_to_seed(
    seen: &Observation,
    is_open: impl Fn(usize) -> bool + Sync,
    source: DepthSource,
) -> Vec<f32> {
    let mut depth = smooth_depth(seen, is_open);
    if source == DepthSource::Completed {
        let known: Vec<f32> = depth.iter().map(|z| if *z > 0.0 { 1.0 } else { 0.0 }).collect();
        // Inverse depth is what is linear in pixels on a plane.
        let mut inverse: Vec<f32> = depth.iter().map(|z| 1.0 / z).collect();
        infill::fill(seen.camera.width, &mut inverse, &known);
        for (depth, inverse) in depth.iter_mut().zip(inverse) {
            *depth = if inverse > 0.0 { 1.0 / inverse } else { 0.0 };
        }
    }
    depth
}

/// Appends Gaussians on the surface that a view shows, one per square that is uniform in
/// colour and depth, unless the middle of the square is covered according to `alpha` (row by row, as large as the view).
///
/// Adds at most `room` and returns how many.
pub(super) fn seed(
    gaussians: &mut Gaussians,
    view: &SeedView<'_>,
    inverse_response: &InverseResponse,
    alpha: &[f32],
    room: usize,
) -> usize {
    let SeedView { seen, world_from_camera, gain, source, .. } = view;
    let before = gaussians.len();
    let open = open_blocks(seen, alpha);
    if room == 0 || !open.contains(&true) {
        return 0;
    }
    let width = seen.camera.width;
    let is_open = |x: usize, y: usize| open[y / LARGEST * width.div_ceil(LARGEST) + x / LARGEST];
    let depth = depth_to_seed(seen, |pixel| is_open(pixel % width, pixel / width), *source);
    let squares = Squares { seen, depth: &depth, inverse_response, gain: *gain, world_from_camera, alpha };
    let region = seen.region;
    for top in (region.top..region.bottom).step_by(LARGEST) {
        for left in (region.left..region.right).step_by(LARGEST) {
            // With a region that starts within a block, a square reaches into the next.
            let corners = [0, LARGEST - 1]
                .map(|by| [(left + by).min(region.right - 1), (top + by).min(region.bottom - 1)]);
            let [[x0, y0], [x1, y1]] = corners;
            if ![(x0, y0), (x1, y0), (x0, y1), (x1, y1)].iter().any(|&(x, y)| is_open(x, y)) {
                continue;
            }
            squares.divide([left, top], LARGEST, &mut |gaussian| {
                if gaussians.len() - before < room {
                    gaussians.push(gaussian);
                }
            });
        }
    }
    gaussians.len() - before
}

struct Squares<'a> {
    seen: &'a Observation,
    /// Depth without noise, metres.
    depth: &'a [f32],
    inverse_response: &'a InverseResponse,
    /// Gain on the map's light that gives that of `seen`.
    gain: f32,
    world_from_camera: &'a RigidTransform,
    alpha: &'a [f32],
}

/// What a square looks like.
struct Look {
    mean_light: [f32; 3],
    deviation: f32,
    /// Nearest, median and farthest depth; `None` if too few pixels have one.
    depth: Option<[f32; 3]>,
}

impl Squares<'_> {
    fn divide(&self, [left, top]: [usize; 2], side: usize, emit: &mut impl FnMut(&Gaussian)) {
        let region = self.seen.region;
        let (right, bottom) = ((left + side).min(region.right), (top + side).min(region.bottom));
        if left >= right || top >= bottom {
            return;
        }
        let look = self.look([left, right], [top, bottom]);
        let uneven = look.deviation > DETAIL || look.depth.is_some_and(|[near, _, far]| far > STEP * near);
        if side > SMALLEST && (uneven || look.depth.is_none()) {
            let half = side / 2;
            for (x, y) in [(0, 0), (half, 0), (0, half), (half, half)] {
                self.divide([left + x, top + y], half, emit);
            }
            return;
        }
        let middle = [0.5 * (left + right - 1) as f32, 0.5 * (top + bottom - 1) as f32];
        let pixel = middle[1] as usize * self.seen.camera.width + middle[0] as usize;
        if let Some([_, depth, _]) = look.depth
            && self.alpha[pixel] < COVERED
        {
            emit(&self.gaussian(middle, depth, side, look.mean_light));
        }
    }

    fn look(&self, [left, right]: [usize; 2], [top, bottom]: [usize; 2]) -> Look {
        let width = self.seen.camera.width;
        let pixels = (top..bottom).flat_map(|y| (left..right).map(move |x| y * width + x));
        let mut light = [0.0; 3];
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        let mut depths = Vec::with_capacity((right - left) * (bottom - top));
        for pixel in pixels {
            let bytes = self.seen.colour.each_ref().map(|plane| plane[pixel]);
            let through = self.gain * self.seen.falloff.as_ref().map_or(1.0, |falloff| falloff[pixel]);
            light
                .iter_mut()
                .zip(bytes)
                .for_each(|(sum, byte)| *sum += self.inverse_response.linear_light(byte) / through);
            let grey = bytes.iter().map(|&byte| f32::from(byte)).sum::<f32>() / (3.0 * 255.0);
            (sum, squares, count) = (sum + grey, squares + grey * grey, count + 1.0);
            if self.depth[pixel] > 0.0 {
                depths.push(self.depth[pixel]);
            }
        }
        let mean = sum / count;
        let deviation = (squares / count - mean * mean).max(0.0).sqrt();
        depths.sort_unstable_by(f32::total_cmp);
        let enough = 2 * depths.len() >= (right - left) * (bottom - top) && !depths.is_empty();
        let depth = enough.then(|| [depths[0], depths[depths.len() / 2], depths[depths.len() - 1]]);
        Look { mean_light: light.map(|sum| sum / count), deviation, depth }
    }

    /// Metres per pixel to the right and down at which the surface at a pixel recedes; none where too little is known of
    /// it. Inverse depth is linear in pixels on a plane.
    fn tilt(&self, [u, v]: [f32; 2], depth: f32, reach: usize) -> [f64; 2] {
        let (width, height) = (self.seen.camera.width, self.seen.camera.height);
        let range = |middle: f32, end: usize| {
            let middle = middle as usize;
            middle.saturating_sub(reach)..(middle + reach + 1).min(end)
        };
        let (mut normal, mut right) = (Matrix3::<f64>::zeros(), Vector3::<f64>::zeros());
        for y in range(v, height) {
            for x in range(u, width) {
                let z = self.depth[y * width + x];
                if z > 0.0 && (z - depth).abs() < SAME_SURFACE * depth {
                    let row = Vector3::new(1.0, f64::from(x as f32 - u), f64::from(y as f32 - v));
                    normal += row * row.transpose();
                    right += row / f64::from(z);
                }
            }
        }
        let plane = normal.cholesky().map_or_else(Vector3::zeros, |normal| normal.solve(&right));
        let slope = -f64::from(depth).powi(2);
        [slope * plane.y, slope * plane.z]
    }

    fn gaussian(&self, [u, v]: [f32; 2], depth: f32, side: usize, colour: [f32; 3]) -> Gaussian {
        let camera = &self.seen.camera;
        let tilt = self.tilt([u, v], depth, side.max(SLOPE_RADIUS));
        let sigma = f64::from(SPREAD) * side as f64;
        let disc = Disc::new(camera, [u, v].map(f64::from), f64::from(depth), tilt, sigma);
        let rotation = self.world_from_camera.rotation * disc.rotation;
        Gaussian {
            mean: self.world_from_camera.transform_point(&disc.mean).map(|x| x as f32).into(),
            log_scale: disc.scale.map(|scale| scale.ln() as f32).into(),
            rotation: [rotation.w, rotation.i, rotation.j, rotation.k].map(|q| q as f32),
            opacity_logit: (OPACITY / (1.0 - OPACITY)).ln(),
            colour,
        }
    }
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::PinholeCamera;
    use mba_tracker::image::PixelRectangle;

    use super::*;
    use mba_raster::exposure::RowTimes;

    /// A grey wall at 2 m with a striped square, and a hole in its depth.
    fn observation() -> Observation {
        let (width, height) = (64, 48);
        let stripes = |x: usize, y: usize| x < 16 && y < 16 && x.is_multiple_of(2);
        let pixels = || (0..width * height).map(move |pixel| (pixel % width, pixel / width));
        let plane: Vec<u8> = pixels().map(|(x, y)| if stripes(x, y) { 250 } else { 100 }).collect();
        Observation {
            camera: PinholeCamera { width, height, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 },
            colour: [plane.clone(), plane.clone(), plane],
            depth: pixels().map(|(x, y)| if x >= 48 && y >= 32 { 0.0 } else { 2.0 }).collect(),
            region: PixelRectangle { left: 0, top: 0, right: width, bottom: height },
            times: RowTimes::GLOBAL,
            falloff: None,
        }
    }

    fn seeded(covered: f32, source: DepthSource, room: usize) -> Gaussians {
        let (seen, mut map) = (observation(), Gaussians::default());
        let alpha = vec![covered; 64 * 48];
        let pose = RigidTransform { translation: Vector3::new(0.0, 0.0, 5.0), ..RigidTransform::identity() };
        let response = InverseResponse::linear();
        let view = SeedView { index: 0, seen: &seen, world_from_camera: pose, gain: 1.0, source };
        let added = seed(&mut map, &view, &response, &alpha, room);
        assert_eq!(added, map.len());
        map
    }

    #[test]
    fn squares_follow_the_detail_and_lie_on_the_surface() {
        let map = seeded(0.0, DepthSource::Measured, 1000);
        // The striped square in squares of 2, ten others of 16; the one without depth stays empty.
        assert_eq!(map.len(), 64 + 10);
        let sizes: Vec<f32> = map.planes()[3].iter().map(|log| log.exp()).collect();
        let fine = sizes.iter().filter(|size| (**size - 0.5 * 2.0 * 2.0 / 60.0).abs() < 1e-4).count();
        assert_eq!(fine, 64);
        assert!(map.planes()[2].iter().all(|z| (z - 7.0).abs() < 1e-4));
    }

    #[test]
    fn holes_in_depth_can_be_completed_and_covered_pixels_get_nothing() {
        let map = seeded(0.0, DepthSource::Completed, 1000);
        assert_eq!(map.len(), 64 + 11);
        assert!(map.planes()[2].iter().all(|z| (z - 7.0).abs() < 1e-2));
        assert_eq!(seeded(0.6, DepthSource::Completed, 1000).len(), 0);
        assert_eq!(seeded(0.0, DepthSource::Measured, 5).len(), 5);
    }
}
