//! The optimisation: Levenberg-Marquardt steps within graduated decisions about robust edges.

use mba_tracker::geometry::RigidTransform;
use nalgebra::Vector6;

use super::kernel::Graduation;
use super::system::NormalEquations;
use super::{PoseGraph, PoseGraphError, PoseGraphReport, PoseGraphSettings};

/// Share of the diagonal that is added at first.
const FIRST_DAMPING: f64 = 1e-9;

/// Damping beyond which no step is worth trying.
const LARGEST_DAMPING: f64 = 1e6;

/// Linearisations for each value of the control parameter: the next one changes the weights anyway.
const ITERATIONS_PER_GRADUATION: usize = 2;

/// Most times that rejected edges, which agree with the result after all, are taken in again.
const MAX_READMISSIONS: usize = 4;

impl PoseGraph {
    /// Moves the nodes to where they agree best with the edges. Takes milliseconds for hundreds of nodes, on one
    /// thread; equal graphs give equal results, bit for bit.
    ///
    /// # Errors
    /// [`PoseGraphError`] when a number makes no sense; the graph is then unchanged.
    pub fn optimise(&mut self, settings: &PoseGraphSettings) -> Result<PoseGraphReport, PoseGraphError> {
        settings.check()?;
        self.check()?;
        let mut solver = Solver::new(self, settings);
        let initial_cost = solver.truncated_cost();
        // Which edges are mistakes is decided first, then the rest is solved, then what agrees after all comes back.
        solver.graduate();
        let mut converged = solver.descend(settings.max_iterations);
        for _ in 0..MAX_READMISSIONS {
            if !solver.readmit() {
                break;
            }
            converged = solver.descend(settings.max_iterations);
        }
        let report = PoseGraphReport {
            iterations: solver.iterations,
            initial_cost,
            final_cost: solver.truncated_cost(),
            rejected: solver.rejected(),
            converged,
        };
        self.world_from_keyframe = solver.poses;
        Ok(report)
    }

    fn check(&self) -> Result<(), PoseGraphError> {
        if let Some(node) = self.world_from_keyframe.iter().position(|pose| !pose.is_valid()) {
            return Err(PoseGraphError::NodePose { node });
        }
        let nodes = self.world_from_keyframe.len();
        for (index, edge) in self.edges.iter().enumerate() {
            if let Some(node) = [edge.from, edge.to].into_iter().find(|&node| node >= nodes) {
                return Err(PoseGraphError::NodeOutOfRange { edge: index, node, nodes });
            }
            if edge.from == edge.to {
                return Err(PoseGraphError::SelfEdge { edge: index, node: edge.from });
            }
            if !edge.from_from_to.is_valid() {
                return Err(PoseGraphError::EdgePose { edge: index });
            }
            let (translation, rotation) = (edge.translation_sigma, edge.rotation_sigma);
            if ![translation, rotation].iter().all(|sigma| *sigma > 0.0 && sigma.is_finite()) {
                return Err(PoseGraphError::Sigma { edge: index, translation, rotation });
            }
        }
        Ok(())
    }

    /// For every node its index among the unknowns; none for those that are held: the first one, and all that
    /// nothing connects with it.
    fn unknowns(&self) -> Vec<Option<usize>> {
        let mut neighbours = vec![Vec::new(); self.world_from_keyframe.len()];
        for edge in &self.edges {
            neighbours[edge.from].push(edge.to);
            neighbours[edge.to].push(edge.from);
        }
        let mut reached = vec![false; neighbours.len()];
        // A search from the first node: what it does not reach has nothing to hold it.
        let mut open = Vec::from_iter(reached.first_mut().map(|first| {
            *first = true;
            0
        }));
        while let Some(node) = open.pop() {
            for &next in &neighbours[node] {
                if !reached[next] {
                    reached[next] = true;
                    open.push(next);
                }
            }
        }
        let mut count = 0..;
        let index = |(node, reached): (usize, bool)| if reached && node > 0 { count.next() } else { None };
        reached.into_iter().enumerate().map(index).collect()
    }
}

/// A graph under way.
struct Solver<'g> {
    graph: &'g PoseGraph,
    settings: &'g PoseGraphSettings,
    poses: Vec<RigidTransform>,
    unknowns: Vec<Option<usize>>,
    /// Of every edge.
    weights: Vec<f64>,
    damping: f64,
    iterations: usize,
}

impl<'g> Solver<'g> {
    fn new(graph: &'g PoseGraph, settings: &'g PoseGraphSettings) -> Self {
        Self {
            graph,
            settings,
            poses: graph.world_from_keyframe.clone(),
            unknowns: graph.unknowns(),
            weights: vec![1.0; graph.edges.len()],
            damping: FIRST_DAMPING,
            iterations: 0,
        }
    }

