//! A scene: solids with baked radiance, and the search for what a ray meets first.

use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::illumination::{Illumination, Lighting};
use super::pattern::{Paint, Spot};
use super::shape::{Ray, Shape};
use super::texture::Texture;
use super::trajectory::Sweep;

/// A solid as a scene description gives it.
#[derive(Clone)]
pub(super) struct Solid {
    pub(super) shape: Shape,
    /// Origin of the shape's frame in the world, metres.
    pub(super) centre: Vec3,
    /// Rotation about the vertical, radians.
    pub(super) yaw: f32,
    /// One paint for all faces, or one for each face.
    pub(super) paints: Vec<Paint>,
    /// Texels relative to the scene's density: small things are seen from nearby.
    pub(super) detail: f32,
}

/// What a scene consists of, before anything is baked. World frame: y up, metres.
pub(super) struct Blueprint {
    pub(super) solids: Vec<Solid>,
    pub(super) lighting: Lighting,
    pub(super) sweep: Sweep,
    /// Typical distance of surfaces from the camera, metres.
    pub(super) typical_depth: f32,
}

/// A solid ready for ray casting.
pub(super) struct Object {
    pub(super) shape: Shape,
    pub(super) centre: Vec3,
    pub(super) object_from_world: Mat3,
    pub(super) bounding_radius: f32,
    textures: Vec<Texture>,
}

/// Objects with baked radiance.
pub(super) struct Scene {
    pub(super) objects: Vec<Object>,
}

/// The first surface on a ray.
#[derive(Clone, Copy)]
pub(super) struct Hit {
    pub(super) t: f32,
    pub(super) object: u16,
}

impl Hit {
    pub(super) const NOTHING: Self = Self { t: f32::INFINITY, object: u16::MAX };
}

impl Scene {
    /// Bakes all charts with `texels_per_metre` for things at the typical depth. Parallel over objects; the result
    /// does not depend on the number of threads.
    pub(super) fn bake(blueprint: &Blueprint, texels_per_metre: f32) -> Self {
        let bare: Vec<Object> = blueprint.solids.iter().map(Object::bare).collect();
        let bare = Self { objects: bare };
        let charts: Vec<(usize, usize)> = (0..bare.objects.len())
            .flat_map(|object| (0..bare.objects[object].shape.faces()).map(move |face| (object, face)))
            .collect();
        let mut textures = charts
            .par_iter()
            .map(|&(object, face)| bake_chart(&bare, blueprint, texels_per_metre, object, face))
            .collect::<Vec<_>>()
            .into_iter();
        let mut objects = bare.objects;
        for object in &mut objects {
            object.textures = textures.by_ref().take(object.shape.faces()).collect();
        }
        Self { objects }
    }

    /// Whether something lies on the ray between its origin and parameter `end`.
    pub(super) fn is_blocked(&self, ray: &Ray, end: f32) -> bool {
        let a = ray.direction.length_squared();
        self.objects.iter().any(|object| {
            let to_centre = object.centre - ray.origin;
            let along = (to_centre.dot(ray.direction) / a).clamp(0.0, end);
            let distance = (to_centre - ray.direction * along).length_squared();
            distance <= object.bounding_radius * object.bounding_radius && object.intersect(ray) < end
        })
    }

    /// The first hit among all objects.
    pub(super) fn trace(&self, ray: &Ray) -> Hit {
        self.objects.iter().enumerate().fold(Hit::NOTHING, |best, (index, object)| {
            let t = object.intersect(ray);
            if t < best.t { Hit { t, object: index as u16 } } else { best }
        })
    }
}

impl Object {
    fn bare(solid: &Solid) -> Self {
        Self {
            shape: solid.shape,
            centre: solid.centre,
            object_from_world: super::shape::yaw(solid.yaw).transpose(),
            bounding_radius: solid.shape.bounding_radius() * 1.001,
            textures: Vec::new(),
        }
    }

    /// Parameter of the first intersection, or infinity.
    #[inline]
    pub(super) fn intersect(&self, ray: &Ray) -> f32 {
        self.shape.intersect(&ray.seen_from(self.centre, &self.object_from_world))
    }

    /// Radiance of the surface at `t` on the ray, for a pixel that covers `pixel` metres at unit `t`.
    #[inline]
    pub(super) fn radiance(&self, ray: &Ray, t: f32, pixel: f32, dither: f32) -> Vec3 {
        let p = ray.seen_from(self.centre, &self.object_from_world).at(t);
        let face = self.shape.face(p);
        let uv = self.shape.chart_from_point(face, p);
        self.textures[face].sample(uv, t * pixel * FOOTPRINT, dither)
    }

    /// Cosine between the ray's reverse and the surface normal at `t`.
    pub(super) fn facing(&self, ray: &Ray, t: f32) -> f32 {
        let local = ray.seen_from(self.centre, &self.object_from_world);
        let p = local.at(t);
        -self.shape.normal(self.shape.face(p), p).dot(local.direction) / local.direction.length()
    }
}

/// Texel size wanted, in pixels: many jittered samples per pixel do the rest of the smoothing.
const FOOTPRINT: f32 = 0.7;

fn bake_chart(scene: &Scene, blueprint: &Blueprint, density: f32, object: usize, face: usize) -> Texture {
    let solid = &blueprint.solids[object];
    let (shape, size) = (solid.shape, solid.shape.chart_size(face));
    let paint = if solid.paints.len() == 1 { &solid.paints[0] } else { &solid.paints[face] };
    let light = Illumination::on_chart(scene, &blueprint.lighting, object, face);
    Texture::bake(size, density * solid.detail, |uv| {
        let spot = Spot { uv, size, local: shape.point_from_chart(face, uv) };
        paint.albedo(&spot) * light.at(uv)
    })
}
