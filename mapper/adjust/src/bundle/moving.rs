//! Keyframes that turned out to be elsewhere, and the map moved along.

use mba_tracker::geometry::RigidTransform;

use super::adjustment::BundleAdjustment;
use super::map_model::MapModel;
use super::mapped_frame::MappedFrame;
use super::world_moves::WorldMoves;

impl<M: MapModel> BundleAdjustment<M> {
    /// Puts the middle of every keyframe's path at a new pose, in the order of the keyframes, which is that of time. Parts
    /// of the map move with the keyframes that they belong to.
    pub fn move_keyframes(&mut self, world_from_keyframe: &[RigidTransform]) -> WorldMoves {
        let mut moves = WorldMoves::default();
        for (frame, new_world_from_keyframe) in self.frames.iter_mut().zip(world_from_keyframe) {
            let MappedFrame { keyframe, state } = frame;
            let new_world_from_world = new_world_from_keyframe.compose(&state.path.mid().inverse());
            state.path = state.path.seen_from(&new_world_from_world);
            keyframe.prior.middle = new_world_from_world.compose(&keyframe.prior.middle);
            moves.push(keyframe.index, new_world_from_world);
        }
        self.map.move_along(&moves);
        for MappedFrame { keyframe, state } in &self.frames {
            self.map.make_room(keyframe.observation.level(0), &state.path.mid());
        }
        moves
    }
}
