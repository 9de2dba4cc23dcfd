//! Checkpoints of a tracked run.
//!
//! A checkpoint holds what was recorded of the frames so far and all that the tracker knows, bit for bit, so that the frames
//! that are left get the poses that they would have got. It is a few megabytes.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use mba_tracker::{SessionError, Tracker};
use serde::{Deserialize, Serialize};

use super::TrackingOptions;
use crate::run::{CHECKPOINT_FILE, RunRows, RunWriter};
use crate::uncertainty::Uncertainty;
use mba_io::checkpoint::{CheckpointError, Fingerprint, Identity, load, save};
use mba_io::dataset::Dataset;

/// Layout of the content.
const VERSION: u32 = 4;

/// Time until the first checkpoint: a run that is stopped sooner has nothing worth keeping.
const FIRST_AFTER: Duration = Duration::from_secs(1);

/// A checkpoint as it is read.
#[derive(Deserialize)]
struct Saved {
    rows: RunRows,
    uncertainty: Uncertainty,
    session: Vec<u8>,
}

/// The same as it is written.
#[derive(Serialize)]
struct Saving<'a> {
    rows: RunRows,
    uncertainty: &'a Uncertainty,
    session: &'a [u8],
}

/// Where and how often a tracked run is kept, and what it goes on from.
pub struct TrackingCheckpoint {
    path: PathBuf,
    identity: Identity,
    interval: Duration,
    started: Instant,
    last: Option<Instant>,
    saved: Option<Saved>,
}

impl TrackingCheckpoint {
    /// Checkpoints in the RUN folder `out`, one after each `interval`. With `resume`, the run goes on from the one that lies
    /// there, if there is one.
    ///
    /// # Errors
    /// [`CheckpointError`] when that is damaged or of another run.
    pub fn new(
        out: &Path,
        dataset: &Dataset,
        options: &TrackingOptions,
        interval: Duration,
        resume: bool,
    ) -> Result<Self, CheckpointError> {
        let (path, identity) = (out.join(CHECKPOINT_FILE), identity(dataset, options));
        let saved = if resume && path.is_file() { Some(load::<Saved>(&path, &identity)?) } else { None };
        if let Some(saved) = &saved
            && !saved.rows.is_of(dataset.len())
        {
            return Err(CheckpointError::Rows { path });
        }
        Ok(Self { path, identity, interval, started: Instant::now(), last: None, saved })
    }

    /// Frames that are done when the run goes on from here; 0 for a run that begins.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.saved.as_ref().map_or(0, |saved| saved.rows.len())
    }

    /// Puts a stopped run back where it was; returns the index of the frame that comes next.
    pub(super) fn restore(
        &mut self,
        tracker: &mut Tracker<'_>,
        uncertainty: &mut Uncertainty,
        run: &mut RunWriter,
    ) -> Result<usize, super::TrackingError> {
        let Some(saved) = self.saved.take() else { return Ok(0) };
        tracker.restore(&saved.session).map_err(|reason| self.unsound(reason))?;
        *uncertainty = saved.uncertainty;
        let next = saved.rows.len();
        run.go_on(saved.rows)?;
        Ok(next)
    }

    fn unsound(&self, reason: SessionError) -> CheckpointError {
        CheckpointError::Session { path: self.path.clone(), reason }
    }

    /// Whether it is time for another checkpoint; after the last frame of a run that took so long that there is one it is.
    pub(super) fn is_due(&self, is_last: bool) -> bool {
        match self.last {
            Some(last) => is_last || last.elapsed() >= self.interval,
            None => self.started.elapsed() >= self.interval.min(FIRST_AFTER),
        }
    }

    /// Writes a checkpoint, unless the run has not proven yet that it takes the place of an earlier one in its folder.
    pub(super) fn write(
        &mut self,
        tracker: &mut Tracker<'_>,
        uncertainty: &Uncertainty,
        run: &RunWriter,
    ) -> Result<(), CheckpointError> {
        if run.has_earlier() {
            return Ok(());
        }
        let mut session = Vec::new();
        tracker.save(&mut |part| session.extend_from_slice(part));
        save(
            &self.path,
            &self.identity,
            &Saving { rows: run.record().rows(), uncertainty, session: &session },
        )?;
        self.last = Some(Instant::now());
        Ok(())
    }
}

/// What a checkpoint has to agree with.
fn identity(dataset: &Dataset, options: &TrackingOptions) -> Identity {
    Identity {
        program: Fingerprint::of(&(env!("CARGO_PKG_VERSION"), "track", VERSION)),
        dataset: Fingerprint::of_dataset(dataset),
        trajectory: Fingerprint::default(),
        settings: Fingerprint::of(&format!("{options:?}")),
        simd: Fingerprint::of_simd(dataset.simd()),
    }
}
