//! Smoothing of a motion over a few frames: a Gaussian process whose fifth derivative is white noise (continuous-time
//! trajectory estimation as in Barfoot, State Estimation for Robotics, chapter 11, with a longer state).
//!
//! The state at one time is place, velocity, acceleration, jerk and snap, each of six numbers: translation and rotation vector
//! in the axes of the frame that is asked about. Time is counted in frame intervals, so that all of them are of like size.

use nalgebra::{Cholesky, Const, Matrix6, SMatrix, SVector, Vector6};

/// Derivatives in a state, from the zeroth.
const ORDER: usize = 5;
const SIZE: usize = 6 * ORDER;

type State = SVector<f64, SIZE>;
type Information = SMatrix<f64, SIZE, SIZE>;
type Chain = SMatrix<f64, ORDER, ORDER>;

/// Information that every number of a state has of its own: it lies within a thousand metres or radians per power of an
/// interval. Keeps what nothing was measured of solvable.
const VAGUE: f64 = 1e-6;

/// What was measured at one time: place and velocity, each with its information matrix.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measurement {
    /// Frame intervals from the frame that is asked about.
    pub(super) time: f64,
    pub(super) place: (Vector6<f64>, Matrix6<f64>),
    pub(super) velocity: Option<(Vector6<f64>, Matrix6<f64>)>,
}

/// How the camera moved at one of the times.
#[derive(Clone, Copy, Debug)]
pub(super) struct Smoothed {
    /// Velocity, acceleration and jerk, per power of a frame interval.
    pub(super) derivatives: [Vector6<f64>; 3],
    /// Variances of velocity and acceleration.
    pub(super) variances: [Vector6<f64>; 2],
}

/// How well measurements agree with a motion of some jerkiness.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Evidence {
    /// Squared deviations, each by its variance.
    energy: f64,
    /// Measured numbers without those that a state takes up.
    count: f64,
    /// Logarithm of the determinant of the state's information less that of the process.
    log_determinant: f64,
}

impl Evidence {
    pub(super) fn add(&mut self, other: &Self) {
        self.energy += other.energy;
        self.count += other.count;
        self.log_determinant += other.log_determinant;
    }

    /// Variance of the measurements as a multiple of what they claim, the likeliest one; `None` without measurements.
    pub(super) fn variance(&self) -> Option<f64> {
        (self.count > 0.0 && self.energy > 0.0).then(|| self.energy / self.count)
    }

    /// Twice the negative logarithm of the likelihood with that variance, up to a constant.
    pub(super) fn cost(&self) -> f64 {
        self.variance().map_or(f64::INFINITY, |variance| self.count * variance.ln() + self.log_determinant)
    }
}

/// What is known of a state: information matrix, and that times the expected state.
struct Belief {
    information: Information,
    vector: State,
}

impl Belief {
    fn of(measurement: &Measurement) -> Self {
        let mut belief = Self { information: Information::identity() * VAGUE, vector: State::zeros() };
        for (order, known) in [Some(measurement.place), measurement.velocity].into_iter().enumerate() {
            let Some((value, information)) = known else { continue };
            let at = 6 * order;
            let mut block = belief.information.fixed_view_mut::<6, 6>(at, at);
            block += information;
            belief.vector.fixed_rows_mut::<6>(at).copy_from(&(information * value));
        }
        belief
    }

    fn add(&mut self, other: &Self) {
        self.information += other.information;
        self.vector += other.vector;
    }

    /// Factors the information; the evidence loses what this state explains.
    fn factored(&self, evidence: &mut Evidence) -> Option<Cholesky<f64, Const<SIZE>>> {
        let factor = self.information.cholesky()?;
        evidence.energy -= self.vector.dot(&factor.solve(&self.vector));
        evidence.log_determinant += log_determinant(factor.l_dirty());
        Some(factor)
    }
}

/// Logarithm of the determinant of the matrix with the Cholesky factor `l`.
fn log_determinant<const N: usize>(l: &SMatrix<f64, N, N>) -> f64 {
    2.0 * l.diagonal().iter().map(|pivot| pivot.ln()).sum::<f64>()
}

/// How the state changes over `dt` intervals: the one that follows is `transition` times the former, with noise of an
/// `information`.
struct Process {
    transition: Information,
    information: Information,
    log_determinant: f64,
}

impl Process {
    /// `drive` is the spectral density of the white noise, square metres and square radians per interval to the ninth.
    fn over(dt: f64, drive: f64) -> Option<Self> {
        let factorial = |k: usize| (1..=k).map(|i| i as f64).product::<f64>();
        let transition = Chain::from_fn(|row, column| match column.checked_sub(row) {
            Some(power) => dt.powi(power as i32) / factorial(power),
            None => 0.0,
        });
        let noise = Chain::from_fn(|row, column| {
            let (row, column) = (ORDER - 1 - row, ORDER - 1 - column);
            let power = row + column + 1;
            drive * dt.powi(power as i32) / (power as f64 * factorial(row) * factorial(column))
        });
        let factor = noise.cholesky()?;
        let log_determinant = -6.0 * log_determinant(factor.l_dirty());
        Some(Self {
            transition: in_six_dimensions(&transition),
            information: in_six_dimensions(&factor.inverse()),
            log_determinant,
        })
    }

