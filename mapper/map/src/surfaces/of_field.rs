//! The surface of a tri-plane field.

use mba_field::triplane::TriplaneField;
use mba_mesh::Mesh;
use mba_raster::sensor::ForwardResponse;
use mba_tracker::photometric::InverseResponse;
use mba_tracker::simd::Level;

use super::field::LIMIT_MB;
use super::{FieldBox, Sight, SurfaceError, Trim, ViewSource, mesh_from_field};

/// Edge of a block of voxels that is looked at or left out as a whole, at most this many truncations: then a surface in
/// it is within 0.61 truncations of one of its corners.
const BLOCK: f64 = 0.7;

/// Blocks of which all corners are farther from the surface than this, truncations, hold none. A learnt distance is off
/// by a little.
const FAR: f32 = 0.8;

/// What lies deeper than the view shows by more than this, truncations, is not seen. Behind a surface nobody has
/// measured anything from one truncation on.
const TOLERANCE: f64 = 0.5;

/// The coloured surface of a field where its distance is zero, by marching cubes with voxels of `voxel` metres, trimmed
/// to what the views of `source` see of it. The field is asked with the instructions `simd`.
///
/// # Errors
/// [`SurfaceError`] for voxels that are not positive or too small for the box of the field.
pub fn surface_of_field(
    simd: Level,
    field: &TriplaneField,
    voxel: f64,
    source: &mut dyn ViewSource,
    trim: &Trim,
) -> Result<Mesh, SurfaceError> {
    let (min, max) = (field.region().origin().into(), field.region().end().into());
    let bounds = FieldBox { min, max, voxel };
    // Most of a room is air: distances are asked for near the surface only.
    let near = NearSurface::new(field, &bounds, simd)?;
    let response = ForwardResponse::new(&InverseResponse::srgb());
    let distances = |points: &[[f32; 3]], out: &mut [f32]| {
        out.fill(f32::NAN);
        // Points that are far from the surface stay unknown.
        let wanted: Vec<usize> = near.of_row(points).collect();
        let places: Vec<_> = wanted.iter().map(|k| points[*k].map(f64::from)).collect();
        wanted.iter().zip(field.distances(simd, &places)).for_each(|(k, distance)| out[*k] = distance);
    };
    let colours = |points: &[[f32; 3]], out: &mut [[f32; 3]]| {
        let places: Vec<_> = points.iter().map(|point| point.map(f64::from)).collect();
        // A field has light, a mesh has display values.
        let display = |light: f32| f32::from(response.encode(light)) / 255.0;
        out.iter_mut().zip(field.colours(simd, &places)).for_each(|(out, light)| *out = light.map(display));
    };
    let mesh = mesh_from_field(&bounds, distances, colours)?;
    let mut sight = Sight::new(&mesh);
    // The field goes on behind what was seen, where it was never taught: only what a view shows is kept.
    let tolerance = TOLERANCE * f64::from(field.settings().truncation);
    for index in 0..source.count() {
        sight.look(&mesh, &source.view(index), tolerance);
    }
    Ok(sight.trim(&mesh, trim))
}

/// Which blocks of a grid may hold a piece of the surface: most of a room is air.
struct NearSurface {
    bounds: FieldBox,
    /// Voxels along an edge of a block.
    edge: usize,
    blocks: [usize; 3],
    /// A byte per block.
    near: Vec<bool>,
}

impl NearSurface {
    fn new(field: &TriplaneField, bounds: &FieldBox, level: Level) -> Result<Self, SurfaceError> {
        let points = bounds.points()?;
        let truncation = f64::from(field.settings().truncation);
        let edge = ((BLOCK * truncation / bounds.voxel) as usize).max(1);
        let blocks = points.map(|points| (points - 1).div_ceil(edge));
        let count: usize = blocks.iter().product();
        if count > LIMIT_MB << 20 {
            return Err(SurfaceError::TooFine { voxel: bounds.voxel, limit_mb: LIMIT_MB });
        }
        let near = Vec::with_capacity(count);
        let mut found = Self { bounds: *bounds, edge, blocks, near };
        let mut below = found.corners(field, level, 0);
        for z in 0..blocks[2] {
            let above = found.corners(field, level, z + 1);
            found.add_layer(&below, &above, FAR * field.settings().truncation);
            below = above;
        }
        Ok(found)
    }

