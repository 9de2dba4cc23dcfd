//! The surface of a signed distance that can be asked for at any point.

use mba_mesh::Mesh;
use rayon::prelude::*;

use super::SurfaceError;
use super::marching::{Assembly, Lattice, Piece, SampleBox};

/// Layers of cells that are in memory at once, and cells across a box of one task.
const SLAB: usize = 16;

/// Memory that a slab, or what is kept of a whole grid, may take, megabytes.
pub(super) const LIMIT_MB: usize = 1024;

/// Vertices whose colours are asked for at once.
const BATCH: usize = 4096;

/// A box in the world with a grid in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldBox {
    /// The corner with the lowest coordinates, metres.
    pub min: [f64; 3],
    /// The corner with the highest coordinates, metres.
    pub max: [f64; 3],
    /// Distance of grid points, metres.
    pub voxel: f64,
}

impl FieldBox {
    /// Points along each axis: the last one is at or beyond the maximum.
    pub(super) fn points(&self) -> Result<[usize; 3], SurfaceError> {
        const MOST: f64 = 1e6;
        let cells = std::array::from_fn(|axis| ((self.max[axis] - self.min[axis]) / self.voxel).ceil());
        let in_range = |cells: &f64| (1.0..MOST).contains(cells);
        let setting = |name, value, expected| Err(SurfaceError::Setting { name, value, expected });
        if self.voxel.is_nan() || self.voxel <= 0.0 {
            return setting("voxel", self.voxel, "a positive number of metres");
        }
        if let Some(&cells) = cells.iter().find(|cells| !in_range(cells)) {
            return setting("number of voxels along an axis", cells, "1 to a million");
        }
        let points = cells.map(|cells| cells as usize + 1);
        let bytes = size_of::<f32>() * (SLAB + 1) * points[0] * points[1];
        if bytes > LIMIT_MB << 20 {
            return Err(SurfaceError::TooFine { voxel: self.voxel, limit_mb: LIMIT_MB });
        }
        Ok(points)
    }
}

/// The surface where a signed distance is zero, by marching cubes on a grid that is evaluated in slabs.
///
/// `distances` gets points (world, metres) and a number for each to fill in: the distance in any unit, negative inside,
/// NaN where there is none; every point is asked for once. `colours` gets the vertices and fills in red, green and blue
/// as displays show them, 0 to 1. Both are called from several threads with up to a row of the grid or a few thousand
/// vertices at a time; the result does not depend on the number of threads.
///
/// # Errors
/// [`SurfaceError`] for a box that is empty or a grid that is too fine.
pub fn mesh_from_field(
    bounds: &FieldBox,
    distances: impl Fn(&[[f32; 3]], &mut [f32]) + Sync,
    colours: impl Fn(&[[f32; 3]], &mut [[f32; 3]]) + Sync,
) -> Result<Mesh, SurfaceError> {
    let points = bounds.points()?;
    let layer = points[0] * points[1];
    let mut assembly = Assembly::new(Lattice { origin: bounds.min, voxel: bounds.voxel });
    // The first layer of a slab is the last of the one below.
    let mut slab: Vec<f32> = Vec::with_capacity((SLAB + 1) * layer);
    for bottom in (0..points[2] - 1).step_by(SLAB) {
        let layers = (SLAB + 1).min(points[2] - bottom);
        // The layer that both slabs share is not asked for again.
        let known = slab.len().checked_sub(layer).map_or(0, |top| {
            slab.copy_within(top.., 0);
            layer
        });
        slab.resize(layers * layer, f32::NAN);
        let first_row = bottom * points[1] + known / points[0];
        let rows = slab[known..].par_chunks_mut(points[0]).enumerate();
        // Rows in parallel, pieces in their order: the mesh is the same for any number of threads.
        rows.for_each(|(row, out)| distances(&row_points(bounds, points, first_row + row), out));
        for piece in slab_surface(&slab, points, bottom) {
            assembly.add(&piece);
        }
    }
    let mut mesh = assembly.finish();
    mesh.colours = vertex_colours(&mesh.vertices, colours);
    Ok(mesh)
}

/// The points of a row of the grid; rows are counted through all layers.
fn row_points(bounds: &FieldBox, points: [usize; 3], row: usize) -> Vec<[f32; 3]> {
    let at = |x: usize| [x, row % points[1], row / points[1]];
    let position = |x| {
        let at = at(x);
        std::array::from_fn(|axis| (bounds.min[axis] + bounds.voxel * at[axis] as f64) as f32)
    };
    (0..points[0]).map(position).collect()
}

/// The pieces of a slab from its strips along x, in order.
fn slab_surface(slab: &[f32], points: [usize; 3], bottom: usize) -> Vec<Piece> {
    let layer = points[0] * points[1];
    let strips = (0..(points[1] - 1).div_ceil(SLAB)).into_par_iter();
    strips
        .map(|strip| {
            let front = strip * SLAB;
            let rows = (SLAB + 1).min(points[1] - front);
            let part = |layer: &[f32]| layer[front * points[0]..(front + rows) * points[0]].to_vec();
            let samples = SampleBox {
                origin: [0, front as i32, bottom as i32],
                points: [points[0], rows, slab.len() / layer],
                values: slab.chunks_exact(layer).flat_map(part).collect(),
            };
            samples.surface()
        })
        .collect()
}

