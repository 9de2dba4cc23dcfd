//! Images, as frames of a data set and by themselves.

use std::cell::RefCell;

use mba_mapper::dataset::{Dataset, open, read_image};

use super::picture::write_frames;
use super::place::{Kept, Place, in_place};

const CALIBRATION: &str = "width = 32\nheight = 24\nfx = 30.0\nfy = 30.0\ncx = 15.5\ncy = 11.5\ndepth_scale = 1000\n\
     distortion = [0.1, 0.01, 0.001, 0.001, 0.0]\n";

/// Most bytes of an image that is decoded at its own size: those that only announce pixels take long.
const FEW_PIXELS: u32 = 1 << 20;

/// The colour or, for an odd first byte, the depth image of a frame.
pub fn image(data: &[u8]) {
    thread_local! {
        static KEPT: Kept = const { RefCell::new(None) };
        static OPENED: RefCell<Option<Dataset>> = const { RefCell::new(None) };
    }
    let Some((choice, content)) = data.split_first() else { return };
    let fill = |place: &Place| {
        write_frames(place);
        place.write("calibration.toml", CALIBRATION.as_bytes());
        OPENED.set(Some(open(place.folder()).expect("a good data set")));
    };
    in_place(&KEPT, fill, |place| {
        let frame = usize::from(choice % 2);
        place.write(["rgb/0.png", "depth/1.png"][frame], content);
        OPENED.with_borrow(|dataset| {
            let Some(Ok(frame)) = dataset.as_ref().map(|dataset| dataset.frame(frame)) else { return };
            assert_eq!((frame.rgb.len(), frame.depth.len()), (3 * 32 * 24, 32 * 24));
        });
    });
}

/// An image of any size and type, as `mba eval images` reads them.
pub fn image_of_any_size(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    if announced_pixels(data).is_some_and(|pixels| pixels > FEW_PIXELS) {
        return;
    }
    in_place(
        &KEPT,
        |_| (),
        |place| {
            let path = place.write("image.png", data);
            if let Ok(image) = read_image(&path) {
                assert!(image.width() > 0 && image.height() > 0);
            }
        },
    );
}

/// The size in the header of a PNG, or of a JPEG whose first frame header is found.
fn announced_pixels(data: &[u8]) -> Option<u32> {
    let number =
        |at: usize| data.get(at..at + 4).map(|four| four.iter().fold(0_u32, |n, b| n << 8 | u32::from(*b)));
    if data.starts_with(b"\x89PNG") {
        return Some(number(16)?.saturating_mul(number(20)?));
    }
    let is_frame = |pair: &[u8]| pair[0] == 0xFF && (0xC0..=0xCF).contains(&pair[1]);
    let sizes =
        data.windows(2).enumerate().filter(|(_, pair)| is_frame(pair)).filter_map(|(at, _)| number(at + 5));
    sizes.map(|size| (size >> 16) * (size & 0xFFFF)).max()
}
