//! A sequence as a data set on disk, in the TUM layout.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use image::{ExtendedColorType, ImageEncoder, codecs::png};
use rayon::prelude::*;

use super::config::{CameraMotion, DepthSensor};
use super::{BlurStatistics, SynthConfig, SynthError, SynthFrame, SynthSequence};
use crate::FileError;
use crate::trajectory_file::{TimedExposure, TimedPose, write_exposures, write_trajectory};

/// What was written.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Number of frames.
    pub frames: usize,
    /// Mean over the frames of the mean blur length, pixels.
    pub mean_blur: f64,
    /// Mean over the frames of the 95th percentile of the blur length, pixels.
    pub p95_blur: f64,
    /// Largest 95th percentile of any frame, pixels.
    pub max_blur: f64,
    /// Largest number of sub-frames.
    pub max_subframes: usize,
}

/// What the text files need to know about a frame.
struct FrameRecord {
    timestamp: f64,
    exposure: TimedExposure,
    blur: BlurStatistics,
    subframes: usize,
    depth: DepthRange,
}

/// Smallest and median valid depth, metres, and the share of valid pixels.
struct DepthRange {
    min: f64,
    median: f64,
    valid: f64,
}

/// Renders all frames and writes them into `folder` (made if missing): `rgb/`, `depth/`, `sharp/`, `rgb.txt`,
/// `depth.txt`, `associations.txt`, `calibration.toml`, `groundtruth.txt`, `groundtruth_exposure.txt`, `blur.csv`,
/// `gyro.csv` if asked for, and a `README.md`. The lists come last, so that a data set that was interrupted is not
/// taken for a whole one.
///
/// `progress(done, total)` is called after each frame, from any thread, in any order of completion.
///
/// # Errors
///
/// [`SynthError::FolderNotEmpty`] if there is anything in `folder`, [`SynthError::File`] if it cannot be written.
pub fn write_dataset(
    sequence: &SynthSequence,
    folder: &Path,
    progress: impl Fn(usize, usize) + Sync,
) -> Result<Summary, SynthError> {
    prepare(folder)?;
    let done = AtomicUsize::new(0);
    let records = (0..sequence.len())
        .into_par_iter()
        .map(|index| {
            let record = write_frame(sequence, folder, index)?;
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, sequence.len());
            Ok(record)
        })
        .collect::<Result<Vec<_>, FileError>>()?;
    let summary = summarise(&records);
    write_ground_truth(folder, &records)?;
    write_text(&folder.join("blur.csv"), &blur_table(sequence, &records))?;
    if let Some(rate) = sequence.config().gyro_rate {
        write_text(&folder.join("gyro.csv"), &gyro_table(sequence, rate))?;
    }
    write_text(&folder.join("calibration.toml"), &calibration(sequence))?;
    write_text(&folder.join("README.md"), &read_me(sequence, folder, &summary))?;
    write_lists(folder, &records)?;
    Ok(summary)
}

fn unwritable(path: &Path, reason: std::io::Error) -> FileError {
    FileError::Unwritable { path: path.to_owned(), reason }
}

fn prepare(folder: &Path) -> Result<(), SynthError> {
    fs::create_dir_all(folder).map_err(|reason| unwritable(folder, reason))?;
    let mut entries =
        fs::read_dir(folder).map_err(|reason| FileError::Unreadable { path: folder.to_owned(), reason })?;
    if entries.next().is_some() {
        return Err(SynthError::FolderNotEmpty { folder: folder.to_owned() });
    }
    for name in ["rgb", "depth", "sharp"] {
        let path = folder.join(name);
        fs::create_dir(&path).map_err(|reason| unwritable(&path, reason))?;
    }
    Ok(())
}

fn write_frame(sequence: &SynthSequence, folder: &Path, index: usize) -> Result<FrameRecord, FileError> {
    let frame = sequence.render_frame(index);
    let (width, height) = (sequence.camera().width as u32, sequence.camera().height as u32);
    let path = |kind: &str| folder.join(kind).join(image_name(index));
    write_png(&path("rgb"), &frame.rgb, width, height, ExtendedColorType::Rgb8)?;
    let depth: Vec<u8> = frame.depth.iter().flat_map(|raw| raw.to_ne_bytes()).collect();
    write_png(&path("depth"), &depth, width, height, ExtendedColorType::L16)?;
    write_png(&path("sharp"), &sequence.render_sharp(index), width, height, ExtendedColorType::Rgb8)?;
    Ok(FrameRecord {
        timestamp: frame.timestamp,
        exposure: TimedExposure {
            timestamp: frame.timestamp,
            start: frame.exposure.start,
            mid: frame.mid,
            end: frame.exposure.end,
        },
        blur: frame.blur,
        subframes: frame.subframes,
        depth: depth_range(&frame),
    })
}

