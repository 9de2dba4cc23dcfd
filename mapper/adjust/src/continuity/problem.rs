//! The second-order cone program of one half of the poses, translation or rotation.
//!
//! Unknown are the increments φ of the control points, the same program for both halves since rotations are linearised
//! at the current path. With residuals z of two instants of frame i, weights β, standard deviations σ and differences D
//! of the current control points:
//!
//! ```text
//! minimise    Σ_i ½ s_i² + h t_i  +  Σ_k ½ s_k² + h t_k
//! subject to  ‖((z_1 - Σ β φ) / σ_i, (z_2 - Σ β φ) / σ_i)‖ ≤ s_i + t_i,   t_i ≥ 0      (Huber of width h)
//!             ‖(D³_k + Δ³φ_k) / j_k‖ ≤ s_k + t_k,   t_k ≥ 0                            (jolts are rare, but real)
//!             ‖D²_k + Δ²φ_k‖ ≤ a_max step²,   ‖D³_k + Δ³φ_k‖ ≤ j_max step³
//! ```
//!
//! The control points bound the acceleration of the whole spline (convex hull), and its jerk is constant per piece.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT,
};
use nalgebra::Vector3;

use super::spline::Support;

/// How often limits that a solution breaks are added before all of them are.
const LIMIT_ROUNDS: usize = 3;

/// By how much a limit may be exceeded, as a share of it, without mattering.
const LIMIT_SLACK: f64 = 1e-3;

const SECOND_DIFFERENCE: [f64; 3] = [1.0, -2.0, 1.0];
const THIRD_DIFFERENCE: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];

/// One frame's residuals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observation {
    pub(super) supports: [Support; 2],
    /// From the current path to the measured ends, world vectors.
    pub(super) residuals: [Vector3<f64>; 2],
    pub(super) sigma: f64,
}

/// The data of the program; lengths in metres or radians.
#[derive(Clone, Debug)]
pub(super) struct Problem {
    pub(super) observations: Vec<Observation>,
    /// From each control point to the next, at the current path.
    pub(super) steps: Vec<Vector3<f64>>,
    /// Standard deviation of each third difference.
    pub(super) bending: Vec<f64>,
    pub(super) max_second: f64,
    pub(super) max_third: f64,
    pub(super) huber: f64,
}

impl Problem {
    /// The increments of the control points, or what the solver says instead.
    pub(super) fn solve(&self) -> Result<Vec<Vector3<f64>>, String> {
        // Limits are far away as a rule, and a program without them is much smaller.
        let mut limits = Limits { second: Vec::new(), third: Vec::new() };
        for _ in 0..LIMIT_ROUNDS {
            let increments = self.solve_within(&limits)?;
            let broken = self.broken(&increments);
            if broken.second.is_empty() && broken.third.is_empty() {
                return Ok(increments);
            }
            limits.add(broken);
        }
        self.solve_within(&self.all_limits())
    }

    fn solve_within(&self, limits: &Limits) -> Result<Vec<Vector3<f64>>, String> {
        let unit = self.unit();
        let program = self.program(limits, unit);
        let increments = program.solve(3 * self.controls())?;
        Ok(increments.chunks_exact(3).map(|x| Vector3::new(x[0], x[1], x[2]) * unit).collect())
    }

    fn controls(&self) -> usize {
        self.steps.len() + 1
    }

    /// Unit of the unknowns that makes the program's numbers moderate.
    fn unit(&self) -> f64 {
        self.observations.iter().map(|o| o.sigma).fold(f64::INFINITY, f64::min)
    }

    fn seconds(&self) -> Vec<Vector3<f64>> {
        self.steps.windows(2).map(|pair| pair[1] - pair[0]).collect()
    }

    fn thirds(&self) -> Vec<Vector3<f64>> {
        self.steps.windows(3).map(|w| w[2] - w[1] * 2.0 + w[0]).collect()
    }

    fn program(&self, limits: &Limits, unit: f64) -> Program {
        let controls = self.controls();
        let mut program =
            Program::new(3 * controls, self.observations.len() + self.bending.len(), self.huber);
        // 1. One Huber term per exposure: both of its meeting points, in standard deviations.
        for observation in &self.observations {
            program.add_huber(|rows| {
                for (support, residual) in observation.supports.iter().zip(&observation.residuals) {
                    let weights = support.weights.map(|weight| weight * unit / observation.sigma);
                    rows.add(support.first, &weights, &(residual / observation.sigma));
                }
            });
        }
        // 2. One per third difference, so that a jolt bends the path in one place instead of in all of its neighbours.
        for (k, (third, sigma)) in self.thirds().iter().zip(&self.bending).enumerate() {
            let weights = THIRD_DIFFERENCE.map(|c| -c * unit / sigma);
            program.add_huber(|rows| rows.add(k, &weights, &(third / *sigma)));
        }
        // 3. Limits of acceleration and jerk as cones, of which only those are given that a path without them would break.
        for (chosen, current, stencil, limit) in [
            (&limits.second, self.seconds(), &SECOND_DIFFERENCE[..], self.max_second),
            (&limits.third, self.thirds(), &THIRD_DIFFERENCE[..], self.max_third),
        ] {
            for &k in chosen {
                program.add_limit(k, stencil, unit / limit, &(current[k] / limit));
            }
        }
        program
    }

