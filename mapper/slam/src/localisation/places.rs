//! Views of a map that a frame may look like.

use mba_adjust::places::{PlaceDescriptor, PlaceIndex};
use mba_io::statistics::quantile;
use mba_map::rendering::{Behind, RenderedView, ViewRenderer};
use mba_tracker::geometry::{PinholeCamera, RigidTransform, so3};
use nalgebra::Vector3;

use crate::run::{FrameStatus, Run};
use crate::slam::view_change;

/// Columns of the views that places are described by: a thumbnail has 20, and blurs what is finer.
const COLUMNS: usize = 80;

/// Similarity from which a place is worth a look, and how many are looked at.
const MIN_SIMILARITY: f32 = 0.6;
const MOST_CANDIDATES: usize = 6;

/// Share of the picture that the map has to show.
const SOLID: f64 = 0.5;

/// Movement of the picture between two places as a share of its width: a thumbnail is recognised when it is moved by twice
/// as much.
const SPACING: f64 = 0.08;

/// Views besides those that the camera of the run had: turned about what it looks at, degrees to the right, and that many times
/// as far from it.
const ASIDE: [(f64, f64); 8] =
    [(0.0, 0.6), (0.0, 1.4), (0.0, 2.0), (-22.5, 1.0), (22.5, 1.0), (-45.0, 1.0), (45.0, 1.0), (0.0, 0.4)];

/// How far the depth of a view may be from where it should look, as a factor: beyond, something stands between, such as the
/// wall behind the camera.
const SAME_DEPTH: f64 = 1.7;

/// Where views are from and what they look like.
pub(super) struct Places {
    /// Descriptions by their number in `poses`.
    index: PlaceIndex,
    /// `world_from_camera`.
    poses: Vec<RigidTransform>,
}

impl Places {
    /// Views of the map from where the camera of a run was, from further away, from nearer and from aside, each as a `camera`
    /// with `depth_scale` raw units per metre sees it. How many there are depends on what was seen, not on how long.
    pub(super) fn of<'a>(
        run: &Run,
        camera: PinholeCamera,
        depth_scale: f64,
        renderer: impl Fn(PinholeCamera) -> ViewRenderer<'a>,
    ) -> Self {
        let camera = small(camera);
        let mut places = Self { index: PlaceIndex::default(), poses: Vec::new() };
        let mut renderer = renderer(camera);
        // Where the camera of the run was, as far as that is another view.
        let mut seen: Vec<(RigidTransform, f64)> = Vec::new();
        let frames = run.frames.iter().zip(&run.exposures);
        for (_, exposure) in frames.filter(|(frame, _)| frame.status != FrameStatus::Lost) {
            // As far from what it looks at as the view before.
            let depth = seen.last().map_or(0.0, |(_, depth)| *depth);
            if !places.is_new(&exposure.mid, depth, &camera) {
                continue;
            }
            let view = renderer.render(&exposure.mid, Behind::Surroundings);
            let depth = median_depth(&view, depth_scale);
            if depth > 0.0 && places.add(exposure.mid, depth, &view, &camera) {
                seen.push((exposure.mid, depth));
            }
        }
        // Then where it was not.
        for (degrees, times) in ASIDE {
            for (pose, depth) in &seen {
                let pose = aside(pose, *depth, degrees, times);
                let expected = depth * times;
                if !places.is_new(&pose, expected, &camera) {
                    continue;
                }
                let view = renderer.render(&pose, Behind::Surroundings);
                let ratio = median_depth(&view, depth_scale) / expected;
                if (SAME_DEPTH.recip()..SAME_DEPTH).contains(&ratio) {
                    places.add(pose, expected, &view, &camera);
                }
            }
        }
        places
    }

    /// Number of views.
    pub(super) fn len(&self) -> usize {
        self.poses.len()
    }

    /// Where a frame may have been seen from that looks like this, the likeliest pose first.
    pub(super) fn guesses(&self, frame: &PlaceDescriptor) -> Vec<RigidTransform> {
        let candidates = self.index.candidates(frame, MOST_CANDIDATES, MIN_SIMILARITY, |_| true);
        candidates.iter().map(|found| self.poses[found.id].compose(&found.stored_from_query)).collect()
    }

    /// Whether there is no place yet near a pose that looks at something `depth` metres away.
    fn is_new(&self, pose: &RigidTransform, depth: f64, camera: &PinholeCamera) -> bool {
        let spacing = SPACING * camera.width as f64;
        !self.poses.iter().any(|known| view_change(known, pose, camera, depth) < spacing)
    }

    /// Adds a view if the map shows enough in it and it is another one; returns whether that is so.
    fn add(&mut self, pose: RigidTransform, depth: f64, view: &RenderedView, camera: &PinholeCamera) -> bool {
        if view.solid < SOLID || !self.is_new(&pose, depth, camera) {
            return false;
        }
        let Ok(descriptor) = PlaceDescriptor::new(&view.rgb, camera) else { return false };
        self.index.push(self.poses.len(), descriptor);
        self.poses.push(pose);
        true
    }
}

