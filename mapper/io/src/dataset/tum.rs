//! The TUM RGB-D layout: lists of images with timestamps, a calibration, optional ground truth.

use std::path::Path;

use super::association::{associate, closest};
use super::eth3d;
use super::known_cameras::{TUM_DEPTH_SCALE, TUM_FRAME_RATE, bonn_camera, tum_camera};
use super::sequence::{Contents, FrameEntry, frames_per_second};
use super::{Calibration, DatasetError, OpenOptions, Warning, calibration_file, exposure_list};
use crate::FileError;
use crate::text_lines::{Line, TextFile};
use crate::trajectory_file::{
    Recorded, TimedExposure, TimedPose, read_recorded_exposures, read_recorded_trajectory, read_trajectory,
};

const ASSOCIATIONS: &str = "associations.txt";
const COLOUR_LIST: &str = "rgb.txt";
const DEPTH_LIST: &str = "depth.txt";

/// Ground truth as EuRoC has it.
const EUROC_TRUTH: [&str; 2] =
    ["state_groundtruth_estimate0/data.csv", "mav0/state_groundtruth_estimate0/data.csv"];

/// Frames per second that are taken for a camera's where no frame rate is given. Slower times are in another unit, or those
/// of a camera whose frame rate has to be given.
const SLOWEST_ASSUMED: f64 = 0.2;

/// One image of a list.
struct ListedImage<'a> {
    timestamp: f64,
    /// Relative to the data set's folder.
    file: &'a str,
}

/// Whether `folder` looks like this layout.
pub(super) fn recognise(folder: &Path) -> bool {
    let has = |name| folder.join(name).is_file();
    // Also one that is a folder or a link to nothing: reading it says so, and nothing else is taken in its place.
    folder.join(ASSOCIATIONS).symlink_metadata().is_ok() || (has(COLOUR_LIST) && has(DEPTH_LIST))
}

/// Reads lists, calibration and ground truth.
pub(super) fn read(folder: &Path, options: &OpenOptions) -> Result<Contents, DatasetError> {
    let mut warnings = Vec::new();
    let associations = folder.join(ASSOCIATIONS);
    let mut entries = if associations.symlink_metadata().is_ok() {
        read_associations(folder, &associations, options, &mut warnings)?
    } else {
        associate_lists(folder, options, &mut warnings)?
    };
    let mut calibration = read_calibration(folder, &entries, &mut warnings)?;
    let is_listed = exposure_list::read(folder, &mut entries, &calibration, &mut warnings)?;
    calibration.settle_exposure(is_listed);
    let (ground_truth, ground_truth_exposures) = read_ground_truth(folder, &entries, &mut warnings)?;
    Ok(Contents { calibration, colour_camera: None, entries, ground_truth, ground_truth_exposures, warnings })
}

/// Reads `timestamp file timestamp file` lines. The pairs are taken as they are; colour may come first (usual)
/// or second (some sequences list `depth/...` first).
fn read_associations(
    folder: &Path,
    path: &Path,
    options: &OpenOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<FrameEntry>, DatasetError> {
    let file = TextFile::read(path)?;
    let mut listed = Vec::new();
    for line in file.lines() {
        let (colour, depth) = parse_pair(&line)?;
        listed.push((line, colour.timestamp, entry(folder, &colour, &depth)));
    }
    let entries = in_order(listed, path, warnings)?;
    if entries.is_empty() {
        return Err(DatasetError::EmptyList { path: path.to_owned() });
    }
    warn_about_pairs(path, &entries, options, warnings);
    Ok(entries)
}

fn parse_pair<'a>(line: &Line<'a>) -> Result<(ListedImage<'a>, ListedImage<'a>), FileError> {
    const EXPECTED: &str = "timestamp image timestamp depth-image";
    let fields: Vec<&str> = line.fields().collect();
    let &[first_time, first_file, second_time, second_file] = fields.as_slice() else {
        return Err(line.malformed(EXPECTED));
    };
    let first = ListedImage { timestamp: line.number(first_time, EXPECTED)?, file: first_file };
    let second = ListedImage { timestamp: line.number(second_time, EXPECTED)?, file: second_file };
    let is_depth = |image: &ListedImage<'_>| image.file.trim_start_matches("./").starts_with("depth");
    if is_depth(&first) && !is_depth(&second) { Ok((second, first)) } else { Ok((first, second)) }
}

