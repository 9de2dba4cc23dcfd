//! Light falling onto the surfaces: lamps with soft shadows, and sky or room light darkened in corners.

use glam::{Vec2, Vec3};

use super::scene::Scene;
use super::shape::Ray;

/// A glowing rectangle that shines downwards.
#[derive(Clone, Copy)]
pub(super) struct Lamp {
    pub(super) centre: Vec3,
    /// Half sides along x and z, metres.
    pub(super) half: Vec2,
    /// Light it would give to a surface that faces it from one metre away.
    pub(super) intensity: Vec3,
}

/// All light of a scene. A white surface under irradiance 1 has radiance 1.
#[derive(Clone)]
pub(super) struct Lighting {
    pub(super) lamps: Vec<Lamp>,
    /// Light from everywhere.
    pub(super) ambient: Vec3,
    /// Distance within which other surfaces take ambient light away, metres.
    pub(super) reach: f32,
}

/// Irradiance on a grid over one chart.
pub(super) struct Illumination {
    columns: usize,
    rows: usize,
    step: Vec2,
    values: Vec<Vec3>,
}

/// Distance of grid points, metres: finer than soft shadows, coarser than textures.
const SPACING: f32 = 0.07;

/// Rays for ambient light and towards each lamp.
const AMBIENT_RAYS: u32 = 24;
const LAMP_RAYS: u32 = 13;

impl Illumination {
    /// The light on a face of an object, with shadows of everything in the scene.
    pub(super) fn on_chart(scene: &Scene, lighting: &Lighting, object: usize, face: usize) -> Self {
        let body = &scene.objects[object];
        let size = body.shape.chart_size(face);
        let columns = 1 + ((size.x / SPACING).ceil() as usize).clamp(1, 200);
        let rows = 1 + ((size.y / SPACING).ceil() as usize).clamp(1, 200);
        let step = size / Vec2::new((columns - 1) as f32, (rows - 1) as f32);
        let world_from_object = body.object_from_world.transpose();
        let values = (0..rows * columns)
            .map(|index| {
                let (column, row) = (index % columns, index / columns);
                // Points on an edge would see half of what lies around the corner.
                let margin = (size * 0.25).min(Vec2::splat(0.01));
                let uv = (step * Vec2::new(column as f32, row as f32)).clamp(margin, size - margin);
                let p = body.shape.point_from_chart(face, uv);
                let normal = world_from_object * body.shape.normal(face, p);
                let point = body.centre + world_from_object * p + normal * 2e-3;
                irradiance(scene, lighting, point, normal)
            })
            .collect();
        Self { columns, rows, step, values }
    }

    /// Irradiance at a chart position, interpolated.
    pub(super) fn at(&self, uv: Vec2) -> Vec3 {
        let at = uv / self.step;
        let (x, y) = ((at.x as usize).min(self.columns - 2), (at.y as usize).min(self.rows - 2));
        let (sx, sy) = (at.x - x as f32, at.y - y as f32);
        let row = |y: usize| {
            let first = y * self.columns + x;
            self.values[first].lerp(self.values[first + 1], sx)
        };
        row(y).lerp(row(y + 1), sy)
    }
}

fn irradiance(scene: &Scene, lighting: &Lighting, point: Vec3, normal: Vec3) -> Vec3 {
    let ambient = lighting.ambient * openness(scene, lighting.reach, point, normal);
    lighting.lamps.iter().fold(ambient, |sum, lamp| sum + lamp_light(scene, lamp, point, normal))
}

/// Share of the ambient light that reaches a point: 1 in the open.
fn openness(scene: &Scene, reach: f32, point: Vec3, normal: Vec3) -> f32 {
    let side = normal.any_orthonormal_vector();
    let other = normal.cross(side);
    let mut open = 0.0;
    for k in 0..AMBIENT_RAYS {
        let (share, turn) = spread(k, AMBIENT_RAYS);
        let angle = std::f64::consts::TAU * f64::from(turn);
        let ring = share.sqrt();
        let (s, c) = (mba_tracker::math::sin(angle) as f32, mba_tracker::math::cos(angle) as f32);
        let direction = (side * c + other * s) * ring + normal * (1.0 - share).sqrt();
        let ray = Ray { origin: point, direction };
        // A room's far wall is no obstacle, a near one takes its share away: soft corners.
        open += if scene.is_blocked(&ray, reach) { 0.35 } else { 1.0 };
    }
    open / AMBIENT_RAYS as f32
}

fn lamp_light(scene: &Scene, lamp: &Lamp, point: Vec3, normal: Vec3) -> Vec3 {
    let mut sum = 0.0;
    for k in 0..LAMP_RAYS {
        let (x, z) = spread(k, LAMP_RAYS);
        let offset = Vec3::new((2.0 * x - 1.0) * lamp.half.x, 0.0, (2.0 * z - 1.0) * lamp.half.y);
        let direction = lamp.centre + offset - point;
        let squared = direction.length_squared();
        let cosines = normal.dot(direction).max(0.0) * direction.y.max(0.0) / squared;
        let ray = Ray { origin: point, direction };
        if cosines > 0.0 && !scene.is_blocked(&ray, 0.999) {
            sum += cosines / squared.max(0.04);
        }
    }
    lamp.intensity * (sum / LAMP_RAYS as f32)
}

/// Point `k` of `n` spread evenly over the unit square. All surface points share the same directions: their errors
/// then vary as slowly as the shadows and do not look like noise.
fn spread(k: u32, n: u32) -> (f32, f32) {
    const GOLDEN: f32 = 0.618_034;
    ((k as f32 + 0.5) / n as f32, (0.5 + GOLDEN * k as f32).fract())
}
