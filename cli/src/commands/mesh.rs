//! `mba mesh`.

use std::path::Path;
use std::time::Instant;

use mba_mapper::map::Scene;
use mba_mapper::map::StoredMap;
use mba_mapper::mesh::{MeshFormat, YAxis};
use mba_mapper::output::{OutputFile, Permission};
use mba_mapper::run::{FrameStatus, Run, path_of};
use mba_mapper::surfaces::{
    ColouredDepth, FusionSettings, MapViews, SurfaceError, Trim, ViewSource, passes, surface_of_map,
};
use mba_tracker::SimdLevel;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use serde::Serialize;

use super::alignment::{AlignmentFigures, align};
use super::open;
use crate::args::surface::MeshArgs;
use crate::console::Console;
use crate::failure::{OrBadInput, bad_input, failed, is_disk_full};
use crate::progress::Progress;
use crate::report::table::pairs;
use crate::written_run::refuse;

/// What is printed.
#[derive(Clone, Debug, Serialize)]
struct Written {
    file: String,
    vertices: usize,
    triangles: usize,
    area_m2: f64,
    voxel_cm: f64,
    views: usize,
    seconds: f64,
    alignment: Option<AlignmentFigures>,
}

/// Writes the surface of a run's map.
///
/// # Errors
/// Bad input when run, map or trajectory cannot be used or the voxels are too small; failure when the mesh cannot be
/// written.
pub fn run(args: &MeshArgs, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let start = Instant::now();
    let run = open::run(&args.run)?;
    let (out, format) = output(args, &run)?;
    let map = open::map(&run)?;
    let map = Scene::from(&map);
    let camera = camera(&run)?;
    let poses = keyframe_poses(&run)?;
    let views = poses.len();
    let alignment = args.align.as_ref().map(|file| align(&run, file, args.max_dt)).transpose()?;
    let progress = console.progress(passes(map) * views, "surface");
    let mut source = Watched { views: MapViews::new(simd, map, camera, poses), progress };
    let settings = FusionSettings { voxel: 0.01 * args.voxel_cm, ..FusionSettings::default() };
    let trim = Trim { least_area: 1e-4 * args.least_area_cm2 };
    let mut mesh = surface_of_map(simd, map, &mut source, &settings, &trim)
        .map_err(|error| (hint(&error), error))
        .or_else(|(hint, error)| Err(error).or_bad_content(&run.folder, hint))?;
    source.progress.finish_and_clear();
    if mesh.triangles.is_empty() {
        let message = format!("no keyframe sees a surface in the map of {}", run.folder.display());
        return Err(failed(message, "look at the map with `mba report`; nothing was written"));
    }
    if let Some(faces) = args.faces {
        mesh = mesh.simplified(faces as usize);
    }
    if let Some(alignment) = &alignment {
        mesh.transform(&alignment.reference_from_estimate);
    }
    let y_axis = if alignment.is_some() { YAxis::AsIs } else { YAxis::Down };
    let content =
        format.format(&mesh, y_axis).or_bad_input("give a larger --voxel-cm, or a file that ends in .ply")?;
    match out.write(&content) {
        Err(error) if !is_disk_full(&error) => {
            Err(error).or_bad_input("name a file for --out that can be written")?;
        }
        other => other?,
    }
    let written = Written {
        file: args.out.display().to_string(),
        vertices: mesh.vertices.len(),
        triangles: mesh.triangles.len(),
        area_m2: mesh.area(),
        voxel_cm: args.voxel_cm,
        views,
        seconds: start.elapsed().as_secs_f64(),
        alignment: alignment.as_ref().map(AlignmentFigures::from),
    };
    if out.is_stdout() {
        console.note(table(&written).trim_end());
        return Ok(());
    }
    console.result(&written, table)
}

/// Claims the file for the mesh, before the work, and says what its format is.
fn output(args: &MeshArgs, run: &Run) -> anyhow::Result<(OutputFile, MeshFormat)> {
    let dataset = path_of(&run.summary.settings.dataset);
    let map = StoredMap::path(&run.folder);
    let mut inputs: Vec<&Path> = vec![&dataset];
    inputs.extend(map.as_deref());
    inputs.extend(args.align.as_deref());
    let permission = Permission { force: args.force, inputs: &inputs };
    let out = OutputFile::claim(&args.out, &permission, MeshFormat::is_own).or_else(refuse)?;
    match MeshFormat::of(&args.out) {
        Some(format) => Ok((out, format)),
        // Pipes and devices may have any name.
        None if out.is_stream() => Ok((out, MeshFormat::Ply)),
        None => {
            let (path, endings) = (args.out.display(), MeshFormat::ENDINGS);
            let message = format!("cannot write {path}: the name of a mesh ends in {endings}");
            Err(bad_input(message, "give such a name for --out"))
        }
    }
}

fn camera(run: &Run) -> anyhow::Result<PinholeCamera> {
    let camera = run.summary.settings.camera.as_ref().ok_or_else(|| {
        bad_input(format!("{} does not tell its camera", run.folder.display()), "make the run again")
    })?;
    camera.check().or_bad_input("correct the camera in summary.json, or make the run again")?;
    Ok(camera.pinhole())
}

/// Mid-exposure poses of the keyframes, or of all frames of a run without any; lost ones are of no use.
fn keyframe_poses(run: &Run) -> anyhow::Result<Vec<RigidTransform>> {
    let poses = |all: bool| -> Vec<RigidTransform> {
        let frames = run.exposures.iter().zip(&run.frames);
        let used =
            frames.filter(|(_, frame)| frame.status != FrameStatus::Lost && (all || frame.keyframe != 0));
        used.map(|(exposure, _)| exposure.mid).collect()
    };
    let keyframes = poses(false);
    let poses = if keyframes.is_empty() { poses(true) } else { keyframes };
    if poses.is_empty() {
        let message = format!("{} has no frame with a pose", run.folder.display());
        return Err(bad_input(message, "track and map the sequence again"));
    }
    Ok(poses)
}

/// Views that are counted.
struct Watched<'a> {
    views: MapViews<'a>,
    progress: Progress,
}

impl ViewSource for Watched<'_> {
    fn count(&self) -> usize {
        self.views.count()
    }

    fn view(&mut self, index: usize) -> ColouredDepth {
        self.progress.inc(1);
        self.views.view(index)
    }
}

fn hint(error: &SurfaceError) -> &'static str {
    match error {
        SurfaceError::TooFine { .. } => "give a larger --voxel-cm",
        _ => "correct --voxel-cm",
    }
}

fn table(written: &Written) -> String {
    let Written { vertices, triangles, area_m2, voxel_cm, views, seconds, .. } = written;
    let mut rows = vec![
        ("surface", format!("{area_m2:.2} m2 in {triangles} triangles, {vertices} vertices")),
        ("seen", format!("from {views} views, with voxels of {voxel_cm} cm, in {seconds:.1} s")),
    ];
    rows.extend(written.alignment.as_ref().map(AlignmentFigures::row));
    rows.push(("written to", written.file.clone()));
    pairs(&rows)
}
