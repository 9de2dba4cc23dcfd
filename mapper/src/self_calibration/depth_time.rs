//! When depth was measured beside colour: where the jumps of depth lie on the edges of the picture.
//!
//! No pose is fitted, so this works before the camera is known: what moves to the left lies to the right of its depth when
//! colour came earlier. What does not move tells how depth is registered to colour.

use rayon::prelude::*;

use super::depth_edges::{EdgeFrame, Supposition};
use super::window::{Tracked, Window};
use crate::dataset::Dataset;

/// Jumps that are looked at, at the most, and how many there have to be.
const MOST_JUMPS: usize = 40_000;
const FEWEST_JUMPS: usize = 400;

/// Jumps with which the coarse search is content.
const COARSE_JUMPS: usize = 6_000;

/// Delays of the coarse search, seconds, and differences of rows' times from which the fine search sets out.
const DELAYS: [f64; 17] = [
    0.0, -0.005, 0.005, -0.01, 0.01, -0.015, 0.015, -0.02, 0.02, -0.025, 0.025, -0.03, 0.03, -0.035, 0.035,
    -0.04, 0.04,
];
const ROWS: [f64; 3] = [0.0, -0.02, 0.02];

/// Shifts of the coarse search, as shares of the image's width: about four pixels of 640.
const SHIFTS: [f64; 5] = [0.0, -1.0 / 160.0, 1.0 / 160.0, -1.0 / 80.0, 1.0 / 80.0];

/// First steps of the fine search: pixels of an image 640 wide, size, seconds, seconds. It ends when they are halved so often.
const STEPS: [f64; 5] = [2.0, 2.0, 0.005, 0.005, 0.01];
const HALVINGS: usize = 5;

/// Shift in pixels (of 640) at which the strength counts a hundredth less: of two places that explain the same the one
/// without a shift is taken.
const RELUCTANCE: f64 = 20.0;

/// The edges have to be that much stronger where the jumps lie than a good way beside.
const MIN_CONTRAST: f64 = 1.15;

/// Stretches of frames that are left out in turn to see how certain the figures are.
const BLOCKS: usize = 5;

/// A time is told from none when it is longer than this, seconds, and than so many standard deviations. Polynomials between
/// poses are off by a twentieth of the times.
const LEAST_TIME: f64 = 2e-3;
const MIN_CERTAINTY: f64 = 3.0;

/// A time is known when its standard deviation is less, seconds: a fifth of usual ones.
const MOST_SIGMA: f64 = 5e-3;

/// A number and its standard deviation, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measured {
    pub(super) seconds: f64,
    pub(super) sigma: f64,
}

impl Measured {
    /// Whether the recording tells it from nothing.
    pub(super) fn differs_from_none(&self) -> bool {
        self.is_certain() && self.seconds.abs() > LEAST_TIME.max(MIN_CERTAINTY * self.sigma)
    }

    /// Whether it is known so well that it may be told from a usual time.
    pub(super) fn is_certain(&self) -> bool {
        self.sigma < MOST_SIGMA
    }
}

/// What the edges tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DepthTime {
    /// Seconds by which depth is later than its timestamps.
    pub(super) delay: Measured,
    /// Time from the first row to the last, of colour minus that of depth.
    pub(super) rows: Measured,
    /// Pixels that depth lies beside colour, columns and rows, when nothing moves.
    pub(super) shift: [f64; 2],
}

/// Looks for the time of depth in a window that was tracked; none where the picture has no edges at jumps of depth.
pub(super) fn find(window: &Window, dataset: &Dataset, tracked: &[Tracked]) -> Option<DepthTime> {
    let frames = edge_frames(window, dataset, tracked);
    let jumps: usize = frames.iter().map(EdgeFrame::len).sum();
    if jumps < FEWEST_JUMPS {
        return None;
    }
    let scale = dataset.calibration().camera.width as f64 / 640.0;
    let edges = Edges { frames: thinned(frames, jumps.div_ceil(MOST_JUMPS)), scale };
    let all = |_: usize| true;
    let start = edges.coarse();
    let best = ROWS
        .into_par_iter()
        .map(|rows| edges.climb(Supposition { rows, ..start }, 1.0, &all))
        .collect::<Vec<_>>()
        .into_iter()
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    if edges.contrast(&best.0) < MIN_CONTRAST {
        return None;
    }
    let sigmas = edges.spread_over_blocks(&best.0);
    Some(DepthTime {
        delay: Measured { seconds: best.0.delay, sigma: sigmas[0] },
        rows: Measured { seconds: best.0.rows, sigma: sigmas[1] },
        shift: best.0.shift,
    })
}

/// The frames of the window that have a velocity.
fn edge_frames(window: &Window, dataset: &Dataset, tracked: &[Tracked]) -> Vec<EdgeFrame> {
    let calibration = dataset.calibration();
    let frame = |(k, frame): (usize, &Tracked)| {
        let image = window.frame(frame.index)?;
        EdgeFrame::new(image, &calibration.camera, calibration.depth_scale, tracked, k)
            .filter(|_| frame.is_found)
    };
    tracked.par_iter().enumerate().filter_map(frame).collect()
}

