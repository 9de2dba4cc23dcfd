//! Where anything may be written: what commands ask before they touch a disk.
//!
//! 1. Nothing is written into a recording: not into the data set of the command, not into any folder that looks like
//!    one or lies in one, through links neither, and no option changes that.
//! 2. A folder or file that this program did not write stays as it is, unless it is asked for by `force`. A RUN is
//!    recognised by its summary, a folder of views or of an export by its list, a folder that a kill left by its lock, a
//!    mesh or a trajectory by its header.
//! 3. Nothing is removed but files that such a folder has by its layout; whatever else lies there stays.
//! 4. One process writes a folder at a time: it holds a lock that the operating system releases when it ends, however
//!    it ends.
//! 5. A file is written beside its place and renamed, so that there is an old or a new one and never half of one.
//!    Devices and pipes, named on purpose, are written to as they are.

mod error;
mod export;
mod file;
mod folder;
mod listed;
mod lock;
mod place;
mod views;

pub use error::OutputError;
pub use export::ExportFolder;
pub use file::OutputFile;
pub use folder::{OutputFolder, Permission};
pub(crate) use lock::is_lock;
pub use views::ViewFolder;

pub use crate::whole_file::write_text;
