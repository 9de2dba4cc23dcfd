//! A synthetic sequence as a data set on disk.

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use mba_io::output::OutputFolder;
use mba_io::png::{encode_depth, encode_rgb};
use mba_io::trajectory_file::{TimedExposure, TimedPose, write_exposures, write_trajectory};
use mba_io::whole_file::{write_text, write_together};
use mba_mesh::{Mesh, write_mesh};
use rayon::prelude::*;

use super::description::TRUTH_FOLDER;
use super::summary::SynthSummary;
use super::{BlurFigure, SynthError, SynthSequence, description, inertial, truth};

/// Figures of one written frame.
struct Written {
    blur: BlurFigure,
    sub_frames: usize,
}

/// Folder of the views that no frame sees.
const HELDOUT_FOLDER: &str = "heldout_views";

/// File of the poses of those views, in their folder.
const POSES_FILE: &str = "poses.txt";

/// Folders of images.
const IMAGE_FOLDERS: [&str; 4] = ["rgb", "depth", "sharp", HELDOUT_FOLDER];

/// Texts and the surface, in the folder itself or among what is not on record.
const FILES: [&str; 13] = [
    "groundtruth.txt",
    "groundtruth_exposure.txt",
    SURFACE_FILE,
    "rgb.txt",
    "depth.txt",
    "associations.txt",
    "blur.csv",
    "imu.csv",
    "exposures.csv",
    "response.csv",
    "response_table.csv",
    "README.md",
    CALIBRATION_FILE,
];

/// File that a complete data set has.
const CALIBRATION_FILE: &str = "calibration.toml";

/// File of points of the true surface.
const SURFACE_FILE: &str = "surface_points.ply";

/// Renders the sequence into `folder` in the native layout (TUM lists, `calibration.toml`) with ground truth,
/// sharp images, held-out views, points of the true surface, blur figures and a README; where the settings ask for
/// them, with exposure times, a recording of an IMU, and what is not on record in a folder `truth`. Calls
/// `progress(done, frames)` after each frame, from any thread and in any order.
///
/// The folder is made if it does not exist. The calibration is written last, so that a folder with it is complete; what
/// a process that was killed left of one without is replaced.
///
/// # Errors
///
/// [`SynthError::FolderNotEmpty`], or a file that cannot be written; what was written so far is removed.
pub fn write_dataset(
    sequence: &SynthSequence,
    folder: &Path,
    progress: impl Fn(usize, usize) + Sync,
) -> Result<SynthSummary, SynthError> {
    let go_on = |done, frames| {
        progress(done, frames);
        ControlFlow::Continue(())
    };
    write_dataset_while(sequence, folder, go_on)
}

/// As [`write_dataset`], as long as `go_on(done, frames)` says so.
///
/// # Errors
///
/// As [`write_dataset`], and [`SynthError::Stopped`] when it was told to stop.
pub fn write_dataset_while(
    sequence: &SynthSequence,
    folder: &Path,
    go_on: impl Fn(usize, usize) -> ControlFlow<()> + Sync,
) -> Result<SynthSummary, SynthError> {
    let claimed = prepare(folder)?;
    let summary = write_all(sequence, folder, go_on).inspect_err(|_| clear(folder))?;
    drop(claimed);
    Ok(summary)
}

