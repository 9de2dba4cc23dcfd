//! What a camera sees of a surface, and how far it can be trusted.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Below this cosine between a surface and the direction to the camera, about 81 degrees, depth is not used: a surface
/// is seen so flat that a pixel's depth says little.
const MIN_COSINE: f32 = 0.15;

/// Places in the window of a plane, in pixels from its middle.
const OFFSETS: [isize; 5] = [-4, -2, 0, 2, 4];

/// Pixels whose inverse depth is off the slope at the middle by at most this share belong to the same surface.
const SAME_SURFACE: f32 = 0.015;

/// Share of the depths in the window that has to belong to the surface: less means an edge between near and far, where mean depths
/// belong to neither.
const LEAST_SHARE: f32 = 0.4;

/// Surfaces nearer than this, metres, weigh no more than one at this distance.
const NEAREST: f32 = 0.5;

/// Depth and colour of a scene from one pose.
#[derive(Clone, Debug, PartialEq)]
pub struct ColouredDepth {
    /// Intrinsics; its size is that of the images.
    pub camera: PinholeCamera,
    /// Pose of the camera.
    pub world_from_camera: RigidTransform,
    /// Depth along the optical axis in metres, row by row; 0 where there is none.
    pub depth: Vec<f32>,
    /// Red, green and blue in linear light, row by row.
    pub colour: Vec<[f32; 3]>,
}

/// Views that can be had one after the other, and again: none has to stay in memory.
pub trait ViewSource {
    /// Number of views.
    fn count(&self) -> usize;

    /// A view by its index, which is below [`Self::count`]; the same every time, whatever the number of threads.
    fn view(&mut self, index: usize) -> ColouredDepth;
}

/// The surface at a pixel, as a plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PixelSurface {
    /// Depth along the optical axis, metres.
    pub(super) depth: f32,
    /// Unit normal in the camera's frame, away from the camera.
    normal: Vector3<f32>,
    /// Distance of the plane from the camera, metres.
    offset: f32,
    /// Cosine between normal and ray; 0 where there is nothing.
    pub(super) cosine: f32,
}

/// A view prepared to be asked for the surface at any image point.
#[derive(Debug)]
pub(super) struct SurfaceView {
    pub(super) camera: PinholeCamera,
    pub(super) camera_from_world: RigidTransform,
    pub(super) pixels: Vec<PixelSurface>,
}

impl SurfaceView {
    pub(super) fn new(view: &ColouredDepth) -> Self {
        let camera = view.camera;
        let pixels = camera.width * camera.height;
        // A source that keeps to its contract gives as many depths as pixels; missing ones are none.
        let mut surface = vec![PixelSurface::default(); pixels];
        if view.depth.len() == pixels {
            let inverse = |depth: &f32| if *depth > 0.0 && depth.is_finite() { 1.0 / depth } else { 0.0 };
            let inverse_depth: Vec<f32> = view.depth.iter().map(inverse).collect();
            let rows = surface.par_chunks_mut(camera.width.max(1)).enumerate();
            rows.for_each(|(v, row)| {
                for (u, pixel) in row.iter_mut().enumerate() {
                    *pixel = surface_at(view, &inverse_depth, u, v).unwrap_or_default();
                }
            });
        }
        Self { camera, camera_from_world: view.world_from_camera.inverse(), pixels: surface }
    }

    /// The surface at the pixel nearest to an image point.
    pub(super) fn at(&self, u: f32, v: f32) -> Option<&PixelSurface> {
        let (width, height) = (self.camera.width, self.camera.height);
        let inside = u > -0.5 && v > -0.5 && u < width as f32 - 0.5 && v < height as f32 - 0.5;
        if !inside {
            return None;
        }
        let nearest = self.pixels.get((v + 0.5) as usize * width + (u + 0.5) as usize)?;
        (nearest.cosine > 0.0).then_some(nearest)
    }
}

impl PixelSurface {
    /// Weight of what the pixel says about a point at some depth, metres: pixels are small when near.
    pub(super) fn weight(&self, depth: f32) -> f32 {
        self.cosine / depth.max(NEAREST).powi(2)
    }

    /// Distance of a point of the camera's frame from the plane, metres; positive in front of it. Between pixels the
    /// planes of both agree, unless there is an edge.
    pub(super) fn distance(&self, point: &Vector3<f32>) -> f32 {
        self.offset - self.normal.dot(point)
    }
}

