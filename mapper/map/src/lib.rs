//! Maps of every kind: what they are, their files, images and meshes of them.

pub mod infill;
pub mod map;
pub mod rendering;
pub mod surfaces;
pub mod viewer_splats;
