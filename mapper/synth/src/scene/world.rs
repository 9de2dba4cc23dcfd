//! A furnished world: walls, things in it and light.

use glam::{Vec2, Vec3};

use super::lighting::{Lighting, SoftShadow, corner_darkening};
use super::material::Material;
use super::shape::{Ray, Shape, box_face, leave_box};
use crate::motion::Sweep;
use crate::round::Round;

/// A closed room with things in it. World y is up, the floor at y = 0; units are metres.
pub(crate) struct Scene {
    enclosure: Enclosure,
    things: Vec<Thing>,
    /// Spheres around the things, for culling.
    bounds: Vec<(Vec3, f32)>,
    lighting: Lighting,
    /// Distance along x after which lamps, shadows and corners are the same again; infinite for a single room.
    repeat: f32,
    /// The path of a camera that films one side of this world.
    pub(crate) sweep: Sweep,
    /// The path of one that films it all round.
    pub(crate) round: Round,
}

/// The walls: a box seen from inside.
pub(super) struct Enclosure {
    pub(super) low: Vec3,
    pub(super) high: Vec3,
    /// Looks of the walls at low x, high x, low y, high y, low z, high z.
    pub(super) materials: [Material; 6],
}

/// A solid with one look.
#[derive(Clone, Copy)]
pub(super) struct Thing {
    shape: Shape,
    material: Material,
}

/// What a ray meets first.
#[derive(Clone, Copy)]
pub(crate) struct Hit {
    /// In units of the ray's direction.
    pub(crate) distance: f32,
    /// Index of the thing, or none for the walls.
    thing: Option<u16>,
}

/// A bundle of rays from one point: axis (unit), sine and cosine of the half angle.
pub(crate) struct Cone {
    pub(crate) apex: Vec3,
    pub(crate) axis: Vec3,
    pub(crate) sine: f32,
    pub(crate) cosine: f32,
}

impl Scene {
    pub(super) fn assemble(
        enclosure: Enclosure,
        things: Vec<Thing>,
        lighting: Lighting,
        sweep: Sweep,
        round: Round,
    ) -> Self {
        let bounds = things.iter().map(|thing| thing.shape.bounds()).collect();
        Self { enclosure, things, bounds, lighting, repeat: f32::INFINITY, sweep, round }
    }

    /// With lamps, shadows and corners that are the same again after every `metres` along x, those of the room around x = 0.
    pub(super) fn repeating(self, metres: f32) -> Self {
        Self { repeat: metres, ..self }
    }

    /// Replaces `visible` by the things that rays of the cone may meet.
    pub(crate) fn cull(&self, cone: &Cone, visible: &mut Vec<u16>) {
        visible.clear();
        let may_meet = |(centre, radius): &(Vec3, f32)| {
            let towards = *centre - cone.apex;
            let along = towards.dot(cone.axis);
            let across = (towards.length_squared() - along * along).max(0.0).sqrt();
            along > -radius && across * cone.cosine - along * cone.sine <= *radius
        };
        let indexed = (0..).zip(&self.bounds);
        visible.extend(indexed.filter(|(_, bounds)| may_meet(bounds)).map(|(index, _)| index));
    }

    /// All things, for rays that belong to no cone.
    pub(crate) fn everything(&self) -> Vec<u16> {
        (0..).zip(&self.things).map(|(index, _)| index).collect()
    }

    /// The first surface on the ray among the walls and the `visible` things.
    pub(crate) fn hit(&self, ray: &Ray, visible: &[u16]) -> Hit {
        let mut hit = Hit { distance: self.enclosure.leave(ray), thing: None };
        for index in visible {
            let distance = self.things[usize::from(*index)].shape.hit(ray);
            if distance < hit.distance {
                hit = Hit { distance, thing: Some(*index) };
            }
        }
        hit
    }

    /// Outward normal at a hit.
    pub(crate) fn normal(&self, ray: &Ray, hit: &Hit) -> Vec3 {
        let point = ray.at(hit.distance);
        match hit.thing {
            Some(index) => self.things[usize::from(index)].shape.surface(point).normal,
            None => self.enclosure.surface(point).0,
        }
    }