    /// Distances at the corners of blocks in the layer below the blocks `z`, row by row.
    fn corners(&self, field: &TriplaneField, level: Level, z: usize) -> Vec<f32> {
        let [columns, rows] = [self.blocks[0] + 1, self.blocks[1] + 1];
        let step = self.bounds.voxel * self.edge as f64;
        let place = |corner: [usize; 3]| -> [f64; 3] {
            core::array::from_fn(|axis| self.bounds.min[axis] + step * corner[axis] as f64)
        };
        let corners = (0..rows).flat_map(|y| (0..columns).map(move |x| [x, y, z]));
        field.distances(level, &corners.map(place).collect::<Vec<_>>())
    }

    /// Judges a layer of blocks by the distances at their corners.
    fn add_layer(&mut self, below: &[f32], above: &[f32], far: f32) {
        let columns = self.blocks[0] + 1;
        for y in 0..self.blocks[1] {
            for x in 0..self.blocks[0] {
                let first = y * columns + x;
                let corners = [first, first + 1, first + columns, first + columns + 1];
                let values = corners.into_iter().flat_map(|corner| [below[corner], above[corner]]);
                let (least, most) = values
                    .fold((f32::INFINITY, f32::NEG_INFINITY), |(least, most), s| (least.min(s), most.max(s)));
                self.near.push(least < far && most > -far);
            }
        }
    }

    /// The blocks that share a point of the grid along an axis: two where they meet.
    fn around(&self, index: usize, axis: usize) -> impl Iterator<Item = usize> + Clone {
        let block = index / self.edge;
        let first = if index.is_multiple_of(self.edge) { block.saturating_sub(1) } else { block };
        first..(block + 1).min(self.blocks[axis])
    }

