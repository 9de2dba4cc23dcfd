//! A tracker allocates nothing, from its construction to the last frame, whatever happens to it.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use mba_tests::handheld::{RenderedFrame, Shake, camera_of_width, sequence, tracker_config, workspace};
use mba_tests::plane_scene::PlaneScene;
use mba_tracker::geometry::RigidTransform;
use mba_tracker::{FrameStatus, ReferenceView, SimdLevel, Tracker, TrackerConfig};

/// The system's allocator, with a count of what is asked of it.
struct Counting;

static CALLS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        CALLS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        CALLS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        CALLS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `realloc`.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What a sequence went through.
#[derive(Default)]
struct Events {
    lost: usize,
    keyframes: usize,
    recovered: usize,
}

fn track(config: &TrackerConfig, memory: &mut [u8], frames: &[RenderedFrame]) -> Option<Events> {
    let mut tracker = Tracker::new(config, SimdLevel::new(), memory).ok()?;
    let mut events = Events::default();
    let mut was_lost = false;
    for (k, frame) in frames.iter().enumerate() {
        let view = frame.view();
        let result = tracker.track(&view).ok()?;
        let lost = result.status == FrameStatus::Lost;
        events.lost += usize::from(lost);
        events.recovered += usize::from(was_lost && !lost);
        events.keyframes += usize::from(result.is_keyframe);
        was_lost = lost;
        // Refused input must not allocate an error either.
        tracker.track(&view).err()?;
        if k + 3 == frames.len() {
            let world_from_camera = result.world_from_camera.mid();
            let reference = ReferenceView { colour: view.colour, depth: view.depth, world_from_camera };
            tracker.set_reference(&reference).ok()?;
            tracker.move_world(&RigidTransform::identity()).ok()?;
            tracker.relocate(&reference, &reference.world_from_camera).ok()?;
        }
    }
    tracker.reset();
    Some(events)
}

fn main() {
    let camera = camera_of_width(160);
    let scene = PlaneScene::corner(5, 0.1);
    let mut frames = sequence(&scene, &camera, &Shake { metres: 0.3, radians: 0.2, hertz: 0.8 }, 24);
    let away = RigidTransform::new(
        mba_tracker::geometry::so3::exp(&nalgebra::Vector3::new(0.5, -1.1, 0.8)),
        nalgebra::Vector3::zeros(),
    );
    for frame in &mut frames[12..14] {
        let truth = mba_tracker::trajectory::ExposureTrajectory::still(away);
        let other = PlaneScene::corner(77, 0.1);
        *frame = RenderedFrame::new(&other, &camera, frame.timestamp, frame.exposure, truth);
    }
    frames[17] = frames[17].replaced(|_| 0, |_, _| 0);
    let config = tracker_config(camera);
    let mut memory = workspace(&config);
    let before = CALLS.load(Ordering::Relaxed);
    let events = track(&config, &mut memory, &frames);
    let calls = CALLS.load(Ordering::Relaxed) - before;
    let events = events.expect("every frame is tracked or lost");
    println!(
        "{calls} calls of the allocator in {} frames: {} keyframes, {} lost, {} times recovered",
        frames.len(),
        events.keyframes,
        events.lost,
        events.recovered
    );
    assert!(before > 0, "the allocator does not count");
    assert_eq!(calls, 0, "the tracker must not touch the heap");
    assert!(events.keyframes >= 2 && events.lost >= 3 && events.recovered >= 2, "not everything was tried");
}