fn image_name(index: usize) -> String {
    format!("{index:06}.png")
}

fn depth_range(frame: &SynthFrame) -> DepthRange {
    let mut valid: Vec<u16> = frame.depth.iter().copied().filter(|raw| *raw > 0).collect();
    valid.sort_unstable();
    let metres = |index: usize| valid.get(index).map_or(0.0, |raw| f64::from(*raw) / 5000.0);
    DepthRange {
        min: metres(0),
        median: metres(valid.len() / 2),
        valid: valid.len() as f64 / frame.depth.len() as f64,
    }
}

/// 16-bit samples are taken in the machine's byte order.
fn write_png(
    path: &Path,
    bytes: &[u8],
    width: u32,
    height: u32,
    colour: ExtendedColorType,
) -> Result<(), FileError> {
    let mut file = Vec::new();
    png::PngEncoder::new_with_quality(&mut file, png::CompressionType::Fast, png::FilterType::Adaptive)
        .write_image(bytes, width, height, colour)
        .map_err(|error| unwritable(path, std::io::Error::other(error)))?;
    write_whole(path, &file)
}

/// Writes beside the file and renames, so that no half file bears the final name.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let partial: PathBuf = path.with_added_extension("partial");
    fs::write(&partial, bytes).and_then(|()| fs::rename(&partial, path)).map_err(|reason| {
        // Only a left-over is lost if this fails too.
        let _ = fs::remove_file(&partial);
        unwritable(path, reason)
    })
}

fn write_text(path: &Path, text: &str) -> Result<(), FileError> {
    write_whole(path, text.as_bytes())
}

fn summarise(records: &[FrameRecord]) -> Summary {
    let n = records.len().max(1) as f64;
    Summary {
        frames: records.len(),
        mean_blur: records.iter().map(|record| record.blur.mean).sum::<f64>() / n,
        p95_blur: records.iter().map(|record| record.blur.p95).sum::<f64>() / n,
        max_blur: records.iter().map(|record| record.blur.p95).fold(0.0, f64::max),
        max_subframes: records.iter().map(|record| record.subframes).max().unwrap_or(0),
    }
}

fn write_ground_truth(folder: &Path, records: &[FrameRecord]) -> Result<(), FileError> {
    let exposures: Vec<TimedExposure> = records.iter().map(|record| record.exposure).collect();
    let mids: Vec<TimedPose> = exposures
        .iter()
        .map(|exposure| TimedPose { timestamp: exposure.timestamp, world_from_camera: exposure.mid })
        .collect();
    write_trajectory(&folder.join("groundtruth.txt"), &mids)?;
    write_exposures(&folder.join("groundtruth_exposure.txt"), &exposures)
}

fn write_lists(folder: &Path, records: &[FrameRecord]) -> Result<(), FileError> {
    let mut both = String::new();
    for (index, record) in records.iter().enumerate() {
        let (t, name) = (record.timestamp, image_name(index));
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(both, "{t:.6} rgb/{name} {t:.6} depth/{name}");
    }
    for (kind, title) in [("depth", "depth images"), ("rgb", "colour images")] {
        let mut list = format!("# {title}\n# timestamp filename\n");
        for (index, record) in records.iter().enumerate() {
            let _ = writeln!(list, "{:.6} {kind}/{}", record.timestamp, image_name(index));
        }
        write_text(&folder.join(format!("{kind}.txt")), &list)?;
    }
    write_text(&folder.join("associations.txt"), &both)
}

