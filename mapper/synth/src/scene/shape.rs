//! Rays and the shapes they meet.

use glam::{Vec2, Vec3};

/// A line of sight; distances along it are in units of `direction`, which need not be of unit length.
#[derive(Clone, Copy)]
pub(crate) struct Ray {
    pub(crate) origin: Vec3,
    pub(crate) direction: Vec3,
}

impl Ray {
    pub(crate) fn at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }
}

/// Place on a surface: outward normal, and coordinates in metres along the surface, the second one upward.
#[derive(Clone, Copy)]
pub(super) struct SurfacePoint {
    pub(super) normal: Vec3,
    pub(super) uv: Vec2,
    /// Axis of the local frame that the face is perpendicular to: 0, 1, 2.
    pub(super) axis: usize,
}

/// A solid seen from outside. World y is up.
#[derive(Clone, Copy)]
pub(super) enum Shape {
    /// A box turned about the vertical; `heading` is cosine and sine of the angle.
    Cuboid {
        centre: Vec3,
        half: Vec3,
        heading: Vec2,
    },
    Sphere {
        centre: Vec3,
        radius: f32,
    },
    /// An upright cylinder, closed at both ends; `centre` is in the middle.
    Column {
        centre: Vec3,
        radius: f32,
        half_height: f32,
    },
}

impl Shape {
    /// The same shape somewhere else.
    pub(super) fn shifted(self, by: Vec3) -> Self {
        match self {
            Self::Cuboid { centre, half, heading } => Self::Cuboid { centre: centre + by, half, heading },
            Self::Sphere { centre, radius } => Self::Sphere { centre: centre + by, radius },
            Self::Column { centre, radius, half_height } => {
                Self::Column { centre: centre + by, radius, half_height }
            }
        }
    }

    /// Smallest positive distance at which the ray enters, or infinity.
    pub(super) fn hit(&self, ray: &Ray) -> f32 {
        match *self {
            Self::Cuboid { centre, half, heading } => {
                let origin = turn(ray.origin - centre, heading);
                hit_box(origin, turn(ray.direction, heading), half)
            }
            Self::Sphere { centre, radius } => hit_sphere(ray.origin - centre, ray.direction, radius),
            Self::Column { centre, radius, half_height } => {
                hit_column(ray.origin - centre, ray.direction, radius, half_height)
            }
        }
    }

    /// Normal and surface coordinates of a point on the surface.
    pub(super) fn surface(&self, point: Vec3) -> SurfacePoint {
        match *self {
            Self::Cuboid { centre, half, heading } => {
                let local = turn(point - centre, heading);
                let face = box_face(local, local / half);
                SurfacePoint { normal: turn_back(face.normal, heading), ..face }
            }
            Self::Sphere { centre, radius } => sphere_surface(point - centre, radius),
            Self::Column { centre, radius, half_height } => {
                column_surface(point - centre, radius, half_height)
            }
        }
    }

    /// Centre and radius of a sphere around the shape.
    pub(super) fn bounds(&self) -> (Vec3, f32) {
        match *self {
            Self::Cuboid { centre, half, .. } => (centre, half.length()),
            Self::Sphere { centre, radius } => (centre, radius),
            Self::Column { centre, radius, half_height } => (centre, radius.hypot(half_height)),
        }
    }

    /// Centre, half sizes along the turned axes and heading of the shape seen from above.
    pub(super) fn footprint(&self) -> (Vec2, Vec2, Vec2) {
        match *self {
            Self::Cuboid { centre, half, heading } => {
                (Vec2::new(centre.x, centre.z), Vec2::new(half.x, half.z), heading)
            }
            Self::Sphere { centre, radius } => {
                (Vec2::new(centre.x, centre.z), Vec2::splat(0.6 * radius), Vec2::X)
            }
            Self::Column { centre, radius, .. } => {
                (Vec2::new(centre.x, centre.z), Vec2::splat(0.75 * radius), Vec2::X)
            }
        }
    }

    /// From the lowest point to the highest.
    pub(super) fn height(&self) -> f32 {
        match *self {
            Self::Cuboid { half, .. } => 2.0 * half.y,
            Self::Sphere { radius, .. } => 2.0 * radius,
            Self::Column { half_height, .. } => 2.0 * half_height,
        }
    }

    /// Height of the lowest point.
    pub(super) fn bottom(&self) -> f32 {
        match *self {
            Self::Cuboid { centre, half, .. } => centre.y - half.y,
            Self::Sphere { centre, radius } => centre.y - radius,
            Self::Column { centre, half_height, .. } => centre.y - half_height,
        }
    }
}

/// World direction to the frame of a box turned by `heading` about the vertical.
fn turn(v: Vec3, heading: Vec2) -> Vec3 {
    Vec3::new(heading.x * v.x - heading.y * v.z, v.y, heading.y * v.x + heading.x * v.z)
}

fn turn_back(v: Vec3, heading: Vec2) -> Vec3 {
    turn(v, Vec2::new(heading.x, -heading.y))
}

/// Distance at which a ray inside a box around the origin leaves it.
pub(super) fn leave_box(origin: Vec3, direction: Vec3, half: Vec3) -> f32 {
    let inverse = direction.recip();
    ((half - origin) * inverse).max((-half - origin) * inverse).min_element()
}

fn hit_box(origin: Vec3, direction: Vec3, half: Vec3) -> f32 {
    let inverse = direction.recip();
    let (a, b) = ((-half - origin) * inverse, (half - origin) * inverse);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    if enter <= leave && enter > 0.0 { enter } else { f32::INFINITY }
}

