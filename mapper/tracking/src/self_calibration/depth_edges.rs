//! Jumps of depth beside the edges of the picture: where a near thing ends in front of a far one, both have an edge.
//!
//! Depth is measured at another time than colour, and rows of either may follow each other. Then an edge of depth lies
//! beside that of colour by the motion in between, which shows when that was.

use std::sync::Arc;

use mba_io::dataset::RgbdFrame;
use mba_tracker::geometry::PinholeCamera;
use nalgebra::{Vector3, Vector6};

use super::motion::motion;
use super::window::Tracked;

/// Pixels between the two depths of a jump: a sensor leaves out the pixels on the edge itself.
const REACH: usize = 4;

/// Least relative difference of the two depths; a surface that is seen from the side has less over so few pixels.
const MIN_JUMP: f64 = 0.08;

/// Gradients above this, in steps of 8 bits, count no more than this: one strong edge is not worth many.
const STRONGEST: f32 = 60.0;

/// Steps in which a strength is kept, per step of 8 bits: the strongest still fits a byte.
const STRENGTH_STEPS: f32 = 4.0;

/// Jumps whose places are found together.
const LANES: usize = 16;

/// Jumps of depth, figure by figure, so that many are moved at a time. A picture's place is known to a few thousandths of a
/// pixel in single precision.
#[derive(Clone, Debug, Default)]
struct Jumps {
    /// Pixel of the depth map, in the middle of the jump: columns, rows.
    place: [Vec<f32>; 2],
    /// How the near side moves in the picture: pixels per second, and per square of a second.
    velocity: [Vec<f32>; 2],
    acceleration: [Vec<f32>; 2],
}

impl Jumps {
    fn figures(&mut self) -> impl Iterator<Item = &mut Vec<f32>> {
        self.place.iter_mut().chain(&mut self.velocity).chain(&mut self.acceleration)
    }

    fn push(&mut self, figures: [[f64; 2]; 3]) {
        self.figures().zip(figures.as_flattened()).for_each(|(all, one)| all.push(*one as f32));
    }
}

/// Jumps of depth in a frame and the strength of its picture's edges.
#[derive(Clone, Debug)]
pub(super) struct EdgeFrame {
    width: usize,
    height: usize,
    /// Smoothed magnitude of the brightness gradient of every pixel, in [`STRENGTH_STEPS`]. In bytes a frame stays in the
    /// cache while it is looked at.
    gradient: Arc<[u8]>,
    jumps: Jumps,
    /// Timestamp of depth minus that of colour, seconds.
    stamp: f64,
}

/// How depth is supposed to lie beside colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Supposition {
    /// Where depth lies in the picture when nothing moves: columns, rows (pixels), and relative size about the middle.
    pub(super) shift: [f64; 2],
    pub(super) zoom: f64,
    /// Seconds by which depth is measured later than its timestamp.
    pub(super) delay: f64,
    /// Time from the first row to the last, of colour minus that of depth, seconds.
    pub(super) rows: f64,
}

impl Supposition {
    /// Everything as the timestamps say.
    pub(super) const NONE: Self = Self { shift: [0.0; 2], zoom: 0.0, delay: 0.0, rows: 0.0 };
}

impl EdgeFrame {
    /// Jumps of frame `image`, which is `tracked[index]`, with raw depth units of `depth_scale` per metre; none without a
    /// velocity.
    pub(super) fn new(
        image: &RgbdFrame,
        camera: &PinholeCamera,
        depth_scale: f64,
        tracked: &[Tracked],
        index: usize,
    ) -> Option<Self> {
        let motion = motion(tracked, index)?;
        let camera_from_world = tracked[index].world_from_mid.rotation.inverse();
        let flow = |motion: &Vector6<f64>, ray: &Vector3<f64>, inverse_depth: f64| {
            let shift = camera_from_world * Vector3::from(motion.fixed_rows::<3>(0));
            // What stands still moves against the camera; per depth, so that the z of the ray is 1.
            let moved = -Vector3::from(motion.fixed_rows::<3>(3)).cross(ray) - shift * inverse_depth;
            [camera.fx * (moved.x - ray.x * moved.z), camera.fy * (moved.y - ray.y * moved.z)]
        };
        let mut found = Jumps::default();
        for (place, raw) in jumps(image) {
            let (ray, inverse_depth) = (camera.ray(place[0], place[1]), depth_scale / f64::from(raw));
            let flows =
                [motion.velocity, motion.acceleration].map(|motion| flow(&motion, &ray, inverse_depth));
            found.push([place, flows[0], flows[1]]);
        }
        Some(Self {
            width: image.width,
            height: image.height,
            gradient: gradient(image).into(),
            jumps: found,
            stamp: image.depth_timestamp - image.timestamp,
        })
    }

    /// Number of jumps.
    pub(super) fn len(&self) -> usize {
        self.jumps.place[0].len()
    }

    /// Of the jumps, pixels per second.
    pub(super) fn sum_of_squared_speeds(&self) -> f64 {
        self.jumps.velocity.iter().flatten().map(|speed| f64::from(speed * speed)).sum()
    }

    /// Keeps every `step`-th jump.
    pub(super) fn thin_out(&mut self, step: usize) {
        self.jumps.figures().for_each(|all| *all = all.iter().step_by(step).copied().collect());
    }

