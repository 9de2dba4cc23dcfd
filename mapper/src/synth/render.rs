//! Frames from rays: several views along the exposure, averaged in linear light.

use glam::{Mat3, Vec3};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use rayon::prelude::*;

use super::noise::{hash2, unit};
use super::scene::{Hit, Scene};
use super::shape::Ray;

/// Side of the square tiles that share one list of visible objects, pixels.
const TILE: usize = 16;

/// A camera pose ready for ray casting.
struct View {
    origin: Vec3,
    rotation: Mat3,
}

impl View {
    fn new(world_from_camera: &RigidTransform) -> Self {
        let column = |k: usize| {
            let column = world_from_camera.rotation_matrix();
            Vec3::new(column[(0, k)] as f32, column[(1, k)] as f32, column[(2, k)] as f32)
        };
        let p = world_from_camera.translation;
        Self {
            origin: Vec3::new(p.x as f32, p.y as f32, p.z as f32),
            rotation: Mat3::from_cols(column(0), column(1), column(2)),
        }
    }
}

/// Rays of a pinhole camera.
#[derive(Clone, Copy)]
struct Lens {
    width: usize,
    per_pixel: (f32, f32),
    centre: (f32, f32),
}

impl Lens {
    fn new(camera: &PinholeCamera) -> Self {
        Self {
            width: camera.width,
            per_pixel: ((1.0 / camera.fx) as f32, (1.0 / camera.fy) as f32),
            centre: (camera.cx as f32, camera.cy as f32),
        }
    }

    /// Direction of unit z in the camera frame.
    #[inline]
    fn direction(&self, u: f32, v: f32) -> Vec3 {
        Vec3::new((u - self.centre.0) * self.per_pixel.0, (v - self.centre.1) * self.per_pixel.1, 1.0)
    }
}

/// An object that may be seen in a tile, and the smallest depth it can have.
#[derive(Clone, Copy)]
struct Candidate {
    object: u16,
    nearest: f32,
}

/// The objects in one tile of one view, nearest first.
#[derive(Default)]
struct Candidates {
    list: Vec<Candidate>,
}

impl Candidates {
    /// Keeps the objects whose bounding ball meets the cone around the tile.
    fn select(&mut self, scene: &Scene, view: &View, lens: &Lens, tile: Tile) {
        let corner = |dx: usize, dy: usize| {
            let (u, v) = ((tile.x + dx) as f32 - 0.5, (tile.y + dy) as f32 - 0.5);
            lens.direction(u, v).normalize()
        };
        let corners =
            [corner(0, 0), corner(tile.width, 0), corner(0, tile.height), corner(tile.width, tile.height)];
        let axis = corners.iter().sum::<Vec3>().normalize();
        let cosine = corners.iter().map(|corner| corner.dot(axis)).fold(1.0, f32::min);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt() + 1e-4;
        let (axis, forward) = (view.rotation * axis, view.rotation.z_axis);
        self.list.clear();
        for (index, object) in scene.objects.iter().enumerate() {
            let to_centre = object.centre - view.origin;
            let along = to_centre.dot(axis);
            let across = (to_centre.length_squared() - along * along).max(0.0).sqrt();
            let radius = object.bounding_radius;
            if across * cosine - along * sine <= radius && along >= -radius {
                let nearest = to_centre.dot(forward) - radius;
                self.list.push(Candidate { object: index as u16, nearest });
            }
        }
        self.list.sort_by(|a, b| a.nearest.total_cmp(&b.nearest));
    }

    #[inline]
    fn trace(&self, scene: &Scene, ray: &Ray) -> Hit {
        let mut best = Hit::NOTHING;
        for candidate in &self.list {
            if candidate.nearest > best.t {
                break;
            }
            let t = scene.objects[usize::from(candidate.object)].intersect(ray);
            if t < best.t {
                best = Hit { t, object: candidate.object };
            }
        }
        best
    }
}