    /// The limits that the path breaks after these increments.
    fn broken(&self, increments: &[Vector3<f64>]) -> Limits {
        // Differences of what the increments make of the steps.
        let moved = increments.windows(2).zip(&self.steps).map(|(pair, step)| step + pair[1] - pair[0]);
        let after = Self { steps: moved.collect(), ..self.without_observations() };
        let beyond = |differences: Vec<Vector3<f64>>, limit: f64| {
            let broken =
                |(k, d): (usize, &Vector3<f64>)| (d.norm() > limit * (1.0 + LIMIT_SLACK)).then_some(k);
            differences.iter().enumerate().filter_map(broken).collect()
        };
        Limits {
            second: beyond(after.seconds(), self.max_second),
            third: beyond(after.thirds(), self.max_third),
        }
    }

    fn without_observations(&self) -> Self {
        Self { observations: Vec::new(), steps: Vec::new(), bending: Vec::new(), ..*self }
    }

    fn all_limits(&self) -> Limits {
        Limits { second: (0..self.steps.len() - 1).collect(), third: (0..self.steps.len() - 2).collect() }
    }
}

/// Which second and third differences are bounded.
struct Limits {
    second: Vec<usize>,
    third: Vec<usize>,
}

impl Limits {
    fn add(&mut self, more: Self) {
        for (list, more) in [(&mut self.second, more.second), (&mut self.third, more.third)] {
            list.extend(more);
            list.sort_unstable();
            list.dedup();
        }
    }
}

/// A sparse matrix as it grows.
#[derive(Default)]
struct Triplets {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
}

impl Triplets {
    fn push(&mut self, row: usize, column: usize, value: f64) {
        self.rows.push(row);
        self.columns.push(column);
        self.values.push(value);
    }

    fn into_matrix(self, rows: usize, columns: usize) -> CscMatrix<f64> {
        CscMatrix::new_from_triplets(rows, columns, self.rows, self.columns, self.values)
    }
}

/// Rows of Ax + s = b.
#[derive(Default)]
struct Rows {
    matrix: Triplets,
    bounds: Vec<f64>,
}

impl Rows {
    /// Three rows whose slack is `offset` - Σ weights · φ over the control points from `first`.
    fn add(&mut self, first: usize, weights: &[f64], offset: &Vector3<f64>) {
        for axis in 0..3 {
            for (k, &weight) in weights.iter().enumerate() {
                self.matrix.push(self.bounds.len(), 3 * (first + k) + axis, weight);
            }
            self.bounds.push(offset[axis]);
        }
    }

    /// One row whose slack is `bound` plus the sum of some unknowns.
    fn add_sum(&mut self, bound: f64, unknowns: &[usize]) {
        for &unknown in unknowns {
            self.matrix.push(self.bounds.len(), unknown, -1.0);
        }
        self.bounds.push(bound);
    }
}

/// minimise ½ xᵀPx + qᵀx subject to Ax + s = b, s in cones. The unknowns are the control points, axis by axis, then s
/// and t of every Huber norm side by side.
struct Program {
    quadratic: Triplets,
    linear: Vec<f64>,
    rows: Rows,
    cones: Vec<SupportedConeT<f64>>,
    /// First unknown of the next Huber norm.
    next: usize,
}

impl Program {
    fn new(controls: usize, norms: usize, huber: f64) -> Self {
        let mut program = Self {
            quadratic: Triplets::default(),
            linear: vec![0.0; controls],
            rows: Rows::default(),
            cones: vec![SupportedConeT::NonnegativeConeT(norms)],
            next: controls,
        };
        for s in (0..norms).map(|k| controls + 2 * k) {
            program.quadratic.push(s, s, 1.0);
            program.linear.extend([0.0, huber]);
            program.rows.add_sum(0.0, &[s + 1]);
        }
        program
    }

    /// Adds the Huber norm of some rows.
    fn add_huber(&mut self, add_rows: impl FnOnce(&mut Rows)) {
        let unknowns = [self.next, self.next + 1];
        self.next += 2;
        self.add_cone(0.0, &unknowns, add_rows);
    }

