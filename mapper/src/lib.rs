//! Data sets, synthetic sequences, evaluation and offline refinement for motion-blur-aware RGB-D SLAM.
//!
//! A [`dataset`], recorded or made by [`synth`], is tracked by [`tracking`] into a [`run`]: poses of every frame at
//! opening, middle and closing of the shutter, and keyframes that [`deblurring`] inverts.
//!
//! What is not on record about the camera is found by [`self_calibration`], which tracks again and again.
//!
//! [`mapping`] goes on from there. [`continuity`] repairs exposures that do not fit their neighbours; [`bundle`] seeds
//! [`gaussians`] from depth and adjusts them together with the path of every exposure. A step renders what the moving
//! camera sees ([`exposure`], the mean of views of [`raster`]), compares it with the captured frame ([`losses`],
//! [`sensor`]) and takes the gradient back to map and path. A [`checkpoint`] keeps all of it, so that a stopped run can
//! go on. The result is another [`run`], with a map.
//!
//! [`places`] recognises where the camera has been before, and [`pose_graph`] spreads the drift that this uncovers.
//!
//! [`rendering`] makes images of a [`map`], with [`infill`] where it has nothing, and [`surfaces`] a [`mesh`];
//! [`evaluation`] and [`image_folders`] compare results with the truth, [`statistics`] summarises. [`export`] writes runs
//! in the formats of other programs.

pub mod bundle;
pub use mba_io::checkpoint;
pub mod continuity;
pub use mba_io::dataset;
pub mod deblurring;
pub mod evaluation;
pub mod export;
pub mod exposure;
pub mod gaussians;
pub mod image_folders;
pub use mba_io::imu;
pub mod infill;
pub mod losses;
pub mod map;
pub mod mapping;
pub use mba_io::mesh;
pub use mba_io::output;
pub mod places;
pub mod pose_graph;
pub mod raster;
pub mod rendering;
pub mod run;
pub mod self_calibration;
pub mod sensor;
pub mod slam;
pub use mba_io::statistics;
pub mod surfaces;
pub use mba_synth as synth;
pub mod tracking;
pub use mba_io::trajectory_file;
pub mod triplane;
mod uncertainty;

pub use mba_io::BinaryFileError;
pub use mba_io::FileError;