    /// Decides which robust edges count: their weights become 0 or 1.
    fn graduate(&mut self) {
        let robust: Vec<usize> = (0..self.weights.len()).filter(|&k| self.graph.edges[k].robust).collect();
        let largest = robust.iter().map(|&k| self.squared_error(k, &self.poses)).fold(0.0, f64::max);
        if robust.is_empty() {
            return;
        }
        // Graduated non-convexity: from a cost that is nearly quadratic for all edges to one that is truncated.
        let mut graduation = Graduation::new(self.settings.rejection_cost, largest);
        loop {
            for &k in &robust {
                self.weights[k] = graduation.weight(self.squared_error(k, &self.poses));
            }
            if graduation.is_tight() || robust.iter().all(|&k| matches!(self.weights[k], 0.0 | 1.0)) {
                break;
            }
            // The poses follow a little before edges are judged more strictly.
            self.descend(ITERATIONS_PER_GRADUATION);
            graduation.tighten();
        }
        for &k in &robust {
            // What was still undecided at the end counts or does not.
            self.weights[k] = self.weights[k].round();
        }
    }

    /// Takes in rejected edges that agree with the rest; whether there was one.
    fn readmit(&mut self) -> bool {
        let agreeing: Vec<usize> = (0..self.weights.len())
            .filter(|&k| self.weights[k] == 0.0)
            .filter(|&k| self.squared_error(k, &self.poses) < self.settings.rejection_cost)
            .collect();
        agreeing.iter().for_each(|&k| self.weights[k] = 1.0);
        !agreeing.is_empty()
    }

    /// Minimises the weighted squares; whether the steps became small.
    fn descend(&mut self, max_iterations: usize) -> bool {
        let mut cost = self.weighted_cost(&self.poses);
        for _ in 0..max_iterations {
            self.iterations += 1;
            match self.improved(cost) {
                Some((poses, new_cost, step)) => {
                    self.poses = poses;
                    cost = new_cost;
                    if step < self.settings.min_step {
                        return true;
                    }
                }
                // Nothing is better than where it is.
                None => return true,
            }
        }
        false
    }

    /// Poses of lower cost than `cost`, their cost and the longest step; none if there are none.
    fn improved(&mut self, cost: f64) -> Option<(Vec<RigidTransform>, f64, f64)> {
        while self.damping < LARGEST_DAMPING {
            let moved = self.normal_equations().solve(self.damping).map(|steps| self.moved(&steps));
            if let Some((poses, step)) = moved {
                let new_cost = self.weighted_cost(&poses);
                if new_cost <= cost {
                    self.damping = FIRST_DAMPING.max(0.1 * self.damping);
                    return Some((poses, new_cost, step));
                }
                // Rounding alone decides whether steps as small as these are better.
                if step < self.settings.min_step {
                    break;
                }
            }
            self.damping *= 100.0;
        }
        self.damping = FIRST_DAMPING;
        None
    }

    fn normal_equations(&self) -> NormalEquations {
        let mut equations = NormalEquations::new(self.unknowns.iter().flatten().count());
        for (edge, weight) in self.graph.edges.iter().zip(&self.weights) {
            let (from, to) = (self.unknowns[edge.from], self.unknowns[edge.to]);
            if *weight > 0.0 && (from.is_some() || to.is_some()) {
                let linear = edge.linearised(&self.poses[edge.from], &self.poses[edge.to]);
                equations.add(&linear, *weight, from, to);
            }
        }
        equations
    }

    fn moved(&self, steps: &[Vector6<f64>]) -> (Vec<RigidTransform>, f64) {
        let step = |(pose, unknown): (&RigidTransform, &Option<usize>)| match unknown {
            Some(index) => pose.perturbed(&steps[*index]),
            None => *pose,
        };
        let poses = self.poses.iter().zip(&self.unknowns).map(step).collect();
        (poses, steps.iter().map(|step| step.norm()).fold(0.0, f64::max))
    }

    fn squared_error(&self, edge: usize, poses: &[RigidTransform]) -> f64 {
        let edge = &self.graph.edges[edge];
        edge.squared_error(&poses[edge.from], &poses[edge.to])
    }

    fn weighted_cost(&self, poses: &[RigidTransform]) -> f64 {
        self.weights.iter().enumerate().map(|(k, weight)| weight * self.squared_error(k, poses)).sum()
    }

    fn truncated_cost(&self) -> f64 {
        let limit = |robust: bool| if robust { self.settings.rejection_cost } else { f64::INFINITY };
        let edges = self.graph.edges.iter().enumerate();
        edges.map(|(k, edge)| self.squared_error(k, &self.poses).min(limit(edge.robust))).sum()
    }

    fn rejected(&self) -> Vec<usize> {
        (0..self.weights.len()).filter(|&k| self.weights[k] == 0.0).collect()
    }
}
