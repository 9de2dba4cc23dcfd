//! When depth was measured beside colour: where the jumps of depth lie on the edges of the picture.
//!
//! No pose is fitted, so this works before the camera is known: what moves to the left lies to the right of its depth when
//! colour came earlier. What does not move tells how depth is registered to colour.

use std::collections::HashMap;

use rayon::prelude::*;

use super::depth_edges::{EdgeFrame, Supposition};
use super::window::{Tracked, Window};

/// Jumps that are looked at, at the most, and how many there have to be.
const MOST_JUMPS: usize = 80_000;
const FEWEST_JUMPS: usize = 400;

/// Jumps with which the coarse search and the way from there are content.
const COARSE_JUMPS: usize = 6_000;
const FAR_JUMPS: usize = 20_000;

/// Delays of the coarse search, seconds, and differences of rows' times from which the fine search sets out.
const DELAYS: [f64; 17] = [
    0.0, -0.005, 0.005, -0.01, 0.01, -0.015, 0.015, -0.02, 0.02, -0.025, 0.025, -0.03, 0.03, -0.035, 0.035,
    -0.04, 0.04,
];
const ROWS: [f64; 3] = [0.0, -0.02, 0.02];

/// Shifts of the coarse search, as shares of the image's width: about four pixels of 640.
const SHIFTS: [f64; 5] = [0.0, -1.0 / 160.0, 1.0 / 160.0, -1.0 / 80.0, 1.0 / 80.0];

/// Smallest steps of the fine search: columns and rows in pixels of an image 640 wide, size, delay and rows in seconds.
const STEPS: [f64; 5] = [0.125, 0.125, 0.0003125, 0.0003125, 0.000625];

/// First steps of the fine search, in smallest ones; they are halved when none helps. It sets out with the first kind, and with
/// the second kind from a place that is nearly right.
const FAR: i32 = 16;
const NEAR: i32 = 8;

/// Shift in pixels (of 640) at which the strength counts a hundredth less: of two places that explain the same the one
/// without a shift is taken.
const RELUCTANCE: f64 = 20.0;

/// The edges have to be that much stronger where the jumps lie than a good way beside.
const MIN_CONTRAST: f64 = 1.15;

/// Stretches of frames that are left out in turn to see how certain the figures are.
const BLOCKS: usize = 5;

/// A time is told from none when it is longer than this, seconds, and than so many standard deviations. Polynomials between
/// poses are off by a twentieth of the times.
const LEAST_TIME: f64 = 4e-3;
const MIN_CERTAINTY: f64 = 3.0;

/// A time is known when its standard deviation is less, seconds: a fifth of usual ones.
const MOST_SIGMA: f64 = 5e-3;

/// How well the picture's edges lie on the jumps of depth, pixels of an image 640 wide: what moves less than that within a
/// time does not tell it.
const EDGE_SIGMA: f64 = 0.25;

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
pub(super) fn find(window: &Window<'_>, tracked: &[Tracked]) -> Option<DepthTime> {
    let frames = edge_frames(window, tracked);
    let jumps: usize = frames.iter().map(EdgeFrame::len).sum();
    if jumps < FEWEST_JUMPS {
        return None;
    }
    let scale = window.camera().width as f64 / 640.0;
    let some = Edges { frames: thinned(frames.clone(), jumps.div_ceil(FAR_JUMPS)), scale };
    let mut terrain = Terrain::new(&some, some.coarse());
    let climbs = ROWS.map(|rows| {
        let start = [0, 0, 0, 0, (rows / STEPS[4]).round() as i32];
        terrain.climb(start, FAR, None)
    });
    let (near, _) = climbs.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let sigmas = terrain.spread_over_blocks(near);
    let edges = Edges { frames: thinned(frames, jumps.div_ceil(MOST_JUMPS)), scale };
    let mut terrain = Terrain::new(&edges, terrain.origin);
    let (best, _) = terrain.climb(near, NEAR, None);
    let place = terrain.supposition(&best);
    if edges.contrast(&place) < MIN_CONTRAST {
        return None;
    }
    let (recorded, fine) = (window.recording.dataset.calibration().camera.width, window.camera().width);
    let of_edges = EDGE_SIGMA * edges.scale / edges.speed();
    // Rows lie within half of their whole time of the middle: evenly, their standard deviation is a part in sqrt(12).
    let of_rows = 12.0_f64.sqrt() * of_edges;
    Some(DepthTime {
        delay: Measured { seconds: place.delay, sigma: sigmas[0].hypot(of_edges) },
        rows: Measured { seconds: place.rows, sigma: sigmas[1].hypot(of_rows) },
        shift: place.shift.map(|pixels| pixels * recorded as f64 / fine as f64),
    })
}

