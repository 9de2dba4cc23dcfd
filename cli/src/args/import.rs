//! Arguments of `mba import`.

use std::path::PathBuf;

use clap::Args;

/// Arguments of `mba import`.
#[derive(Debug, Args)]
#[command(after_help = "\
What SOURCE is shows in its files. Images are copied as they are, times to the nanosecond, with what is recorded of \
cameras, exposure times, poses, inertia and confidence; a note says what is assumed.

  bags          ROS 1 (also of RealSense Viewer), MCAP of ROS 2 and others
  telephones    Stray Scanner, Record3D, Polycam raw data, 3D Scanner App
  desk          .sens of ScanNet, Open3D recorder, transforms.json with depth
  benchmarks    7-Scenes, BundleFusion, ICL-NUIM, MBA-VO with ArchViz, TUM, Bonn, ETH3D, Replica, ScanNet

docs/import.md has an example for each.

Examples:
  mba import rs.bag --out data
  mba import walk.mcap --out data --depth-topic /camera/depth/image_rect_raw
  mba import 71de12f9 --out data")]
pub struct Import {
    /// Recording: a file or folder
    #[arg(value_name = "SOURCE")]
    pub source: PathBuf,
    /// New or empty folder for the data set
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Topic of the colour images of a bag; default: the likeliest
    #[arg(long, value_name = "TOPIC")]
    pub colour_topic: Option<String>,
    /// Topic of the depth images of a bag; default: the likeliest, registered ones first
    #[arg(long, value_name = "TOPIC")]
    pub depth_topic: Option<String>,
}
