//! What can be chosen about the optimisation of a pose graph, and what it ends with.

use super::PoseGraphError;

/// Settings of [`PoseGraph::optimise`](super::PoseGraph::optimise).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseGraphSettings {
    /// Most linearisations between two decisions about robust edges, and after the last; 1 to 1000.
    pub max_iterations: usize,
    /// Cost of rejecting a robust edge, in squared standard deviations; positive. An edge is rejected when the
    /// graph is better off by more. The default is the 99.97 % quantile of chi-square with six degrees of freedom:
    /// graphs with honest standard deviations hardly ever disagree as much with a right edge.
    pub rejection_cost: f64,
    /// Optimisation ends when no tangent vector of a node is longer (metres and radians); positive.
    pub min_step: f64,
}

impl Default for PoseGraphSettings {
    fn default() -> Self {
        Self { max_iterations: 30, rejection_cost: 25.0, min_step: 1e-8 }
    }
}

impl PoseGraphSettings {
    pub(super) fn check(&self) -> Result<(), PoseGraphError> {
        let positive = f64::MIN_POSITIVE..=f64::MAX;
        let checks = [
            ("max_iterations", self.max_iterations as f64, 1.0..=1000.0, "1 to 1000"),
            ("rejection_cost", self.rejection_cost, positive.clone(), "a positive number"),
            ("min_step", self.min_step, positive, "a positive number"),
        ];
        match checks.into_iter().find(|(_, value, range, _)| !range.contains(value)) {
            Some((name, value, _, expected)) => Err(PoseGraphError::Setting { name, value, expected }),
            None => Ok(()),
        }
    }
}

/// What [`PoseGraph::optimise`](super::PoseGraph::optimise) ended with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseGraphReport {
    /// Linearisations in all.
    pub iterations: usize,
    /// Squared disagreement of all edges in standard deviations, each robust edge at most
    /// [`PoseGraphSettings::rejection_cost`], before.
    pub initial_cost: f64,
    /// The same after.
    pub final_cost: f64,
    /// Indices of the robust edges that were rejected, in ascending order.
    pub rejected: Vec<usize>,
    /// Whether the last steps were below [`PoseGraphSettings::min_step`].
    pub converged: bool,
}
