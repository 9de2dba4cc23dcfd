//! Sum of what a splat got from its tiles.

use super::backward::SplatSums;
use super::bin::Bins;
use super::lanes::LANES;
use super::order::NO_RANK;

/// Number of sums of a splat.
pub(super) const SUMS: usize = 12;

/// The sums of eight Gaussians over all tiles, in the order of the tiles; zero for those that are not drawn.
/// Returns whether any is drawn.
#[inline(always)]
pub(super) fn reduce(ranks: &[u32], bins: &Bins, sums: &[SplatSums], out: &mut [[f32; LANES]; SUMS]) -> bool {
    *out = [[0.0; LANES]; SUMS];
    let mut any = false;
    for (lane, &rank) in ranks.iter().enumerate().filter(|(_, rank)| **rank != NO_RANK) {
        any = true;
        let mut total = [0.0; SUMS];
        for &slot in bins.slots(rank as usize) {
            total.iter_mut().zip(&sums[slot as usize]).for_each(|(total, sum)| *total += sum);
        }
        out.iter_mut().zip(total).for_each(|(out, total)| out[lane] = total);
    }
    any
}
