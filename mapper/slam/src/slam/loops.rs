//! Places that are seen again: the drift since, and the way back for a tracker that is lost.

use mba_adjust::bundle::MappedFrame;
use mba_adjust::places::{PlaceDescriptor, PlaceIndex};
use mba_adjust::pose_graph::{PoseGraph, PoseGraphEdge, PoseGraphSettings};
use mba_io::checkpoint::exact_poses::{PoseNumbers, numbers, pose};
use mba_io::dataset::RgbdFrame;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::{SimdLevel, TrackerConfig};

use super::growing_map::GrowingMap;
use super::keyframe_choice::view_change;
use super::messages::SharpView;
use super::relocaliser::{PoseMeasurement, Relocaliser};
use super::saved::SavedLoops;

/// Keyframes before the newest that are no place seen *again*.
const RECENT: usize = 12;

/// Where keyframes were given up those that are left lie far apart: then no more than this share of them is recent.
const RECENT_SHARE: f64 = 0.25;

/// Similarity from which a keyframe is worth a look, and how many are looked at.
const MIN_SIMILARITY: f32 = 0.7;
const MOST_CANDIDATES: usize = 3;

/// Disagreement below which nothing has drifted, as a fraction of the width of the picture.
const DRIFT: f64 = 0.003;

/// Keyframes until the next look after one that found no drift: places around are all seen again and again.
const PAUSE: usize = 6;

/// Standard deviation of the motion between consecutive keyframes: a constant part in metres and radians, and a share
/// of the motion.
const ODOMETRY: (f64, f64, f64) = (2e-3, 1e-3, 0.02);

/// Standard deviation of a measurement, metres and radians.
const SIGHTING: (f64, f64) = (2e-3, 1e-3);

/// What is known of places, and the loops that were closed.
pub(super) struct Loops {
    relocaliser: Relocaliser,
    places: PlaceIndex,
    closed: Vec<Closure>,
    pause: usize,
}

/// A keyframe that was seen again, both by their index in the data set.
#[derive(Clone, Copy, Debug)]
struct Closure {
    before: usize,
    now: usize,
    before_from_now: RigidTransform,
}

impl Loops {
    pub(super) fn new(config: &TrackerConfig, simd: SimdLevel) -> Self {
        Self {
            relocaliser: Relocaliser::new(config, simd),
            places: PlaceIndex::default(),
            closed: Vec::new(),
            pause: 0,
        }
    }

    /// What was known of places and loops when a run was stopped; `keyframes` are the images of the keyframes.
    pub(super) fn restore(&mut self, saved: &SavedLoops, keyframes: &[RgbdFrame], camera: &PinholeCamera) {
        for image in keyframes {
            if let Ok(descriptor) = PlaceDescriptor::new(&image.rgb, camera) {
                self.places.push(image.index, descriptor);
            }
        }
        let closure = |(before, now, motion): &(usize, usize, PoseNumbers)| Closure {
            before: *before,
            now: *now,
            before_from_now: pose(*motion),
        };
        self.closed = saved.closed.iter().map(closure).collect();
        self.pause = saved.pause;
    }

    /// The loops that were closed, as a checkpoint keeps them.
    pub(super) fn saved(&self) -> SavedLoops {
        let closed = self.closed.iter().map(|c| (c.before, c.now, numbers(&c.before_from_now))).collect();
        SavedLoops { closed, pause: self.pause }
    }

    /// For questions about views.
    pub(super) fn relocaliser(&mut self) -> &mut Relocaliser {
        &mut self.relocaliser
    }

    /// Loops that were closed.
    pub(super) fn closed(&self) -> usize {
        self.closed.len()
    }

    /// Remembers the newest keyframe, and forgets those that the map has given up.
    pub(super) fn remember(&mut self, map: &GrowingMap, image: &RgbdFrame) {
        let known = |id: usize| map.bundle.frames.iter().any(|frame| frame.keyframe.index == id);
        self.places.retain(known);
        if let Ok(descriptor) = PlaceDescriptor::new(&image.rgb, &map.sensor.camera) {
            self.places.push(image.index, descriptor);
        }
    }

    /// Where a lost frame is: the view of the keyframe it was recognised in, to start from.
    pub(super) fn find(&mut self, map: &GrowingMap, image: &RgbdFrame) -> Option<SharpView> {
        let (_, view, measurement) = self.recognise(map, image, |_| true)?;
        Some(SharpView { start_from: Some(measurement.world_from_camera), ..view })
    }