fn write_all(
    sequence: &SynthSequence,
    folder: &Path,
    go_on: impl Fn(usize, usize) -> ControlFlow<()> + Sync,
) -> Result<SynthSummary, SynthError> {
    let truth = (!sequence.config().sensor.is_on_record).then_some(TRUTH_FOLDER);
    for name in IMAGE_FOLDERS.into_iter().chain(truth) {
        let path = folder.join(name);
        fs::create_dir(&path).map_err(|reason| SynthError::unwritable(path, reason))?;
    }
    let done = AtomicUsize::new(0);
    let write_counted = |index| {
        let written = write_frame(sequence, folder, index)?;
        match go_on(done.fetch_add(1, Ordering::Relaxed) + 1, sequence.len()) {
            ControlFlow::Continue(()) => Ok(written),
            ControlFlow::Break(()) => Err(SynthError::Stopped),
        }
    };
    // Frames side by side, in their order.
    let written: Vec<_> =
        (0..sequence.len()).into_par_iter().map(write_counted).collect::<Result<_, SynthError>>()?;
    let summary = summarise(&written);
    write_ground_truth(sequence, folder)?;
    write_heldout_views(sequence, folder)?;
    let surface = Mesh { vertices: sequence.surface_points(), ..Mesh::default() };
    write_mesh(&folder.join(SURFACE_FILE), &surface)?;
    if !sequence.config().sensor.is_on_record {
        truth::write(sequence, folder)?;
    }
    // The calibration is the last: a folder without it is not complete.
    for (name, text) in texts(sequence, &summary, &written) {
        write_text(&folder.join(name), &text)?;
    }
    Ok(summary)
}

/// Names and contents of the text files, the calibration last.
fn texts(
    sequence: &SynthSequence,
    summary: &SynthSummary,
    written: &[Written],
) -> Vec<(&'static str, String)> {
    let config = sequence.config();
    let mut texts = vec![
        ("rgb.txt", image_list(sequence, "rgb", SynthSequence::timestamp)),
        ("depth.txt", image_list(sequence, "depth", SynthSequence::depth_timestamp)),
        ("associations.txt", associations(sequence)),
        ("blur.csv", blur_table(sequence, written)),
        ("README.md", description::readme(sequence, summary)),
    ];
    if config.sensor.imu {
        texts.push(("imu.csv", inertial::table(sequence)));
    }
    // A sensor that is not on record tells its geometry and its rate only.
    if config.sensor.is_on_record {
        texts
            .extend(config.sensor.auto_exposure.then(|| ("exposures.csv", description::exposures(sequence))));
        texts.extend(description::response_table(&config.response));
        texts.push((CALIBRATION_FILE, description::calibration(sequence)));
    } else {
        texts.push((CALIBRATION_FILE, description::bare_calibration(sequence)));
    }
    texts
}

/// Claims a folder that is new, empty, or left by a process that was killed before it was done.
fn prepare(folder: &Path) -> Result<OutputFolder, SynthError> {
    if OutputFolder::is_in_use_by_others(folder) || folder.join(CALIBRATION_FILE).exists() {
        return Err(SynthError::FolderNotEmpty { folder: folder.to_owned() });
    }
    let claimed = OutputFolder::for_data_set(folder)?;
    clear(folder);
    Ok(claimed)
}

/// Removes the files of a data set that is not complete, and nothing else. What cannot be removed stays: it is in nobody's
/// way but that of the next data set, which says so.
fn clear(folder: &Path) {
    let remove = |path: PathBuf| {
        let _ = fs::remove_file(path.with_added_extension("partial"));
        let _ = fs::remove_file(path);
    };
    for images in IMAGE_FOLDERS.map(|name| folder.join(name)) {
        for file in fs::read_dir(&images).into_iter().flatten().flatten() {
            let name = file.file_name();
            // Whatever else lies there was put there by others.
            if name.to_str().is_some_and(is_own_image) {
                remove(file.path());
            }
        }
        remove(images.join(POSES_FILE));
        let _ = fs::remove_dir(images);
    }
    let truth = folder.join(TRUTH_FOLDER);
    for place in [&truth, folder] {
        FILES.iter().for_each(|name| remove(place.join(name)));
    }
    let _ = fs::remove_dir(truth);
}

/// Whether a file is named like an image of a data set, or like one that is being written.
fn is_own_image(name: &str) -> bool {
    let stem = name.strip_suffix(".partial").unwrap_or(name).strip_suffix(".png");
    stem.is_some_and(|stem| stem.len() >= 6 && stem.bytes().all(|byte| byte.is_ascii_digit()))
}

