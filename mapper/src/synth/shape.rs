//! Solid shapes: where a ray meets them, and how their faces unroll into flat charts.

use glam::{Mat3, Vec2, Vec3};
use mba_tracker::math::atan2;

/// A ray `origin + t direction`. Directions of camera rays have unit z in the camera frame, so that `t` is depth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
}

/// A shape around the origin of its own frame, metres.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    /// An upright box of half sides `half`, seen from outside.
    Block { half: Vec3 },
    /// The inside of a box: the walls, floor and ceiling of a room.
    Room { half: Vec3 },
    /// A ball.
    Ball { radius: f32 },
    /// A cylinder about the y axis, closed by caps.
    Drum { radius: f32, half_height: f32 },
}

/// Rays that start closer than this to a surface do not meet it, metres.
const SKIN: f32 = 1e-4;

/// Directions are kept off the coordinate planes by this much, so that slab tests never divide zero by zero.
const TILT: f32 = 1e-12;

impl Ray {
    /// The ray in the frame of an object whose origin is at `centre` in the world.
    #[inline]
    pub(super) fn seen_from(&self, centre: Vec3, object_from_world: &Mat3) -> Self {
        let direction = *object_from_world * self.direction;
        let flat = direction.abs().cmplt(Vec3::splat(TILT));
        Self {
            origin: *object_from_world * (self.origin - centre),
            direction: Vec3::select(flat, Vec3::splat(TILT), direction),
        }
    }

    /// The point at parameter `t`.
    #[inline]
    pub(super) fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// Faces of boxes in this order: +x, -x, +y, -y, +z, -z.
pub(super) const BOX_FACES: usize = 6;

impl Shape {
    /// Radius of a ball about the origin that contains the shape.
    pub(super) fn bounding_radius(&self) -> f32 {
        match self {
            Self::Block { half } | Self::Room { half } => half.length(),
            Self::Ball { radius } => *radius,
            Self::Drum { radius, half_height } => Vec2::new(*radius, *half_height).length(),
        }
    }

    /// Number of faces, each with its own chart.
    pub(super) fn faces(&self) -> usize {
        match self {
            Self::Block { .. } | Self::Room { .. } => BOX_FACES,
            Self::Ball { .. } => 1,
            Self::Drum { .. } => 3,
        }
    }

    /// Smallest positive `t` at which the ray (in the shape's frame) meets the surface, or infinity.
    #[inline]
    pub(super) fn intersect(&self, ray: &Ray) -> f32 {
        match self {
            Self::Block { half } => intersect_block(ray, *half),
            Self::Room { half } => intersect_room(ray, *half),
            Self::Ball { radius } => intersect_ball(ray, *radius),
            Self::Drum { radius, half_height } => intersect_drum(ray, *radius, *half_height),
        }
    }

    /// Face on which a surface point lies.
    #[inline]
    pub(super) fn face(&self, p: Vec3) -> usize {
        match self {
            Self::Block { half } | Self::Room { half } => box_face(p, *half),
            Self::Ball { .. } => 0,
            Self::Drum { radius, half_height } => {
                let radial = (p.x * p.x + p.z * p.z).sqrt() - radius;
                if p.y.abs() - half_height < radial {
                    0
                } else if p.y > 0.0 {
                    1
                } else {
                    2
                }
            }
        }
    }

    /// Width and height of a face's chart, metres.
    pub(super) fn chart_size(&self, face: usize) -> Vec2 {
        match self {
            Self::Block { half } | Self::Room { half } => match face {
                0 | 1 => 2.0 * Vec2::new(half.z, half.y),
                2 | 3 => 2.0 * Vec2::new(half.x, half.z),
                _ => 2.0 * Vec2::new(half.x, half.y),
            },
            Self::Ball { radius } => std::f32::consts::PI * radius * Vec2::new(2.0, 1.0),
            Self::Drum { radius, half_height } => match face {
                0 => Vec2::new(std::f32::consts::TAU * radius, 2.0 * half_height),
                _ => Vec2::splat(2.0 * radius),
            },
        }
    }

    /// Position on the chart, metres: u to the right and v downwards for somebody who looks at the face.
    #[inline]
    pub(super) fn chart_from_point(&self, face: usize, p: Vec3) -> Vec2 {
        match self {
            Self::Block { half } => box_chart(face, p, *half),
            Self::Room { half } => {
                let seen_from_outside = box_chart(face, p, *half);
                Vec2::new(self.chart_size(face).x - seen_from_outside.x, seen_from_outside.y)
            }
            Self::Ball { radius } => {
                let ring = (p.x * p.x + p.z * p.z).sqrt();
                Vec2::new(turn(p.x, p.z), angle(ring, p.y)) * *radius
            }
            Self::Drum { radius, half_height } => match face {
                0 => Vec2::new(turn(p.x, p.z) * radius, half_height - p.y),
                _ => Vec2::new(p.x + radius, p.z + radius),
            },
        }
    }