/// The frames of the window that have a velocity.
fn edge_frames(window: &Window<'_>, tracked: &[Tracked]) -> Vec<EdgeFrame> {
    let (camera, depth_scale) = (window.camera(), window.recording.dataset.calibration().depth_scale);
    let frame = |(k, frame): (usize, &Tracked)| {
        let image = window.frame(frame.index)?;
        EdgeFrame::new(image, &camera, depth_scale, tracked, k).filter(|_| frame.is_found)
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

/// Sum of the strengths of edges, and how many it is of.
type Strength = (f64, usize);

fn sum(strengths: impl IntoIterator<Item = Strength>) -> Strength {
    strengths.into_iter().fold((0.0, 0), |sum, next| (sum.0 + next.0, sum.1 + next.1))
}

impl Edges {
    /// Mean strength of the picture's edges at jumps, less a little for the shift.
    fn height(&self, supposed: &Supposition, strength: Strength) -> f64 {
        let shift = supposed.shift[0].hypot(supposed.shift[1]) / (RELUCTANCE * self.scale);
        strength.0 / strength.1.max(1) as f64 * (1.0 - 0.01 * shift * shift)
    }

    /// Root mean square of the speeds of the jumps, pixels per second.
    fn speed(&self) -> f64 {
        let jumps: usize = self.frames.iter().map(EdgeFrame::len).sum();
        let squares: f64 = self.frames.iter().map(EdgeFrame::sum_of_squared_speeds).sum();
        (squares / jumps.max(1) as f64).sqrt()
    }

    /// Strength in each stretch of frames.
    fn of_blocks(&self, supposed: &Supposition) -> [Strength; BLOCKS] {
        let strengths: Vec<Strength> = self.frames.par_iter().map(|frame| frame.strength(supposed)).collect();
        let length = self.frames.len().div_ceil(BLOCKS);
        let mut blocks = [(0.0, 0); BLOCKS];
        blocks
            .iter_mut()
            .zip(strengths.chunks(length))
            .for_each(|(block, part)| *block = sum(part.iter().copied()));
        blocks
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
        let height = |place: Supposition| {
            let strengths = self.frames.iter().step_by(step).map(|frame| frame.strength(&place));
            (place, self.height(&place, sum(strengths)))
        };
        let heights: Vec<(Supposition, f64)> =
            places.collect::<Vec<_>>().into_par_iter().map(height).collect();
        let highest = heights.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        highest.map_or(Supposition::NONE, |(place, _)| place)
    }

    /// Strength at a place over the mean of that a dozen pixels (of 640) to either side.
    fn contrast(&self, place: &Supposition) -> f64 {
        let far = 12.0 * self.scale;
        let height = |x: f64, y: f64| {
            let beside = Supposition { shift: [place.shift[0] + x, place.shift[1] + y], ..*place };
            self.height(&beside, sum(self.of_blocks(&beside)))
        };
        let beside = height(far, far) + height(far, -far) + height(-far, far) + height(-far, -far);
        4.0 * height(0.0, 0.0) / beside
    }
}

/// A place in smallest steps from the origin.
type Place = [i32; 5];

/// Strengths at the places that were looked at; climbs from several starts, with and without some of the frames, meet the
/// same ones.
struct Terrain<'a> {
    edges: &'a Edges,
    origin: Supposition,
    known: HashMap<Place, [Strength; BLOCKS]>,
}

impl<'a> Terrain<'a> {
    fn new(edges: &'a Edges, origin: Supposition) -> Self {
        Self { edges, origin, known: HashMap::new() }
    }

    fn supposition(&self, place: &Place) -> Supposition {
        let step = |figure: usize| f64::from(place[figure]) * STEPS[figure];
        let (scale, origin) = (self.edges.scale, &self.origin);
        Supposition {
            shift: [origin.shift[0] + step(0) * scale, origin.shift[1] + step(1) * scale],
            zoom: origin.zoom + step(2),
            delay: origin.delay + step(3),
            rows: origin.rows + step(4),
        }
    }

    /// Height of a place without the frames of a stretch.
    fn height(&mut self, place: &Place, left_out: Option<usize>) -> f64 {
        let supposed = self.supposition(place);
        let blocks = self.known.entry(*place).or_insert_with(|| self.edges.of_blocks(&supposed));
        let taking_part = blocks.iter().enumerate().filter(|(block, _)| Some(*block) != left_out);
        self.edges.height(&supposed, sum(taking_part.map(|(_, strength)| *strength)))
    }

    /// Climbs from `start` in steps along one figure after the other, halved when none helps; returns the place and its height.
    fn climb(&mut self, start: Place, first_step: i32, left_out: Option<usize>) -> (Place, f64) {
        let (mut place, mut height) = (start, self.height(&start, left_out));
        let mut step = first_step;
        while step > 0 {
            let before = height;
            for (figure, signed) in (0..5).flat_map(|figure| [(figure, step), (figure, -step)]) {
                let mut tried = place;
                tried[figure] += signed;
                let tried_height = self.height(&tried, left_out);
                if tried_height > height {
                    (place, height) = (tried, tried_height);
                }
            }
            if height <= before {
                step /= 2;
            }
        }
        (place, height)
    }

    /// Standard deviations of delay and rows by how much they change when a stretch of frames is left out (the jackknife),
    /// or the last steps of the search where that is more.
    fn spread_over_blocks(&mut self, best: Place) -> [f64; 2] {
        let places: Vec<Supposition> = (0..BLOCKS)
            .map(|block| {
                let (place, _) = self.climb(best, NEAR, Some(block));
                self.supposition(&place)
            })
            .collect();
        let deviation = |figure: &dyn Fn(&Supposition) -> f64, last_step: f64| {
            let count = places.len() as f64;
            let mean = places.iter().map(figure).sum::<f64>() / count;
            let squares: f64 = places.iter().map(|place| (figure(place) - mean).powi(2)).sum();
            ((count - 1.0) / count * squares).sqrt().max(last_step)
        };
        [deviation(&|place| place.delay, STEPS[3]), deviation(&|place| place.rows, STEPS[4])]
    }
}
