//! Frames of which not everything was seen at once, as they look from one pose.

use std::borrow::Cow;

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::Vector3;
use rayon::prelude::*;

use mba_raster::exposure::{ExposurePath, RowTimes};
use mba_raster::sensor::Observation;

/// Steps of the search for the row in which a point was seen, and for the depth at which a ray ends.
const STEPS: usize = 4;

/// Change of depth of the last step, as a ratio, up to which a ray has found its end: others pass an edge.
const SETTLED: f64 = 0.01;

/// Change of depth, as a ratio, from which on the search is over.
const UNCHANGED: f64 = 1e-3;

/// What `seen` would have shown if all rows of colour and depth had been exposed together around the middle of `path`,
/// blurred as before. A frame that was seen at once is passed on.
pub(super) fn seen_at_once<'a>(seen: &'a Observation, path: &ExposurePath) -> Cow<'a, Observation> {
    if seen.times.is_global() { Cow::Borrowed(seen) } else { Cow::Owned(rectified(seen, path)) }
}

fn rectified(seen: &Observation, path: &ExposurePath) -> Observation {
    let Observation { camera, colour, depth, region, times, falloff } = seen;
    let (width, height) = (camera.width, camera.height);
    let mid = path.mid();
    let colour_rows = Rows::new(camera, path, |v| times.view_time(0.5, v, height));
    let depth_rows = Rows::new(camera, path, |v| times.depth_time(v, height));
    // Where no depth is known, as far away as most: rotation moves the picture most.
    let typical = typical(depth);
    let measured = Measured { rows: &depth_rows, depth, typical };
    let (rectified_depth, sources): (Vec<f32>, Vec<usize>) = (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let from = [pixel % width, pixel / width];
            let ray = camera.ray(from[0] as f64, from[1] as f64);
            let known = measured.seen_from(&mid, from, ray);
            let point = mid.transform_point(&(ray * if known > 0.0 { known } else { typical }));
            (known as f32, colour_rows.source(&point, from[1]).unwrap_or(pixel))
        })
        .unzip();
    Observation {
        camera: *camera,
        colour: colour.each_ref().map(|plane| sources.iter().map(|&source| plane[source]).collect()),
        depth: rectified_depth,
        region: *region,
        times: RowTimes::GLOBAL,
        falloff: falloff.as_ref().map(|plane| sources.iter().map(|&source| plane[source]).collect()),
    }
}

/// A camera with a pose for every row.
struct Rows<'a> {
    camera: &'a PinholeCamera,
    world_from_camera: Vec<RigidTransform>,
    camera_from_world: Vec<RigidTransform>,
}

impl<'a> Rows<'a> {
    fn new(camera: &'a PinholeCamera, path: &ExposurePath, time: impl Fn(f64) -> f64) -> Self {
        let world_from_camera: Vec<_> = (0..camera.height).map(|v| path.at(time(v as f64))).collect();
        let camera_from_world = world_from_camera.iter().map(RigidTransform::inverse).collect();
        Self { camera, world_from_camera, camera_from_world }
    }

    /// The pixel at which a point of the world is seen, in a row near `row`.
    fn source(&self, point: &Vector3<f64>, mut row: usize) -> Option<usize> {
        let camera = self.camera;
        for _ in 0..STEPS {
            let local = self.camera_from_world[row].transform_point(point);
            if local.z <= 0.0 {
                return None;
            }
            let pixel = camera.project(&local);
            let (u, v) = (pixel.x.round(), pixel.y.round());
            let inside = u >= 0.0 && v >= 0.0 && u < camera.width as f64 && v < camera.height as f64;
            // Casts saturate.
            let seen_in = (v as usize).min(camera.height - 1);
            if seen_in == row {
                return inside.then(|| row * camera.width + u as usize);
            }
            row = seen_in;
        }
        // Between two rows.
        let local = self.camera_from_world[row].transform_point(point);
        let u = camera.project(&local).x.round();
        (u >= 0.0 && u < camera.width as f64).then(|| row * camera.width + u as usize)
    }
}

/// A depth image with the pose of every row.
struct Measured<'a> {
    rows: &'a Rows<'a>,
    depth: &'a [f32],
    /// Depth from which the search starts where there is none.
    typical: f64,
}

