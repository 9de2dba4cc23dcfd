//! The images that an earlier run left.

use std::fs;
use std::path::Path;

use mba_io::run_layout::{DEBLURRED_FOLDER, DEPTH_FOLDER};

use super::RunError;

/// Removes the images of an earlier run in `folder`, and nothing else.
pub(super) fn remove_keyframe_images(folder: &Path) -> Result<(), RunError> {
    [DEBLURRED_FOLDER, DEPTH_FOLDER].iter().try_for_each(|images| remove_images(&folder.join(images)))
}

fn remove_images(images: &Path) -> Result<(), RunError> {
    let Ok(files) = fs::read_dir(images) else { return Ok(()) };
    for path in files.flatten().map(|file| file.path()).filter(|path| is_keyframe_image(path)) {
        fs::remove_file(&path).map_err(|reason| RunError::unwritable(&path, reason))?;
    }
    // Whatever else lies in the folder is somebody else's and stays.
    let _ = fs::remove_dir(images);
    Ok(())
}

fn is_keyframe_image(path: &Path) -> bool {
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let is_number = stem.len() >= 6 && stem.bytes().all(|byte| byte.is_ascii_digit());
    is_number && path.extension().is_some_and(|extension| extension == "png")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_images_of_keyframes_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let images = folder.path().join(DEBLURRED_FOLDER);
        remove_keyframe_images(folder.path()).unwrap();
        fs::create_dir(&images).unwrap();
        for name in ["000012.png", "1234567.png", "notes.png", "000012.txt"] {
            fs::write(images.join(name), "").unwrap();
        }
        remove_keyframe_images(folder.path()).unwrap();
        let mut left: Vec<_> = fs::read_dir(&images).unwrap().map(|file| file.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["000012.txt", "notes.png"]);
    }
}