    /// The surface point of a chart position: the inverse of [`Self::chart_from_point`].
    pub(super) fn point_from_chart(&self, face: usize, uv: Vec2) -> Vec3 {
        match self {
            Self::Block { half } => box_point(face, uv, *half),
            Self::Room { half } => box_point(face, Vec2::new(self.chart_size(face).x - uv.x, uv.y), *half),
            Self::Ball { radius } => {
                let (azimuth, polar) = (uv.x / radius - std::f32::consts::PI, uv.y / radius);
                let ring = radius * sine(polar);
                Vec3::new(ring * sine(azimuth), radius * cosine(polar), ring * cosine(azimuth))
            }
            Self::Drum { radius, half_height } => match face {
                0 => {
                    let azimuth = uv.x / radius - std::f32::consts::PI;
                    Vec3::new(radius * sine(azimuth), half_height - uv.y, radius * cosine(azimuth))
                }
                1 => Vec3::new(uv.x - radius, *half_height, uv.y - radius),
                _ => Vec3::new(uv.x - radius, -half_height, uv.y - radius),
            },
        }
    }

    /// Unit normal of a surface point, towards free space.
    #[inline]
    pub(super) fn normal(&self, face: usize, p: Vec3) -> Vec3 {
        match self {
            Self::Block { .. } => box_normal(face),
            Self::Room { .. } => -box_normal(face),
            Self::Ball { radius } => p / *radius,
            Self::Drum { radius, .. } => match face {
                0 => Vec3::new(p.x, 0.0, p.z) / *radius,
                1 => Vec3::Y,
                _ => -Vec3::Y,
            },
        }
    }
}

/// Entry of a ray into a box, by slabs.
#[inline]
fn intersect_block(ray: &Ray, half: Vec3) -> f32 {
    let inverse = ray.direction.recip();
    let middle = -ray.origin * inverse;
    let reach = half * inverse.abs();
    let enter = (middle - reach).max_element();
    let leave = (middle + reach).min_element();
    if enter <= leave && enter > SKIN { enter } else { f32::INFINITY }
}

/// Exit of a ray from the inside of a box.
#[inline]
fn intersect_room(ray: &Ray, half: Vec3) -> f32 {
    let inverse = ray.direction.recip();
    (half * inverse.abs() - ray.origin * inverse).min_element()
}

#[inline]
fn intersect_ball(ray: &Ray, radius: f32) -> f32 {
    let a = ray.direction.length_squared();
    let b = ray.origin.dot(ray.direction);
    // The discriminant by the distance of the line from the centre: no cancellation for far rays.
    let nearest = ray.origin - ray.direction * (b / a);
    let discriminant = radius * radius - nearest.length_squared();
    if discriminant < 0.0 {
        return f32::INFINITY;
    }
    let t = -b / a - (discriminant / a).sqrt();
    if t > SKIN { t } else { f32::INFINITY }
}

fn intersect_drum(ray: &Ray, radius: f32, half_height: f32) -> f32 {
    let (o, d) = (Vec2::new(ray.origin.x, ray.origin.z), Vec2::new(ray.direction.x, ray.direction.z));
    let a = d.length_squared();
    let b = o.dot(d);
    let nearest = o - d * (b / a);
    let discriminant = radius * radius - nearest.length_squared();
    if discriminant < 0.0 {
        return f32::INFINITY;
    }
    let reach = (discriminant / a).sqrt();
    let inverse = 1.0 / ray.direction.y;
    let (middle, half) = (-ray.origin.y * inverse, half_height * inverse.abs());
    let enter = (-b / a - reach).max(middle - half);
    let leave = (-b / a + reach).min(middle + half);
    if enter <= leave && enter > SKIN { enter } else { f32::INFINITY }
}

#[inline]
fn box_face(p: Vec3, half: Vec3) -> usize {
    let q = p / half;
    let a = q.abs();
    if a.x >= a.y && a.x >= a.z {
        usize::from(q.x < 0.0)
    } else if a.y >= a.z {
        2 + usize::from(q.y < 0.0)
    } else {
        4 + usize::from(q.z < 0.0)
    }
}

fn box_normal(face: usize) -> Vec3 {
    match face {
        0 => Vec3::X,
        1 => -Vec3::X,
        2 => Vec3::Y,
        3 => -Vec3::Y,
        4 => Vec3::Z,
        _ => -Vec3::Z,
    }
}

#[inline]
fn box_chart(face: usize, p: Vec3, half: Vec3) -> Vec2 {
    match face {
        0 => Vec2::new(half.z - p.z, half.y - p.y),
        1 => Vec2::new(p.z + half.z, half.y - p.y),
        2 => Vec2::new(p.x + half.x, p.z + half.z),
        3 => Vec2::new(p.x + half.x, half.z - p.z),
        4 => Vec2::new(p.x + half.x, half.y - p.y),
        _ => Vec2::new(half.x - p.x, half.y - p.y),
    }
}

fn box_point(face: usize, uv: Vec2, half: Vec3) -> Vec3 {
    match face {
        0 => Vec3::new(half.x, half.y - uv.y, half.z - uv.x),
        1 => Vec3::new(-half.x, half.y - uv.y, uv.x - half.z),
        2 => Vec3::new(uv.x - half.x, half.y, uv.y - half.z),
        3 => Vec3::new(uv.x - half.x, -half.y, half.z - uv.y),
        4 => Vec3::new(uv.x - half.x, half.y - uv.y, half.z),
        _ => Vec3::new(half.x - uv.x, half.y - uv.y, -half.z),
    }
}

/// Azimuth about y from the back (-z), increasing to the right as seen from outside, in `[0, 2 pi]`.
fn turn(x: f32, z: f32) -> f32 {
    angle(x, z) + std::f32::consts::PI
}

fn angle(y: f32, x: f32) -> f32 {
    atan2(f64::from(y), f64::from(x)) as f32
}

fn sine(x: f32) -> f32 {
    mba_tracker::math::sin(f64::from(x)) as f32
}

fn cosine(x: f32) -> f32 {
    mba_tracker::math::cos(f64::from(x)) as f32
}

/// Rotation by `angle` radians about y, taking coordinates of the shape into the world.
pub(super) fn yaw(angle: f32) -> Mat3 {
    let (s, c) = (sine(angle), cosine(angle));
    Mat3::from_cols(Vec3::new(c, 0.0, -s), Vec3::Y, Vec3::new(s, 0.0, c))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPES: [Shape; 4] = [
        Shape::Block { half: Vec3::new(0.5, 0.25, 0.75) },
        Shape::Room { half: Vec3::new(2.0, 1.5, 3.0) },
        Shape::Ball { radius: 0.4 },
        Shape::Drum { radius: 0.3, half_height: 0.8 },
    ];

    #[test]
    fn charts_invert_and_faces_agree() {
        for shape in SHAPES {
            for face in 0..shape.faces() {
                let size = shape.chart_size(face);
                // Inside the disc that a drum's cap fills of its square chart.
                for share in [Vec2::new(0.4, 0.3), Vec2::new(0.7, 0.55), Vec2::new(0.5, 0.2)] {
                    let uv = share * size;
                    let p = shape.point_from_chart(face, uv);
                    assert_eq!(shape.face(p), face, "{shape:?} {face}");
                    let back = shape.chart_from_point(face, p);
                    assert!((back - uv).abs().max_element() < 1e-5, "{shape:?} {face} {uv} {back}");
                }
            }
        }
    }

    #[test]
    fn charts_keep_lengths_and_are_not_mirrored() {
        for shape in SHAPES {
            for face in 0..shape.faces() {
                let uv = shape.chart_size(face) * Vec2::new(0.45, 0.5);
                let at = |offset: Vec2| shape.point_from_chart(face, uv + offset);
                let h = 1e-3;
                let right = (at(Vec2::X * h) - at(Vec2::X * -h)) / (2.0 * h);
                let down = (at(Vec2::Y * h) - at(Vec2::Y * -h)) / (2.0 * h);
                assert!((right.length() - 1.0).abs() < 1e-3 && (down.length() - 1.0).abs() < 1e-3);
                let normal = shape.normal(face, at(Vec2::ZERO));
                // Seen against the normal, right x down points away from the viewer. A drum's bottom alone is
                // laid out like its top, mirrored, which nobody reads.
                let expected = if matches!(shape, Shape::Drum { .. }) && face == 2 { 1.0 } else { -1.0 };
                assert!((right.cross(down).dot(normal) - expected).abs() < 2e-3, "{shape:?} {face}");
            }
        }
    }

    #[test]
    fn rays_meet_the_surface_they_are_aimed_at() {
        for shape in SHAPES {
            for face in 0..shape.faces() {
                let p = shape.point_from_chart(face, shape.chart_size(face) * Vec2::new(0.45, 0.6));
                let normal = shape.normal(face, p);
                let origin = p + normal * 0.7 + normal.any_orthogonal_vector() * 0.1;
                let ray = Ray { origin, direction: (p - origin) * 2.0 };
                let ray = ray.seen_from(Vec3::ZERO, &Mat3::IDENTITY);
                assert!((shape.intersect(&ray) - 0.5).abs() < 1e-5, "{shape:?} {face}");
                if !matches!(shape, Shape::Room { .. }) {
                    let away = Ray { origin, direction: normal }.seen_from(Vec3::ZERO, &Mat3::IDENTITY);
                    assert!(shape.intersect(&away).is_infinite(), "{shape:?} {face}");
                }
            }
        }
    }

    #[test]
    fn a_ray_past_a_solid_misses_it() {
        let ray = Ray { origin: Vec3::new(0.9, 0.85, -5.0), direction: Vec3::Z };
        let ray = ray.seen_from(Vec3::ZERO, &Mat3::IDENTITY);
        for shape in SHAPES.iter().filter(|shape| !matches!(shape, Shape::Room { .. })) {
            assert!(shape.intersect(&ray).is_infinite(), "{shape:?}");
        }
    }
}