fn thinned(mut frames: Vec<EdgeFrame>, step: usize) -> Vec<EdgeFrame> {
    frames.iter_mut().for_each(|frame| frame.thin_out(step));
    frames
}

struct Edges {
    frames: Vec<EdgeFrame>,
    /// Width of the image over 640 pixels.
    scale: f64,
}

impl Edges {
    /// Mean strength of the picture's edges at the jumps of the frames that take part.
    fn strength(&self, supposed: &Supposition, takes_part: &dyn Fn(usize) -> bool) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for (_, frame) in self.frames.iter().enumerate().filter(|(k, _)| takes_part(*k)) {
            let (strength, number) = frame.strength(supposed);
            sum += strength;
            count += number;
        }
        let shift = supposed.shift[0].hypot(supposed.shift[1]) / (RELUCTANCE * self.scale);
        sum / count.max(1) as f64 * (1.0 - 0.01 * shift * shift)
    }

    /// The best of a grid of delays and shifts.
    fn coarse(&self) -> Supposition {
        let jumps: usize = self.frames.iter().map(EdgeFrame::len).sum();
        // A share of the frames has the same edges as all of them.
        let step = jumps.div_ceil(COARSE_JUMPS);
        let width = 640.0 * self.scale;
        let places = DELAYS.iter().flat_map(|delay| {
            SHIFTS.iter().flat_map(move |x| {
                SHIFTS.iter().map(move |y| Supposition {
                    shift: [x * width, y * width],
                    delay: *delay,
                    ..Supposition::NONE
                })
            })
        });
        let places: Vec<Supposition> = places.collect();
        let strengths: Vec<f64> =
            places.par_iter().map(|place| self.strength(place, &|k| k % step == 0)).collect();
        let best = (0..places.len()).max_by(|a, b| strengths[*a].total_cmp(&strengths[*b])).unwrap_or(0);
        places[best]
    }

    /// Climbs from `start` in steps along one figure after the other, halved when none helps; `first` is the share of the usual
    /// first steps.
    fn climb(
        &self,
        start: Supposition,
        first: f64,
        takes_part: &dyn Fn(usize) -> bool,
    ) -> (Supposition, f64) {
        let mut steps = STEPS.map(|step| step * first);
        steps[..2].iter_mut().for_each(|step| *step *= self.scale);
        let (mut place, mut height) = (start, self.strength(&start, takes_part));
        for _ in 0..HALVINGS {
            loop {
                let before = height;
                for (figure, step) in steps.iter().enumerate() {
                    for signed in [*step, -*step] {
                        let tried = stepped(&place, figure, signed);
                        let strength = self.strength(&tried, takes_part);
                        if strength > height {
                            (place, height) = (tried, strength);
                        }
                    }
                }
                if height <= before {
                    break;
                }
            }
            steps = steps.map(|step| 0.5 * step);
        }
        (place, height)
    }

    /// Strength at a place over the mean of that a dozen pixels (of 640) to either side.
    fn contrast(&self, place: &Supposition) -> f64 {
        let far = 12.0 * self.scale;
        let beside = [[far, far], [far, -far], [-far, far], [-far, -far]].map(|[x, y]| {
            let shift = [place.shift[0] + x, place.shift[1] + y];
            self.strength(&Supposition { shift, ..*place }, &|_| true)
        });
        4.0 * self.strength(place, &|_| true) / beside.iter().sum::<f64>()
    }

    /// Standard deviations of delay and rows by how much they change when a stretch of frames is left out (the jackknife),
    /// or the last steps of the search where that is more.
    fn spread_over_blocks(&self, best: &Supposition) -> [f64; 2] {
        let length = self.frames.len().div_ceil(BLOCKS);
        let without = |block: usize| self.climb(*best, 0.5, &|k| k / length != block).0;
        let places: Vec<Supposition> = (0..BLOCKS).into_par_iter().map(without).collect();
        let deviation = |figure: &dyn Fn(&Supposition) -> f64, last_step: f64| {
            let count = places.len() as f64;
            let mean = places.iter().map(figure).sum::<f64>() / count;
            let squares: f64 = places.iter().map(|place| (figure(place) - mean).powi(2)).sum();
            ((count - 1.0) / count * squares).sqrt().max(last_step)
        };
        let last = 0.5_f64.powi(HALVINGS as i32);
        [deviation(&|place| place.delay, STEPS[3] * last), deviation(&|place| place.rows, STEPS[4] * last)]
    }
}

/// The supposition with one figure changed.
fn stepped(place: &Supposition, figure: usize, step: f64) -> Supposition {
    let mut place = *place;
    match figure {
        0 | 1 => place.shift[figure] += step,
        2 => place.zoom += step,
        3 => place.delay += step,
        _ => place.rows += step,
    }
    place
}
