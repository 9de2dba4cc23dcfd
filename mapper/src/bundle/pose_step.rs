//! Steps of the poses at both ends of an exposure.

use mba_tracker::trajectory::ExposureTrajectory;
use nalgebra::{SMatrix, Vector6};
use serde::{Deserialize, Serialize};

use crate::exposure::ExposureGradient;

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.99;

/// Moments of the gradients by the middle (six numbers) and by the motion (six numbers) of one exposure.
///
/// In these coordinates the problem nearly falls apart into two: the middle says where the picture is, the motion how
/// it is smeared.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseMoments {
    first: [f64; 12],
    second: [f64; 12],
    updates: u32,
}

/// What one unit of every tangent is worth, so that a step moves the picture by about a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseUnits {
    /// Metres per pixel at the typical depth.
    pub metres: f64,
    /// Radians per pixel.
    pub radians: f64,
}

impl PoseMoments {
    /// Moves `path` one step of about `pixels` against the gradient; the middle stays where it is if `hold_middle`.
    pub fn step(
        &mut self,
        path: &mut ExposureTrajectory,
        gradient: &ExposureGradient,
        units: PoseUnits,
        pixels: f64,
        hold_middle: bool,
    ) {
        self.updates += 1;
        let t = self.updates.min(10_000) as i32;
        let (c1, c2) = (1.0 / (1.0 - BETA_1.powi(t)), 1.0 / (1.0 - BETA_2.powi(t)));
        let by_middle = gradient.start + gradient.end;
        let by_motion = (gradient.end - gradient.start) * 0.5;
        let mut steps = [0.0; 12];
        for (k, step) in steps.iter_mut().enumerate() {
            let unit = if k % 6 < 3 { units.metres } else { units.radians };
            let g = unit * if k < 6 { by_middle[k] } else { by_motion[k - 6] };
            let (m, v) = (&mut self.first[k], &mut self.second[k]);
            *m = BETA_1 * *m + (1.0 - BETA_1) * g;
            *v = BETA_2 * *v + (1.0 - BETA_2) * g * g;
            *step = -pixels * unit * (*m * c1) / ((*v * c2).sqrt() + 1e-20);
        }
        let middle = Vector6::from_column_slice(&steps[..6]) * if hold_middle { 0.0 } else { 1.0 };
        let motion = Vector6::from_column_slice(&steps[6..]) * 0.5;
        let mut tangent = SMatrix::<f64, 12, 1>::zeros();
        tangent.fixed_rows_mut::<6>(0).copy_from(&(middle - motion));
        tangent.fixed_rows_mut::<6>(6).copy_from(&(middle + motion));
        *path = path.perturbed(&tangent);
    }
}