fn write_frame(sequence: &SynthSequence, folder: &Path, index: usize) -> Result<Written, SynthError> {
    let frame = sequence.render_frame(index);
    let path = |kind: &str| folder.join(kind).join(format!("{index:06}.png"));
    let size = [frame.width, frame.height];
    write_png(path("rgb"), encode_rgb(size, &frame.rgb))?;
    write_png(path("depth"), encode_depth(size, &frame.depth))?;
    write_png(path("sharp"), encode_rgb(size, &sequence.render_sharp(index)))?;
    Ok(Written { blur: frame.blur, sub_frames: frame.sub_frames })
}

fn write_png(path: PathBuf, png: io::Result<Vec<u8>>) -> Result<(), SynthError> {
    let png = png.map_err(|reason| SynthError::unwritable(&path, reason))?;
    Ok(write_together(&[(path, png)])?)
}

fn summarise(written: &[Written]) -> SynthSummary {
    let mean = written.iter().map(|frame| frame.blur.mean_px).sum::<f64>() / written.len() as f64;
    SynthSummary {
        frames: written.len(),
        mean_blur_px: mean,
        largest_p95_px: written.iter().map(|frame| frame.blur.p95_px).fold(0.0, f64::max),
        most_sub_frames: written.iter().map(|frame| frame.sub_frames).max().unwrap_or(0),
    }
}

fn write_ground_truth(sequence: &SynthSequence, folder: &Path) -> Result<(), SynthError> {
    let exposure = |index: usize| {
        let [start, mid, end] = sequence.exposure_poses(index, 0.0);
        TimedExposure { timestamp: sequence.timestamp(index), start, mid, end }
    };
    let exposures: Vec<_> = (0..sequence.len()).map(exposure).collect();
    let pose = |exposure: &TimedExposure| TimedPose {
        timestamp: exposure.timestamp,
        world_from_camera: exposure.mid,
    };
    let poses: Vec<_> = exposures.iter().map(pose).collect();
    write_trajectory(&folder.join("groundtruth.txt"), &poses)?;
    write_exposures(&folder.join("groundtruth_exposure.txt"), &exposures)?;
    Ok(())
}

/// Images named by their line in `poses.txt`, from zero.
fn write_heldout_views(sequence: &SynthSequence, folder: &Path) -> Result<(), SynthError> {
    let folder = folder.join(HELDOUT_FOLDER);
    let size = [sequence.camera().width, sequence.camera().height];
    let poses = sequence.heldout_poses();
    poses.par_iter().enumerate().try_for_each(|(index, pose)| {
        let rgb = sequence.render_view(&pose.world_from_camera);
        write_png(folder.join(format!("{index:06}.png")), encode_rgb(size, &rgb))
    })?;
    Ok(write_trajectory(&folder.join(POSES_FILE), &poses)?)
}

/// `rgb.txt` or `depth.txt`. Writing to a string cannot fail.
fn image_list(sequence: &SynthSequence, kind: &str, time: fn(&SynthSequence, usize) -> f64) -> String {
    let mut text = format!("# {kind} images\n# timestamp filename\n");
    for index in 0..sequence.len() {
        let _ = writeln!(text, "{:.6} {kind}/{index:06}.png", time(sequence, index));
    }
    text
}

fn associations(sequence: &SynthSequence) -> String {
    let mut text = String::new();
    for index in 0..sequence.len() {
        let (colour, depth) = (sequence.timestamp(index), sequence.depth_timestamp(index));
        let _ = writeln!(text, "{colour:.6} rgb/{index:06}.png {depth:.6} depth/{index:06}.png");
    }
    text
}

fn blur_table(sequence: &SynthSequence, written: &[Written]) -> String {
    let mut text = String::from("frame,timestamp,exposure_s,mean_px,p95_px,subframes\n");
    for (index, Written { blur, sub_frames }) in written.iter().enumerate() {
        let BlurFigure { mean_px, p95_px, .. } = blur;
        let (time, exposure) = (sequence.timestamp(index), sequence.exposure_seconds(index));
        let _ = writeln!(text, "{index},{time:.6},{exposure:.6},{mean_px:.3},{p95_px:.3},{sub_frames}");
    }
    text
}
