//! What goes wrong while a camera films.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use super::SynthError;

/// Frames by their index, in ranges with both ends.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FrameRanges(Vec<RangeInclusive<usize>>);

impl FrameRanges {
    /// No frames.
    pub const NONE: Self = Self(Vec::new());

    /// Frames in these ranges.
    #[must_use]
    pub fn new(ranges: Vec<RangeInclusive<usize>>) -> Self {
        Self(ranges)
    }

    /// Whether the frame is one of them.
    #[must_use]
    pub fn contains(&self, index: usize) -> bool {
        self.0.iter().any(|range| range.contains(&index))
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The largest index; none without frames.
    pub(super) fn last(&self) -> Option<usize> {
        self.0.iter().map(|range| *range.end()).max()
    }
}

impl fmt::Display for FrameRanges {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return formatter.write_str("none");
        }
        let ranges: Vec<_> =
            self.0.iter().map(|range| format!("{}-{}", range.start(), range.end())).collect();
        formatter.write_str(&ranges.join(", "))
    }
}

impl FromStr for FrameRanges {
    type Err = SynthError;

    /// Reads ranges such as `10-15,20`.
    fn from_str(text: &str) -> Result<Self, SynthError> {
        let range = |part: &str| {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let (first, last) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
            (first <= last).then_some(first..=last)
        };
        let ranges: Option<Vec<_>> = text.split(',').map(range).collect();
        ranges.map(Self).ok_or_else(|| SynthError::FrameRanges { text: text.to_owned() })
    }
}

/// What goes wrong, by the index of the frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Events {
    /// Frames that are covered: colours and depth are 0.
    pub black: FrameRanges,
    /// Frames with a lamp or the sun in both lenses: colours are 255, and depth, whose pattern drowns, is 0.
    pub saturated: FrameRanges,
    /// From this frame on the camera goes again where it has been from the first frame on.
    pub jump: Option<usize>,
}

impl Events {
    /// Nothing goes wrong.
    pub const NONE: Self = Self { black: FrameRanges::NONE, saturated: FrameRanges::NONE, jump: None };

    /// What fills the colours of the frame instead of the scene, in which case it has no depth.
    pub(super) fn flood(&self, index: usize) -> Option<u8> {
        match () {
            () if self.black.contains(index) => Some(0),
            () if self.saturated.contains(index) => Some(u8::MAX),
            () => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_both_ends() {
        let frames: FrameRanges = "10-12, 20".parse().unwrap();
        let held: Vec<usize> = (0..30).filter(|index| frames.contains(*index)).collect();
        assert_eq!((held, frames.last()), (vec![10, 11, 12, 20], Some(20)));
        for text in ["", "5-3", "a", "1-", "1,,2", "-4"] {
            let message = text.parse::<FrameRanges>().unwrap_err().to_string();
            assert_eq!(message, format!("\"{text}\" are no frames; ranges such as 10-15,20 are needed"));
        }
    }
}
