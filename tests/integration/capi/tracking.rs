//! C gets what Rust gets.

use core::ffi::CStr;
use std::sync::atomic::{AtomicU64, Ordering};

use mba_tests::handheld::camera_of_width;
use mba_tests::plane_scene::DEPTH_SCALE;
use mba_tracker::capi::codes::{MBA_ERROR_TIMESTAMP, MBA_OK, MBA_STATUS_OK};
use mba_tracker::capi::types::{MbaPose, MbaResult};
use mba_tracker::capi::{
    mba_move_world, mba_relocate, mba_reset, mba_set_reference, mba_status_string, mba_track, mba_version,
};
use mba_tracker::geometry::{RigidTransform, so3};
use mba_tracker::photometric::InverseResponse;
use mba_tracker::{ReferenceView, SimdLevel, Tracker, TrackerConfig};
use nalgebra::{Vector3, Vector6};

use super::{Bench, frame_of};

extern "C" fn three_more() -> u64 {
    static TICKS: AtomicU64 = AtomicU64::new(0);
    TICKS.fetch_add(3, Ordering::Relaxed)
}

fn as_pose(transform: &RigidTransform) -> MbaPose {
    let q = transform.rotation.coords;
    MbaPose { rotation: [q.x, q.y, q.z, q.w], translation: transform.translation.into() }
}

#[test]
fn poses_are_those_of_the_rust_tracker_bit_for_bit() {
    let mut bench = Bench::new(5);
    bench.config.clock = Some(three_more);
    let (code, tracker) = bench.init();
    assert_eq!(code, MBA_OK);
    let table = InverseResponse::from_table(&bench.response).expect("linear");
    let config = TrackerConfig::compact(camera_of_width(160), (1.0 / DEPTH_SCALE) as f32, table);
    let mut memory = vec![0; config.workspace_len()];
    let mut rust = Tracker::new(&config, SimdLevel::baseline(), &mut memory).expect("valid");
    for frame in &bench.frames {
        let mut result = core::mem::MaybeUninit::<MbaResult>::uninit();
        // SAFETY: all pointers are valid; the result is written on success.
        let result = unsafe {
            assert_eq!(mba_track(tracker, &frame_of(frame), result.as_mut_ptr()), MBA_OK);
            result.assume_init()
        };
        let expected = rust.track(&frame.view()).expect("tracked");
        assert_eq!(result.status, MBA_STATUS_OK);
        assert_eq!(result.world_from_camera_start, as_pose(&expected.world_from_camera.start));
        assert_eq!(result.world_from_camera_end, as_pose(&expected.world_from_camera.end));
        assert_eq!((result.iterations as usize, result.ticks), (expected.iterations, 3));
        assert_eq!(result.has_covariance == 1, result.index > 0);
        if let Some(inverse) = expected.information.try_inverse().filter(|_| result.index > 0) {
            for k in 0..36 {
                let (got, want) = (result.covariance[k], inverse[(k / 6, k % 6)]);
                let scale = (inverse[(k / 6, k / 6)] * inverse[(k % 6, k % 6)]).sqrt();
                assert!((got - want).abs() < 1e-6 * scale, "{k}: {got} {want}");
            }
        }
    }
}

#[test]
fn reset_starts_a_new_world_and_a_reference_view_is_one() {
    let mut bench = Bench::new(2);
    let (_, tracker) = bench.init();
    let mut result = core::mem::MaybeUninit::<MbaResult>::uninit();
    let (first, second) = (frame_of(&bench.frames[0]), frame_of(&bench.frames[1]));
    let pose = MbaPose { rotation: [0.0, 0.0, 0.0, 1.0], translation: [5.0, 6.0, 7.0] };
    // SAFETY: all pointers are valid; the result is written on success.
    let result = unsafe {
        assert_eq!(mba_track(tracker, &second, result.as_mut_ptr()), MBA_OK);
        assert_eq!(mba_track(tracker, &first, result.as_mut_ptr()), MBA_ERROR_TIMESTAMP);
        assert_eq!(mba_reset(tracker), MBA_OK);
        assert_eq!(mba_set_reference(tracker, &first.image, &first.depth, &pose), MBA_OK);
        assert_eq!(mba_track(tracker, &second, result.as_mut_ptr()), MBA_OK);
        result.assume_init()
    };
    let moved = result.world_from_camera_start.translation;
    assert!((0..3).all(|k| (moved[k] - pose.translation[k]).abs() < 0.05), "{moved:?}");
}

/// A pose that the camera of the bench is nowhere near.
fn far_away() -> RigidTransform {
    RigidTransform::new(so3::exp(&Vector3::new(0.4, -1.0, 0.2)), Vector3::new(5.0, 6.0, 7.0))
}

#[test]
fn another_world_and_another_place_are_those_of_the_rust_tracker_bit_for_bit() {
    let mut bench = Bench::new(4);
    let (_, tracker) = bench.init();
    let frames: Vec<_> = bench.frames.iter().map(frame_of).collect();
    let table = InverseResponse::from_table(&bench.response).expect("linear");
    let config = TrackerConfig::compact(camera_of_width(160), (1.0 / DEPTH_SCALE) as f32, table);
    let mut memory = vec![0; config.workspace_len()];
    let mut rust = Tracker::new(&config, SimdLevel::baseline(), &mut memory).expect("valid");
    let aside = far_away().perturbed(&Vector6::new(0.01, 0.0, 0.01, 0.0, 0.005, 0.0));

    let mut result = core::mem::MaybeUninit::<MbaResult>::uninit();
    for (k, frame) in frames.iter().enumerate() {
        let colour = bench.frames[0].view().colour;
        let view =
            ReferenceView { colour, depth: bench.frames[0].view().depth, world_from_camera: far_away() };
        // SAFETY: all pointers are valid; the result is written on success.
        let result = unsafe {
            if k == 1 {
                rust.move_world(&far_away().inverse()).expect("valid");
                assert_eq!(mba_move_world(tracker, &as_pose(&far_away().inverse())), MBA_OK);
            }
            if k == 3 {
                rust.relocate(&view, &aside).expect("valid");
                let (view, camera) = (as_pose(&far_away()), as_pose(&aside));
                let (image, depth) = (&frames[0].image, &frames[0].depth);
                assert_eq!(mba_relocate(tracker, image, depth, &view, &camera), MBA_OK);
            }
            assert_eq!(mba_track(tracker, frame, result.as_mut_ptr()), MBA_OK);
            result.assume_init()
        };
        let expected = rust.track(&bench.frames[k].view()).expect("tracked");
        assert_eq!(result.status, MBA_STATUS_OK, "frame {k}");
        assert_eq!(result.world_from_camera_start, as_pose(&expected.world_from_camera.start));
        assert_eq!(result.world_from_camera_end, as_pose(&expected.world_from_camera.end));
        let world = match k {
            0 => RigidTransform::identity(),
            3 => far_away(),
            _ => far_away().inverse(),
        };
        // The bench's camera starts at the origin of its world and moves by centimetres.
        let error = world.compose(&bench.frames[k].truth.mid()).tangent_to(&expected.world_from_camera.mid());
        assert!(error.norm() < 0.01, "frame {k}: {error:?}");
    }
}

#[test]
fn version_and_names() {
    assert_eq!(mba_version(), 0x00_01_00);
    // SAFETY: never null, terminated, static.
    let name = |status| unsafe { CStr::from_ptr(mba_status_string(status)) };
    assert_eq!([0, 1, 2, -7].map(name), [c"ok", c"weak", c"lost", c"unknown status"]);
}
