//! Levenberg-Marquardt damping.

use nalgebra::{SMatrix, SVector};

use super::{BOWED_UNKNOWNS, UNKNOWNS};

/// Damping factor and how fast it grows on failure (Nielsen's rule).
#[derive(Clone, Copy, Debug)]
pub(super) struct Damping {
    factor: f64,
    growth: f64,
}

impl Default for Damping {
    fn default() -> Self {
        Self { factor: 1e-4, growth: 2.0 }
    }
}

/// Damping beyond which a step no longer moves anything.
const HOPELESS: f64 = 1e4;

impl Damping {
    /// Solves `(H + mu diag(H)) step = -g`, always from the undamped matrix. `None` when that is singular.
    ///
    /// Not inlined: the copies of the matrix are off the stack again when the step is evaluated.
    #[inline(never)]
    pub(super) fn step(
        &self,
        hessian: &SMatrix<f64, BOWED_UNKNOWNS, BOWED_UNKNOWNS>,
        gradient: &SVector<f64, BOWED_UNKNOWNS>,
    ) -> Option<SVector<f64, BOWED_UNKNOWNS>> {
        let mut damped = *hessian;
        // Of the unknowns that every frame has.
        let trace: f64 = (0..UNKNOWNS).map(|i| hessian[(i, i)]).sum();
        let floor = 1e-9 * trace / UNKNOWNS as f64;
        for i in 0..BOWED_UNKNOWNS {
            damped[(i, i)] += self.factor * hessian[(i, i)] + floor;
        }
        let step = damped.cholesky()?.solve(&-gradient);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }

    /// After a step whose decrease was `ratio` times the predicted one.
    pub(super) fn accept(&mut self, ratio: f64) {
        let excess = 2.0 * ratio - 1.0;
        self.factor = (self.factor * (1.0 - excess * excess * excess).max(1.0 / 3.0)).max(1e-9);
        self.growth = 2.0;
    }

    /// After a step that did not lower the cost; `false` when no smaller step is worth a try.
    pub(super) fn reject(&mut self) -> bool {
        self.factor *= self.growth;
        self.growth *= 2.0;
        self.factor < HOPELESS
    }
}