/// The plane that fits best around a pixel. In normalised image coordinates x, y the inverse depth of a plane
/// `a X + b Y + c Z = 1` is `a x + b y + c`: a linear least-squares problem over those pixels of the window that
/// belong to the same surface. This also evens out the bumps that single Gaussians make.
fn surface_at(view: &ColouredDepth, inverse_depth: &[f32], u: usize, v: usize) -> Option<PixelSurface> {
    let PinholeCamera { width, height, fx, fy, cx, cy } = view.camera;
    let centre = inverse_depth[v * width + u];
    if centre <= 0.0 {
        return None;
    }
    // Inverse depth of a neighbour relative to the centre: small numbers keep their digits.
    let beside = |dx: isize, dy: isize| {
        let [u, v] = [u.checked_add_signed(dx)?, v.checked_add_signed(dy)?];
        let inverse = if u < width && v < height { inverse_depth[v * width + u] } else { 0.0 };
        (inverse > 0.0).then_some(inverse - centre)
    };
    // 1. A rough slope, which does not reach across an edge.
    let along_x = gradient([beside(-2, 0), beside(2, 0)]);
    let along_y = gradient([beside(0, -2), beside(0, 2)]);
    // 2. A fit to those neighbours that the rough slope explains.
    let mut fit = PlaneFit::default();
    let mut within = 0;
    for [dx, dy] in OFFSETS.into_iter().flat_map(|dy| OFFSETS.map(|dx| [dx, dy])) {
        let Some(difference) = beside(dx, dy) else { continue };
        within += 1;
        let (x, y) = (dx as f32, dy as f32);
        if (difference - along_x * x - along_y * y).abs() <= SAME_SURFACE * centre {
            fit.add(x, y, difference);
        }
    }
    // Among pieces of several surfaces there is no plane.
    if fit.count < LEAST_SHARE * within as f32 {
        return None;
    }
    let [a, b, difference] = fit.solve()?;
    // 3. From slopes per pixel to the plane `n.X = offset` in metres.
    let (a, b, inverse) = (a * fx as f32, b * fy as f32, centre + difference);
    let (x, y) = (((u as f64 - cx) / fx) as f32, ((v as f64 - cy) / fy) as f32);
    let c = inverse - a * x - b * y;
    let plane = Vector3::new(a, b, c);
    let offset = 1.0 / plane.norm();
    // Seen at a grazing angle, a plane is hardly determined, and depth least of all.
    let cosine = inverse * offset / (x * x + y * y + 1.0).sqrt();
    let surface = PixelSurface { depth: 1.0 / inverse, normal: plane * offset, offset, cosine };
    (cosine > MIN_COSINE).then_some(surface)
}

/// Change per pixel by the differences to what is two pixels before and behind: the smaller one, which does not reach
/// across an edge.
fn gradient([before, behind]: [Option<f32>; 2]) -> f32 {
    let slopes = [before.map(|difference| -0.5 * difference), behind.map(|difference| 0.5 * difference)];
    slopes.into_iter().flatten().min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0)
}

/// Sums for a fit of `d = a x + b y + c`.
#[derive(Clone, Copy, Debug, Default)]
struct PlaneFit {
    count: f32,
    x: f32,
    y: f32,
    xx: f32,
    xy: f32,
    yy: f32,
    d: f32,
    xd: f32,
    yd: f32,
}

impl PlaneFit {
    fn add(&mut self, x: f32, y: f32, d: f32) {
        self.count += 1.0;
        self.x += x;
        self.y += y;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
        self.d += d;
        self.xd += x * d;
        self.yd += y * d;
    }

    /// a, b and c; `None` when all points are on a line.
    fn solve(&self) -> Option<[f32; 3]> {
        let [x, y, d] = [self.x, self.y, self.d].map(|sum| sum / self.count);
        let (xx, xy, yy) = (self.xx - self.x * x, self.xy - self.x * y, self.yy - self.y * y);
        let (xd, yd) = (self.xd - self.x * d, self.yd - self.y * d);
        let determinant = xx * yy - xy * xy;
        if determinant < 0.5 {
            return None;
        }
        let a = (yy * xd - xy * yd) / determinant;
        let b = (xx * yd - xy * xd) / determinant;
        Some([a, b, d - a * x - b * y])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane through (0, 0, 2) whose normal leans by `lean` to the side, seen from the origin.
    fn leaning(lean: f32) -> SurfaceView {
        let camera = PinholeCamera { width: 41, height: 31, fx: 100.0, fy: 90.0, cx: 20.0, cy: 15.0 };
        let depth = |pixel: usize| {
            let x = ((pixel % 41) as f32 - 20.0) / 100.0;
            2.0 * lean.cos() / (lean.cos() + lean.sin() * x)
        };
        SurfaceView::new(&ColouredDepth {
            camera,
            world_from_camera: RigidTransform::identity(),
            depth: (0..41 * 31).map(depth).collect(),
            colour: Vec::new(),
        })
    }

    #[test]
    fn a_plane_has_its_distance_and_weight_everywhere() {
        for lean in [0.0, 0.5, -1.0_f32] {
            let view = leaning(lean);
            let centre = view.at(20.0, 15.0).unwrap();
            assert!(
                (centre.depth - 2.0).abs() < 1e-4 && (centre.weight(2.0) - lean.cos() / 4.0).abs() < 1e-3
            );
            let point = Vector3::new(0.155, -0.12, 1.0);
            let distance = lean.cos() * (2.0 - point.z) - lean.sin() * point.x;
            let found = view.at(35.5, 4.2).unwrap().distance(&point);
            assert!((found - distance).abs() < 1e-3, "{found} instead of {distance}");
        }
    }

    #[test]
    fn mixed_depth_at_edges_is_not_trusted() {
        // Near on the left, far on the right, and a column in between that belongs to neither.
        let depth = |k: usize| [1.0, 1.5, 2.0][(k % 9 + 1) / 5 + (k % 9) / 5];
        let mut view = ColouredDepth {
            camera: PinholeCamera { width: 9, height: 5, fx: 100.0, fy: 100.0, cx: 4.0, cy: 2.0 },
            world_from_camera: RigidTransform::identity(),
            depth: (0..45).map(depth).collect(),
            colour: Vec::new(),
        };
        let row = |view: &ColouredDepth| -> Vec<bool> {
            SurfaceView::new(view).pixels[18..27].iter().map(|pixel| pixel.cosine > 0.0).collect()
        };
        assert_eq!(row(&view), [true, true, true, true, false, true, true, true, true]);
        let near = SurfaceView::new(&view).pixels[18 + 3];
        assert_eq!((near.depth, near.offset), (1.0, 1.0), "what is behind the edge has no influence");
        view.depth[20] = 0.0;
        assert_eq!(row(&view)[..4], [true, true, false, true]);
        view.depth.pop();
        assert_eq!(row(&view), [false; 9]);
        assert_eq!(leaning(1.5).at(20.0, 15.0), None, "4 degrees are too flat");
    }
}