/// The camera with as few pixels as a thumbnail can be made of.
fn small(camera: PinholeCamera) -> PinholeCamera {
    // Halved as long as all pixels have a partner: the shape of the image stays.
    let sizes = [camera.width, camera.height];
    let is_fine = |level: &usize| {
        camera.width >> level >= COLUMNS && sizes.iter().all(|size| size.is_multiple_of(1 << level))
    };
    camera.at_level((0..usize::BITS as usize).take_while(is_fine).last().unwrap_or(0))
}

/// Median depth of a view in metres; 0 where there is none.
fn median_depth(view: &RenderedView, depth_scale: f64) -> f64 {
    let known = view.depth.iter().filter(|raw| **raw > 0).map(|raw| f64::from(*raw) / depth_scale);
    quantile(&known.collect::<Vec<_>>(), 0.5).unwrap_or(0.0)
}

/// A pose that is turned about the point `depth` metres ahead by so many degrees, to the right of it, and `times` as far away.
fn aside(world_from_camera: &RigidTransform, depth: f64, degrees: f64, times: f64) -> RigidTransform {
    let ahead =
        |metres: f64| RigidTransform::new(so3::exp(&Vector3::zeros()), Vector3::new(0.0, 0.0, metres));
    // The camera's y axis points down: a turn about it against the clock, seen from above, takes the camera to the right.
    let turn = so3::exp(&Vector3::new(0.0, -degrees.to_radians(), 0.0));
    world_from_camera
        .compose(&ahead(depth))
        .compose(&RigidTransform::new(turn, Vector3::zeros()))
        .compose(&ahead(-depth * times))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_from_aside_looks_at_the_same_from_where_it_is_said_to_be() {
        let pose = RigidTransform::new(so3::exp(&Vector3::new(0.1, -0.4, 0.2)), Vector3::new(1.0, 2.0, 3.0));
        let seen = pose.transform_point(&Vector3::new(0.0, 0.0, 2.0));
        for (degrees, times) in ASIDE {
            let other = aside(&pose, 2.0, degrees, times);
            let there = other.inverse().transform_point(&seen);
            assert!((there - Vector3::new(0.0, 0.0, 2.0 * times)).norm() < 1e-12, "{there}");
            assert!((pose.rotation.angle_to(&other.rotation) - degrees.abs().to_radians()).abs() < 1e-7);
            let right = pose.inverse().transform_point(&other.translation).x;
            assert!(right * degrees >= 0.0, "{degrees} degrees: {right} m to the right");
        }
    }

    #[test]
    fn small_views_keep_their_shape() {
        let size = |width, height| {
            let camera = PinholeCamera { width, height, fx: 500.0, fy: 500.0, cx: 300.0, cy: 200.0 };
            let PinholeCamera { width, height, .. } = small(camera);
            (width, height)
        };
        assert_eq!(
            [size(640, 480), size(1280, 720), size(634, 478), size(50, 40)],
            [(80, 60), (80, 45), (317, 239), (50, 40)]
        );
    }
}
