//! The built-in scenes. World frame: y up, metres, the floor at y = 0.

mod build;
mod desk;
mod hall;
mod room;
mod wall;

use super::config::SceneName;
use super::scene::Blueprint;

/// The description of a scene.
pub(super) fn blueprint(name: SceneName) -> Blueprint {
    match name {
        SceneName::Room => room::blueprint(),
        SceneName::Hall => hall::blueprint(),
        SceneName::Desk => desk::blueprint(),
        SceneName::Wall => wall::blueprint(),
    }
}
