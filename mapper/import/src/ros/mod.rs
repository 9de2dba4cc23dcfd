//! Bags of ROS 1 and MCAP files, as ROS 2 and others write them.
//!
//! [`bag`] and [`mcap`] take messages out of files one after the other, [`wire`] and [`messages`] make sense of their bytes,
//! [`topics`] chooses among topics, [`frames`] relates the places of sensors, [`recorder`] hands images, inertia and
//! exposure times to the data set, and [`cameras`] keeps what is said of cameras.

mod bag;
mod cameras;
mod chunk;
mod container;
mod folder;
mod frames;
mod mcap;
mod messages;
mod pixels;
mod recorder;
mod topics;
mod wire;

pub(crate) use folder::file_of_folder;
pub(crate) use recorder::{BAG, MCAP};
