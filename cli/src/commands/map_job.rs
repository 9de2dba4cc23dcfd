//! `mba map JOB`: one group, or all of them in processes of their own.

use std::path::Path;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::Duration;

use mba_mapper::mapping::{MapError, MapProgress};
use mba_mapper::submaps::{
    GroupState, Job, JobStatus, SubmapError, Worked, estimated_memory_bytes, map_submap,
};
use mba_tracker::SimdLevel;
use mba_tracker::simd::level_name;
use serde_json::json;

use super::map::{self, PROGRESS_STEPS, advise};
use super::status::table;
use super::{calibrate, job};
use crate::args::map::Map;
use crate::console::Console;
use crate::failure::{TRY_AGAIN, failed, interrupted, try_again};
use crate::interrupt::{self, Resumption};
use crate::itself;
use crate::report::table as tables;
use crate::written_run::{self, absolute, note_written};

/// Time between two looks at the processes.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Share of the free memory that processes may take.
const MEMORY_SHARE: f64 = 0.8;

/// Maps what the arguments name: one group of a job, all of them, or a whole data set.
///
/// # Errors
/// As [`map::run`], [`submap`] and [`all`].
pub fn run(args: &Map, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    match (args.work.submap, args.work.jobs) {
        (Some(k), _) => submap(args, k, simd, console),
        (None, Some(jobs)) => all(args, jobs.get().into(), simd, console),
        (None, None) => map::run(args, simd, console),
    }
}

/// Maps group `k` of the job and prints the summary.
///
/// # Errors
/// Bad input when the job cannot be used; exit code 75 after a signal; failure when the results cannot be written.
pub fn submap(args: &Map, k: usize, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let job = job::open_job(&args.dataset)?;
    let (dataset, run) = job::inputs(&job, simd)?;
    let _saving = interrupt::saving();
    let progress = console.progress(PROGRESS_STEPS, "mapping");
    let observe = |at: MapProgress| {
        progress.set_position((at.position * PROGRESS_STEPS as f64) as u64);
        progress.set_message(format!("group {k}: {}, {:.1} dB", at.size, at.psnr));
        interrupt::flow()
    };
    let values = json!({ "job": absolute(&job.folder), "group": k, "trajectory": job.plan.run });
    let describe = written_run::settings(&dataset, &values);
    let interval = args.mapping.checkpoint_interval;
    let worked = map_submap(&job, k, (&dataset, &run), interval, describe, observe);
    progress.finish_and_clear();
    let folder = job.group_folder(k);
    let summary = match worked {
        Ok(Worked::Mapped(summary)) => summary,
        Ok(Worked::WasThere) => {
            console.note(format!("{} is mapped already", folder.display()));
            return Ok(());
        }
        Err(SubmapError::Map(MapError::Stopped)) => {
            let message = format!("stopped; {} holds a checkpoint", folder.display());
            return Err(try_again(message, Resumption::Always.advice()));
        }
        Err(SubmapError::Map(error)) => return advise(error, &run).map(drop),
        Err(error) => return job::refuse(error),
    };
    calibrate::keep(&dataset, &folder)?;
    note_written(&folder, console);
    console.result(&*summary, tables::summary)
}

/// Maps all groups of the job that are not mapped yet in at most `most` processes at a time, and prints its status.
///
/// # Errors
/// As [`submap`]; the first group that failed is named.
pub fn all(args: &Map, most: usize, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let job = job::open_job(&args.dataset)?;
    let (dataset, _) = job::inputs(&job, simd)?;
    let camera = dataset.calibration().camera;
    let most = fitting(&job, camera.width * camera.height, most, console);
    let waiting = JobStatus::of(&job).groups.into_iter().filter(|group| group.state != GroupState::Done);
    let mut waiting: Vec<usize> = waiting.map(|group| group.group).rev().collect();
    let _saving = interrupt::saving();
    let threads = (rayon::current_num_threads() / most.max(1)).max(1);
    let progress = console.progress(waiting.len(), "mapping");
    let mut workers = Workers { running: Vec::new() };
    let mut failure = None;
    while failure.is_none() && !(waiting.is_empty() && workers.running.is_empty()) {
        while workers.running.len() < most
            && let Some(group) = waiting.pop()
        {
            let child = start(&job.folder, group, (threads, simd), args.mapping.checkpoint_interval)?;
            workers.running.push((group, child));
        }
        sleep(LOOK_EVERY);
        if interrupt::flow().is_break() {
            let message = "stopped; the groups that were in work hold checkpoints";
            return Err(interrupted(message, Resumption::Always.advice()));
        }
        for (group, code) in workers.ended()? {
            progress.inc(1);
            if code != Some(0) {
                failure = failure.or(Some((group, code)));
            }
        }
    }
    progress.finish_and_clear();
    match failure {
        None => console.result(&JobStatus::of(&job), table),
        Some((group, code)) => Err(failure_of(&job, group, code)),
    }
}

/// What a process that ended with another exit code than 0 means.
fn failure_of(job: &Job, group: usize, code: Option<i32>) -> anyhow::Error {
    let folder = job.group_folder(group);
    match code {
        Some(code) if code == i32::from(TRY_AGAIN) => {
            let message = format!("{} was stopped by a signal", folder.display());
            try_again(message, Resumption::Always.advice())
        }
        Some(code) => {
            let message = format!("{} ended with exit code {code}", folder.display());
            failed(message, format!("see what `mba map {} --submap {group}` says", job.folder.display()))
        }
        None => {
            let message = format!("the process of {} was killed", folder.display());
            failed(message, format!("with too little memory, start fewer: {}", Resumption::Always.advice()))
        }
    }
}

/// How many processes fit into the memory that is free: at least one, at most `most`.
fn fitting(job: &Job, pixels: usize, most: usize, console: &Console) -> usize {
    let each = estimated_memory_bytes(job, pixels) as f64;
    let Some(free) = free_memory_bytes() else { return most };
    let fitting = ((MEMORY_SHARE * free as f64 / each) as usize).max(1);
    if fitting < most {
        let (each, free) = (each / 1e6, free as f64 / 1e6);
        console.note(format!("{fitting} at a time: each takes {each:.0} MB, and {free:.0} MB are free"));
    }
    fitting.min(most)
}

/// Memory that the system can give, where it says so.
fn free_memory_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kibibytes: u64 = line.trim().strip_suffix(" kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

/// Starts the process of one group.
fn start(
    job: &Path,
    group: usize,
    (threads, simd): (usize, SimdLevel),
    interval: Duration,
) -> anyhow::Result<Child> {
    let mut command = itself::command()?;
    command.arg("map").arg(job).args(["--submap", &group.to_string(), "--quiet"]);
    command.args(["--threads", &threads.to_string(), "--simd", level_name(simd)]);
    command.args(["--checkpoint-interval", &interval.as_secs_f64().to_string()]);
    Ok(command.stdin(Stdio::null()).stdout(Stdio::null()).spawn()?)
}

/// Processes at work; those that are left end with this one.
struct Workers {
    running: Vec<(usize, Child)>,
}

impl Workers {
    /// Groups whose processes have ended since the last look, with their exit codes.
    fn ended(&mut self) -> anyhow::Result<Vec<(usize, Option<i32>)>> {
        let mut ended = Vec::new();
        let mut running = Vec::new();
        for (group, mut child) in self.running.drain(..) {
            match child.try_wait()? {
                Some(status) => ended.push((group, status.code())),
                None => running.push((group, child)),
            }
        }
        self.running = running;
        Ok(ended)
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        // A group that is killed loses what it did since its last checkpoint, and nothing else.
        for (_, child) in &mut self.running {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