    /// Looks for an older place in the newest keyframe, whose frame is given. If the map says otherwise where that is,
    /// returns poses of all keyframes that agree better.
    pub(super) fn correct(&mut self, map: &GrowingMap, image: &RgbdFrame) -> Option<Vec<RigidTransform>> {
        if self.pause > 0 {
            self.pause -= 1;
            return None;
        }
        let frames = &map.bundle.frames;
        let newest = frames.len().checked_sub(1)?;
        // Keyframes just before are always similar, and say nothing about drift.
        let recent = match map.retired {
            0 => RECENT,
            _ => RECENT.min((RECENT_SHARE * frames.len() as f64) as usize),
        };
        let old = &frames[..newest.saturating_sub(recent)];
        let old: Vec<usize> = old.iter().map(|frame| frame.keyframe.index).collect();
        let (before, view, measurement) = self.recognise(map, image, |id| old.contains(&id))?;
        // Where the map says that the newest keyframe is, in pixels from where the old place says it is.
        let MappedFrame { keyframe, state } = &frames[newest];
        let (now, depth) = (state.path.mid(), keyframe.depth);
        let camera = &map.sensor.camera;
        if view_change(&measurement.world_from_camera, &now, camera, depth) < DRIFT * camera.width as f64 {
            self.pause = PAUSE;
            return None;
        }
        // All closures so far count again: the graph may find a mistake among them.
        let before_from_now = view.world_from_camera.inverse().compose(&measurement.world_from_camera);
        self.closed.push(Closure { before, now: image.index, before_from_now });
        let mut graph = self.graph(map);
        let report = graph.optimise(&PoseGraphSettings::default()).ok()?;
        let last = graph.edges.len().checked_sub(1)?;
        // The new one contradicts the rest.
        if report.rejected.contains(&last) {
            self.closed.pop();
            return None;
        }
        Some(graph.world_from_keyframe)
    }

    /// The first of the most similar keyframes, of those that are eligible, that the frame can be aligned with.
    fn recognise(
        &mut self,
        map: &GrowingMap,
        image: &RgbdFrame,
        is_eligible: impl Fn(usize) -> bool,
    ) -> Option<(usize, SharpView, PoseMeasurement)> {
        let descriptor = PlaceDescriptor::new(&image.rgb, &map.sensor.camera).ok()?;
        let candidates = self.places.candidates(&descriptor, MOST_CANDIDATES, MIN_SIMILARITY, is_eligible);
        candidates.into_iter().find_map(|candidate| {
            let mut frames = map.bundle.frames.iter();
            let frame = frames.find(|frame| frame.keyframe.index == candidate.id)?;
            let view = self.relocaliser.keyframe_view(frame, map.sensor.depth_scale);
            let guess = view.world_from_camera.compose(&candidate.stored_from_query);
            let measurement = self.relocaliser.align_to(image, &view, &guess)?;
            Some((candidate.id, view, measurement))
        })
    }

    /// Keyframes in the order of time, tied by their motions so far and by the places that were seen again.
    fn graph(&self, map: &GrowingMap) -> PoseGraph {
        let frames = &map.bundle.frames;
        let world_from_keyframe: Vec<RigidTransform> =
            frames.iter().map(|frame| frame.state.path.mid()).collect();
        let odometry = world_from_keyframe.windows(2).enumerate().map(|(from, pair)| {
            let from_from_to = pair[0].inverse().compose(&pair[1]);
            // Drift grows with the way.
            let (metres, radians, share) = ODOMETRY;
            PoseGraphEdge {
                from,
                to: from + 1,
                from_from_to,
                translation_sigma: metres + share * from_from_to.translation.norm(),
                rotation_sigma: radians + share * from_from_to.rotation.angle(),
                robust: false,
            }
        });
        let node = |index: usize| frames.iter().position(|frame| frame.keyframe.index == index);
        let closures = self.closed.iter().filter_map(|closure| {
            Some(PoseGraphEdge {
                from: node(closure.before)?,
                to: node(closure.now)?,
                from_from_to: closure.before_from_now,
                translation_sigma: SIGHTING.0,
                rotation_sigma: SIGHTING.1,
                robust: true,
            })
        });
        let edges = odometry.chain(closures).collect();
        PoseGraph { world_from_keyframe, edges }
    }
}
