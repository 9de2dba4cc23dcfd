//! Analytic worlds: what a ray meets and how bright it is.

mod hall;
mod lighting;
mod material;
mod pattern;
mod print;
mod room;
mod room_behind;
mod room_furniture;
mod rooms;
mod shape;
mod wall;
mod world;

pub(super) use shape::Ray;
pub(super) use world::{Cone, Hit, Scene};

use super::{CameraMotion, SceneName};

impl Scene {
    /// The world of this name, furnished where a camera that moves like this looks.
    pub(super) fn new(name: SceneName, motion: CameraMotion) -> Self {
        match name {
            SceneName::Room => room::build(motion),
            SceneName::Hall => hall::build(motion),
            SceneName::Wall => wall::build(),
        }
    }

    /// A row of `count` furnished rooms with doors between them.
    pub(super) fn rooms(count: usize) -> Self {
        rooms::build(count)
    }
}
