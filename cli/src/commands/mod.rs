//! One file per command.

pub mod ablate;
pub mod alignment;
pub mod calibrate;
mod camera_facts;
pub mod demo;
pub mod eval_images;
pub mod eval_mesh;
pub mod eval_trajectory;
pub mod export;
pub mod import;
pub mod info;
pub mod job;
pub mod localise;
pub mod map;
pub mod map_job;
pub mod merge;
pub mod mesh;
pub mod open;
pub mod outcome;
pub mod render;
pub mod report;
pub mod slam;
pub mod split;
pub mod status;
pub mod synth;
pub mod track;
pub mod view;
