//! How good results are: trajectories, motion within exposures, images, depth, surfaces, and whole folders of images.

pub mod evaluation;
pub mod image_folders;
