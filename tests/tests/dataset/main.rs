//! Data sets: every layout, every message.

mod bad_input;
mod camera_facts;
mod depth_camera;
mod folder;
mod inertial;
mod other_layouts;
mod tum_layout;
