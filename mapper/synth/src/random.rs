//! Random numbers that depend on seed, frame and row only, never on the order of computation.

use rand_core::Rng;
use rand_pcg::Pcg32;

/// What the numbers are for; different purposes get independent numbers.
#[derive(Clone, Copy)]
pub(super) enum Purpose {
    Shake = 1,
    Colour = 2,
    Depth = 3,
    Inertial = 4,
}

/// Random numbers of one row of one frame.
pub(super) struct RowRandom {
    generator: Pcg32,
}

impl RowRandom {
    /// The generator for `purpose`, frame and row (both 0 where they do not apply).
    pub(super) fn new(seed: u64, purpose: Purpose, frame: usize, row: usize) -> Self {
        let place = (frame as u64) << 32 | row as u64;
        let state = scramble(seed ^ scramble(place));
        Self { generator: Pcg32::new(state, scramble(state ^ purpose as u64)) }
    }

    /// Uniform in `(0, 1)`, 24 bits.
    pub(super) fn uniform(&mut self) -> f32 {
        ((self.generator.next_u32() >> 8) as f32 + 0.5) / 16_777_216.0
    }

    /// Two independent standard normal numbers (Box and Muller 1958).
    pub(super) fn normal_pair(&mut self) -> [f32; 2] {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        let (sine, cosine) = (std::f32::consts::TAU * self.uniform()).sin_cos();
        [radius * cosine, radius * sine]
    }
}

/// The output function of SplitMix64 (Steele et al. 2014): neighbouring inputs give unrelated outputs.
fn scramble(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_unit_variance_and_rows_are_independent() {
        let row = |row| {
            let mut random = RowRandom::new(7, Purpose::Colour, 3, row);
            (0..20_000).flat_map(move |_| random.normal_pair()).collect::<Vec<_>>()
        };
        let (a, b) = (row(0), row(1));
        let mean = |values: &mut dyn Iterator<Item = f32>| values.map(f64::from).sum::<f64>() / 40_000.0;
        assert!(mean(&mut a.iter().copied()).abs() < 0.02, "four standard errors are 0.02");
        assert!((mean(&mut a.iter().map(|x| x * x)) - 1.0).abs() < 0.03);
        assert!((mean(&mut a.iter().map(|x| x.powi(4))) - 3.0).abs() < 0.2, "kurtosis of a normal");
        assert!(mean(&mut a.iter().zip(&b).map(|(x, y)| x * y)).abs() < 0.02);
    }
}
