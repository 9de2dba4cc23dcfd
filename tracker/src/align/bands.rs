//! The parts of a frame whose rows are exposed at about the same time, with virtual views of their own.

use arrayvec::ArrayVec;
use core::ops::Range;

use super::Estimate;
use super::problem::Objective;
use crate::trajectory::BowedTrajectory;
use crate::transfer::{
    MAX_BANDS, MAX_VIRTUAL_VIEWS, PatchSite, RowBand, RowDelay, TransferParts, TransferProblem, VirtualView,
};

/// The bands of rows of a frame at an estimate, those without any patch left out.
pub(super) struct Bands<'o> {
    objective: &'o Objective<'o>,
    estimate: &'o Estimate,
    path: BowedTrajectory,
    sites: &'o [PatchSite],
    count: usize,
    next: usize,
    /// First site that no band had yet.
    first: usize,
    /// Of the current band. Large, so it is filled where it is.
    views: ArrayVec<VirtualView, MAX_VIRTUAL_VIEWS>,
}

impl<'o> Bands<'o> {
    pub(super) fn new(objective: &'o Objective<'o>, estimate: &'o Estimate, sites: &'o [PatchSite]) -> Self {
        let timing = &objective.frame.timing;
        let count = if timing.is_rolling() { timing.bands.clamp(1, MAX_BANDS) } else { 1 };
        Self {
            objective,
            estimate,
            path: estimate.path(),
            sites,
            count,
            next: 0,
            first: 0,
            views: ArrayVec::new_const(),
        }
    }
}

impl TransferParts for Bands<'_> {
    fn next_part(&mut self) -> Option<(TransferProblem<'_>, Range<usize>)> {
        let Objective { frame, level, camera, views, inverse_depth, .. } = *self.objective;
        let height = frame.levels[level].height;
        while self.next < self.count {
            let band = RowBand::new(self.next, self.count, height);
            self.next += 1;
            // Sites are sorted by row where there is more than one band.
            let end = match self.next == self.count {
                true => self.sites.len(),
                false => {
                    self.sites.partition_point(|site| usize::try_from(site.v).is_ok_and(|v| v < band.end))
                }
            };
            let sites = self.first..end;
            self.first = end;
            if !sites.is_empty() {
                band.fill_views(&self.path, &frame.timing, views, &camera, inverse_depth, &mut self.views);
                let step = (frame.timing.readout / height as f64) as f32;
                let rows = RowDelay { centre: band.centre() as f32, step };
                return Some((self.objective.transfer_problem(self.estimate, &self.views, rows), sites));
            }
        }
        None
    }
}