impl Measured<'_> {
    /// Depth along the ray of pixel `from` of a camera at `world_from_camera`, 0 where nothing was measured or the ray
    /// passes an edge.
    fn seen_from(&self, world_from_camera: &RigidTransform, from: [usize; 2], ray: Vector3<f64>) -> f64 {
        let camera = self.rows.camera;
        let (mut row, start) = (from[1], f64::from(self.depth[from[1] * camera.width + from[0]]));
        let mut depth = if start > 0.0 { start } else { self.typical };
        let mut change = f64::INFINITY;
        // The third row of the inverse of the pose: what depth is measured along.
        let forward = world_from_camera.rotation * Vector3::z();
        for _ in 0..STEPS {
            let point = world_from_camera.transform_point(&(ray * depth));
            let Some(pixel) = self.rows.source(&point, row) else { return 0.0 };
            let measured = f64::from(self.depth[pixel]);
            if measured <= 0.0 {
                return 0.0;
            }
            row = pixel / camera.width;
            let local = camera.ray((pixel % camera.width) as f64, row as f64) * measured;
            let point = self.rows.world_from_camera[row].transform_point(&local);
            let before = depth;
            depth = forward.dot(&(point - world_from_camera.translation));
            if depth <= 0.0 {
                return 0.0;
            }
            change = (depth - before).abs();
            if change < UNCHANGED * depth {
                break;
            }
        }
        if change <= SETTLED * depth { depth } else { 0.0 }
    }
}

/// Median depth in metres; 2 where nothing was measured.
fn typical(depth: &[f32]) -> f64 {
    let mut depths: Vec<f32> = depth.iter().copied().filter(|depth| *depth > 0.0).step_by(7).collect();
    if depths.is_empty() {
        return 2.0;
    }
    let middle = depths.len() / 2;
    f64::from(*depths.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use mba_tracker::image::PixelRectangle;
    use mba_tracker::trajectory::ExposureTrajectory;
    use nalgebra::Vector6;

    use super::*;

    const SIZE: [usize; 2] = [80, 60];

    fn camera() -> PinholeCamera {
        PinholeCamera { width: SIZE[0], height: SIZE[1], fx: 70.0, fy: 70.0, cx: 39.5, cy: 29.5 }
    }

    /// Brightness of a wall at z = 2 that slopes to the right.
    fn light(point: &Vector3<f64>) -> u8 {
        (128.0 + 50.0 * (7.0 * point.x).sin() + 50.0 * (6.0 * point.y).cos()) as u8
    }

    /// Where a ray meets the wall `z = 2 + x/4`, as a multiple of the ray.
    fn hit(pose: &RigidTransform, ray: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let normal = Vector3::new(-0.25, 0.0, 1.0);
        let direction = pose.rotation * ray;
        let distance = (2.0 - normal.dot(&pose.translation)) / normal.dot(&direction);
        (distance, pose.translation + direction * distance)
    }

    #[test]
    fn rows_come_to_where_one_look_would_have_seen_them() {
        let camera = camera();
        // Ten pixels aside while the rows are exposed; depth is of later.
        let motion = Vector6::new(0.2, -0.05, 0.05, 0.02, 0.06, -0.05);
        let path = ExposurePath::linear(ExposureTrajectory::from_mid_and_motion(
            &RigidTransform::identity(),
            &motion,
        ));
        let times = RowTimes { exposure: 0.2, readout: 0.8, depth_offset: 0.4, depth_readout: -0.1 };
        let pixels = || (0..SIZE[0] * SIZE[1]).map(|pixel| (pixel % SIZE[0], pixel / SIZE[0]));
        let seen_at =
            |(u, v): (usize, usize), time: f64| hit(&path.at(time), &camera.ray(u as f64, v as f64));
        let plane: Vec<u8> =
            pixels().map(|at| light(&seen_at(at, times.view_time(0.5, at.1 as f64, SIZE[1])).1)).collect();
        let depth = pixels().map(|at| seen_at(at, times.depth_time(at.1 as f64, SIZE[1])).0 as f32);
        let seen = Observation {
            camera,
            colour: [plane.clone(), plane.clone(), plane],
            depth: depth.collect(),
            region: PixelRectangle { left: 0, top: 0, right: SIZE[0], bottom: SIZE[1] },
            times,
            falloff: None,
        };
        let found = seen_at_once(&seen, &path);
        let (mut compared, mut off_before) = (0, 0);
        for (pixel, (u, v)) in pixels().enumerate() {
            let (distance, point) = seen_at((u, v), 0.5);
            if !(12..68).contains(&u) || !(12..48).contains(&v) {
                continue;
            }
            compared += 1;
            let known = f64::from(found.depth[pixel]);
            assert!((known - distance).abs() < 0.01, "depth at {u}, {v}: {known} instead of {distance}");
            // Half a pixel to the nearest source is up to 50 * (7 + 6) * 2.2 m / 140 = 10.2 steps of brightness.
            let difference = i32::from(found.colour[0][pixel]) - i32::from(light(&point));
            assert!(difference.abs() <= 10, "{u}, {v}: {difference}");
            off_before += usize::from(seen.colour[0][pixel].abs_diff(light(&point)) > 10);
        }
        assert!(off_before > compared / 4, "only {off_before} of {compared} pixels were somewhere else");
        let at_once = Observation { times: RowTimes::GLOBAL, ..seen.clone() };
        assert!(matches!(seen_at_once(&at_once, &path), Cow::Borrowed(_)));
    }
}
