//! Folders that `ros2 bag record` writes.

use std::path::{Path, PathBuf};

use crate::ImportError;
use crate::format::files;

/// The file of messages in a folder of ROS 2; any other path as it is.
///
/// # Errors
/// [`ImportError::Unusable`] for a recording in another form, or in several files.
pub(crate) fn file_of_folder(path: &Path) -> Result<PathBuf, ImportError> {
    if !path.is_dir() || !path.join("metadata.yaml").is_file() {
        return Ok(path.to_owned());
    }
    let recorded = files(path, "", &[".mcap"])?;
    match recorded.as_slice() {
        [file] => Ok(file.clone()),
        [] if !files(path, "", &[".db3"])?.is_empty() => Err(ImportError::unusable(
            path,
            "it is a recording in the form sqlite3, which is not read",
            "`ros2 bag convert` makes one of the form mcap of it",
        )),
        [] => Ok(path.to_owned()),
        [first, ..] => Err(ImportError::unusable(
            path,
            format!("it is a recording of {} files", recorded.len()),
            format!("bring them in one by one, the first is {}", first.display()),
        )),
    }
}