fn warn_about_pairs(path: &Path, entries: &[FrameEntry], options: &OpenOptions, warnings: &mut Vec<Warning>) {
    let tolerance = options.association_tolerance;
    let offsets = entries.iter().map(|entry| (entry.timestamp - entry.depth_timestamp).abs());
    // A microsecond of slack for timestamps that were rounded when written.
    let loose = offsets.filter(|offset| *offset > tolerance + 1e-6);
    let largest = loose.clone().fold(0.0, f64::max);
    let count = loose.count();
    if count > 0 {
        warnings.push(Warning::LoosePairs { list: path.to_owned(), count, tolerance, largest });
    }
    let mut sorted: Vec<f64> = entries.iter().map(|entry| entry.depth_timestamp).collect();
    sorted.sort_by(f64::total_cmp);
    let reused: Vec<f64> = sorted.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]).collect();
    if let Some(&first) = reused.first() {
        warnings.push(Warning::DepthReused { list: path.to_owned(), count: reused.len(), first });
    }
}

/// What is listed in the order of time, each with its line and time; a list in another order is worth a warning.
fn in_order<T>(
    mut listed: Vec<(Line<'_>, f64, T)>,
    path: &Path,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<T>, FileError> {
    let count = listed.windows(2).filter(|pair| pair[1].1 < pair[0].1).count();
    if count > 0 {
        listed.sort_by(|a, b| a.1.total_cmp(&b.1));
        warnings.push(Warning::Unsorted { list: path.to_owned(), count });
    }
    for pair in listed.windows(2) {
        pair[1].0.check_order(pair[1].1, Some(pair[0].1))?;
    }
    Ok(listed.into_iter().map(|(_, _, listed)| listed).collect())
}

/// Pairs the images of `rgb.txt` and `depth.txt` by time.
fn associate_lists(
    folder: &Path,
    options: &OpenOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<FrameEntry>, DatasetError> {
    let tolerance = options.association_tolerance;
    let (colour_list, depth_list) = (folder.join(COLOUR_LIST), folder.join(DEPTH_LIST));
    let (colour_file, depth_file) = (TextFile::read(&colour_list)?, TextFile::read(&depth_list)?);
    let colour = parse_list(&colour_file, &colour_list, warnings)?;
    let depth = parse_list(&depth_file, &depth_list, warnings)?;
    let times = |list: &[ListedImage<'_>]| list.iter().map(|image| image.timestamp).collect::<Vec<_>>();
    let (colour_times, depth_times) = (times(&colour), times(&depth));

    // The closest pairs first, each image once.
    let pairs = associate(&colour_times, &depth_times, tolerance);
    if pairs.is_empty() {
        return Err(DatasetError::NoAssociation {
            colour_list,
            colour_count: colour.len(),
            depth_list,
            depth_count: depth.len(),
            tolerance,
            closest: closest(&colour_times, &depth_times),
        });
    }
    // What has no partner is told for each list.
    let matched = |side: fn(&(usize, usize)) -> usize| pairs.iter().map(side).collect::<Vec<_>>();
    warnings.extend(unmatched(&colour_list, &colour_times, &matched(|pair| pair.0), tolerance));
    warnings.extend(unmatched(&depth_list, &depth_times, &matched(|pair| pair.1), tolerance));
    Ok(pairs.into_iter().map(|(i, j)| entry(folder, &colour[i], &depth[j])).collect())
}

/// Parses `timestamp file` lines.
fn parse_list<'a>(
    file: &'a TextFile,
    path: &Path,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<ListedImage<'a>>, DatasetError> {
    const EXPECTED: &str = "timestamp image";
    let mut listed = Vec::new();
    for line in file.lines() {
        let fields: Vec<&str> = line.fields().collect();
        let &[time, file] = fields.as_slice() else { return Err(line.malformed(EXPECTED).into()) };
        let timestamp = line.number(time, EXPECTED)?;
        listed.push((line, timestamp, ListedImage { timestamp, file }));
    }
    let images = in_order(listed, path, warnings)?;
    if images.is_empty() { Err(DatasetError::EmptyList { path: path.to_owned() }) } else { Ok(images) }
}

fn unmatched(list: &Path, times: &[f64], matched: &[usize], tolerance: f64) -> Option<Warning> {
    let mut is_matched = vec![false; times.len()];
    for &index in matched {
        is_matched[index] = true;
    }
    let first = is_matched.iter().position(|matched| !matched)?;
    let count = times.len() - matched.len();
    Some(Warning::Unmatched { list: list.to_owned(), count, first: times[first], tolerance })
}

fn entry(folder: &Path, colour: &ListedImage<'_>, depth: &ListedImage<'_>) -> FrameEntry {
    FrameEntry {
        timestamp: colour.timestamp,
        depth_timestamp: depth.timestamp,
        colour: folder.join(colour.file),
        depth: folder.join(depth.file),
        exposure_seconds: None,
    }
}

/// The calibration file or, without one, the calibration of a known camera.
fn read_calibration(
    folder: &Path,
    entries: &[FrameEntry],
    warnings: &mut Vec<Warning>,
) -> Result<Calibration, DatasetError> {
    let path = folder.join(calibration_file::FILE_NAME);
    if path.is_file() {
        let times: Vec<f64> = entries.iter().map(|entry| entry.timestamp).collect();
        let measured = frames_per_second(&times).filter(|rate| *rate > SLOWEST_ASSUMED);
        return calibration_file::read(&path, measured, warnings);
    }
    let eth3d = folder.join(eth3d::FILE_NAME);
    if eth3d.is_file() {
        return eth3d::read(&eth3d, entries);
    }
    let absolute = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let first = entries.first().map_or(0.0, |entry| entry.timestamp);
    let known = tum_camera(&absolute, first)
        .or_else(|| bonn_camera(&absolute, first))
        .ok_or_else(|| DatasetError::MissingCalibration { folder: folder.to_owned() })?;
    warnings.push(Warning::KnownCamera { camera: known.name });
    let calibration =
        Calibration::of_geometry(known.camera, known.distortion, TUM_DEPTH_SCALE, TUM_FRAME_RATE);
    Ok(calibration.rolling())
}

/// Reads `groundtruth.txt` and `groundtruth_exposure.txt` where they exist; the second can stand in for the
/// first.
fn read_ground_truth(
    folder: &Path,
    entries: &[FrameEntry],
    warnings: &mut Vec<Warning>,
) -> Result<(Vec<TimedPose>, Vec<TimedExposure>), DatasetError> {
    let (poses_path, exposures_path) =
        (folder.join("groundtruth.txt"), folder.join("groundtruth_exposure.txt"));
    let exposures = if exposures_path.is_file() {
        sound(read_recorded_exposures(&exposures_path)?, warnings)
    } else {
        Vec::new()
    };
    let euroc = EUROC_TRUTH.map(|name| folder.join(name)).into_iter().find(|path| path.is_file());
    let poses = if poses_path.is_file() {
        sound(read_recorded_trajectory(&poses_path)?, warnings)
    } else if let (Some(path), true) = (euroc, exposures.is_empty()) {
        read_trajectory(&path)?
    } else {
        // Exposures have poses at mid exposure, which are ground truth as well.
        let mid = |e: &TimedExposure| TimedPose { timestamp: e.timestamp, world_from_camera: e.mid };
        exposures.iter().map(mid).collect()
    };
    // Truth of another time belongs to another recording, or to another clock.
    if let (Some(first), Some(last), [first_frame, .., last_frame]) = (poses.first(), poses.last(), entries)
        && (last.timestamp < first_frame.timestamp || first.timestamp > last_frame.timestamp)
    {
        warnings.push(Warning::GroundTruthElsewhere { path: poses_path });
    }
    Ok((poses, exposures))
}

/// The good poses; what is not is counted in a warning.
fn sound<T>(recorded: Recorded<T>, warnings: &mut Vec<Warning>) -> Vec<T> {
    if let Some(first) = recorded.first_error {
        warnings.push(Warning::PosesLeftOut { count: recorded.left_out, first: first.to_string() });
    }
    recorded.poses
}