/// Display colours of all vertices as bytes.
fn vertex_colours(
    vertices: &[[f32; 3]],
    colours: impl Fn(&[[f32; 3]], &mut [[f32; 3]]) + Sync,
) -> Vec<[u8; 3]> {
    let batches = vertices.par_chunks(BATCH).flat_map_iter(|batch| {
        let mut out = vec![[0.0; 3]; batch.len()];
        colours(batch, &mut out);
        out.into_iter().map(|colour| colour.map(|channel| (255.0 * channel).round() as u8))
    });
    batches.collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;
    use std::f64::consts::PI;

    use nalgebra::Vector3;

    use super::*;

    const RADIUS: f32 = 0.5;

    /// Signed distance of a ball around (0.01, 0.02, 0.03); none in the half space x > `end`.
    fn ball(voxel: f64, end: f32) -> Mesh {
        let bounds = FieldBox { min: [-0.57, -0.55, -0.53], max: [0.6, 0.6, 0.6], voxel };
        let distance = |[x, y, z]: [f32; 3]| {
            let squared = (x - 0.01).powi(2) + (y - 0.02).powi(2) + (z - 0.03).powi(2);
            if x > end { f32::NAN } else { squared.sqrt() - RADIUS }
        };
        let distances = |points: &[[f32; 3]], out: &mut [f32]| {
            out.iter_mut().zip(points).for_each(|(o, p)| *o = distance(*p))
        };
        let colours = |points: &[[f32; 3]], out: &mut [[f32; 3]]| {
            out.iter_mut().zip(points).for_each(|(o, p)| *o = p.map(|x| x + 0.5));
        };
        mesh_from_field(&bounds, distances, colours).unwrap()
    }

    /// How many triangles go along each side, by its vertices; the second number counts those of opposite direction.
    fn sides(mesh: &Mesh) -> HashMap<[u32; 2], [usize; 2]> {
        let mut sides: HashMap<[u32; 2], [usize; 2]> = HashMap::new();
        for [a, b, c] in &mesh.triangles {
            for [from, to] in [[*a, *b], [*b, *c], [*c, *a]] {
                sides.entry([from.min(to), from.max(to)]).or_default()[usize::from(from > to)] += 1;
            }
        }
        sides
    }

    #[test]
    fn a_ball_is_closed_and_has_its_area_and_volume() {
        let mesh = ball(0.03, 1.0);
        assert!(sides(&mesh).values().all(|count| *count == [1, 1]), "a side is open, doubled or turned");
        // Euler: a sphere.
        assert_eq!(mesh.vertices.len() + mesh.triangles.len(), sides(&mesh).len() + 2);
        let centre = Vector3::new(0.01, 0.02, 0.03);
        let radius = f64::from(RADIUS);
        for vertex in &mesh.vertices {
            let from_centre = (Vector3::from(vertex.map(f64::from)) - centre).norm();
            // A chord of the distance along an edge of h: off by less than h^2 / (8 r).
            assert!((from_centre - radius).abs() < 0.03 * 0.03 / (8.0 * radius) + 1e-6, "{from_centre}");
        }
        let volume: f64 = mesh
            .triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = mesh.corners(triangle);
                a.cross(&b).dot(&c) / 6.0
            })
            .sum();
        let (area, expected) = (mesh.area(), 4.0 * PI * radius * radius);
        assert!((area / expected - 1.0).abs() < 3e-3, "area {area} instead of {expected}");
        let expected = 4.0 / 3.0 * PI * radius.powi(3);
        assert!((volume / expected - 1.0).abs() < 3e-3, "volume {volume} instead of {expected}");
    }

    #[test]
    fn the_surface_ends_where_the_distance_is_unknown() {
        let mesh = ball(0.05, 0.2);
        let open = sides(&mesh).values().filter(|count| **count != [1, 1]).count();
        let beyond = mesh.vertices.iter().filter(|vertex| vertex[0] > 0.2).count();
        assert!(open > 20 && beyond == 0, "{open} open sides, {beyond} vertices beyond the end");
        assert!(sides(&mesh).values().all(|[there, back]| *there <= 1 && *back <= 1));
        let [x, ..] = mesh.vertices[0];
        assert_eq!(mesh.colours[0][0], (255.0 * (x + 0.5)).round() as u8);
    }

    #[test]
    fn the_surface_does_not_depend_on_the_number_of_threads() {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ball(0.02, 0.3))
        };
        assert!(with(1) == with(3));
    }

    #[test]
    fn absurd_grids_are_refused() {
        let mesh = |max: f64, voxel: f64| {
            let bounds = FieldBox { min: [0.0; 3], max: [max, max, 1.0], voxel };
            mesh_from_field(&bounds, |_, _| (), |_, _| ()).map(|_| ()).unwrap_err().to_string()
        };
        assert!(mesh(1.0, 0.0).contains("voxel is 0"));
        assert!(mesh(-1.0, 0.1).contains("number of voxels along an axis is -10"));
        assert!(mesh(f64::NAN, 0.1).contains("is NaN"));
        assert!(mesh(1.0, 1e-5).contains("voxels of 0.001 cm need more than 1024 MB"));
    }
}
