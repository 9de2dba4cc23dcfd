//! The bits of a scan, the codes in them, and the blocks that codes are.

/// Largest mean of a block that is believed, in the units of its transform: eight times 128, and as much again for encoders
/// that go beyond white on purpose.
const LARGEST_MEAN: i32 = 2048;

/// Bits of the longest difference of two means, and of the longest other value, in an image with 8 bits.
const LONGEST_DIFFERENCE: u8 = 11;
const LONGEST_VALUE: u8 = 10;

/// Bits of a code that are looked up at once; longer codes are rare.
const LOOKED_UP: u32 = 9;

/// Values of a block.
pub(super) const BLOCK: usize = 64;

/// The next marker and what follows it.
pub(super) fn next_marker(bytes: &[u8]) -> Option<(u8, &[u8])> {
    let at = bytes.windows(2).position(|pair| pair[0] == 0xFF && !matches!(pair[1], 0 | 0xFF))?;
    Some((bytes[at + 1], &bytes[at + 2..]))
}

/// One component in a unit of a scan.
pub(super) struct Part<'a> {
    pub(super) blocks: usize,
    pub(super) means: &'a Codes,
    pub(super) values: &'a Codes,
    pub(super) mean_step: i32,
}

/// Why a block cannot be read.
pub(super) enum BlockDamage {
    Ends,
    Senseless,
}

/// The bits of a scan up to the next marker.
#[derive(Clone)]
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    /// Bytes that were taken out of `bytes`.
    pub(super) at: usize,
    /// The next `count` bits are the lowest of these.
    held: u64,
    pub(super) count: u32,
}

impl<'a> Bits<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, held: 0, count: 0 }
    }

    /// Holds more than 32 bits, or all there are: a code and its value have no more than 27.
    pub(super) fn fill(&mut self) {
        if self.count > 32 {
            return;
        }
        // Bytes of ones, behind which something special may be, are rare.
        if let Some(word) = self.bytes[self.at..].first_chunk::<4>()
            && !word.contains(&0xFF)
        {
            self.at += 4;
            self.held = self.held << 32 | u64::from(u32::from_be_bytes(*word));
            self.count += 32;
            return;
        }
        while self.count <= 48 {
            let byte = match self.bytes[self.at..] {
                // A byte of ones that is no marker.
                [0xFF, 0, ..] => {
                    self.at += 2;
                    0xFF
                }
                [] | [0xFF, ..] => return,
                [byte, ..] => {
                    self.at += 1;
                    byte
                }
            };
            self.held = self.held << 8 | u64::from(byte);
            self.count += 8;
        }
    }

    /// Goes on behind the restart marker; false if there is none.
    pub(super) fn restart(&mut self) -> bool {
        let Some((marker, rest)) = next_marker(&self.bytes[self.at..]) else { return false };
        *self = Self { at: self.bytes.len() - rest.len(), held: 0, count: 0, ..*self };
        (0xD0..=0xD7).contains(&marker)
    }

    /// Takes up to 16 bits; none if there are not as many.
    pub(super) fn take(&mut self, length: u32) -> Option<u32> {
        // With all 64 bits held, shifting them out for none would be shifting by their number.
        if length == 0 {
            return Some(0);
        }
        self.count = self.count.checked_sub(length)?;
        Some((self.held >> self.count) as u32 & ((1 << length) - 1))
    }

    /// Takes one code and returns its symbol.
    fn symbol(&mut self, codes: &Codes) -> Result<u8, BlockDamage> {
        self.fill();
        // What is missing is taken for zeros.
        let next =
            if self.count >= 16 { self.held >> (self.count - 16) } else { self.held << (16 - self.count) };
        let (length, symbol) = codes.find(next as u32 & 0xFFFF).ok_or(BlockDamage::Senseless)?;
        self.take(length).ok_or(BlockDamage::Ends)?;
        Ok(symbol)
    }

    /// Takes the values of one block; `mean` is that of the block before.
    pub(super) fn block(&mut self, part: &Part<'_>, mean: &mut i32) -> Result<(), BlockDamage> {
        let length = self.symbol(part.means)?;
        if length > LONGEST_DIFFERENCE {
            return Err(BlockDamage::Senseless);
        }
        let bits = self.take(length.into()).ok_or(BlockDamage::Ends)? as i32;
        // The first bit is 0 for negative numbers, which are counted up from the lowest.
        let is_negative = length > 0 && bits >> (length - 1) == 0;
        *mean += if is_negative { bits + 1 - (1 << length) } else { bits };
        if mean.saturating_mul(part.mean_step).abs() > LARGEST_MEAN {
            return Err(BlockDamage::Senseless);
        }
        let mut place = 1;
        while place < BLOCK {
            let symbol = self.symbol(part.values)?;
            let (zeros, length) = (usize::from(symbol >> 4), symbol & 15);
            if length > LONGEST_VALUE {
                return Err(BlockDamage::Senseless);
            }
            // All others are zero, but for the symbol of 16 zeros.
            if length == 0 && zeros != 15 {
                break;
            }
            place += zeros + 1;
            if place > BLOCK {
                return Err(BlockDamage::Senseless);
            }
            self.take(length.into()).ok_or(BlockDamage::Ends)?;
        }
        Ok(())
    }
}

/// Codes of different lengths, which follow each other in the order of their numbers.
pub(super) struct Codes {
    /// Length and symbol of the code at the beginning of such bits; length 0 if it is longer.
    short: Vec<(u8, u8)>,
    /// For every length from 1 bit on, one past its last code, filled up to 16 bits, and by how much the place of a symbol is
    /// above its code.
    ends: [(u32, i32); 16],
    symbols: Vec<u8>,
}

impl Codes {
    /// Codes of which `lengths` says how many have 1, 2, .. 16 bits.
    pub(super) fn new(lengths: &[u8; 16], symbols: &[u8]) -> Self {
        let mut short = vec![(0, 0); 1 << LOOKED_UP];
        let mut ends = [(0, 0); 16];
        let (mut code, mut place) = (0_u32, 0);
        for ((length, count), end) in (1..).zip(lengths).zip(&mut ends) {
            let above = place as i32 - code as i32;
            for _ in 0..*count {
                if length <= LOOKED_UP {
                    let first = (code << (LOOKED_UP - length)) as usize;
                    let same = short.iter_mut().skip(first).take(1 << (LOOKED_UP - length));
                    same.for_each(|entry| *entry = (length as u8, symbols[place]));
                }
                code += 1;
                place += 1;
            }
            *end = (code << (16 - length), above);
            code <<= 1;
        }
        Self { short, ends, symbols: symbols.to_vec() }
    }

    /// Length and symbol of the code at the beginning of 16 bits.
    fn find(&self, bits: u32) -> Option<(u32, u8)> {
        let (length, symbol) = self.short[(bits >> (16 - LOOKED_UP)) as usize];
        if length > 0 {
            return Some((length.into(), symbol));
        }
        let (length, (_, above)) = (1..).zip(self.ends).find(|(_, (end, _))| bits < *end)?;
        let place = (bits >> (16 - length)) as i32 + above;
        Some((length, *self.symbols.get(usize::try_from(place).ok()?)?))
    }
}
