//! Data sets, synthetic sequences, evaluation and offline refinement for motion-blur-aware RGB-D SLAM.
//!
//! A [`dataset`], recorded or made by [`synth`], or brought in from another layout by [`import`], is tracked by [`tracking`] into a [`run`]: poses of every frame at
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
//! [`submaps`] maps runs of any length: split into groups that independent processes map, and merged again.
//!
//! [`localisation`] finds the frames of another recording in the map of a run.
//!
//! [`places`] recognises where the camera has been before, and [`pose_graph`] spreads the drift that this uncovers.
//!
//! [`rendering`] makes images of a [`map`], with [`infill`] where it has nothing, and [`surfaces`] a [`mesh`];
//! [`evaluation`] and [`image_folders`] compare results with the truth, [`statistics`] summarises. [`export`] writes runs
//! in the formats of other programs.

pub use mba_adjust::{bundle, continuity, deblurring, places, pose_graph};
pub use mba_eval::{evaluation, image_folders};
pub use mba_field::triplane;
pub use mba_import as import;
pub use mba_io::{
    BinaryFileError, FileError, checkpoint, dataset, imu, output, statistics, trajectory_file, whole_file,
};
pub use mba_map::{infill, map, rendering, surfaces, viewer_splats};
pub use mba_mesh as mesh;
pub use mba_raster::{exposure, gaussians, losses, raster, sensor};
pub use mba_slam::{export, hindsight, localisation, mapping, run, self_calibration, slam, tracking};
pub use mba_submaps as submaps;
pub use mba_synth as synth;
