//! Recordings that are folders of images.

mod camera;
pub(crate) mod icl_nuim;
pub(crate) mod layouts;
pub(crate) mod mba_vo;
pub(crate) mod numbered;
pub(crate) mod open3d;
pub(crate) mod polycam;
pub(crate) mod scanner_app;
pub(crate) mod stray;
pub(crate) mod transforms;
