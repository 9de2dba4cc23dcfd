//! `mba render`.

use std::path::Path;
use std::time::Instant;

use mba_mapper::evaluation::PoseAlignment;
use mba_mapper::map::{MAP_FILE, StoredMap};
use mba_mapper::output::{Permission, ViewFolder};
use mba_mapper::rendering::{Behind, RenderedView, ViewRenderer};
use mba_mapper::run::{Run, RunCamera, Spread, path_of};
use mba_mapper::trajectory_file::{TimedPose, read_trajectory};
use mba_tracker::SimdLevel;
use serde::Serialize;

use super::alignment::{AlignmentFigures, align};
use super::open;
use crate::args::{Render, Switch, ViewNames};
use crate::console::Console;
use crate::failure::{OrBadInput, bad_input, is_disk_full};
use crate::report::table::{pairs, percent};
use crate::written_run::refuse;

/// What is printed.
#[derive(Clone, Debug, Serialize)]
struct Written {
    folder: String,
    views: usize,
    width: usize,
    height: usize,
    /// Gaussians of the map; 0 for a tri-plane field.
    gaussians: usize,
    /// Time to render and encode a view, without writing files, milliseconds.
    milliseconds_per_view: Option<Spread>,
    /// Share (0 to 1) of all pixels with an alpha above one half.
    solid_share: f64,
    alignment: Option<AlignmentFigures>,
}

/// Renders every pose of a file to a colour and a depth image.
///
/// # Errors
/// Bad input when run, poses or camera cannot be used; failure when the images cannot be written.
pub fn run(args: &Render, simd: SimdLevel, console: &Console) -> anyhow::Result<()> {
    let run = open::run(&args.run)?;
    let map = open::map(&run)?;
    let camera = camera(&run, args)?;
    let poses = poses(&args.poses)?;
    let alignment = args.align.as_ref().map(|file| align(&run, file, args.max_dt)).transpose()?;
    if map.is_empty() {
        console.warning(format!(
            "{} holds no Gaussians: all views are empty",
            run.folder.join(MAP_FILE).display()
        ));
    }
    let poses = in_map_frame(&poses, alignment.as_ref());
    let names = poses.iter().enumerate().map(|(index, pose)| name(args.names, index, pose));
    let inputs = [&*path_of(&run.summary.settings.dataset), &run.folder];
    let permission = Permission { force: args.force, inputs: &inputs };
    let folder = ViewFolder::claim(&args.out, &permission, names).or_else(refuse)?;
    let written = render_all((&map, simd), &camera, &poses, (args, &folder), console)?;
    folder.finish().or_else(refuse)?;
    console.result(&Written { alignment: alignment.as_ref().map(AlignmentFigures::from), ..written }, table)
}

/// The run's camera, or the one that the options describe.
fn camera(run: &Run, args: &Render) -> anyhow::Result<RunCamera> {
    let camera = match (&run.summary.settings.camera, args.size, args.focal) {
        (Some(camera), size, focal) => {
            let sized = size.map_or_else(|| camera.clone(), |(width, height)| camera.resized(width, height));
            focal.map_or_else(|| sized.clone(), |focal| sized.refocused(focal))
        }
        (None, Some((width, height)), Some(focal)) => RunCamera::simple(width, height, focal),
        (None, ..) => {
            let message = format!("{} does not tell its camera", run.folder.display());
            return Err(bad_input(message, "give --size and --focal, or make the run again"));
        }
    };
    camera.check().or_bad_input("correct --size or --focal")?;
    Ok(camera)
}

fn poses(path: &Path) -> anyhow::Result<Vec<TimedPose>> {
    let poses = read_trajectory(path).or_bad_input("--poses needs lines `timestamp tx ty tz qx qy qz qw`")?;
    if poses.is_empty() {
        let message = format!("{} holds no poses", path.display());
        return Err(bad_input(message, "it needs a line `timestamp tx ty tz qx qy qz qw` for every view"));
    }
    Ok(poses)
}

fn in_map_frame(poses: &[TimedPose], alignment: Option<&PoseAlignment>) -> Vec<TimedPose> {
    let Some(alignment) = alignment else { return poses.to_vec() };
    let map_from_reference = alignment.reference_from_estimate.inverse();
    let carry = |pose: &TimedPose| TimedPose {
        timestamp: pose.timestamp,
        world_from_camera: map_from_reference.compose(&pose.world_from_camera),
    };
    poses.iter().map(carry).collect()
}

fn render_all(
    (map, simd): (&StoredMap, SimdLevel),
    camera: &RunCamera,
    poses: &[TimedPose],
    (args, folder): (&Render, &ViewFolder),
    console: &Console,
) -> anyhow::Result<Written> {
    let mut renderer =
        ViewRenderer::new(simd, map, camera.pinhole(), &camera.inverse_response()?, camera.depth_scale);
    let progress = console.progress(poses.len(), "rendering");
    let behind = if args.fill == Switch::On { Behind::Surroundings } else { Behind::Black };
    let mut times = Vec::with_capacity(poses.len());
    let mut solid = 0.0;
    for (index, pose) in poses.iter().enumerate() {
        let start = Instant::now();
        let view = renderer.render(&pose.world_from_camera, behind);
        times.push(1e3 * start.elapsed().as_secs_f64());
        solid += view.solid / poses.len() as f64;
        write(&view, folder, &name(args.names, index, pose))?;
        progress.inc(1);
    }
    progress.finish_and_clear();
    Ok(Written {
        folder: args.out.display().to_string(),
        views: poses.len(),
        width: camera.width,
        height: camera.height,
        gaussians: map.gaussians(),
        milliseconds_per_view: Spread::of(&times),
        solid_share: solid,
        alignment: None,
    })
}

fn write(view: &RenderedView, folder: &ViewFolder, name: &str) -> anyhow::Result<()> {
    let [colour, depth] = folder.paths(name);
    match view.write(&colour, &depth) {
        Err(error) if !is_disk_full(&error) => {
            Err(error).or_bad_input("name a folder for --out that can be written")
        }
        other => Ok(other?),
    }
}

fn name(names: ViewNames, index: usize, pose: &TimedPose) -> String {
    match names {
        ViewNames::Line => format!("{index:06}.png"),
        ViewNames::Timestamp => format!("{:.6}.png", pose.timestamp),
    }
}

fn table(written: &Written) -> String {
    let map = match written.gaussians {
        0 => "a tri-plane field".to_owned(),
        count => format!("{count} Gaussians"),
    };
    let mut rows = vec![
        ("views", format!("{} of {} x {} pixels", written.views, written.width, written.height)),
        ("map", map),
        ("pixels showing the map", percent(written.solid_share)),
    ];
    rows.extend(
        written
            .milliseconds_per_view
            .iter()
            .map(|ms| ("time per view", format!("median {:.1} ms", ms.median))),
    );
    rows.extend(written.alignment.as_ref().map(AlignmentFigures::row));
    rows.push(("written to", written.folder.clone()));
    pairs(&rows)
}
