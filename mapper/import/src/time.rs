//! Times to the nanosecond.

use std::fmt;

/// Nanoseconds since whenever the clock of the recording began.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Time(i64);

const NANOSECONDS: i64 = 1_000_000_000;

impl Time {
    /// From nanoseconds; none beyond 292 years.
    pub(crate) fn from_nanoseconds(nanoseconds: u64) -> Option<Self> {
        i64::try_from(nanoseconds).ok().map(Self)
    }

    /// From seconds and nanoseconds, as messages of ROS have them.
    pub(crate) fn from_parts(seconds: i64, nanoseconds: u32) -> Option<Self> {
        seconds.checked_mul(NANOSECONDS)?.checked_add(i64::from(nanoseconds)).map(Self)
    }

    /// From seconds: the shortest decimal that reads as this number is taken for what was meant, so that decimals that were
    /// read once are written again as they were. None for what is not finite or beyond 292 years.
    pub(crate) fn from_seconds(seconds: f64) -> Option<Self> {
        let text = format!("{seconds}");
        let (sign, digits) = text.strip_prefix('-').map_or((1, text.as_str()), |digits| (-1, digits));
        let (whole, decimals) = digits.split_once('.').unwrap_or((digits, ""));
        let whole: i64 = whole.parse().ok()?;
        // The tenth decimal rounds the ninth.
        let padded: String = decimals.chars().chain(std::iter::repeat('0')).take(10).collect();
        let fraction = (padded.parse::<i64>().ok()? + 5) / 10;
        whole.checked_mul(NANOSECONDS)?.checked_add(fraction).map(|time| Self(sign * time))
    }

    /// Seconds, as near as a double comes.
    pub(crate) fn seconds(self) -> f64 {
        // Decimal to binary rounds once; a division of the integer would round twice.
        self.to_string().parse().unwrap_or(0.0)
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (sign, time) = (if self.0 < 0 { "-" } else { "" }, self.0.unsigned_abs());
        let unit = NANOSECONDS as u64;
        write!(f, "{sign}{}.{:09}", time / unit, time % unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_kept() {
        for (seconds, text) in [
            (1_305_031_102.175_304, "1305031102.175304000"),
            (0.1, "0.100000000"),
            (-2.25, "-2.250000000"),
            (1e-9, "0.000000001"),
            (0.999_999_999_9, "1.000000000"),
            (59_426.112_113, "59426.112113000"),
        ] {
            assert_eq!(Time::from_seconds(seconds).unwrap().to_string(), text);
        }
        assert_eq!(Time::from_parts(1_700_000_000, 123_456_789).unwrap().to_string(), "1700000000.123456789");
        assert_eq!(Time::from_parts(1_700_000_000, 123_456_789).unwrap().seconds(), 1_700_000_000.123_456_7);
        assert_eq!([f64::NAN, f64::INFINITY, 1e12].map(Time::from_seconds), [None; 3]);
        assert_eq!(Time::from_nanoseconds(u64::MAX), None);
    }
}
