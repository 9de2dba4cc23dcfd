//! When each row of a picture and of its depth is exposed.

/// How a camera reads its rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowTiming {
    /// Time from the first row of a colour picture to the last, seconds: row `v` of `H` is exposed around
    /// `((v + 1/2)/H - 1/2)` times this, counted from the frame's time. Negative where the last row comes first,
    /// 0 where all rows are exposed together.
    pub readout_seconds: f64,
    /// The same for the rows of a depth image.
    pub depth_readout_seconds: f64,
}

/// When the rows of one frame are exposed, in units of the time of its path: 0 where the path begins, 1 where it ends,
/// mid exposure of the middle row in between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowTimes {
    /// Time that the shutter is open, 0 to 1; 1 for a path that is the exposure of the middle row.
    pub exposure: f64,
    /// From the first row of the picture to the last.
    pub readout: f64,
    /// From mid exposure to the middle row of the depth image.
    pub depth_offset: f64,
    /// From the first row of the depth image to the last.
    pub depth_readout: f64,
}

/// Shortest path in seconds that has rows: in less time nothing moves.
const SHORTEST_PATH: f64 = 1e-6;

impl RowTiming {
    /// Row times of a frame that was exposed for `exposure_seconds` and whose depth was measured
    /// `depth_offset_seconds` after mid exposure, on a path over `path_seconds` around mid exposure.
    #[must_use]
    pub fn over(&self, path_seconds: f64, exposure_seconds: f64, depth_offset_seconds: f64) -> RowTimes {
        let unit = path_seconds.max(SHORTEST_PATH);
        RowTimes {
            exposure: if exposure_seconds == path_seconds { 1.0 } else { exposure_seconds / unit },
            readout: self.readout_seconds / unit,
            depth_offset: depth_offset_seconds / unit,
            depth_readout: self.depth_readout_seconds / unit,
        }
    }

    /// Seconds around mid exposure in which anything of a frame is measured: its exposure time for a camera that
    /// exposes all rows together and measures depth with them.
    #[must_use]
    pub fn span_seconds(&self, exposure_seconds: f64, depth_offset_seconds: f64) -> f64 {
        let colour = exposure_seconds + self.readout_seconds.abs();
        let depth = 2.0 * depth_offset_seconds.abs() + self.depth_readout_seconds.abs();
        colour.max(depth)
    }
}

impl RowTimes {
    /// A frame whose path is its exposure, whose rows are exposed together, and whose depth is that of mid exposure.
    pub const GLOBAL: Self = Self { exposure: 1.0, readout: 0.0, depth_offset: 0.0, depth_readout: 0.0 };

    /// Whether all rows are exposed together over the whole path, with depth of the middle.
    #[must_use]
    pub fn is_global(&self) -> bool {
        *self == Self::GLOBAL
    }

    /// Path time of the virtual view at `s` of the exposure, 0 at opening to 1 at closing, for the row at `v` of
    /// `height`; rows count from the centre of the first.
    #[must_use]
    pub fn view_time(&self, s: f64, v: f64, height: usize) -> f64 {
        if self.exposure == 1.0 && self.readout == 0.0 {
            return s;
        }
        0.5 + (s - 0.5) * self.exposure + share_of_rows(v, height) * self.readout
    }

    /// Path time of the row at `v` of the depth image.
    #[must_use]
    pub fn depth_time(&self, v: f64, height: usize) -> f64 {
        0.5 + self.depth_offset + share_of_rows(v, height) * self.depth_readout
    }
}

/// Place of a row between the first (-1/2) and the last (1/2).
fn share_of_rows(v: f64, height: usize) -> f64 {
    (v + 0.5) / height as f64 - 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_exposed_one_after_the_other_around_the_middle_one() {
        let timing = RowTiming { readout_seconds: 0.02, depth_readout_seconds: -0.01 };
        // 10 ms of exposure, depth 11 ms late: colour takes 30 ms, depth at most 2 * 11 + 10.
        let span = timing.span_seconds(0.01, 0.011);
        assert!((span - 0.032).abs() < 1e-15);
        let times = timing.over(span, 0.01, 0.011);
        let seconds = |time: f64| (time - 0.5) * span;
        let opening_of_first = seconds(times.view_time(0.0, -0.5, 480));
        let closing_of_last = seconds(times.view_time(1.0, 479.5, 480));
        assert!((opening_of_first + 0.015).abs() < 1e-15 && (closing_of_last - 0.015).abs() < 1e-15);
        assert!((seconds(times.view_time(0.5, 239.5, 480))).abs() < 1e-15);
        assert!((seconds(times.depth_time(-0.5, 480)) - 0.016).abs() < 1e-15);
        assert!((seconds(times.depth_time(239.5, 480)) - 0.011).abs() < 1e-15);
    }

    #[test]
    fn a_global_shutter_is_a_path_over_the_exposure() {
        let timing = RowTiming::default();
        assert_eq!(timing.span_seconds(0.016, 0.0), 0.016);
        assert_eq!(timing.over(0.016, 0.016, 0.0), RowTimes::GLOBAL);
        for s in [1.0 / 18.0, 0.3, 0.5] {
            assert_eq!(RowTimes::GLOBAL.view_time(s, 17.0, 480).to_bits(), s.to_bits());
        }
        // No time at all is no division by zero.
        assert_eq!(timing.over(0.0, 0.0, 0.0), RowTimes::GLOBAL);
    }
}
