//! One trajectory from both ways.

use mba_adjust::pose_graph::{PoseGraph, PoseGraphEdge, PoseGraphError, PoseGraphSettings};
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::geometry::RigidTransform;

use super::backwards::SeenBackwards;
use crate::tracking::Measured;

/// Least standard deviations of a measured motion, metres and radians: what no alignment is better than.
const LEAST_SIGMA: [f64; 2] = [2e-4, 1e-4];

/// How much more uncertain a measured motion is than its alignment says: what moves several frames alike, as a keyframe whose
/// rows were put right a little wrongly, is in no residual.
const DEPENDENCE: f64 = 3.0;

/// How much more uncertain yet what was aligned with a first keyframe is, whose path was learnt from a single other frame.
pub(super) const FIRST_KEYFRAME: f64 = 4.0;

/// The motion from a frame's reference to the frame, as one way measured it; `factor` times as uncertain as usual. What is
/// `doubted` is left out where it contradicts the rest.
pub(super) fn edge(
    frame: usize,
    measured: &Measured,
    world_from_mid: impl Fn(usize) -> RigidTransform,
    factor: f64,
    doubted: bool,
) -> Option<PoseGraphEdge> {
    let is_measured = measured.reference != frame && measured.sigma.iter().all(|sigma| *sigma > 0.0);
    let [translation_sigma, rotation_sigma] =
        [0, 1].map(|kind| measured.sigma[kind].max(LEAST_SIGMA[kind]) * DEPENDENCE * factor);
    (is_measured && (translation_sigma + rotation_sigma).is_finite()).then(|| PoseGraphEdge {
        from: measured.reference,
        to: frame,
        from_from_to: world_from_mid(measured.reference).inverse().compose(&world_from_mid(frame)),
        translation_sigma,
        rotation_sigma,
        robust: doubted,
    })
}

/// One trajectory from both ways.
pub(super) struct Joined {
    /// Mid poses that agree best with what both ways measured.
    pub(super) world_from_mid: Vec<RigidTransform>,
    /// Whether what the first way and the way back say of each frame agrees with them.
    pub(super) agrees: Vec<[bool; 2]>,
    /// Frames that are tied together by what was not left out have the same number.
    pub(super) part: Vec<usize>,
}

/// Joins what both ways measured of every frame, `ways`, and what was measured of places that were seen `again`; `forwards` are
/// the poses of the first way.
///
/// Where the ways contradict each other, what contradicts more of the rest is left out, and if nothing else decides, what is
/// less certain of itself.
pub(super) fn joined(
    forwards: Vec<RigidTransform>,
    ways: &[[Option<PoseGraphEdge>; 2]],
    again: &[PoseGraphEdge],
) -> Result<Joined, PoseGraphError> {
    let settings = PoseGraphSettings::default();
    let (origins, mut edges): (Vec<[usize; 2]>, Vec<PoseGraphEdge>) = ways
        .iter()
        .enumerate()
        .flat_map(|(frame, ways)| [0, 1].map(|way| ways[way].map(|edge| ([frame, way], edge))))
        .flatten()
        .unzip();
    edges.extend(again);
    // Neither way is right from the beginning: the start is the middle between both.
    let believed = edges.iter().map(|edge| PoseGraphEdge { robust: false, ..*edge }).collect();
    let mut graph = PoseGraph { world_from_keyframe: forwards.clone(), edges: believed };
    graph.optimise(&settings)?;
    graph.edges = edges;
    let mut rejected = graph.optimise(&settings)?.rejected;
    if !is_connected(&graph, &rejected) {
        // Both ways to a frame were left out. The first way does not lose any.
        graph.world_from_keyframe = forwards;
        graph.edges.iter_mut().zip(&origins).for_each(|(edge, [_, way])| edge.robust &= *way == 1);
        rejected = graph.optimise(&settings)?.rejected;
    }
    let mut agrees = vec![[true; 2]; ways.len()];
    // Edges of places come last.
    for [frame, way] in rejected.iter().filter_map(|edge| origins.get(*edge).copied()) {
        agrees[frame][way] = false;
    }
    let part = parts(&graph, &rejected);
    Ok(Joined { world_from_mid: graph.world_from_keyframe, agrees, part })
}

/// Whether what is tied together by all edges is so without those that were rejected, in ascending order.
fn is_connected(graph: &PoseGraph, rejected: &[usize]) -> bool {
    let count = |part: &[usize]| part.iter().enumerate().filter(|(node, part)| node == *part).count();
    count(&parts(graph, &[])) == count(&parts(graph, rejected))
}