    /// Bounds ‖offset + scale Σ stencil · φ‖ by 1.
    fn add_limit(&mut self, first: usize, stencil: &[f64], scale: f64, offset: &Vector3<f64>) {
        let weights: Vec<f64> = stencil.iter().map(|c| -c * scale).collect();
        self.add_cone(1.0, &[], |rows| rows.add(first, &weights, offset));
    }

    /// Bounds the norm of some rows by `bound` plus the sum of some unknowns.
    fn add_cone(&mut self, bound: f64, unknowns: &[usize], add_rows: impl FnOnce(&mut Rows)) {
        let first = self.rows.bounds.len();
        self.rows.add_sum(bound, unknowns);
        add_rows(&mut self.rows);
        self.cones.push(SupportedConeT::SecondOrderConeT(self.rows.bounds.len() - first));
    }

    /// The first `wanted` unknowns.
    fn solve(self, wanted: usize) -> Result<Vec<f64>, String> {
        let unknowns = self.linear.len();
        let quadratic = self.quadratic.into_matrix(unknowns, unknowns);
        let constraints = self.rows.matrix.into_matrix(self.rows.bounds.len(), unknowns);
        let mut solver = DefaultSolver::new(
            &quadratic,
            &self.linear,
            &constraints,
            &self.rows.bounds,
            &self.cones,
            solver_settings()?,
        )
        .map_err(|error| error.to_string())?;
        solver.solve();
        // A solution that is almost optimal is one: its tolerance is a few times as large.
        match solver.solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => Ok(solver.solution.x[..wanted].to_vec()),
            status => Err(format!("{status:?}")),
        }
    }
}

fn solver_settings() -> Result<DefaultSettings<f64>, String> {
    DefaultSettingsBuilder::default()
        .verbose(false)
        .max_threads(1)
        // Unknowns are in standard deviations: a millionth of one is enough.
        .tol_gap_abs(1e-6)
        .tol_gap_rel(1e-6)
        .tol_feas(1e-7)
        .build()
        .map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::spline::Knots;
    use super::*;

    /// A resting path of one second that is observed twenty times at `height(time)` with unit noise.
    fn observed(height: impl Fn(f64) -> f64) -> Problem {
        let knots = Knots::over([0.0, 1.0], 0.1);
        let observation = |k: usize| {
            let times = [0.05 * k as f64, 0.05 * k as f64 + 0.02];
            Observation {
                supports: times.map(|time| knots.support(time)),
                residuals: times.map(|time| Vector3::new(height(time), 0.0, 0.0)),
                sigma: 1.0,
            }
        };
        Problem {
            observations: (0..20).map(observation).collect(),
            steps: vec![Vector3::zeros(); knots.count - 1],
            bending: vec![0.5; knots.count - 3],
            max_second: 1e3,
            max_third: 1e3,
            huber: 2.0,
        }
    }

    #[test]
    fn an_outlier_pulls_no_more_for_being_further_away() {
        let heights = [100.0, 1_000.0].map(|outlier| {
            observed(|time| if (0.49..0.53).contains(&time) { outlier } else { 0.0 }).solve().unwrap()
        });
        let pulled = heights[0].iter().map(Vector3::norm).fold(0.0, f64::max);
        assert!((0.01..3.0).contains(&pulled), "{pulled}");
        for (near, far) in heights[0].iter().zip(&heights[1]) {
            assert!((near - far).norm() < 1e-3, "{near} {far}");
        }
    }

    #[test]
    fn limits_hold_where_the_observations_break_them() {
        // Second differences of 400 t² over steps of 0.1 are 8; the kink in the middle has large third differences.
        let parabola = |time: f64| 400.0 * time * (time - 0.5).abs();
        let free = observed(parabola);
        let bound = Problem { max_second: 3.0, max_third: 2.0, ..free.clone() };
        let largest = |problem: &Problem| {
            let steps: Vec<_> = problem.solve().unwrap().windows(2).map(|pair| pair[1] - pair[0]).collect();
            let path = Problem { steps, ..problem.without_observations() };
            [path.seconds(), path.thirds()]
                .map(|differences| differences.iter().map(Vector3::norm).fold(0.0, f64::max))
        };
        let [second, third] = largest(&free);
        assert!(second > 6.0 && third > 4.0, "{second} {third}");
        let [second, third] = largest(&bound);
        assert!(second < 3.0 * 1.002 && third < 2.0 * 1.002, "{second} {third}");
        assert!(second > 2.9 || third > 1.9, "neither limit is reached: {second} {third}");
    }
}
