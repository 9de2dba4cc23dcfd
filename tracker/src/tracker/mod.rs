//! The tracker: frames in, poses at shutter opening and closing out.

mod config;
mod frame;
mod history;
mod result;
mod track;

pub use config::{ReferenceMode, TrackerConfig, workspace_len};
pub use frame::Frame;
pub use result::{FrameResult, FrameStatus};
pub use track::Tracker;
