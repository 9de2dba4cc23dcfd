//! A synthetic sequence as a data set on disk.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ImageBuffer, Luma, PixelWithColorType, Rgb};
use rayon::prelude::*;

use super::{BlurFigure, SynthError, SynthSequence, description, inertial, truth};
use crate::surfaces::{Mesh, write_mesh};
use crate::trajectory_file::{TimedExposure, TimedPose, write_exposures, write_trajectory};

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Number of frames.
    pub frames: usize,
    /// Mean over the frames of their mean blur, pixels.
    pub mean_blur_px: f64,
    /// Largest 95th percentile of the blur of a frame, pixels.
    pub largest_p95_px: f64,
    /// Most sub-frames that were averaged into one frame.
    pub most_sub_frames: usize,
}

/// Figures of one written frame.
struct Written {
    blur: BlurFigure,
    sub_frames: usize,
}

/// Folder of the views that no frame sees.
const HELDOUT_FOLDER: &str = "heldout_views";

/// File of points of the true surface.
const SURFACE_FILE: &str = "surface_points.ply";

/// Renders the sequence into `folder` in the native layout (TUM lists, `calibration.toml`) with ground truth,
/// sharp images, held-out views, points of the true surface, blur figures and a README; where the settings ask for
/// them, with exposure times, a recording of an IMU, and what is not on record in a folder `truth`. Calls
/// `progress(done, frames)` after each frame, from any thread and in any order.
///
/// The folder is made if it does not exist. The calibration is written last, so that a folder with it is complete.
///
/// # Errors
///
/// [`SynthError::FolderNotEmpty`], or a file that cannot be written; what was written so far stays.
pub fn write_dataset(
    sequence: &SynthSequence,
    folder: &Path,
    progress: impl Fn(usize, usize) + Sync,
) -> Result<Summary, SynthError> {
    prepare(folder, sequence.config().sensor.is_on_record)?;
    let done = AtomicUsize::new(0);
    let write_counted = |index| {
        let written = write_frame(sequence, folder, index)?;
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, sequence.len());
        Ok(written)
    };
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
    for (name, text) in texts(sequence, &summary, &written) {
        let path = folder.join(name);
        fs::write(&path, text).map_err(|reason| SynthError::unwritable(path, reason))?;
    }
    Ok(summary)
}

/// Names and contents of the text files, the calibration last.
fn texts(sequence: &SynthSequence, summary: &Summary, written: &[Written]) -> Vec<(&'static str, String)> {
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
    if config.sensor.is_on_record {
        texts
            .extend(config.sensor.auto_exposure.then(|| ("exposures.csv", description::exposures(sequence))));
        texts.extend(description::response_table(&config.response));
        texts.push(("calibration.toml", description::calibration(sequence)));
    } else {
        texts.push(("calibration.toml", description::bare_calibration(sequence)));
    }
    texts
}

fn prepare(folder: &Path, is_on_record: bool) -> Result<(), SynthError> {
    let unwritable = |reason| SynthError::unwritable(folder, reason);
    fs::create_dir_all(folder).map_err(unwritable)?;
    if fs::read_dir(folder).map_err(unwritable)?.next().is_some() {
        return Err(SynthError::FolderNotEmpty { folder: folder.to_owned() });
    }
    let truth = (!is_on_record).then_some(truth::FOLDER);
    for name in ["rgb", "depth", "sharp", HELDOUT_FOLDER].into_iter().chain(truth) {
        let path = folder.join(name);
        fs::create_dir(&path).map_err(|reason| SynthError::unwritable(path, reason))?;
    }
    Ok(())
}

fn write_frame(sequence: &SynthSequence, folder: &Path, index: usize) -> Result<Written, SynthError> {
    let frame = sequence.render_frame(index);
    let path = |kind: &str| folder.join(kind).join(format!("{index:06}.png"));
    let size = [frame.width, frame.height];
    write_png::<Rgb<u8>>(&path("rgb"), size, frame.rgb)?;
    write_png::<Luma<u16>>(&path("depth"), size, frame.depth)?;
    write_png::<Rgb<u8>>(&path("sharp"), size, sequence.render_sharp(index))?;
    Ok(Written { blur: frame.blur, sub_frames: frame.sub_frames })
}

fn write_png<P>(path: &Path, [width, height]: [usize; 2], values: Vec<P::Subpixel>) -> Result<(), SynthError>
where
    P: PixelWithColorType,
    [P::Subpixel]: image::EncodableLayout,
{
    let file = File::create(path).map_err(|reason| SynthError::unwritable(path, reason))?;
    let encoder =
        PngEncoder::new_with_quality(BufWriter::new(file), CompressionType::Fast, FilterType::Adaptive);
    let Some(image) = ImageBuffer::<P, _>::from_raw(width as u32, height as u32, values) else {
        return Ok(());
    };
    let failed = |reason| SynthError::Image { path: path.to_owned(), reason };
    image.write_with_encoder(encoder).map_err(failed)
}

fn summarise(written: &[Written]) -> Summary {
    let mean = written.iter().map(|frame| frame.blur.mean_px).sum::<f64>() / written.len() as f64;
    Summary {
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
        write_png::<Rgb<u8>>(&folder.join(format!("{index:06}.png")), size, rgb)
    })?;
    Ok(write_trajectory(&folder.join("poses.txt"), &poses)?)
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
