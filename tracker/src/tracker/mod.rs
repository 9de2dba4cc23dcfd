//! The tracker: frames in, poses at shutter opening and closing out.

mod bootstrap;
mod bound;
mod coarse_to_fine;
mod config;
mod evidence;
mod expected;
mod frame;
mod hindsight;
mod history;
mod keyframe_path;
mod outside;
mod policy;
mod recovery;
mod reference;
mod relocalisation;
mod result;
mod session;
mod track;

pub use config::{
    Effort, MAX_RECENT_KEYFRAMES, Readout, ReferenceMode, TrackerConfig, WorkspacePlan, workspace_len,
};
pub use frame::{ExpectedPath, Frame, GyroReading, ReferenceView};
pub use result::{Doubt, FrameResult, FrameStatus, Revision};
pub use track::Tracker;