/// A rectangle of pixels.
#[derive(Clone, Copy)]
struct Tile {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

/// Mean radiance of every pixel over the views (`world_from_camera`), with `samples` jittered rays per pixel in
/// each. `seed` selects the jitter. Row-major; parallel over bands of rows, the same for every number of threads.
pub(super) fn render_mean(
    scene: &Scene,
    camera: &PinholeCamera,
    views: &[RigidTransform],
    samples: usize,
    seed: u32,
) -> Vec<Vec3> {
    let lens = Lens::new(camera);
    let views: Vec<View> = views.iter().map(View::new).collect();
    let mut image = vec![Vec3::ZERO; camera.width * camera.height];
    image.par_chunks_mut(camera.width * TILE).enumerate().for_each(|(band, rows)| {
        let mut candidates = Candidates::default();
        let height = rows.len() / lens.width;
        for x in (0..lens.width).step_by(TILE) {
            let tile = Tile { x, y: band * TILE, width: TILE.min(lens.width - x), height };
            for (index, view) in views.iter().enumerate() {
                candidates.select(scene, view, &lens, tile);
                let first = (index * samples) as u32;
                add_view(scene, &candidates, view, &lens, tile, first..first + samples as u32, seed, rows);
            }
        }
        let share = 1.0 / (views.len() * samples) as f32;
        rows.iter_mut().for_each(|pixel| *pixel *= share);
    });
    image
}

/// Adds the radiance of one view to the pixels of a tile.
#[expect(clippy::too_many_arguments, reason = "the inner loop's whole state, used once")]
fn add_view(
    scene: &Scene,
    candidates: &Candidates,
    view: &View,
    lens: &Lens,
    tile: Tile,
    samples: std::ops::Range<u32>,
    seed: u32,
    rows: &mut [Vec3],
) {
    for y in 0..tile.height {
        for x in tile.x..tile.x + tile.width {
            let shift = hash2(x as i32, (tile.y + y) as i32, seed);
            let mut sum = Vec3::ZERO;
            for sample in samples.clone() {
                let [du, dv, dither] = jitter(shift, sample);
                let direction = lens.direction(x as f32 + du, (tile.y + y) as f32 + dv);
                let ray = Ray { origin: view.origin, direction: view.rotation * direction };
                let hit = candidates.trace(scene, &ray);
                if let Some(object) = scene.objects.get(usize::from(hit.object)) {
                    sum += object.radiance(&ray, hit.t, lens.per_pixel.0, dither);
                }
            }
            rows[y * lens.width + x] += sum;
        }
    }
}

/// Offset of a sample from the pixel centre, within half a pixel, and a number in `[0, 1)` for the choice of the
/// texture level: the additive sequence of the three-dimensional golden ratio, shifted differently for every pixel.
#[inline]
fn jitter(shift: u32, sample: u32) -> [f32; 3] {
    const STEPS: [u32; 3] = [0xd1b5_4a32, 0xabc9_8388, 0x8cb9_2ba7];
    let start = [shift, shift.wrapping_mul(0x9e37_79b1), shift.rotate_left(13).wrapping_mul(0x85eb_ca6b)];
    let at = |k: usize| unit(start[k].wrapping_add(STEPS[k].wrapping_mul(sample)));
    [at(0) - 0.5, at(1) - 0.5, at(2)]
}

/// What a pixel's central ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SurfaceSample {
    /// Depth along the optical axis, metres; infinite where nothing is met.
    pub(super) z: f32,
    /// Cosine between the surface normal and the direction to the camera.
    pub(super) facing: f32,
}

/// Depth and slope of the surface in every pixel centre. Row-major, parallel over bands of rows.
pub(super) fn render_surface(
    scene: &Scene,
    camera: &PinholeCamera,
    world_from_camera: &RigidTransform,
) -> Vec<SurfaceSample> {
    let lens = Lens::new(camera);
    let view = View::new(world_from_camera);
    let mut image = vec![SurfaceSample { z: f32::INFINITY, facing: 0.0 }; camera.width * camera.height];
    image.par_chunks_mut(camera.width * TILE).enumerate().for_each(|(band, rows)| {
        let mut candidates = Candidates::default();
        let height = rows.len() / lens.width;
        for x in (0..lens.width).step_by(TILE) {
            let tile = Tile { x, y: band * TILE, width: TILE.min(lens.width - x), height };
            candidates.select(scene, &view, &lens, tile);
            for (y, u) in (0..height).flat_map(|y| (x..x + tile.width).map(move |u| (y, u))) {
                let direction = view.rotation * lens.direction(u as f32, (tile.y + y) as f32);
                rows[y * lens.width + u] =
                    surface(scene, &candidates, &Ray { origin: view.origin, direction });
            }
        }
    });
    image
}

fn surface(scene: &Scene, candidates: &Candidates, ray: &Ray) -> SurfaceSample {
    let hit = candidates.trace(scene, ray);
    let facing = scene.objects.get(usize::from(hit.object)).map_or(0.0, |object| object.facing(ray, hit.t));
    SurfaceSample { z: hit.t, facing }
}

/// Depth along the optical axis for pixel `(u, v)` of a camera, or `None` where nothing is met.
pub(super) fn depth_at(
    scene: &Scene,
    camera: &PinholeCamera,
    pose: &RigidTransform,
    (u, v): (f64, f64),
) -> Option<f64> {
    let view = View::new(pose);
    let direction = view.rotation * Lens::new(camera).direction(u as f32, v as f32);
    let hit = scene.trace(&Ray { origin: view.origin, direction });
    hit.t.is_finite().then_some(f64::from(hit.t))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_a_pixel_cover_it_evenly() {
        for shift in [0, 12_345, 0xdead_beef] {
            let n = 64;
            let samples: Vec<_> = (0..n).map(|k| jitter(shift, k)).collect();
            for axis in 0..2 {
                let mean = samples.iter().map(|s| s[axis]).sum::<f32>() / n as f32;
                let square = samples.iter().map(|s| s[axis] * s[axis]).sum::<f32>() / n as f32;
                assert!(mean.abs() < 0.03, "{mean}");
                assert!((square - 1.0 / 12.0).abs() < 0.01, "{square}");
            }
            // A quarter of the pixel holds a quarter of the samples, give or take two.
            let quarter = samples.iter().filter(|s| s[0] < 0.0 && s[1] < 0.0).count();
            assert!((14..=18).contains(&quarter), "{quarter}");
        }
    }
}
