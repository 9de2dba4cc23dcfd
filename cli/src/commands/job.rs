//! What `mba split`, `mba map JOB`, `mba status` and `mba merge` have in common.

use std::path::Path;

use mba_mapper::dataset::Dataset;
use mba_mapper::run::{Run, path_of};
use mba_mapper::submaps::{Job, SubmapError};
use mba_tracker::SimdLevel;

use super::open;
use crate::failure::{OrBadInput, bad_input, is_disk_full};
use crate::written_run::output_hint;

/// Opens the folder of a job.
///
/// # Errors
/// Bad input with advice.
pub fn open_job(folder: &Path) -> anyhow::Result<Job> {
    Job::open(folder).or_else(refuse)
}

/// The data set and the run that a job was made of, with what the run found about the camera.
///
/// # Errors
/// Bad input with advice.
pub fn inputs(job: &Job, simd: SimdLevel) -> anyhow::Result<(Dataset, Run)> {
    for (what, folder) in [("run", job.run()), ("data set", job.dataset())] {
        if !folder.is_dir() {
            let (folder, job) = (folder.display(), job.folder.display());
            let message = format!("the {what} {folder} that the job {job} was made of is not there");
            return Err(bad_input(message, "put it back, or split the run again"));
        }
    }
    let run = open::run(&job.run())?;
    let dataset = open::with_estimates(open::dataset(&job.dataset(), simd)?, &run)?;
    Ok((dataset, run))
}

/// The data set of a run: the one on record, or the one that is given instead.
///
/// # Errors
/// Bad input with advice.
pub fn dataset_of(run: &Run, instead: Option<&Path>, simd: SimdLevel) -> anyhow::Result<Dataset> {
    let recorded = path_of(&run.summary.settings.dataset);
    let folder = instead.unwrap_or(&recorded);
    if instead.is_none() && !folder.is_dir() {
        let message = format!("the data set {} of the run is not there", folder.display());
        return Err(bad_input(message, "name the folder with --dataset"));
    }
    open::with_estimates(open::dataset(folder, simd)?, run)
}

/// The refusal of a job, with advice.
///
/// # Errors
/// Always: bad input, or failure when the disk is full.
pub fn refuse<T>(error: SubmapError) -> anyhow::Result<T> {
    if is_disk_full(&error) || matches!(&error, SubmapError::File(error) if is_disk_full(error)) {
        return Err(error.into());
    }
    let hint = match &error {
        SubmapError::NotAJob { .. } => "give the folder that `mba split --out` wrote",
        SubmapError::Malformed { .. } => {
            "restore the file, or make it again with `mba split` or `mba map JOB`"
        }
        SubmapError::Changed { .. } => "restore it, or split the run again",
        SubmapError::NoSuchGroup { .. } => "`mba status JOB` lists the groups",
        SubmapError::Missing { .. } => {
            "map it with `mba map JOB --submap K`, or leave such groups out with --without-missing"
        }
        SubmapError::Foreign { .. } | SubmapError::Damaged { .. } => {
            "`mba map JOB --submap K` maps the group again"
        }
        SubmapError::NoKeyframes => "look at frames.csv of the run and at `mba info DATASET`",
        SubmapError::Output(error) => output_hint(error),
        _ => "look at `mba status JOB`, and split the run again if its files have changed",
    };
    Err(error).or_bad_input(hint)
}
