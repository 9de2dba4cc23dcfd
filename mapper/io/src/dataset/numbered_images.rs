//! Images that are paired by the number in their names and have no timestamps.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::sequence::FrameEntry;
use super::{DatasetError, Warning};
use crate::FileError;

/// Images of one kind: `<prefix><number>.<extension>` in a folder.
pub(super) struct ImageFolder<'a> {
    pub(super) path: &'a Path,
    pub(super) prefix: &'static str,
}

/// Pairs colour and depth images of the same number, in the order of the numbers. The timestamp is the number
/// over `frame_rate`; that, and images without a partner, are added to `warnings`.
pub(super) fn pair(
    colour: &ImageFolder<'_>,
    depth: &ImageFolder<'_>,
    frame_rate: f64,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<(usize, FrameEntry)>, DatasetError> {
    let (colours, depths) = (list(colour)?, list(depth)?);
    // Both lists are in the order of their numbers.
    let partner = |number: &usize, others: &[(usize, PathBuf)]| {
        others.binary_search_by_key(number, |(number, _)| *number).ok()
    };
    let entries: Vec<(usize, FrameEntry)> = colours
        .iter()
        .filter_map(|(number, path)| {
            let (_, depth) = &depths[partner(number, &depths)?];
            Some((*number, entry(*number as f64 / frame_rate, path, depth)))
        })
        .collect();
    if entries.is_empty() {
        return Err(DatasetError::EmptyList { path: colour.path.to_owned() });
    }
    let value = format!("image number / {frame_rate}");
    warnings.push(Warning::Assumed { key: "the time of each frame", value });
    for (folder, images, others) in [(colour, &colours, &depths), (depth, &depths, &colours)] {
        // One sentence for all images of a folder that have no partner.
        let mut alone = images.iter().filter(|(number, _)| partner(number, others).is_none());
        if let Some((_, first)) = alone.next() {
            let (folder, count) = (folder.path.to_owned(), 1 + alone.count());
            warnings.push(Warning::Unpaired { folder, count, first: first.clone() });
        }
    }
    Ok(entries)
}

/// Numbers and paths, sorted, each number once.
fn list(folder: &ImageFolder<'_>) -> Result<Vec<(usize, PathBuf)>, FileError> {
    let unreadable = |reason: io::Error| FileError::Unreadable { path: folder.path.to_owned(), reason };
    let mut images = Vec::new();
    for file in fs::read_dir(folder.path).map_err(unreadable)? {
        let path = file.map_err(unreadable)?.path();
        if let Some(number) = image_number(&path, folder.prefix) {
            images.push((number, path));
        }
    }
    images.sort();
    images.dedup_by_key(|(number, _)| *number);
    Ok(images)
}

fn image_number(path: &Path, prefix: &str) -> Option<usize> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    if !matches!(extension.as_str(), "png" | "jpg" | "jpeg") {
        return None;
    }
    path.file_stem()?.to_str()?.strip_prefix(prefix)?.parse().ok()
}

fn entry(timestamp: f64, colour: &Path, depth: &Path) -> FrameEntry {
    FrameEntry {
        timestamp,
        depth_timestamp: timestamp,
        colour: colour.to_owned(),
        depth: depth.to_owned(),
        exposure_seconds: None,
    }
}