    /// Sum of the strengths of the picture's edges where the jumps of depth should lie, and of how many that is. Those that
    /// leave the picture do not count.
    pub(super) fn strength(&self, supposed: &Supposition) -> (f64, usize) {
        let (mut sum, mut count) = (0.0, 0);
        for start in (0..self.len()).step_by(LANES) {
            let lanes = LANES.min(self.len() - start);
            let [u, v] = self.places_in_colour(start, lanes, supposed);
            for (u, v) in u.into_iter().zip(v).take(lanes) {
                if let Some(strength) = self.sample(u, v) {
                    sum += f64::from(strength);
                    count += 1;
                }
            }
        }
        (sum / f64::from(STRENGTH_STEPS), count)
    }

    /// Where `lanes` jumps of depth from number `start` on should lie in the picture: columns and rows, pixels.
    ///
    /// Plain loops over arrays of a known length become vector instructions.
    fn places_in_colour(&self, start: usize, lanes: usize, supposed: &Supposition) -> [[f32; LANES]; 2] {
        let load = |all: &[Vec<f32>; 2]| {
            [0, 1].map(|axis| {
                let mut loaded = [0.0; LANES];
                loaded[..lanes].copy_from_slice(&all[axis][start..start + lanes]);
                loaded
            })
        };
        let (place, velocity) = (load(&self.jumps.place), load(&self.jumps.velocity));
        let acceleration = load(&self.jumps.acceleration);
        let size = [self.width as f32, self.height as f32];
        // Both times count from the timestamp of colour. Only the difference of the rows' times is supposed.
        let time_of_depth = (self.stamp + supposed.delay) as f32;
        let (rows, zoom) = (supposed.rows as f32, supposed.zoom as f32);
        let moved = |axis: usize, lane: usize, time: f32| {
            let (sum, difference) = (time + time_of_depth, time - time_of_depth);
            place[axis][lane] + difference * (velocity[axis][lane] + 0.5 * sum * acceleration[axis][lane])
        };
        let time_of_row = |row: f32| rows * ((row + 0.5) / size[1] - 0.5);
        let mut places = [[0.0; LANES]; 2];
        for lane in 0..LANES {
            // The row decides the time and the time the row; a second look is enough.
            let near = moved(1, lane, time_of_row(place[1][lane]));
            let time = time_of_row(near);
            for axis in 0..2 {
                let from_middle = place[axis][lane] + 0.5 - 0.5 * size[axis];
                places[axis][lane] =
                    moved(axis, lane, time) + supposed.shift[axis] as f32 + zoom * from_middle;
            }
        }
        places
    }

    /// Bilinear value of the gradient, in [`STRENGTH_STEPS`]; none outside of the picture.
    fn sample(&self, u: f32, v: f32) -> Option<f32> {
        let inside = |x: f32, size: usize| x >= 0.0 && x < (size - 1) as f32;
        if !inside(u, self.width) || !inside(v, self.height) {
            return None;
        }
        let (column, row) = (u as u32, v as u32);
        let (a, b) = (u - column as f32, v - row as f32);
        let at = row as usize * self.width + column as usize;
        let pair = |at: usize| {
            let [left, right] = [self.gradient[at], self.gradient[at + 1]].map(f32::from);
            left + a * (right - left)
        };
        let (upper, lower) = (pair(at), pair(at + self.width));
        Some(upper + b * (lower - upper))
    }
}

/// Places of jumps between the pixels of a row or of a column, and the raw depth of the near side.
pub(super) fn jumps(image: &RgbdFrame) -> Vec<([f64; 2], u16)> {
    let (width, height) = (image.width, image.height);
    let mut found = Vec::new();
    for v in 0..height {
        for u in 0..width {
            let here = image.depth[v * width + u];
            for [along_u, along_v] in [[REACH, 0], [0, REACH]] {
                let (other_u, other_v) = (u + along_u, v + along_v);
                if here == 0 || other_u >= width || other_v >= height {
                    continue;
                }
                let there = image.depth[other_v * width + other_u];
                let (near, far) = (here.min(there), here.max(there));
                if near > 0 && f64::from(far) > (1.0 + MIN_JUMP) * f64::from(near) {
                    let middle = [u as f64 + 0.5 * along_u as f64, v as f64 + 0.5 * along_v as f64];
                    found.push((middle, near));
                }
            }
        }
    }
    found
}

/// Magnitude of the gradient of the green channel, no more than [`STRONGEST`], smoothed by (1 2 1)/4 along both axes, in
/// [`STRENGTH_STEPS`]. 0 on the border.
pub(super) fn gradient(image: &RgbdFrame) -> Vec<u8> {
    let (width, height) = (image.width, image.height);
    let green = |at: usize| f32::from(image.rgb[3 * at + 1]);
    let strength = |at: usize| {
        let (u, v) = (at % width, at / width);
        if u == 0 || v == 0 || u + 1 == width || v + 1 == height {
            return 0.0;
        }
        let (along_u, along_v) = (green(at + 1) - green(at - 1), green(at + width) - green(at - width));
        along_u.hypot(along_v).min(STRONGEST)
    };
    // Central differences of green, which most pixels of a sensor measure; then 1 2 1 along rows and columns.
    let magnitude: Vec<f32> = (0..width * height).map(strength).collect();
    let smoothed = |values: &[f32], step: usize| {
        let mut out = vec![0.0; values.len()];
        for at in step..values.len().saturating_sub(step) {
            out[at] = 0.25 * (values[at - step] + values[at + step]) + 0.5 * values[at];
        }
        out
    };
    let whole = smoothed(&smoothed(&magnitude, 1), width);
    whole.into_iter().map(|strength| (STRENGTH_STEPS * strength).round() as u8).collect()
}