    /// What `earlier` says of the state that follows.
    fn forwards(&self, earlier: &Belief, evidence: &mut Evidence) -> Option<Belief> {
        let pull = self.transition.transpose() * self.information;
        let total =
            Belief { information: earlier.information + pull * self.transition, vector: earlier.vector };
        self.without(&total, &self.information, &pull, evidence)
    }

    /// What `later` says of the state before it.
    fn backwards(&self, later: &Belief, evidence: &mut Evidence) -> Option<Belief> {
        let pull = self.information * self.transition;
        let total = Belief { information: later.information + self.information, vector: later.vector };
        self.without(&total, &(self.transition.transpose() * pull), &pull, evidence)
    }

    /// Eliminates the state of `total`; the other one has `own` information, and `pull` couples them.
    fn without(
        &self,
        total: &Belief,
        own: &Information,
        pull: &Information,
        evidence: &mut Evidence,
    ) -> Option<Belief> {
        let factor = total.factored(evidence)?;
        evidence.log_determinant -= self.log_determinant;
        let solved = factor.solve(pull);
        Some(Belief {
            information: own - pull.transpose() * solved,
            vector: solved.transpose() * total.vector,
        })
    }
}

/// The same for each of six numbers.
fn in_six_dimensions(chain: &Chain) -> Information {
    Information::from_fn(|row, column| if row % 6 == column % 6 { chain[(row / 6, column / 6)] } else { 0.0 })
}