/// The face nearest to a point whose position in half sizes is `relative`.
pub(super) fn box_face(local: Vec3, relative: Vec3) -> SurfacePoint {
    let size = relative.abs();
    if size.x >= size.y && size.x >= size.z {
        let sign = relative.x.signum();
        SurfacePoint { normal: Vec3::X * sign, uv: Vec2::new(-local.z * sign, local.y), axis: 0 }
    } else if size.y >= size.z {
        let normal = Vec3::Y * relative.y.signum();
        SurfacePoint { normal, uv: Vec2::new(-local.x, local.z), axis: 1 }
    } else {
        let sign = relative.z.signum();
        SurfacePoint { normal: Vec3::Z * sign, uv: Vec2::new(local.x * sign, local.y), axis: 2 }
    }
}

/// The discriminant is formed from the point closest to the centre, which keeps its digits at a distance.
fn hit_sphere(origin: Vec3, direction: Vec3, radius: f32) -> f32 {
    let length2 = direction.length_squared();
    let middle = -origin.dot(direction) / length2;
    let closest = origin + direction * middle;
    let rest = radius * radius - closest.length_squared();
    let enter = middle - (rest.max(0.0) / length2).sqrt();
    if rest > 0.0 && enter > 0.0 { enter } else { f32::INFINITY }
}

fn sphere_surface(local: Vec3, radius: f32) -> SurfacePoint {
    let normal = local / local.length();
    let uv = Vec2::new(normal.x.atan2(normal.z), normal.y.clamp(-1.0, 1.0).asin()) * radius;
    SurfacePoint { normal, uv, axis: 2 }
}

fn hit_column(origin: Vec3, direction: Vec3, radius: f32, half_height: f32) -> f32 {
    let flat = |v: Vec3| Vec2::new(v.x, v.z);
    let (o, d) = (flat(origin), flat(direction));
    let length2 = d.length_squared();
    // Across the axis the column is a circle: nearest point of the ray, half of the chord.
    let middle = -o.dot(d) / length2;
    let rest = radius * radius - (o + d * middle).length_squared();
    if rest <= 0.0 {
        return f32::INFINITY;
    }
    let side = middle - (rest / length2).sqrt();
    if side > 0.0 && (origin.y + direction.y * side).abs() <= half_height {
        return side;
    }
    // From above or below the ray may come in through a cap.
    let cap = (half_height.copysign(origin.y) - origin.y) / direction.y;
    let on_cap = (o + d * cap).length_squared() <= radius * radius;
    if cap > 0.0 && origin.y.abs() > half_height && on_cap { cap } else { f32::INFINITY }
}

fn column_surface(local: Vec3, radius: f32, half_height: f32) -> SurfacePoint {
    let across = Vec2::new(local.x, local.z).length();
    // The nearer surface: a cap or the side.
    if half_height - local.y.abs() < radius - across {
        let normal = Vec3::Y * local.y.signum();
        return SurfacePoint { normal, uv: Vec2::new(local.x, local.z), axis: 1 };
    }
    let normal = Vec3::new(local.x / across, 0.0, local.z / across);
    SurfacePoint { normal, uv: Vec2::new(local.x.atan2(local.z) * radius, local.y), axis: 2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(origin: [f32; 3], direction: [f32; 3]) -> Ray {
        Ray { origin: origin.into(), direction: direction.into() }
    }

    #[test]
    fn turned_box_is_met_at_its_corner() {
        // A unit cube turned by 45 degrees shows its edge, sqrt(1/2) in front of the centre.
        let heading = Vec2::splat(0.5_f32.sqrt());
        let cube = Shape::Cuboid { centre: Vec3::new(0.0, 0.0, 5.0), half: Vec3::splat(0.5), heading };
        let distance = cube.hit(&ray([0.0, 0.1, 0.0], [0.0, 0.0, 2.0]));
        assert!((2.0 * distance - (5.0 - 0.5_f32.sqrt())).abs() < 1e-5, "{distance}");
        // At x = 0.2 the front lies 0.2 deeper; its normal points at 45 degrees.
        let near = ray([0.2, 0.1, 0.0], [0.0, 0.0, 1.0]);
        let distance = cube.hit(&near);
        assert!((distance - (5.2 - 0.5_f32.sqrt())).abs() < 1e-5, "{distance}");
        let normal = cube.surface(near.at(distance)).normal;
        assert!((normal - Vec3::new(0.5_f32.sqrt(), 0.0, -(0.5_f32.sqrt()))).length() < 1e-5, "{normal}");
    }

    #[test]
    fn sphere_and_column_are_met_where_geometry_says() {
        let centre = Vec3::new(0.3, 0.0, 4.0);
        let sphere = Shape::Sphere { centre, radius: 0.5 };
        // 0.3 beside the centre: the front is at 4 - sqrt(0.25 - 0.09) = 3.6.
        assert!((sphere.hit(&ray([0.0; 3], [0.0, 0.0, 1.0])) - 3.6).abs() < 1e-5);
        assert_eq!(sphere.hit(&ray([0.0; 3], [0.0, 0.0, -1.0])), f32::INFINITY);
        let column = Shape::Column { centre, radius: 0.5, half_height: 1.0 };
        assert!((column.hit(&ray([0.0; 3], [0.0, 0.0, 1.0])) - 3.6).abs() < 1e-5);
        // From above, onto the cap at y = 1.
        assert!((column.hit(&ray([0.0, 3.0, 4.0], [0.0, -1.0, 0.001])) - 2.0).abs() < 1e-5);
        assert_eq!(column.hit(&ray([0.0, 1.5, 0.0], [0.0, 0.0, 1.0])), f32::INFINITY);
    }
}