fn blur_table(sequence: &SynthSequence, records: &[FrameRecord]) -> String {
    let mut table = String::from(
        "frame,timestamp,exposure_s,mean_px,p95_px,path_mean_px,path_p95_px,subframes,z_min,z_median,z_valid\n",
    );
    let exposure = sequence.config().exposure_seconds;
    for (index, FrameRecord { timestamp, blur, subframes, depth, .. }) in records.iter().enumerate() {
        let BlurStatistics { mean, p95, path_mean, path_p95 } = blur;
        let _ = write!(
            table,
            "{index},{timestamp:.6},{exposure:.6},{mean:.3},{p95:.3},{path_mean:.3},{path_p95:.3}"
        );
        let _ = writeln!(table, ",{subframes},{:.3},{:.3},{:.4}", depth.min, depth.median, depth.valid);
    }
    table
}

/// Angular rates from the beginning of the first exposure to the end of the last one.
fn gyro_table(sequence: &SynthSequence, rate: f64) -> String {
    let half = 0.5 * sequence.config().exposure_seconds;
    let first = ((sequence.timestamp(0) - half) * rate).floor() as i64;
    let last = ((sequence.timestamp(sequence.len() - 1) + half) * rate).ceil() as i64;
    let mut table = String::from("timestamp,wx,wy,wz\n");
    for reading in first..=last {
        let t = (reading as f64 / rate * 1e6).round() / 1e6;
        let w = sequence.angular_velocity(t);
        let _ = writeln!(table, "{t:.6},{:.7},{:.7},{:.7}", w.x, w.y, w.z);
    }
    table
}

fn calibration(sequence: &SynthSequence) -> String {
    let camera = sequence.camera();
    let config = sequence.config();
    format!(
        "width = {}\nheight = {}\nfx = {:?}\nfy = {:?}\ncx = {:?}\ncy = {:?}\ndepth_scale = 5000.0\n\
         exposure_seconds = {:?}\nframe_rate = {:?}\nresponse = \"{}\"\nreadout = \"global\"\n",
        camera.width,
        camera.height,
        camera.fx,
        camera.fy,
        camera.cx,
        camera.cy,
        config.exposure_seconds,
        config.frame_rate,
        config.response.as_str(),
    )
}

fn read_me(sequence: &SynthSequence, folder: &Path, summary: &Summary) -> String {
    let config = sequence.config();
    let name = folder.file_name().map_or("sequence".into(), |name| name.to_string_lossy());
    format!(
        "# {name}\n\nSynthetic sequence of the scene `{}`: {} frames {}x{}, {} per second, exposure {} ms, response {}, \
         seed {}.\n\n* Camera: {}.\n* Blur (start-to-end displacement): mean {:.1} px, mean of the 95th percentiles \
         {:.1} px, largest {:.1} px.\n* Colour: mean of N sub-frames (N in `blur.csv`) in linear light over the \
         exposure, times {}, {}, then response and rounding to 8 bit.\n* `sharp/`: noise-free image at mid exposure, \
         same gain and response.\n* `depth/`: z at mid exposure, 5000 units per metre, 0 = missing; {}.\n* \
         `groundtruth.txt` (mid exposure), `groundtruth_exposure.txt` (start, mid, end): camera-to-world, camera x \
         right, y down, z forward; world y up, floor at y = 0, metres.\n* `gyro.csv` (if present): angular rate in \
         the camera frame, rad/s, without noise or bias.\n* Pixel (i, j) has its centre at u = i, v = j.\n",
        config.scene,
        config.frames,
        config.width,
        config.height,
        config.frame_rate,
        1e3 * config.exposure_seconds,
        config.response.as_str(),
        config.seed,
        describe_motion(config),
        summary.mean_blur,
        summary.p95_blur,
        summary.max_blur,
        config.gain,
        describe_noise(config),
        match config.depth {
            DepthSensor::Exact => "exact",
            DepthSensor::StructuredLight =>
                "like a structured-light sensor (noise 0.0019 z^2 m, millimetre steps, holes)",
        },
    )
}

fn describe_motion(config: &SynthConfig) -> String {
    match config.motion {
        CameraMotion::Still => "at rest".into(),
        CameraMotion::MeanBlur(pixels) => format!("slow sweep and hand shake for a mean blur of {pixels} px"),
        CameraMotion::Shake(rate) => format!("slow sweep and hand shake of {rate} rad/s rms"),
    }
}

fn describe_noise(config: &SynthConfig) -> String {
    config.noise.map_or("no noise".into(), |noise| {
        format!(
            "Poisson-Gaussian noise ({} e- full well, {} e- read noise)",
            noise.full_well_electrons, noise.read_noise_electrons
        )
    })
}