/// The motion at measurement `centre` of `measurements`, which are in the order of time, for a process of `drive`; and how well
/// all of them agree with it. `None` where the numbers cannot be worked with.
///
/// Costs two factors of 30 x 30 numbers for each measurement.
pub(super) fn smooth(
    measurements: &[Measurement],
    centre: usize,
    drive: f64,
) -> Option<(Smoothed, Evidence)> {
    let mut evidence = Evidence { count: -(SIZE as f64), ..Evidence::default() };
    for measurement in measurements {
        for (value, information) in [Some(measurement.place), measurement.velocity].into_iter().flatten() {
            evidence.energy += value.dot(&(information * value));
            evidence.count += 6.0;
        }
    }
    let belief = |k: usize| Belief::of(&measurements[k]);
    let process = |k: usize| Process::over(measurements[k + 1].time - measurements[k].time, drive);
    // From both sides towards the centre.
    let mut total = belief(centre);
    let mut before: Option<Belief> = None;
    for k in 0..centre {
        let mut earlier = belief(k);
        before.iter().for_each(|known| earlier.add(known));
        before = Some(process(k)?.forwards(&earlier, &mut evidence)?);
    }
    let mut after: Option<Belief> = None;
    for k in (centre..measurements.len() - 1).rev() {
        let mut later = belief(k + 1);
        after.iter().for_each(|known| later.add(known));
        after = Some(process(k)?.backwards(&later, &mut evidence)?);
    }
    before.iter().chain(&after).for_each(|known| total.add(known));
    let factor = total.factored(&mut evidence)?;
    let (state, variances) = (factor.solve(&total.vector), factor.inverse().diagonal());
    let part = |of: &State, order: usize| Vector6::from(of.fixed_rows::<6>(6 * order));
    let smoothed = Smoothed {
        derivatives: [1, 2, 3].map(|order| part(&state, order)),
        variances: [1, 2].map(|order| part(&variances, order)),
    };
    Some((smoothed, evidence))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients of time, its square and so on.
    const TERMS: [[f64; 6]; 4] = [
        [0.04, -0.02, 0.01, 0.03, 0.01, 0.09],
        [-0.03, 0.05, 0.01, -0.02, 0.02, -0.12],
        [0.04, 0.01, -0.07, 0.01, -0.01, 0.05],
        [0.01, -0.02, 0.01, 0.01, 0.0, -0.009],
    ];

    fn measured(time: f64, information: f64) -> Measurement {
        let term = |k: usize| Vector6::from(TERMS[k]);
        let place: Vector6<f64> = (0..4).map(|k| term(k) * time.powi(k as i32 + 1)).sum();
        let rate: Vector6<f64> = (0..4).map(|k| term(k) * ((k + 1) as f64 * time.powi(k as i32))).sum();
        let information = Matrix6::identity() * information;
        Measurement { time, place: (place, information), velocity: Some((rate, information)) }
    }

    #[test]
    fn a_motion_of_the_fourth_degree_is_found_exactly() {
        let measurements = [-2.0, -0.9, 0.0, 1.1, 2.0].map(|time| measured(time, 1e8));
        let (found, evidence) = smooth(&measurements, 2, 1e-6).unwrap();
        for (order, factorial) in [1.0, 2.0, 6.0].into_iter().enumerate() {
            let expected = Vector6::from(TERMS[order]) * factorial;
            let error = (found.derivatives[order] - expected).norm();
            assert!(error < 1e-6, "derivative {order} is off by {error}");
        }
        // Sixty numbers were measured, and a state takes up thirty of them; what is left agrees.
        assert_eq!(evidence.count, 30.0);
        assert!(evidence.variance().is_none_or(|variance| variance < 1e-3), "{evidence:?}");
    }

    #[test]
    fn the_centre_may_be_at_either_end() {
        let measurements = [0.0, 1.0, 2.1].map(|time| measured(time, 1e8));
        let (found, _) = smooth(&measurements, 0, 1e-9).unwrap();
        assert!((found.derivatives[0] - Vector6::from(TERMS[0])).norm() < 1e-4);
        let shifted = measurements.map(|m| Measurement { time: m.time - 2.1, ..m });
        let (found, _) = smooth(&shifted, 2, 1e-9).unwrap();
        let rate = measured(2.1, 1.0).velocity.unwrap().0;
        assert!((found.derivatives[0] - rate).norm() < 1e-4);
    }

    /// The same motion in a dense system of all states, as a check of the elimination.
    #[test]
    fn the_elimination_agrees_with_a_dense_solution() {
        let mut measurements = [-1.0, 0.0, 1.2, 2.0].map(|time| measured(time, 400.0));
        // Something that no smooth motion does.
        measurements[2].place.0 += Vector6::new(0.1, -0.05, 0.02, 0.01, 0.03, -0.1);
        let drive = 0.01;
        let size = measurements.len() * SIZE;
        let mut information = nalgebra::DMatrix::<f64>::zeros(size, size);
        let mut vector = nalgebra::DVector::<f64>::zeros(size);
        for (k, measurement) in measurements.iter().enumerate() {
            let belief = Belief::of(measurement);
            let mut block = information.view_mut((k * SIZE, k * SIZE), (SIZE, SIZE));
            block += belief.information;
            vector.rows_mut(k * SIZE, SIZE).copy_from(&belief.vector);
        }
        for k in 0..measurements.len() - 1 {
            let dt = measurements[k + 1].time - measurements[k].time;
            let process = Process::over(dt, drive).unwrap();
            let mut residual = SMatrix::<f64, SIZE, { 2 * SIZE }>::zeros();
            residual.fixed_view_mut::<SIZE, SIZE>(0, 0).copy_from(&-process.transition);
            residual.fixed_view_mut::<SIZE, SIZE>(0, SIZE).copy_from(&Information::identity());
            let mut block = information.view_mut((k * SIZE, k * SIZE), (2 * SIZE, 2 * SIZE));
            block += residual.transpose() * process.information * residual;
        }
        let inverse = information.cholesky().unwrap().inverse();
        let expected = &inverse * vector;
        let (found, _) = smooth(&measurements, 1, drive).unwrap();
        for order in 0..3 {
            let expected = expected.rows(SIZE + 6 * (order + 1), 6);
            let error = (found.derivatives[order] - expected).norm();
            assert!(error < 1e-6 * expected.norm(), "derivative {order} is off by {error}");
        }
        for order in 0..2 {
            let at = SIZE + 6 * (order + 1);
            let expected = inverse[(at, at)];
            assert!((found.variances[order][0] / expected - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn the_likeliest_process_is_the_one_that_moved_the_camera() {
        // A shake of one turn in six frames, measured to a hundredth of its size.
        let rate = std::f64::consts::TAU / 6.0;
        let shaken = |k: i32| {
            let phase = f64::from(k) * rate;
            let noise =
                |seed: i32| Vector6::from_fn(|i, _| 0.01 * (f64::from(seed) * 7.3 + i as f64 * 2.9).sin());
            let information = Matrix6::identity() * 1e4;
            let velocity = Vector6::repeat(phase.cos() * rate) + noise(k + 50);
            Measurement {
                time: f64::from(k),
                place: (Vector6::repeat(phase.sin()) + noise(k), information),
                velocity: Some((velocity, information)),
            }
        };
        let cost = |drive: f64| {
            let measurements: Vec<Measurement> = (-3..=3).map(shaken).collect();
            smooth(&measurements, 3, drive).unwrap().1.cost()
        };
        // The fifth derivative of the shake is a little above one.
        let [slow, likely, wild] = [1e-8, 0.1, 1e6].map(cost);
        assert!(slow > likely && wild > likely, "{slow} {likely} {wild}");
    }
}
