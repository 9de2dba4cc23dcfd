//! A room of known walls, fused from exact depth.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::{UnitQuaternion, Vector3};

use super::*;
use crate::surfaces::{ColouredDepth, Sight, Trim};

const CAMERA: PinholeCamera =
    PinholeCamera { width: 128, height: 96, fx: 100.0, fy: 100.0, cx: 63.5, cy: 47.5 };

/// A box around the cameras and a smaller one within it, as half edges and centres, metres.
const ROOM: [f64; 3] = [1.03, 0.71, 1.52];
const CHEST: [[f64; 3]; 2] = [[0.2, 0.25, 0.15], [0.1, 0.47, 0.9]];

/// Views of room and chest from a few poses, in front of which a speck hovers in the middle view only.
struct Room {
    poses: Vec<RigidTransform>,
    speck: bool,
}

impl Room {
    fn new(speck: bool) -> Self {
        let pose = |k: usize| {
            let turn =
                UnitQuaternion::from_euler_angles(0.1 * (k % 3) as f64 - 0.1, 0.15 * k as f64 - 0.3, 0.0);
            RigidTransform::new(turn, Vector3::new(0.1 * k as f64 - 0.2, -0.1, -0.5))
        };
        Self { poses: (0..5).map(pose).collect(), speck }
    }
}

/// Depth along a ray from within the room.
fn cast(origin: &Vector3<f64>, ray: &Vector3<f64>) -> f64 {
    let planes = |half: f64, centre: f64, k: usize| {
        let [a, b] = [-half, half].map(|side| (centre + side - origin[k]) / ray[k]);
        [a.min(b), a.max(b)]
    };
    let room = (0..3).map(|k| planes(ROOM[k], 0.0, k)[1]).fold(f64::INFINITY, f64::min);
    let [half, centre] = CHEST;
    let enters = (0..3).map(|k| planes(half[k], centre[k], k)[0]).fold(f64::NEG_INFINITY, f64::max);
    let leaves = (0..3).map(|k| planes(half[k], centre[k], k)[1]).fold(f64::INFINITY, f64::min);
    if enters > 0.0 && enters < leaves { enters } else { room }
}

/// Unsigned distance of a point from the walls of the room and the chest.
fn distance_from_surface(point: &[f32; 3]) -> f64 {
    let point = point.map(f64::from);
    let walls = (0..3).map(|k| (ROOM[k] - point[k].abs()).abs()).fold(f64::INFINITY, f64::min);
    let [half, centre] = CHEST;
    let outside = |k: usize| (point[k] - centre[k]).abs() - half[k];
    let beyond = (0..3).map(|k| outside(k).max(0.0).powi(2)).sum::<f64>().sqrt();
    let deepest = (0..3).map(outside).fold(f64::NEG_INFINITY, f64::max);
    walls.min(if deepest > 0.0 { beyond } else { -deepest })
}

impl ViewSource for Room {
    fn count(&self) -> usize {
        self.poses.len()
    }

    fn view(&mut self, index: usize) -> ColouredDepth {
        let world_from_camera = self.poses[index];
        let PinholeCamera { width, height, .. } = CAMERA;
        let pixel = |k: usize| [k % width, k / width];
        let depth = |k: usize| {
            let [u, v] = pixel(k);
            let ray = world_from_camera.rotation * CAMERA.ray(u as f64, v as f64);
            let speck = self.speck && index == 2 && (54..74).contains(&u) && (50..70).contains(&v);
            if speck { 1.0 } else { cast(&world_from_camera.translation, &ray) as f32 }
        };
        let pixels = 0..width * height;
        ColouredDepth {
            camera: CAMERA,
            world_from_camera,
            depth: pixels.clone().map(depth).collect(),
            colour: pixels.map(|_| [0.5, 0.0, 1.0]).collect(),
        }
    }
}

fn settings(voxel: f64) -> FusionSettings {
    FusionSettings { voxel, ..FusionSettings::default() }
}

#[test]
fn walls_are_where_they_are() {
    let mesh = fuse_views(&mut Room::new(false), &settings(0.02)).unwrap();
    assert!(mesh.triangles.len() > 5000, "{}", mesh.triangles.len());
    let mut errors: Vec<f64> = mesh.vertices.iter().map(distance_from_surface).collect();
    errors.sort_by(f64::total_cmp);
    let [median, most] = [errors[errors.len() / 2], errors[errors.len() * 99 / 100]];
    // Corners are rounded by as much as a voxel.
    assert!(median < 0.02 * 0.01 && most < 0.02, "median {median}, 99 % {most}");
    let middle = Vector3::new(0.0, -0.1, -0.5);
    let facing = mesh.triangles.iter().filter(|triangle| {
        let [a, b, c] = mesh.corners(triangle);
        (b - a).cross(&(c - a)).dot(&(middle - a)) > 0.0
    });
    let facing = facing.count();
    assert!(
        facing > mesh.triangles.len() * 99 / 100,
        "{facing} of {} face the cameras",
        mesh.triangles.len()
    );
}

#[test]
fn what_one_view_sees_and_others_see_through_goes() {
    let hovering = |speck: bool| {
        let mesh = fuse_views(&mut Room::new(speck), &settings(0.02)).unwrap();
        mesh.vertices.iter().filter(|vertex| distance_from_surface(vertex) > 0.1).count()
    };
    assert_eq!(hovering(false), 0);
    // It is 20 cm wide; the other views see the wall behind it.
    assert_eq!(hovering(true), 0);
}

#[test]
fn fusion_does_not_depend_on_the_number_of_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fuse_views(&mut Room::new(true), &settings(0.04)).unwrap())
    };
    assert!(with(1) == with(3));
}

#[test]
fn only_what_was_seen_stays_and_gets_its_colour() {
    let mut room = Room::new(false);
    let mut mesh = fuse_views(&mut room, &settings(0.04)).unwrap();
    let surface = mesh.triangles.len();
    // A wall behind the wall, which no view can see.
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend([[-0.5, 0.0, 2.0], [0.5, 0.0, 2.0], [0.0, 0.5, 2.0]]);
    mesh.triangles.push([first, first + 1, first + 2]);
    let mut sight = Sight::new(&mesh);
    (0..room.count()).for_each(|index| sight.look(&mesh, &room.view(index), 0.16));
    let seen = sight.trim(&mesh, &Trim { least_area: 0.0 });
    assert!(seen.vertices.iter().all(|vertex| vertex[2] < 1.8), "the wall behind the wall is there");
    // Some triangles of edges are hidden by them.
    assert!((surface * 99 / 100..=surface).contains(&seen.triangles.len()), "{}", seen.triangles.len());
    // Linear light of one half is 188 in sRGB.
    assert!(seen.colours.iter().all(|colour| *colour == [188, 0, 255]));
    let large = sight.trim(&mesh, &Trim { least_area: 100.0 });
    assert_eq!(large.triangles.len(), 0);
}

#[test]
fn grids_and_settings_out_of_range_are_refused() {
    let refused = |settings| fuse_views(&mut Room::new(false), &settings).unwrap_err().to_string();
    let small = FusionSettings { limit_mb: 1, ..settings(0.02) };
    assert!(refused(small).contains("voxels of 2.000 cm need more than 1 MB"));
    assert!(refused(settings(f64::NAN)).contains("voxel is NaN"));
    assert!(
        refused(FusionSettings { truncation_voxels: 0.5, ..settings(0.02) }).contains("truncation is 0.5")
    );
}