    /// Which points of a row of the grid belong to a block near the surface.
    fn of_row<'a>(&'a self, row: &[[f32; 3]]) -> impl Iterator<Item = usize> + 'a {
        let index = |point: &[f32; 3], axis: usize| {
            ((f64::from(point[axis]) - self.bounds.min[axis]) / self.bounds.voxel).round().max(0.0) as usize
        };
        let first = row.first().map_or([0; 3], |point| [0, 1, 2].map(|axis| index(point, axis)));
        let beside: Vec<usize> = self
            .around(first[1], 1)
            .flat_map(|y| self.around(first[2], 2).map(move |z| (z * self.blocks[1] + y) * self.blocks[0]))
            .collect();
        let is_near = move |k: &usize| {
            beside.iter().any(|start| self.around(first[0] + k, 0).any(|x| self.near[start + x]))
        };
        (0..row.len()).filter(is_near)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use mba_tracker::geometry::{PinholeCamera, RigidTransform};
    use mba_tracker::image::PixelRectangle;
    use mba_tracker::trajectory::ExposureTrajectory;

    use super::*;
    use crate::surfaces::MapViews;
    use mba_field::triplane::{
        FieldExposure, FieldLoss, FieldSettings, FieldStep, FieldWeights, Region, SamplingSettings,
        TriplaneAdam,
    };
    use mba_raster::exposure::{ExposurePath, RowTimes, RowTiming};
    use mba_raster::losses::Exposure;
    use mba_raster::sensor::{Observation, Sensor};

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 48, height: 36, fx: 40.0, fy: 40.0, cx: 23.5, cy: 17.5 };

    /// How far away the wall is, metres.
    const WALL: f32 = 0.9;

    /// A field that has seen a grey wall across the axis of a camera in the origin.
    static SEEN: LazyLock<TriplaneField> = LazyLock::new(|| {
        let pixels = CAMERA.width * CAMERA.height;
        let region = PixelRectangle { left: 0, top: 0, right: CAMERA.width, bottom: CAMERA.height };
        let plane = || vec![120; pixels];
        let colour = [plane(), plane(), plane()];
        let seen = Observation {
            camera: CAMERA,
            colour,
            depth: vec![WALL; pixels],
            region,
            times: RowTimes::GLOBAL,
            falloff: None,
        };
        let sensor = Sensor {
            camera: CAMERA,
            inverse_response: InverseResponse::srgb(),
            depth_scale: 5000.0,
            region,
            rows: RowTiming::default(),
            falloff: None,
        };
        let still = RigidTransform::identity();
        let path = ExposurePath::linear(ExposureTrajectory { start: still, end: still });
        let region = Region::around([-0.6, -0.5, 0.0], [0.6, 0.5, 1.1]);
        let mut field = TriplaneField::new(region, FieldSettings::default(), 1);
        let mut field_loss = FieldLoss::new(Level::new(), &sensor);
        let mut adam = TriplaneAdam::default();
        for step in 0..400 {
            let given = FieldExposure {
                exposure: Exposure { seen: &seen, path: &path, gain: 1.0, views: 1 },
                pixels: 256,
                weights: FieldWeights::default(),
                sampling: SamplingSettings::default(),
                with_path: false,
                seed: 1,
                step,
            };
            field_loss.evaluate(&field, &given);
            adam.step(Level::new(), &mut field, field_loss.gradients(), FieldStep::default());
        }
        field
    });

    #[test]
    fn nothing_of_the_surface_lies_in_what_is_left_out() {
        let (min, max) = (SEEN.region().origin().into(), SEEN.region().end().into());
        for voxel in [0.007, 0.01, 0.03] {
            let bounds = FieldBox { min, max, voxel };
            let near = NearSurface::new(&SEEN, &bounds, Level::new()).unwrap();
            let share = near.near.iter().filter(|near| **near).count() as f64 / near.near.len() as f64;
            assert!((0.05..0.9).contains(&share), "{share} of the blocks");
            let all = |points: &[[f32; 3]], out: &mut [f32]| {
                let places: Vec<_> = points.iter().map(|point| point.map(f64::from)).collect();
                out.copy_from_slice(&SEEN.distances(Level::new(), &places));
            };
            let near_only = |points: &[[f32; 3]], out: &mut [f32]| {
                all(points, out);
                let wanted: Vec<usize> = near.of_row(points).collect();
                let left_out = |k: &usize| !wanted.contains(k);
                (0..points.len()).filter(left_out).for_each(|k| out[k] = f32::NAN);
            };
            let [whole, found] = [
                mesh_from_field(&bounds, all, |_, _| ()).unwrap(),
                mesh_from_field(&bounds, near_only, |_, _| ()).unwrap(),
            ];
            assert!(whole.triangles.len() > 500, "{} triangles", whole.triangles.len());
            assert!(
                whole == found,
                "{} instead of {} triangles",
                found.triangles.len(),
                whole.triangles.len()
            );
        }
    }

    #[test]
    fn the_wall_is_where_it_was_seen_and_nothing_else_is_kept() {
        let trim = Trim { least_area: 0.0 };
        let mut views = MapViews::new(Level::new(), &*SEEN, CAMERA, vec![RigidTransform::identity()]);
        let mesh = surface_of_field(Level::new(), &SEEN, 0.01, &mut views, &trim).unwrap();
        // The camera sees 48/40 x 36/40 of the distance, half of a pixel less at each side.
        let expected = f64::from(WALL * WALL) * 48.0 / 40.0 * 36.0 / 40.0;
        assert!((mesh.area() / expected - 1.0).abs() < 0.05, "{} m2 instead of {expected}", mesh.area());
        let off = mesh.vertices.iter().map(|vertex| (vertex[2] - WALL).abs()).fold(0.0, f32::max);
        assert!(off < 0.005, "a vertex is {off} m off");
        let mean = mesh.colours.iter().flatten().map(|byte| f64::from(*byte)).sum::<f64>();
        let mean = mean / (3 * mesh.colours.len()) as f64;
        assert!((mean - 120.0).abs() < 6.0, "mean colour {mean}");
        let unseen = surface_of_field(
            Level::new(),
            &SEEN,
            0.01,
            &mut MapViews::new(Level::new(), &*SEEN, CAMERA, vec![]),
            &trim,
        );
        assert!(unseen.unwrap().triangles.is_empty());
    }
}
