//! Python's package `mba`: the tracker frame by frame, data sets, runs and maps as numpy arrays, and every command of the
//! program as a function. What Python sees is described in `package/mba/_mba.pyi`.
//!
//! Long work is done without Python's lock, and poses are 4 x 4 matrices that take points of the camera to the world.

mod camera;
mod dataset;
mod errors;
mod figures;
mod images;
mod map;
mod poses;
mod program;
mod run;
mod tracker;

/// The compiled part of the package.
#[pyo3::pymodule(name = "_mba")]
mod module {
    #[pymodule_export]
    use crate::dataset::{Dataset, RgbdFrame};
    #[pymodule_export]
    use crate::figures::{psnr, ssim};
    #[pymodule_export]
    use crate::map::{Map, View};
    #[pymodule_export]
    use crate::program::{call, main};
    #[pymodule_export]
    use crate::run::read_run;
    #[pymodule_export]
    use crate::tracker::{FrameResult, Revision, Tracker};
}
