//! The functions for C, called as C calls them.

mod errors;
mod tracking;

use mba_tests::handheld::{RenderedFrame, Shake, camera_of_width, sequence};
use mba_tests::plane_scene::{DEPTH_SCALE, PlaneScene};
use mba_tracker::capi::codes::{MBA_ERROR_NULL_POINTER, MBA_OK, MBA_PIXEL_GREY8};
use mba_tracker::capi::types::{MbaConfig, MbaDepth, MbaFrame, MbaImage, MbaTracker};
use mba_tracker::capi::{mba_config_compact, mba_memory_size, mba_tracker_init};

/// Memory as C's `aligned_alloc` would return it.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Line([u8; 64]);

struct Bench {
    config: MbaConfig,
    response: Box<[f32; 256]>,
    memory: Vec<Line>,
    frames: Vec<RenderedFrame>,
}

impl Bench {
    fn new(count: usize) -> Self {
        let camera = camera_of_width(160);
        let shake = Shake { metres: 0.04, radians: 0.02, hertz: 1.0 };
        let frames = sequence(&PlaneScene::corner(5, 0.1), &camera, &shake, count);
        let response: Box<[f32; 256]> = Box::new(core::array::from_fn(|byte| byte as f32 / 255.0));
        let mut config = core::mem::MaybeUninit::uninit();
        let (fx, fy, cx, cy) = (camera.fx, camera.fy, camera.cx, camera.cy);
        let scale = (1.0 / DEPTH_SCALE) as f32;
        // SAFETY: the output is writable for one configuration and written on success.
        let mut config = unsafe {
            assert_eq!(mba_config_compact(config.as_mut_ptr(), 160, 120, fx, fy, cx, cy, scale), MBA_OK);
            config.assume_init()
        };
        config.response = response.as_ptr();
        let mut bytes = 0;
        // SAFETY: both pointers are valid.
        assert_eq!(unsafe { mba_memory_size(&config, &mut bytes) }, MBA_OK);
        Self { config, response, memory: vec![Line([0xa5; 64]); bytes.div_ceil(64)], frames }
    }

    fn bytes(&self) -> usize {
        self.memory.len() * 64
    }

    fn init(&mut self) -> (i32, *mut MbaTracker) {
        let mut tracker = core::ptr::null_mut();
        let bytes = self.bytes();
        // SAFETY: the memory is as long as stated and lives as long as the bench.
        let code =
            unsafe { mba_tracker_init(self.memory.as_mut_ptr().cast(), bytes, &self.config, &mut tracker) };
        assert_ne!(code, MBA_ERROR_NULL_POINTER);
        (code, tracker)
    }
}

/// A frame as C would describe it.
fn frame_of(frame: &RenderedFrame) -> MbaFrame {
    let (width, height) = (frame.size.0 as u32, frame.size.1 as u32);
    MbaFrame {
        timestamp: frame.timestamp,
        exposure: frame.exposure,
        image: MbaImage {
            data: frame.grey.as_ptr(),
            size_bytes: frame.grey.len(),
            width,
            height,
            stride_bytes: width,
            format: MBA_PIXEL_GREY8,
        },
        depth: MbaDepth {
            data: frame.depth.as_ptr(),
            size_bytes: 2 * frame.depth.len(),
            width,
            height,
            stride_bytes: 2 * width,
        },
        depth_timestamp: frame.timestamp,
        angular_velocity: core::ptr::null(),
    }
}
