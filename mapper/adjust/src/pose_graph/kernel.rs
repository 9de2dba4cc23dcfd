//! Weights of edges that may be mistakes: graduated non-convexity with truncated least squares.
//!
//! The truncated cost `min(r^2, c^2)` is approached from a convex one by the control parameter mu, which grows from
//! almost 0 (Yang et al. 2020, eq. 13 and 14).

/// Factor by which mu grows.
const GROWTH: f64 = 1.4;

/// Bound of the growth: the cost is truncated least squares to within a thousandth from here on.
const LARGEST_MU: f64 = 1e3;

/// The state of the approach.
#[derive(Clone, Copy, Debug)]
pub(super) struct Graduation {
    rejection_cost: f64,
    mu: f64,
}

impl Graduation {
    /// Begins where the cost is convex for squared residuals up to `largest`.
    pub(super) fn new(rejection_cost: f64, largest: f64) -> Self {
        let excess = 2.0 * largest - rejection_cost;
        let mu = if excess > 0.0 { rejection_cost / excess } else { LARGEST_MU };
        Self { rejection_cost, mu: mu.min(LARGEST_MU) }
    }

    /// Weight in `[0, 1]` of an edge with this squared residual.
    pub(super) fn weight(&self, squared: f64) -> f64 {
        let weight = (self.rejection_cost / squared * self.mu * (self.mu + 1.0)).sqrt() - self.mu;
        // A residual of zero divides by zero, to infinity: the weight is then 1.
        weight.clamp(0.0, 1.0)
    }

    pub(super) fn tighten(&mut self) {
        self.mu *= GROWTH;
    }

    /// Whether nothing more is to be gained from tightening.
    pub(super) fn is_tight(&self) -> bool {
        self.mu >= LARGEST_MU
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_go_from_little_for_all_to_a_decision() {
        let mut graduation = Graduation::new(25.0, 1e6);
        // (c/r) sqrt(mu) - mu with mu = c^2 / (2 r^2) at the largest residual.
        let expected = 25e-6 * (0.5_f64.sqrt() - 0.5);
        assert!((graduation.weight(1e6) / expected - 1.0).abs() < 1e-3);
        assert_eq!(graduation.weight(0.0), 1.0);
        while !graduation.is_tight() {
            graduation.tighten();
        }
        assert_eq!(graduation.weight(24.9), 1.0);
        assert_eq!(graduation.weight(25.1), 0.0);
    }
}
