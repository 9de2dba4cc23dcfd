//! Diffuse light: lamps, sky light, darkened corners and soft shadows under things.
//!
//! Nothing depends on the direction of view, so a surface point has the same radiance in every frame.

use glam::{Vec2, Vec3, Vec4};

use super::shape::Shape;

/// Light of a scene.
pub(super) struct Lighting {
    /// Light from above and from below, without direction.
    pub(super) from_above: Vec3,
    pub(super) from_below: Vec3,
    pub(super) lamps: Lamps,
    pub(super) shadows: Vec<SoftShadow>,
}

/// A small lamp.
pub(super) struct Lamp {
    pub(super) position: Vec3,
    pub(super) colour: Vec3,
    /// Distance in metres at which its light has fallen to half.
    pub(super) reach: f32,
}

/// Up to four lamps side by side, so that one vector instruction serves all of them.
pub(super) struct Lamps {
    x: Vec4,
    y: Vec4,
    z: Vec4,
    red: Vec4,
    green: Vec4,
    blue: Vec4,
    inverse_reach2: Vec4,
}

impl Lamps {
    pub(super) fn new<const N: usize>(lamps: &[Lamp; N]) -> Self {
        const { assert!(N <= 4, "a vector has four lanes") };
        let lane =
            |value: fn(&Lamp) -> f32| Vec4::from(std::array::from_fn(|k| lamps.get(k).map_or(0.0, value)));
        Self {
            x: lane(|lamp| lamp.position.x),
            y: lane(|lamp| lamp.position.y),
            z: lane(|lamp| lamp.position.z),
            red: lane(|lamp| lamp.colour.x),
            green: lane(|lamp| lamp.colour.y),
            blue: lane(|lamp| lamp.colour.z),
            inverse_reach2: lane(|lamp| 1.0 / (lamp.reach * lamp.reach)),
        }
    }

    /// Light at a point with this normal, wrapped around a little as that of lamps with a shade.
    fn light(&self, point: Vec3, normal: Vec3) -> Vec3 {
        let (x, y, z) = (self.x - point.x, self.y - point.y, self.z - point.z);
        let distance2 = x * x + y * y + z * z;
        let along_normal = x * normal.x + y * normal.y + z * normal.z;
        let distance = Vec4::from(distance2.to_array().map(f32::sqrt));
        let incidence = ((along_normal / distance + 0.25) / 1.25).max(Vec4::ZERO);
        let arriving = incidence / (Vec4::ONE + distance2 * self.inverse_reach2);
        Vec3::new(arriving.dot(self.red), arriving.dot(self.green), arriving.dot(self.blue))
    }
}

/// The darkened patch that a thing leaves on the horizontal surface below it.
pub(super) struct SoftShadow {
    centre: Vec2,
    half: Vec2,
    heading: Vec2,
    /// Height of the receiving surface.
    height: f32,
    softness: f32,
    strength: f32,
}

impl SoftShadow {
    /// What `shape` casts on the horizontal surface at `height`: fainter and wider the higher it hangs.
    pub(super) fn below(shape: &Shape, height: f32) -> Self {
        let (centre, half, heading) = shape.footprint();
        let gap = (shape.bottom() - height).max(0.0);
        Self { centre, half, heading, height, softness: 0.12 + 0.45 * gap, strength: 0.6 / (1.0 + 1.2 * gap) }
    }

    fn transmission(&self, point: Vec3) -> f32 {
        let p = Vec2::new(point.x, point.z) - self.centre;
        let h = self.heading;
        let local = Vec2::new(h.x * p.x - h.y * p.y, h.y * p.x + h.x * p.y).abs() - self.half;
        let outside = local.max(Vec2::ZERO).length() + local.max_element().min(0.0);
        let x = (0.5 - 0.5 * outside / self.softness).clamp(0.0, 1.0);
        1.0 - self.strength * x * x * (3.0 - 2.0 * x)
    }
}

impl Lighting {
    /// Light arriving at a surface point, before corners and shadows are considered.
    pub(super) fn irradiance(&self, point: Vec3, normal: Vec3) -> Vec3 {
        let upward = 0.5 + 0.5 * normal.y;
        let light = self.from_below.lerp(self.from_above, upward) + self.lamps.light(point, normal);
        if normal.y > 0.9 { light * self.shadow(point) } else { light }
    }

    fn shadow(&self, point: Vec3) -> f32 {
        let here = self.shadows.iter().filter(|shadow| (shadow.height - point.y).abs() < 0.01);
        here.map(|shadow| shadow.transmission(point)).product()
    }
}

/// How much of the light reaches the inside of a room close to its edges and corners; `margin` is the distance to
/// the nearer of each pair of walls.
pub(super) fn corner_darkening(margin: Vec3, normal: Vec3) -> f32 {
    let closeness = (Vec3::ONE + (margin / 0.18) * (margin / 0.18)).recip();
    let facing_along = Vec3::ONE - normal.abs();
    let shade = Vec3::ONE - 0.45 * closeness * facing_along;
    shade.x * shade.y * shade.z
}
