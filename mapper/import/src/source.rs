//! What a source is, and bringing it in.

use std::path::{Path, PathBuf};

use crate::destination::{Destination, Imported};
use crate::format::{Format, Reading};
use crate::options::ImportOptions;
use crate::{ImportError, folders, record3d, ros, sens};

/// All kinds; the first that recognises a source reads it.
const FORMATS: &[&Format] = &[
    &ros::MCAP,
    &ros::BAG,
    &sens::FORMAT,
    &record3d::FORMAT,
    &folders::stray::FORMAT,
    &folders::polycam::FORMAT,
    &folders::scanner_app::FORMAT,
    &folders::transforms::FORMAT,
    &folders::mba_vo::FORMAT,
    &folders::numbered::FORMAT,
    &folders::open3d::FORMAT,
    // It has the list of the layouts below, with numbers for times.
    &folders::icl_nuim::FORMAT,
    &folders::layouts::FORMAT,
];

/// A recording of a known kind.
#[derive(Clone, Debug)]
pub struct Source {
    path: PathBuf,
    format: &'static Format,
}

impl Source {
    /// Recognises a file or folder.
    ///
    /// # Errors
    /// [`ImportError::Unknown`], or [`ImportError::File`] when there is nothing that can be read.
    pub fn recognise(path: &Path) -> Result<Self, ImportError> {
        path.metadata().map_err(|reason| ImportError::unreadable(path, reason))?;
        let path = &ros::file_of_folder(path)?;
        let known = FORMATS.iter().find(|format| (format.recognise)(path));
        known.map(|format| Self { path: path.clone(), format }).ok_or_else(|| {
            let looked_for: Vec<String> =
                FORMATS.iter().map(|format| format!("{} ({})", format.looked_for, format.name)).collect();
            ImportError::Unknown { source_path: path.clone(), looked_for: looked_for.join(", ") }
        })
    }

    /// What it is, for people.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        self.format.name
    }
}

/// Writes `source` into `folder`, which is new or empty, as a data set in the native layout. Calls `progress` with what is
/// done and all there is.
///
/// # Errors
/// [`ImportError`]; what was written so far is gone again.
pub fn import(
    source: &Source,
    folder: &Path,
    options: &ImportOptions,
    progress: &dyn Fn(u64, u64),
) -> Result<Imported, ImportError> {
    let mut destination = Destination::claim(folder, &source.path)?;
    let reading = Reading { path: &source.path, options, progress };
    let facts = (source.format.read)(&reading, &mut destination)?;
    destination.finish(&facts, &source.path)
}
