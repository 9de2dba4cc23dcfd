//! Keyframes that turned out to be elsewhere, and the map moved along.

use mba_tracker::geometry::RigidTransform;

use super::adjustment::BundleAdjustment;
use super::map_model::MapModel;
use super::world_moves::WorldMoves;

impl<M: MapModel> BundleAdjustment<M> {
    /// Puts the middle of every keyframe's path at a new pose, in the order of the keyframes, which is that of time. Parts
    /// of the map move with the keyframes that they belong to.
    pub fn move_keyframes(&mut self, world_from_keyframe: &[RigidTransform]) -> WorldMoves {
        let mut moves = WorldMoves::default();
        let both = self.keyframes.iter_mut().zip(&mut self.state.frames).zip(world_from_keyframe);
        for ((keyframe, frame), new_world_from_keyframe) in both {
            let new_world_from_world = new_world_from_keyframe.compose(&frame.path.mid().inverse());
            frame.path = frame.path.seen_from(&new_world_from_world);
            keyframe.prior.middle = new_world_from_world.compose(&keyframe.prior.middle);
            moves.push(keyframe.index, new_world_from_world);
        }
        let map = &mut self.state.map;
        map.move_along(&moves);
        for (keyframe, frame) in self.keyframes.iter().zip(&self.state.frames) {
            map.make_room(keyframe.observation.level(0), &frame.path.mid());
        }
        moves
    }
}
