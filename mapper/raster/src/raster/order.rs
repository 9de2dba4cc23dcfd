//! Order of the Gaussians that are drawn: by depth, ties by index.

use super::project::{Extent, NOT_DRAWN, Projected, Splat};

/// Rank of a Gaussian that is not drawn.
pub(super) const NO_RANK: u32 = u32::MAX;

/// Ranks per piece of work.
const RANKS_PER_PIECE: usize = 4096;

const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;

/// Splats in the order in which they are composited.
#[derive(Debug, Default)]
pub(super) struct Order {
    pub(super) splats: Vec<Splat>,
    pub(super) extents: Vec<Extent>,
    pub(super) rank_from_gaussian: Vec<u32>,
    /// Depth key and Gaussian of every rank.
    keys: Vec<(u32, u32)>,
    swap: Vec<(u32, u32)>,
}

/// A range of ranks.
pub(super) struct RankPiece<'a> {
    splats: &'a mut [Splat],
    extents: &'a mut [Extent],
    keys: &'a [(u32, u32)],
}

impl Order {
    /// Number of Gaussians that are drawn.
    pub(super) fn len(&self) -> usize {
        self.splats.len()
    }

    /// Sorts what was projected; the pieces are then to be filled.
    pub(super) fn sort(&mut self, projected: &[Projected]) {
        self.keys.clear();
        let drawn = projected.iter().zip(0..).filter(|(p, _)| p.depth_key != NOT_DRAWN);
        self.keys.extend(drawn.map(|(p, gaussian)| (p.depth_key, gaussian)));
        sort_by_key(&mut self.keys, &mut self.swap);
        self.rank_from_gaussian.clear();
        self.rank_from_gaussian.resize(projected.len(), NO_RANK);
        for (&(_, gaussian), rank) in self.keys.iter().zip(0..) {
            self.rank_from_gaussian[gaussian as usize] = rank;
        }
        self.splats.resize(self.keys.len(), Splat::default());
        self.extents.resize(self.keys.len(), Extent::default());
    }

    /// Pieces of ranks, of which what was projected is then to be gathered.
    pub(super) fn pieces_mut(&mut self) -> impl Iterator<Item = RankPiece<'_>> {
        let splats = self.splats.chunks_mut(RANKS_PER_PIECE);
        let outputs = splats.zip(self.extents.chunks_mut(RANKS_PER_PIECE));
        let keys = self.keys.chunks(RANKS_PER_PIECE);
        outputs.zip(keys).map(|((splats, extents), keys)| RankPiece { splats, extents, keys })
    }
}

impl RankPiece<'_> {
    /// Copies what was projected.
    pub(super) fn gather(&mut self, projected: &[Projected]) {
        let outputs = self.splats.iter_mut().zip(self.extents.iter_mut());
        for ((splat, extent), &(_, gaussian)) in outputs.zip(self.keys) {
            let projected = &projected[gaussian as usize];
            (*splat, *extent) = (projected.splat, projected.extent);
        }
    }
}

/// Stable radix sort by the first number, least significant digits first.
fn sort_by_key(keys: &mut Vec<(u32, u32)>, swap: &mut Vec<(u32, u32)>) {
    swap.clear();
    swap.resize(keys.len(), (0, 0));
    for pass in 0..u32::BITS.div_ceil(DIGIT_BITS) {
        let digit = |key: u32| (key >> (pass * DIGIT_BITS)) as usize % DIGITS;
        // Counts per digit, then places where each digit begins, then one move in the old order.
        let mut next = [0_u32; DIGITS];
        keys.iter().for_each(|&(key, _)| next[digit(key)] += 1);
        let mut start = 0;
        for count in &mut next {
            start += core::mem::replace(count, start);
        }
        for &entry in keys.iter() {
            let place = &mut next[digit(entry.0)];
            swap[*place as usize] = entry;
            *place += 1;
        }
        core::mem::swap(keys, swap);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sorts_like_a_stable_comparison_sort() {
        let scrambled = |i: u32| i.wrapping_mul(2_654_435_761) % 5003 * 800_011;
        let mut keys: Vec<(u32, u32)> = (0..20_000).map(|i| (scrambled(i), i)).collect();
        let mut want = keys.clone();
        want.sort_by_key(|&(key, _)| key);
        sort_by_key(&mut keys, &mut Vec::new());
        assert!(keys == want, "the order differs");
    }
}
