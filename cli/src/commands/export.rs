//! `mba export`.

use std::path::{Path, PathBuf};

use mba_mapper::FileError;
use mba_mapper::dataset::Dataset;
use mba_mapper::export::{
    ExportError, POSES_FILE, PosedFrame, PosedFrames, SceneExport, SceneLayout, TIMES_FILE, format_euroc,
    format_kitti_poses, format_kitti_times, format_tum, is_own_euroc, is_own_tum,
};
use mba_mapper::gaussians::format_ply_for_viewers;
use mba_mapper::map::{MAP_FILE, StoredMap};
use mba_mapper::output::{ExportFolder, OutputFile, Permission};
use mba_mapper::run::{
    EXPOSURES_FILE, FRAMES_FILE, FrameStatus, Run, SUMMARY_FILE, TRAJECTORY_FILE, for_viewers, is_own_splats,
    path_of,
};
use mba_tracker::SimdLevel;
use serde::Serialize;

use super::open;
use crate::args::export::{Export, ExportFormat};
use crate::console::Console;
use crate::failure::{OrBadInput, bad_input, is_disk_full};
use crate::report::table::pairs;
use crate::written_run::{name, refuse};

/// What is printed.
#[derive(Clone, Debug, Serialize)]
struct Written {
    format: String,
    path: String,
    frames: usize,
    /// Frames that are left out because they have no pose.
    lost: usize,
    /// Points beside the images; none for formats without.
    points: Option<usize>,
}

/// Writes a run in the format of another program.
///
/// # Errors
/// Bad input when the run or its data set cannot be used; failure when the disk is full.
pub fn run(args: &Export, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let run = open::run(&args.run)?;
    if let (Some(images), None) = (args.images, args.to.layout()) {
        let message = format!("--images {} is given, but {} has no images", name(&images), name(&args.to));
        return Err(bad_input(message, "leave it out, or give --to nerfstudio or --to colmap"));
    }
    match (args.to.layout(), args.to) {
        (Some(layout), _) => scene(args, (&run, simd), layout, console),
        (None, ExportFormat::Euroc) => trajectory(args, &run, format_euroc, is_own_euroc, console),
        (None, ExportFormat::Kitti) => kitti(args, &run, console),
        (None, ExportFormat::Splat) => splats(args, (&run, simd), console),
        (None, _) => trajectory(args, &run, format_tum, is_own_tum, console),
    }
}

/// What is read and must not be written: the data set, the run and its files.
fn inputs(args: &Export, run: &Run) -> Vec<PathBuf> {
    let files = [TRAJECTORY_FILE, EXPOSURES_FILE, FRAMES_FILE, SUMMARY_FILE, MAP_FILE];
    let files = files.iter().map(|name| run.folder.join(name));
    [data_set_folder(args, run), run.folder.clone()].into_iter().chain(files).collect()
}

fn data_set_folder(args: &Export, run: &Run) -> PathBuf {
    args.dataset.clone().unwrap_or_else(|| path_of(&run.summary.settings.dataset))
}

/// Writes a file of poses.
fn trajectory(
    args: &Export,
    run: &Run,
    format: impl Fn(&[PosedFrame]) -> String,
    is_own: impl Fn(&[u8]) -> bool,
    console: &Console,
) -> anyhow::Result<()> {
    let inputs = inputs(args, run);
    let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
    let permission = Permission { force: args.force, inputs: &inputs };
    let posed = PosedFrames::of(run).or_else(advise)?;
    let out = OutputFile::claim(&args.out, &permission, is_own).or_else(refuse)?;
    out.write(format(&posed.frames).as_bytes()).or_else(unwritable)?;
    let written = written(args, posed.frames.len(), posed.lost, None);
    if out.is_stdout() {
        console.note(table(&written).trim_end());
        return Ok(());
    }
    console.result(&written, table)
}

/// Writes poses and times.
fn kitti(args: &Export, run: &Run, console: &Console) -> anyhow::Result<()> {
    let posed = PosedFrames::of(run).or_else(advise)?;
    let mut folder = claim(args, run, [POSES_FILE, TIMES_FILE].map(str::to_owned))?;
    let texts =
        [(POSES_FILE, format_kitti_poses(&posed.frames)), (TIMES_FILE, format_kitti_times(&posed.frames))];
    for (name, text) in texts {
        folder.write(name, text.as_bytes()).or_else(unwritable)?;
    }
    folder.finish().or_else(refuse)?;
    console.result(&written(args, posed.frames.len(), posed.lost, None), table)
}

