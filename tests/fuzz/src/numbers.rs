//! Numbers and choices from the bytes of an input.

/// Numbers that programs get wrong.
const ODD: [f64; 14] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    1e300,
    -1e300,
    1e-300,
    f64::MIN_POSITIVE,
    1e10,
    4_294_967_296.0,
    1e-9,
];

/// What is left of an input. At its end there are zeros.
pub(super) struct Numbers<'a>(&'a [u8]);

impl<'a> Numbers<'a> {
    pub(super) fn new(data: &'a [u8]) -> Self {
        Self(data)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    pub(super) fn bytes<const N: usize>(&mut self) -> [u8; N] {
        core::array::from_fn(|_| self.byte())
    }

    pub(super) fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes())
    }

    /// 0 to `limit` - 1.
    pub(super) fn below(&mut self, limit: usize) -> usize {
        usize::from(self.byte()) % limit.max(1)
    }

    /// True for one byte in `rarity`.
    pub(super) fn rarely(&mut self, rarity: usize) -> bool {
        self.below(rarity) == rarity - 1
    }

    /// Mostly `usual` plus up to `spread` to both sides, now and then anything.
    pub(super) fn near(&mut self, usual: f64, spread: f64) -> f64 {
        match self.byte() {
            step @ 0..=239 => usual + spread * (f64::from(step) - 120.0) / 120.0,
            240..=253 => ODD[self.below(ODD.len())],
            _ => f64::from_bits(u64::from_le_bytes(self.bytes())),
        }
    }
}
