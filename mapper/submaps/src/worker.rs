//! The map of one group.

use std::fs;
use std::io::ErrorKind;
use std::ops::ControlFlow;
use std::time::Duration;

use mba_io::FileError;
use mba_io::checkpoint::CheckpointError;
use mba_io::dataset::Dataset;
use mba_io::output::{OutputFolder, Permission};
use mba_io::run_layout::{CHECKPOINT_FILE, SUBMAP_FILE};
use mba_slam::mapping::{MapError, MapProgress, map_part};
use mba_slam::run::{Run, RunSettings, Summary};

use crate::submap::Submap;
use crate::{Job, SubmapError};

/// Memory of the program itself, its tables and threads, bytes.
const PROGRAM_BYTES: u64 = 60 << 20;

/// Bytes per pixel of every keyframe in memory: colours and depth at two resolutions, tables of the path.
const BYTES_PER_KEYFRAME_PIXEL: u64 = 14;

/// Bytes per pixel of one picture for rendering, gradients and Gaussians.
const BYTES_PER_PIXEL: u64 = 500;

/// Bytes per Gaussian: parameters, gradients, moments.
const BYTES_PER_GAUSSIAN: u64 = 400;

/// What became of a group.
#[derive(Clone, Debug)]
pub enum Worked {
    /// Its map was there already.
    WasThere,
    /// It was mapped.
    Mapped(Box<Summary>),
}

/// Maps group `k` of a job into its RUN folder, from the checkpoint there if that belongs to the same work, unless the map is
/// there already. The result depends on the plan and its inputs only. `describe` becomes the settings of the run;
/// `observe` is called after every step and says whether to go on.
///
/// # Errors
/// [`SubmapError::NoSuchGroup`], [`SubmapError::Changed`], [`SubmapError::Output`] while another process maps the same
/// group, and those of [`map_part`]; [`MapError::Stopped`] if `observe` asked for it.
pub fn map_submap(
    job: &Job,
    k: usize,
    (dataset, run): (&Dataset, &Run),
    checkpoint_interval: Duration,
    describe: RunSettings,
    mut observe: impl FnMut(MapProgress) -> ControlFlow<()>,
) -> Result<Worked, SubmapError> {
    let Some(group) = job.plan.groups.get(k) else {
        let groups = job.plan.groups.len();
        return Err(SubmapError::NoSuchGroup { folder: job.folder.clone(), group: k, groups });
    };
    job.check_inputs(dataset, run)?;
    let folder = job.group_folder(k);
    let inputs = [dataset.folder(), run.folder.as_path()];
    let claim = || OutputFolder::for_run(&folder, &Permission { force: false, inputs: &inputs });
    let mut out = claim()?;
    if Submap::read(job, k).is_ok() {
        return Ok(Worked::WasThere);
    }
    // From here on the folder is in work: what says otherwise goes first.
    remove(&folder.join(SUBMAP_FILE))?;
    let settings = job.plan.settings.mapping(group, checkpoint_interval);
    let part = group.part();
    let mut map =
        |out, resume| map_part((dataset, run), &settings, &part, out, resume, describe.clone(), &mut observe);
    let mapped = match map(out, true) {
        // The checkpoint is one of an earlier plan, or damaged: it is of no use to anybody.
        Err(MapError::Checkpoint(error)) if !matches!(error, CheckpointError::File(_)) => {
            remove(&folder.join(CHECKPOINT_FILE))?;
            out = claim()?;
            map(out, false)
        }
        other => other,
    }?;
    // Another process that has waited for the folder finds it either without this file or finished.
    let _out = claim()?;
    Submap::write(job, k, &mapped.keyframes)?;
    Ok(Worked::Mapped(Box::new(mapped.summary)))
}

/// Most memory that the process of a group takes, about, bytes.
#[must_use]
pub fn estimated_memory_bytes(job: &Job, pixels: usize) -> u64 {
    let of_group = |group: &crate::Group| {
        let keyframes = (group.keyframes.len() + group.border.len()) as u64;
        let pictures = pixels as u64 * (BYTES_PER_PIXEL + keyframes * BYTES_PER_KEYFRAME_PIXEL);
        pictures + group.max_gaussians as u64 * BYTES_PER_GAUSSIAN
    };
    PROGRAM_BYTES + job.plan.groups.iter().map(of_group).max().unwrap_or(0)
}

fn remove(path: &std::path::Path) -> Result<(), SubmapError> {
    match fs::remove_file(path) {
        Err(reason) if reason.kind() != ErrorKind::NotFound => {
            Err(FileError::Unwritable { path: path.to_owned(), reason }.into())
        }
        _ => Ok(()),
    }
}