    /// Linear RGB radiance at a hit; `pixel_angle` is the angle in radians between neighbouring pixels.
    pub(crate) fn radiance(&self, ray: &Ray, hit: &Hit, pixel_angle: f32) -> Vec3 {
        let point = ray.at(hit.distance);
        let length = ray.direction.length();
        // The size of a pixel on the surface, which fades out patterns that are finer than it.
        let pixel_at = |normal: Vec3| {
            let cosine = (ray.direction.dot(normal) / length).abs().max(0.1);
            pixel_angle * hit.distance * length / cosine.sqrt()
        };
        let (normal, albedo) = match hit.thing {
            Some(index) => {
                let thing = &self.things[usize::from(index)];
                let surface = thing.shape.surface(point);
                let pixel = pixel_at(surface.normal);
                (surface.normal, thing.material.colour(surface.uv, surface.axis, pixel))
            }
            None => {
                let (normal, uv, material) = self.enclosure.surface(point);
                (normal, material.colour(uv, 2, pixel_at(normal)))
            }
        };
        // Less light comes into corners of the room.
        let mut margin = (point - self.enclosure.low).min(self.enclosure.high - point);
        let mut place = point;
        if self.repeat.is_finite() {
            place.x -= self.repeat * (point.x / self.repeat).round();
            margin.x = 0.5 * self.repeat - place.x.abs();
        }
        let light = self.lighting.irradiance(place, normal) * corner_darkening(margin, normal);
        // Patterns may swing below black.
        albedo.max(Vec3::ZERO) * light
    }
}

impl Enclosure {
    fn leave(&self, ray: &Ray) -> f32 {
        let centre = 0.5 * (self.low + self.high);
        leave_box(ray.origin - centre, ray.direction, 0.5 * (self.high - self.low))
    }

    /// Normal into the room, surface coordinates, look.
    fn surface(&self, point: Vec3) -> (Vec3, Vec2, &Material) {
        let centre = 0.5 * (self.low + self.high);
        // The face is the nearest one, which the share of the half size does not tell in a long room.
        let beyond = (point - centre).abs() - 0.5 * (self.high - self.low);
        let sign = (point - centre).signum();
        let face = box_face(point, sign / (1.0 - beyond));
        let side = usize::from(sign[face.axis] > 0.0);
        (-face.normal, face.uv, &self.materials[2 * face.axis + side])
    }
}

impl Thing {
    /// A box standing on height `bottom`, turned by `degrees` about the vertical; `size` is its full size.
    pub(super) fn cuboid(
        x: f32,
        bottom: f32,
        z: f32,
        size: [f32; 3],
        degrees: f32,
        material: Material,
    ) -> Self {
        let half = 0.5 * Vec3::from(size);
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let centre = Vec3::new(x, bottom + half.y, z);
        Self { shape: Shape::Cuboid { centre, half, heading: Vec2::new(cosine, sine) }, material }
    }

    /// An upright cylinder standing on height `bottom`.
    pub(super) fn column(x: f32, bottom: f32, z: f32, radius: f32, height: f32, material: Material) -> Self {
        let half_height = 0.5 * height;
        let centre = Vec3::new(x, bottom + half_height, z);
        Self { shape: Shape::Column { centre, radius, half_height }, material }
    }

    /// The same, `shift` metres further along x, with other colours and prints for every number.
    pub(super) fn elsewhere(&self, shift: f32, number: u32) -> Self {
        let shape = self.shape.shifted(Vec3::new(shift, 0.0, 0.0));
        Self { shape, material: self.material.varied(number) }
    }

    /// Middle of the thing.
    pub(super) fn centre(&self) -> Vec3 {
        self.shape.bounds().0
    }

    /// A sphere around (x, y, z).
    pub(super) fn sphere(x: f32, y: f32, z: f32, radius: f32, material: Material) -> Self {
        Self { shape: Shape::Sphere { centre: Vec3::new(x, y, z), radius }, material }
    }
}

/// Shadows of all things wider than a hand on the floor, and of each on the surface at height `on` it stands on.
pub(super) fn shadows(things: &[Thing], on: &[f32]) -> Vec<SoftShadow> {
    let solid =
        |thing: &&Thing| thing.shape.footprint().1.min_element() > 0.04 && thing.shape.height() > 0.02;
    let on_floor = things.iter().filter(solid).filter(|thing| thing.shape.bottom() < 0.95);
    let mut shadows: Vec<_> = on_floor.map(|thing| SoftShadow::below(&thing.shape, 0.0)).collect();
    for height in on {
        let standing = things.iter().filter(|thing| (thing.shape.bottom() - height).abs() < 0.005);
        shadows.extend(standing.map(|thing| SoftShadow::below(&thing.shape, *height)));
    }
    shadows
}
