//! Rings with known truth.

use std::f64::consts::TAU;

use mba_tracker::geometry::{RigidTransform, so3};
use nalgebra::{Vector3, Vector6};
use rand_core::Rng;
use rand_pcg::Pcg64Mcg;

use super::{PoseGraph, PoseGraphEdge, PoseGraphError, PoseGraphSettings};

const TRANSLATION_SIGMA: f64 = 0.002;
const ROTATION_SIGMA: f64 = 0.002;

/// Cameras on a circle of 1.5 m, looking outward, up and down.
fn ring(nodes: usize) -> Vec<RigidTransform> {
    let pose = |k: usize| {
        let angle = TAU * k as f64 / nodes as f64;
        let place = Vector3::new(angle.sin(), 0.2 * (3.0 * angle).sin(), angle.cos()) * 1.5;
        let rotation = so3::exp(&(Vector3::y() * angle)) * so3::exp(&(Vector3::x() * (0.2 * angle.cos())));
        RigidTransform::new(rotation, place)
    };
    (0..nodes).map(pose).collect()
}

/// Uniform numbers of unit variance.
fn noise(random: &mut Pcg64Mcg) -> f64 {
    3.0_f64.sqrt() * (random.next_u64() as f64 / u64::MAX as f64 * 2.0 - 1.0)
}

fn measured(truth: &[RigidTransform], from: usize, to: usize, error: &Vector6<f64>) -> PoseGraphEdge {
    let from_from_to = truth[from].inverse().compose(&truth[to]).perturbed(error);
    PoseGraphEdge {
        from,
        to,
        from_from_to,
        translation_sigma: TRANSLATION_SIGMA,
        rotation_sigma: ROTATION_SIGMA,
        robust: false,
    }
}

/// Odometry round the ring with noise, and a bias that makes it drift; poses follow it.
fn drifting(truth: &[RigidTransform], bias: f64) -> PoseGraph {
    let mut random = Pcg64Mcg::new(7);
    let mut graph = PoseGraph { world_from_keyframe: vec![truth[0]], edges: Vec::new() };
    for k in 1..truth.len() {
        let error = Vector6::from_fn(|row, _| {
            let sigma = if row < 3 { TRANSLATION_SIGMA } else { ROTATION_SIGMA };
            sigma * (bias + noise(&mut random))
        });
        let edge = measured(truth, k - 1, k, &error);
        graph.world_from_keyframe.push(graph.world_from_keyframe[k - 1].compose(&edge.from_from_to));
        graph.edges.push(edge);
    }
    graph
}

fn loop_edge(truth: &[RigidTransform], from: usize, to: usize, error: &Vector6<f64>) -> PoseGraphEdge {
    PoseGraphEdge { robust: true, ..measured(truth, from, to, error) }
}

fn position_error(graph: &PoseGraph, truth: &[RigidTransform], node: usize) -> f64 {
    (graph.world_from_keyframe[node].translation - truth[node].translation).norm()
}

fn mean_error(graph: &PoseGraph, truth: &[RigidTransform]) -> f64 {
    (0..truth.len()).map(|node| position_error(graph, truth, node)).sum::<f64>() / truth.len() as f64
}

#[test]
fn one_exact_loop_edge_takes_the_drift_out_of_a_ring() {
    let truth = ring(40);
    let mut graph = drifting(&truth, 0.2);
    let (drift, mean) = (position_error(&graph, &truth, 39), mean_error(&graph, &truth));
    assert!(drift > 0.02, "{drift} m");
    graph.edges.push(PoseGraphEdge {
        translation_sigma: 1e-4,
        rotation_sigma: 1e-4,
        ..loop_edge(&truth, 39, 0, &Vector6::zeros())
    });
    let report = graph.optimise(&PoseGraphSettings::default()).unwrap();
    let end = position_error(&graph, &truth, 39);
    println!(
        "drift {drift:.4} m, then {end:.5} m; mean {mean:.4} m, then {:.4} m",
        mean_error(&graph, &truth)
    );
    println!("{report:?}");
    assert!(report.converged && report.rejected.is_empty(), "{report:?}");
    assert!(end < 0.05 * drift, "{end} m of {drift} m");
    assert!(mean_error(&graph, &truth) < 0.6 * mean);
    assert_eq!(graph.world_from_keyframe[0], truth[0], "the first node is held");
}

#[test]
fn wrong_edges_are_rejected_and_right_ones_kept() {
    let truth = ring(40);
    let right = [(39, 0), (38, 1), (36, 2)];
    let mut clean = drifting(&truth, 0.2);
    let mut random = Pcg64Mcg::new(3);
    let mut error = |scale: f64| Vector6::from_fn(|_, _| scale * TRANSLATION_SIGMA * noise(&mut random));
    clean.edges.extend(right.map(|(from, to)| loop_edge(&truth, from, to, &error(1.0))));
    let mut spoilt = clean.clone();
    // From two centimetres and a degree to a different room.
    let wrong = [(30, 5, 10.0), (25, 3, 40.0), (33, 12, 400.0), (20, 1, 1000.0)];
    let first_wrong = spoilt.edges.len();
    spoilt.edges.extend(wrong.map(|(from, to, scale)| loop_edge(&truth, from, to, &error(scale))));
    clean.optimise(&PoseGraphSettings::default()).unwrap();
    let report = spoilt.optimise(&PoseGraphSettings::default()).unwrap();
    println!("{report:?}");
    assert_eq!(report.rejected, Vec::from_iter(first_wrong..first_wrong + wrong.len()));
    for (a, b) in clean.world_from_keyframe.iter().zip(&spoilt.world_from_keyframe) {
        assert!(a.tangent_to(b).norm() < 1e-6);
    }
}