/// Writes the Gaussians of the map with colours for viewers.
fn splats(args: &Export, (run, simd): (&Run, SimdLevel), console: &Console) -> anyhow::Result<()> {
    let folder = run.folder.display();
    let StoredMap::Gaussians(map) = open::map(run)? else {
        let message =
            format!("the map of {folder} is a tri-plane field, which viewers of splats do not know");
        return Err(bad_input(message, "`mba mesh` makes a surface of it"));
    };
    let Some(camera) = &run.summary.settings.camera else {
        return Err(bad_input(format!("{folder} does not tell its camera"), "make the run again"));
    };
    let inputs = inputs(args, run);
    let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
    let permission = Permission { force: args.force, inputs: &inputs };
    let out = OutputFile::claim(&args.out, &permission, is_own_splats).or_else(refuse)?;
    let response = camera.inverse_response().or_bad_input("make the run again")?;
    let viewing = for_viewers(
        simd,
        &map,
        camera.pinhole(),
        &response,
        run.summary.upright.as_ref(),
        (&run.exposures, &run.frames),
    );
    out.write(&format_ply_for_viewers(&map, &viewing)).or_else(unwritable)?;
    let lost = run.frames.iter().filter(|frame| frame.status == FrameStatus::Lost).count();
    let written = written(args, run.frames.len() - lost, lost, Some(map.len()));
    if out.is_stdout() {
        console.note(table(&written).trim_end());
        return Ok(());
    }
    console.result(&written, table)
}

/// Writes images, cameras and points.
fn scene(
    args: &Export,
    (run, simd): (&Run, SimdLevel),
    layout: SceneLayout,
    console: &Console,
) -> anyhow::Result<()> {
    let map = if run.folder.join(MAP_FILE).is_file() { Some(open::map(run)?) } else { None };
    let gaussians = map.as_ref().and_then(|map| match map {
        StoredMap::Gaussians(map) => Some(map),
        StoredMap::Field(_) => None,
    });
    let images = args.images.unwrap_or_default().into();
    let export = SceneExport::new(run, layout, images, gaussians).or_else(advise)?;
    let dataset = if export.needs_data_set() { Some(data_set(args, run, simd)?) } else { None };
    let mut folder = claim(args, run, export.names())?;
    let progress = console.progress(export.frames().len(), "exporting");
    let points = export.write(dataset.as_ref(), &mut folder, || progress.inc(1)).or_else(advise)?;
    progress.finish_and_clear();
    folder.finish().or_else(refuse)?;
    console.result(&written(args, export.frames().len(), export.lost(), Some(points)), table)
}

fn claim(args: &Export, run: &Run, names: impl IntoIterator<Item = String>) -> anyhow::Result<ExportFolder> {
    let inputs = inputs(args, run);
    let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
    ExportFolder::claim(&args.out, &Permission { force: args.force, inputs: &inputs }, names).or_else(refuse)
}

/// The data set that some of the images are in.
fn data_set(args: &Export, run: &Run, simd: SimdLevel) -> anyhow::Result<Dataset> {
    if args.dataset.is_some() {
        return open::dataset(&data_set_folder(args, run), simd);
    }
    open::open_with(&data_set_folder(args, run), simd).map_err(|error| {
        let message = format!("the run {} needs its data set: {error}", run.folder.display());
        bad_input(message, "name the place where the data set is now with --dataset")
    })
}

fn written(args: &Export, frames: usize, lost: usize, points: Option<usize>) -> Written {
    Written { format: name(&args.to), path: args.out.display().to_string(), frames, lost, points }
}

/// Advice for what stops an export.
fn advise<T>(error: ExportError) -> anyhow::Result<T> {
    let hint = match error {
        ExportError::Output(error) => return refuse(error),
        ExportError::File(error) => return unwritable(error),
        ExportError::NoPose { .. } => "look at frames.csv of the run and at `mba info DATASET`",
        ExportError::NoKeyframe { .. } => "give --images all",
        ExportError::Camera { .. } | ExportError::Frames { .. } | ExportError::Timestamp { .. } => {
            "name the data set of the run with --dataset, or track it again"
        }
        ExportError::Image(_) => "restore the image, or track the data set again",
        _ => "make the run again, or restore its files",
    };
    Err(error).or_bad_input(hint)
}

/// Advice for a file that cannot be written.
fn unwritable<T>(error: FileError) -> anyhow::Result<T> {
    if is_disk_full(&error) {
        return Err(error.into());
    }
    Err(error).or_bad_input("name a place for --out that can be written")
}

fn table(written: &Written) -> String {
    let lost = match written.lost {
        0 => String::new(),
        1 => ", 1 lost frame left out".to_owned(),
        lost => format!(", {lost} lost frames left out"),
    };
    let mut rows = vec![("format", written.format.clone()), ("frames", format!("{}{lost}", written.frames))];
    rows.extend(written.points.map(|points| ("points", points.to_string())));
    rows.push(("written to", written.path.clone()));
    pairs(&rows)
}