/// For every node the one that stands for all that are tied to it by edges other than those that were rejected, in ascending
/// order.
fn parts(graph: &PoseGraph, rejected: &[usize]) -> Vec<usize> {
    let mut part: Vec<usize> = (0..graph.world_from_keyframe.len()).collect();
    let counted = graph.edges.iter().enumerate().filter(|(edge, _)| rejected.binary_search(edge).is_err());
    for (_, edge) in counted {
        let [one, other] = [edge.from, edge.to].map(|node| root(&part, node));
        part[one] = other;
    }
    (0..part.len()).map(|node| root(&part, node)).collect()
}

/// The node that stands for the part which `node` belongs to.
fn root(part: &[usize], mut node: usize) -> usize {
    while part[node] != node {
        node = part[node];
    }
    node
}

/// What both ways say of the exposure of one frame.
pub(super) struct Ends<'a> {
    pub(super) forwards: &'a TimedExposure,
    /// Whether that agrees with the joined trajectory.
    pub(super) forwards_agrees: bool,
    /// The way back, where it agrees.
    pub(super) back: Option<&'a SeenBackwards>,
}

impl Ends<'_> {
    /// The exposure around `world_from_mid`: what agrees, or between both ways.
    pub(super) fn around(&self, world_from_mid: &RigidTransform) -> TimedExposure {
        let of = |exposure: &TimedExposure| {
            let mid_from_world = exposure.mid.inverse();
            [exposure.start, exposure.end].map(|end| mid_from_world.compose(&end))
        };
        let mut ends = of(self.forwards);
        if let Some(back) = self.back {
            let others = of(&back.exposure);
            let share = if self.forwards_agrees { 0.5 } else { 1.0 };
            ends = [0, 1].map(|k| ends[k].perturbed(&(ends[k].tangent_to(&others[k]) * share)));
        }
        let [start, end] = ends.map(|end| world_from_mid.compose(&end));
        TimedExposure { timestamp: self.forwards.timestamp, start, mid: *world_from_mid, end }
    }
}

#[cfg(test)]
mod tests {
    use mba_tracker::FrameStatus;
    use nalgebra::Vector3;

    use super::*;

    fn at(x: f64) -> RigidTransform {
        RigidTransform { translation: Vector3::new(x, 0.0, 0.0), ..RigidTransform::identity() }
    }

    fn measured(reference: usize) -> Measured {
        Measured { reference, sigma: [1e-3, 1e-3] }
    }

    /// Both ways along a line of five frames, which have them at `forwards`, from the first, and at `backwards`, from the last but
    /// one, a keyframe of the way back.
    fn line(forwards: [f64; 5], backwards: [f64; 5]) -> Joined {
        let [forwards, backwards] = [forwards, backwards].map(|way| way.map(at));
        let ways: Vec<_> = (0..5)
            .map(|frame| {
                let keyframe = if frame < 3 { 3 } else { 4 };
                let back = edge(frame, &measured(keyframe), |k| backwards[k], 1.0, true);
                [edge(frame, &measured(0), |k| forwards[k], 1.0, back.is_some()), back]
            })
            .collect();
        joined(forwards.to_vec(), &ways, &[]).unwrap()
    }

    fn places(joined: &Joined) -> Vec<f64> {
        joined.world_from_mid.iter().map(|pose| pose.translation.x).collect()
    }

    #[test]
    fn both_ways_share_what_they_differ_by() {
        let joined = line([0.0, 1.0, 2.0, 3.004, 4.0], [0.0, 1.0, 2.0, 3.0, 4.0]);
        let places = places(&joined);
        // One way leads from frame 0 to frame 3 over 3.004, four over 3.000: straight back, and by frames 1, 2 and 4.
        assert!(places[3] > 3.0005 && places[3] < 3.003, "{places:?}");
        assert_eq!(joined.agrees, [[true; 2]; 5]);
    }

    #[test]
    fn what_contradicts_more_of_the_rest_is_left_out_whichever_way_said_it() {
        let right = [0.0, 1.0, 2.0, 3.0, 4.0];
        for (forwards, backwards, mistaken) in
            [([0.0, 1.0, 2.0, 3.3, 4.0], right, [3, 0]), (right, [0.3, 1.0, 2.0, 3.0, 4.0], [0, 1])]
        {
            let joined = line(forwards, backwards);
            assert!((places(&joined)[3] - 3.0).abs() < 0.01, "{:?}", places(&joined));
            let mut agrees = [[true; 2]; 5];
            agrees[mistaken[0]][mistaken[1]] = false;
            assert_eq!(joined.agrees, agrees);
        }
    }

