//! Normal equations of a pose graph, sparse.

use clarabel::algebra::CscMatrix;
use clarabel::qdldl::{QDLDLFactorisation, QDLDLSettings};
use nalgebra::{Matrix6, Vector6};

use super::edge::LinearEdge;

/// Unknowns of a node.
const DEGREES: usize = 6;

/// Information that every unknown has on its own, 1/m^2 or 1/rad^2: far below any measurement, it keeps nodes whose
/// edges are all rejected where they are.
const FLOOR: f64 = 1e-6;

/// `J^T W J` (its upper triangle) and `-J^T W r` of the unknown nodes.
#[derive(Debug)]
pub(super) struct NormalEquations {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
    diagonal: Vec<Matrix6<f64>>,
    descent: Vec<f64>,
}

impl NormalEquations {
    pub(super) fn new(unknown_nodes: usize) -> Self {
        Self {
            rows: Vec::new(),
            columns: Vec::new(),
            values: Vec::new(),
            diagonal: vec![Matrix6::zeros(); unknown_nodes],
            descent: vec![0.0; DEGREES * unknown_nodes],
        }
    }

    /// Adds an edge between two nodes; those that are held are none.
    pub(super) fn add(&mut self, edge: &LinearEdge, weight: f64, from: Option<usize>, to: Option<usize>) {
        for (node, jacobian) in [(from, &edge.jacobian_from), (to, &edge.jacobian_to)] {
            if let Some(node) = node {
                // H += w J^T J, b -= w J^T r, block by block.
                self.diagonal[node] += jacobian.transpose() * jacobian * weight;
                let descent: Vector6<f64> = jacobian.transpose() * edge.residual * -weight;
                for (k, value) in descent.iter().enumerate() {
                    self.descent[DEGREES * node + k] += value;
                }
            }
        }
        match (from, to) {
            (Some(from), Some(to)) if from < to => {
                self.push(from, to, &(edge.jacobian_from.transpose() * edge.jacobian_to * weight));
            }
            (Some(from), Some(to)) => {
                self.push(to, from, &(edge.jacobian_to.transpose() * edge.jacobian_from * weight))
            }
            _ => (),
        }
    }

    fn push(&mut self, row: usize, column: usize, block: &Matrix6<f64>) {
        for j in 0..DEGREES {
            // Of blocks on the diagonal the upper triangle only.
            let count = if row == column { j + 1 } else { DEGREES };
            for i in 0..count {
                self.rows.push(DEGREES * row + i);
                self.columns.push(DEGREES * column + j);
                self.values.push(block[(i, j)]);
            }
        }
    }

    /// Steps of the unknown nodes with the diagonal raised by the share `damping`; none if there is no finite one.
    pub(super) fn solve(mut self, damping: f64) -> Option<Vec<Vector6<f64>>> {
        let size = self.descent.len();
        if size == 0 {
            return Some(Vec::new());
        }
        for node in 0..self.diagonal.len() {
            let mut block = self.diagonal[node];
            for k in 0..DEGREES {
                // Levenberg and Marquardt; the floor holds directions that no edge measures.
                block[(k, k)] += damping * block[(k, k)] + FLOOR;
            }
            self.push(node, node, &block);
        }
        let matrix = CscMatrix::new_from_triplets(size, size, self.rows, self.columns, self.values);
        let settings = QDLDLSettings { regularize_enable: false, ..QDLDLSettings::default() };
        // L D L^T of the sparse matrix.
        let mut factors = QDLDLFactorisation::new(&matrix, Some(settings)).ok()?;
        factors.solve(&mut self.descent);
        let steps = self.descent.chunks_exact(DEGREES).map(Vector6::from_column_slice);
        self.descent.iter().all(|step| step.is_finite()).then(|| steps.collect())
    }
}
