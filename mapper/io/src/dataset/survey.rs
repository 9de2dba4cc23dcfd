//! A look at a few frames of a data set before any long work.

use super::{Dataset, RgbdFrame};

/// What a sample of frames shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    /// Frames looked at.
    pub sampled: usize,
    /// What is wrong with those of them that cannot be read, one sentence each.
    pub unreadable: Vec<String>,
    /// Readable frames whose colour image is black.
    pub black: usize,
    /// Readable frames whose colour image is of one brightness, black or not.
    pub plain: usize,
    /// Readable frames without a single depth value.
    pub without_depth: usize,
    /// Readable frames whose depth values have their two bytes exchanged, as it looks.
    pub swapped_depth: usize,
    /// Share (0 to 1) of the pixels of the readable frames whose depth is missing; `None` without readable frames.
    pub missing_depth: Option<f64>,
    /// Median depth in metres; `None` when all depth is missing.
    pub median_depth: Option<f64>,
}

/// Looks at up to `max_frames` frames (at least one), evenly spread over the whole data set.
#[must_use]
pub fn survey(dataset: &Dataset, max_frames: usize) -> Survey {
    let sampled = max_frames.clamp(1, dataset.len().max(1));
    let mut unreadable = Vec::new();
    let (mut black, mut plain, mut without_depth, mut swapped_depth) = (0, 0, 0, 0);
    let mut counts = DepthCounts::new();
    for k in 0..sampled {
        match dataset.frame(k * dataset.len() / sampled) {
            Ok(frame) => {
                // Black is a lens cap, plain a wall or an image that is empty.
                let [mean, deviation] = brightness(&frame.rgb);
                black += usize::from(mean < BLACK);
                plain += usize::from(deviation < PLAIN);
                without_depth += usize::from(frame.depth_is_empty());
                swapped_depth += usize::from(looks_swapped(&frame.depth, frame.width));
                counts.add(&frame);
            }
            Err(error) => unreadable.push(error.to_string()),
        }
    }
    Survey {
        sampled,
        unreadable,
        black,
        plain,
        without_depth,
        swapped_depth,
        missing_depth: counts.missing_share(),
        median_depth: counts.median_raw().map(|raw| raw / dataset.calibration().depth_scale),
    }
}

/// Mean of the stored colour values below which an image is black, and standard deviation below which it shows nothing.
const BLACK: f64 = 2.0;
const PLAIN: f64 = 1.0;

/// Mean and standard deviation of stored values.
fn brightness(values: &[u8]) -> [f64; 2] {
    let count = values.len().max(1) as f64;
    let sum: u64 = values.iter().map(|value| u64::from(*value)).sum();
    let squares: u64 = values.iter().map(|value| u64::from(*value).pow(2)).sum();
    let mean = sum as f64 / count;
    [mean, (squares as f64 / count - mean * mean).max(0.0).sqrt()]
}

/// How many times smoother depth has to be with its bytes exchanged to be taken for exchanged. A step of one raw unit is
/// one of 256 with them, so right and wrong lie far from 1 on both sides.
const SMOOTHER: u32 = 4;

/// Pixels in which depth has to differ from its right neighbour before anything is said about its bytes.
const FEWEST_STEPS: usize = 100;

/// Whether raw depth of `width` columns is smoother with the two bytes of each value exchanged.
///
/// Surfaces are smooth, so steps between neighbours are a few raw units. Values that are all multiples of 256 (8-bit depth,
/// shifted) are not judged: exchanged, none would lie beyond 255 units.
fn looks_swapped(depth: &[u16], width: usize) -> bool {
    let neighbours = || {
        let rows = depth.chunks_exact(width.max(1));
        rows.flat_map(|row| row.windows(2)).map(|pair| [pair[0], pair[1]]).filter(|pair| !pair.contains(&0))
    };
    if neighbours().all(|pair| pair[0].to_le_bytes()[0] == 0) {
        return false;
    }
    let mut steps: Vec<u32> =
        neighbours().map(|[a, b]| u32::from(a.abs_diff(b))).filter(|step| *step > 0).collect();
    let mut exchanged: Vec<u32> = neighbours()
        .map(|[a, b]| u32::from(a.swap_bytes().abs_diff(b.swap_bytes())))
        .filter(|step| *step > 0)
        .collect();
    if steps.len() < FEWEST_STEPS {
        return false;
    }
    // The median: edges of things are long steps with either order.
    let median = |steps: &mut [u32]| *steps.select_nth_unstable(steps.len() / 2).1;
    median(&mut steps) > SMOOTHER * median(&mut exchanged)
}

/// How often each raw depth value occurs.
struct DepthCounts(Vec<u64>);

impl DepthCounts {
    fn new() -> Self {
        Self(vec![0; usize::from(u16::MAX) + 1])
    }

    fn add(&mut self, frame: &RgbdFrame) {
        for depth in &frame.depth {
            self.0[usize::from(*depth)] += 1;
        }
    }

    fn missing_share(&self) -> Option<f64> {
        let total: u64 = self.0.iter().sum();
        (total > 0).then(|| self.0[0] as f64 / total as f64)
    }

    /// The smallest raw value that at least half of the values that are not missing do not exceed.
    fn median_raw(&self) -> Option<f64> {
        let valid: u64 = self.0[1..].iter().sum();
        let mut seen = 0;
        self.0.iter().enumerate().skip(1).find_map(|(raw, count)| {
            seen += count;
            (valid > 0 && 2 * seen >= valid).then_some(raw as f64)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exchanged_bytes_are_recognised_by_their_steps() {
        // A wall that is tilted in two directions, an edge in its middle, and holes.
        let tilted = |unit: usize| -> Vec<u16> {
            let raw = |k: usize| {
                let (column, row) = (k % 40, k / 40);
                let far = if column < 20 { 1500 } else { 2300 };
                if k.is_multiple_of(17) { 0 } else { ((far + 3 * column + 2 * row) * unit) as u16 }
            };
            (0..40 * 30).map(raw).collect()
        };
        let swapped: Vec<u16> = tilted(1).iter().map(|raw| raw.swap_bytes()).collect();
        assert!(!looks_swapped(&tilted(1), 40) && looks_swapped(&swapped, 40));
        // Finer units fill both bytes.
        let swapped: Vec<u16> = tilted(10).iter().map(|raw| raw.swap_bytes()).collect();
        assert!(!looks_swapped(&tilted(10), 40) && looks_swapped(&swapped, 40));
        // Eight bits of depth in the high byte are coarse and right.
        let coarse: Vec<u16> = tilted(1).iter().map(|raw| raw / 16 * 256).collect();
        assert!(!looks_swapped(&coarse, 40));
        assert!(!looks_swapped(&[0; 1200], 40) && !looks_swapped(&[], 0));
    }

    #[test]
    fn depth_counts_know_share_and_median() {
        let depth = vec![0, 0, 0, 100, 200, 65_535, 300, 250];
        let frame = RgbdFrame {
            index: 0,
            timestamp: 0.0,
            depth_timestamp: 0.0,
            exposure_seconds: 0.01,
            width: 8,
            height: 1,
            rgb: vec![0; 24],
            depth,
        };
        let mut counts = DepthCounts::new();
        assert_eq!((counts.missing_share(), counts.median_raw()), (None, None));
        counts.add(&frame);
        assert_eq!((counts.missing_share(), counts.median_raw()), (Some(0.375), Some(250.0)));
    }
}