    #[test]
    fn a_place_that_is_seen_again_takes_the_drift_away() {
        // Each frame is known by the one before, and the way has become longer by a centimetre.
        let way = [0.0, 1.0, 2.0, 1.01, 0.01].map(at);
        let ways: Vec<_> = (0..5_usize)
            .map(|k| [edge(k, &measured(k.saturating_sub(1)), |k| way[k], 1.0, false), None])
            .collect();
        let again = |x: f64| edge(4, &measured(0), |k| if k == 4 { at(x) } else { at(0.0) }, 0.1, true);
        let end = |again: Option<PoseGraphEdge>| {
            let joined = joined(way.to_vec(), &ways, &Vec::from_iter(again)).unwrap();
            places(&joined)[4]
        };
        assert!((end(None) - 0.01).abs() < 1e-9);
        assert!(end(again(0.0)).abs() < 1e-3);
        // Another place that looks alike.
        assert!((end(again(0.7)) - 0.01).abs() < 1e-6);
    }

    #[test]
    fn of_two_that_contradict_each_other_the_more_certain_is_believed() {
        for certain in [0, 1] {
            let edges = [0, 1].map(|way| PoseGraphEdge {
                from: 0,
                to: 1,
                from_from_to: at(1.0 + 0.3 * way as f64),
                translation_sigma: if way == certain { 1e-3 } else { 3e-3 },
                rotation_sigma: 1e-3,
                robust: true,
            });
            let joined = joined(vec![at(0.0), at(1.0)], &[[None, None], edges.map(Some)], &[]).unwrap();
            assert!((places(&joined)[1] - (1.0 + 0.3 * certain as f64)).abs() < 1e-6);
            assert_eq!(joined.agrees[1], [certain == 0, certain == 1]);
        }
    }

    #[test]
    fn what_nothing_ties_any_more_is_noticed() {
        let tie = |from: usize, to: usize| edge(to, &measured(from), |_| at(0.0), 1.0, true).unwrap();
        let graph =
            PoseGraph { world_from_keyframe: vec![at(0.0); 4], edges: vec![tie(0, 1), tie(1, 2), tie(0, 2)] };
        // Nothing ever tied frame 3.
        assert!(is_connected(&graph, &[]) && is_connected(&graph, &[1]));
        assert!(!is_connected(&graph, &[1, 2]));
        let [whole, cut] = [parts(&graph, &[1]), parts(&graph, &[0, 2])];
        assert!(whole[0] == whole[1] && whole[1] == whole[2] && whole[3] != whole[0], "{whole:?}");
        assert!(cut[1] == cut[2] && cut[0] != cut[1], "{cut:?}");
    }

    #[test]
    fn a_frame_that_was_not_aligned_measures_nothing() {
        let own = Measured { reference: 2, sigma: [1e-3, 1e-3] };
        let none = Measured { reference: 1, sigma: [0.0, 0.0] };
        assert!(edge(2, &own, |_| at(0.0), 1.0, false).is_none());
        assert!(edge(2, &none, |_| at(0.0), 1.0, false).is_none());
    }

    #[test]
    fn exposures_meet_in_the_middle_around_the_joined_pose_unless_one_is_mistaken() {
        let exposure = |start: f64, mid: f64, end: f64| TimedExposure {
            timestamp: 1.0,
            start: at(start),
            mid: at(mid),
            end: at(end),
        };
        let back = SeenBackwards {
            status: FrameStatus::Ok,
            exposure: exposure(6.8, 7.0, 7.2),
            blur_px: 3.0,
            measured: measured(0),
        };
        let forwards = exposure(1.9, 2.0, 2.1);
        for (back, forwards_agrees, half) in
            [(Some(&back), true, 0.15), (Some(&back), false, 0.2), (None, true, 0.1)]
        {
            let joined = Ends { forwards: &forwards, forwards_agrees, back }.around(&at(3.0));
            assert_eq!(joined.timestamp, 1.0);
            assert!((joined.start.translation.x - (3.0 - half)).abs() < 1e-12);
            assert!((joined.end.translation.x - (3.0 + half)).abs() < 1e-12);
        }
    }
}
