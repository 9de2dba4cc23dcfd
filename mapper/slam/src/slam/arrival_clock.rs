//! When the next frame is due.

use std::thread;
use std::time::{Duration, Instant};

use super::settings::Arrival;

/// A clock that frames arrive by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    arrival: Arrival,
    started: Instant,
    first_timestamp: f64,
    frame_seconds: f64,
}

impl Pace {
    /// Frames `frame_seconds` apart, the first at `first_timestamp`, which is now.
    pub(super) fn new(arrival: Arrival, first_timestamp: f64, frame_seconds: f64) -> Self {
        Self { arrival, started: Instant::now(), first_timestamp, frame_seconds }
    }

    /// Waits until the frame of that time has arrived. `false` when the next one is there already: then this one is
    /// late.
    pub(super) fn wait_for(&self, timestamp: f64) -> bool {
        if self.arrival == Arrival::LockStep {
            return true;
        }
        let due = timestamp - self.first_timestamp;
        let ahead = due - self.started.elapsed().as_secs_f64();
        if let Ok(ahead) = Duration::try_from_secs_f64(ahead) {
            thread::sleep(ahead);
        }
        ahead > -self.frame_seconds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_wait_for_their_time_and_late_ones_are_refused() {
        let pace = Pace::new(Arrival::RealTime, 100.0, 0.02);
        let before = Instant::now();
        assert!(pace.wait_for(100.03));
        assert!(before.elapsed() >= Duration::from_millis(29));
        assert!(!pace.wait_for(99.9));
        assert!(Pace::new(Arrival::LockStep, 100.0, 0.02).wait_for(0.0));
    }
}