#[test]
fn a_wrong_edge_alone_does_not_bend_the_graph() {
    let truth = ring(40);
    let before = drifting(&truth, 0.0);
    // Edges that claim to be far better than odometry.
    for scale in [0.2, 1.0, 3.0] {
        let mut graph = before.clone();
        let error = Vector6::new(scale, -scale, 0.5 * scale, 0.2 * scale, 0.5 * scale, 0.0);
        let edge = loop_edge(&truth, 39, 0, &error);
        graph.edges.push(PoseGraphEdge { translation_sigma: 2e-4, rotation_sigma: 2e-4, ..edge });
        let report = graph.optimise(&PoseGraphSettings::default()).unwrap();
        assert_eq!(report.rejected, [39], "{scale}: {report:?}");
        for (a, b) in before.world_from_keyframe.iter().zip(&graph.world_from_keyframe) {
            assert!(a.tangent_to(b).norm() < 1e-6, "{scale}");
        }
    }
}

#[test]
fn three_hundred_nodes_with_loops_are_solved_to_the_minimum() {
    let round = ring(100);
    let truth: Vec<_> = (0..300).map(|k| round[k % 100]).collect();
    let mut graph = drifting(&truth, 0.1);
    for k in (100..300).step_by(10) {
        graph.edges.push(loop_edge(&truth, k, k - 100, &Vector6::zeros()));
    }
    let started = std::time::Instant::now();
    let report = graph.optimise(&PoseGraphSettings::default()).unwrap();
    println!("{:.1} ms, {report:?}", started.elapsed().as_secs_f64() * 1e3);
    assert!(report.converged && report.rejected.is_empty(), "{report:?}");
    // At the minimum no single node gains by moving.
    let cost = |graph: &PoseGraph| -> f64 {
        let pose = |node: usize| &graph.world_from_keyframe[node];
        graph.edges.iter().map(|edge| edge.squared_error(pose(edge.from), pose(edge.to))).sum()
    };
    let least = cost(&graph);
    assert!((least - report.final_cost).abs() < 1e-9 * least);
    for (node, axis) in [(1, 0), (57, 3), (150, 1), (222, 4), (299, 5)] {
        for step in [-1e-5, 1e-5] {
            let mut moved = graph.clone();
            let by = Vector6::from_fn(|row, _| if row == axis { step } else { 0.0 });
            moved.world_from_keyframe[node] = graph.world_from_keyframe[node].perturbed(&by);
            assert!(cost(&moved) > least, "node {node}, axis {axis}");
        }
    }
}

#[test]
fn nodes_without_connection_are_held() {
    let truth = ring(8);
    let mut graph = drifting(&truth, 1.0);
    graph.edges.remove(4);
    // Nodes 5 to 7 hang together, but not with the first.
    graph.edges.push(loop_edge(&truth, 7, 5, &Vector6::zeros()));
    graph.edges.push(loop_edge(&truth, 4, 0, &Vector6::zeros()));
    let before = graph.clone();
    graph.optimise(&PoseGraphSettings::default()).unwrap();
    assert_eq!(graph.world_from_keyframe[5..], before.world_from_keyframe[5..]);
    assert_eq!(graph.world_from_keyframe[0], before.world_from_keyframe[0]);
    assert_ne!(graph.world_from_keyframe[4], before.world_from_keyframe[4]);
    let mut empty = PoseGraph::default();
    assert!(empty.optimise(&PoseGraphSettings::default()).unwrap().converged);
}

#[test]
fn numbers_that_make_no_sense_are_named() {
    let truth = ring(4);
    let graph = drifting(&truth, 0.0);
    let error = |spoil: fn(&mut PoseGraph)| {
        let mut spoilt = graph.clone();
        spoil(&mut spoilt);
        let before = spoilt.clone();
        let error = spoilt.optimise(&PoseGraphSettings::default()).unwrap_err();
        assert_eq!(format!("{spoilt:?}"), format!("{before:?}"));
        error
    };
    assert_eq!(
        error(|graph| graph.edges[1].to = 4),
        PoseGraphError::NodeOutOfRange { edge: 1, node: 4, nodes: 4 }
    );
    assert_eq!(error(|graph| graph.edges[2].to = 2), PoseGraphError::SelfEdge { edge: 2, node: 2 });
    assert_eq!(
        error(|graph| graph.world_from_keyframe[3].translation.x = f64::INFINITY),
        PoseGraphError::NodePose { node: 3 }
    );
    assert_eq!(
        error(|graph| graph.edges[0].from_from_to.translation.y = f64::NAN),
        PoseGraphError::EdgePose { edge: 0 }
    );
    let message = error(|graph| graph.edges[0].rotation_sigma = 0.0).to_string();
    assert_eq!(message, "edge 0: standard deviations 0.002 m and 0 rad, both have to be positive");
    let settings = PoseGraphSettings { rejection_cost: f64::NAN, ..PoseGraphSettings::default() };
    assert!(matches!(graph.clone().optimise(&settings), Err(PoseGraphError::Setting { .. })));
}
