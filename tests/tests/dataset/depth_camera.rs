//! Depth of another camera than colour, and which of it counts.

use std::fs;

use image::{GrayImage, ImageBuffer, Luma};
use mba_mapper::dataset::{read_calibration, write_calibration};

use crate::folder::{Folder, HEIGHT, WIDTH};

/// A data set whose depth images are 4 x 3 pixels of 1000, 1001, ...
fn half_size() -> Folder {
    let folder = Folder::complete();
    for k in 0..3 {
        let depth = ImageBuffer::from_fn(4, 3, |x, y| Luma([(1000 + x + 4 * y) as u16]));
        depth.save(folder.path.join(format!("depth/{k}.png"))).unwrap();
    }
    folder
}

#[test]
fn smaller_depth_of_the_same_proportions_is_brought_to_the_pixels_of_colour() {
    let folder = half_size();
    let dataset = folder.open();
    let frame = dataset.frame(0).unwrap();
    assert_eq!((frame.width, frame.depth.len()), (8, 48));
    // Pixel (3, 2) lies at (1.25, 0.75) of depth, where the value is 1000 + 1.25 + 3.
    assert_eq!(frame.depth[2 * 8 + 3], 1004);
    assert_eq!(frame.depth[0], 0, "outside of the centres of all depth pixels");
    let expected =
        "[depth] of the calibration is not given, the view of colour with pixels 2 times as wide is assumed";
    assert!(folder.warnings().iter().any(|warning| warning == expected), "{:?}", folder.warnings());
}

#[test]
fn the_section_says_what_the_depth_camera_sees_and_from_where() {
    let folder = half_size();
    // Four pixels that see the middle half of what colour sees across.
    let section = "\n[depth]\nwidth = 4\nheight = 3\nfx = 7.0\nfy = 7.5\ncx = 1.5\ncy = 1.0\n";
    folder.edit("calibration.toml", "readout = \"global\"\n", &format!("readout = \"global\"\n{section}"));
    let depth = folder.open().frame(0).unwrap().depth;
    // The principal points coincide: (3.5, 2.5) of colour is (1.5, 1.0) of depth, and pixels have the same size.
    assert_eq!((depth[2 * 8 + 2], depth[2 * 8 + 5], depth[2 * 8 + 6]), (1002, 1005, 0));
    let moved = format!("{section}rotation = [1, 0, 0, 0, 1, 0, 0, 0, 1]\ntranslation = [0.05, 0, 0]\n");
    folder.edit("calibration.toml", section, &moved);
    let depth = folder.open().frame(0).unwrap().depth;
    // 0.05 m to the right at 0.2 m: 1.75 pixels.
    assert_eq!((depth[2 * 8 + 3], depth[2 * 8 + 4], depth[2 * 8 + 7], depth[2 * 8]), (0, 1004, 1007, 0));
    let path = folder.path.join("calibration.toml");
    let read = read_calibration(&path).unwrap();
    write_calibration(&path, &read).unwrap();
    assert_eq!(read_calibration(&path).unwrap(), read);

    folder.edit("calibration.toml", "translation = [0.05", "translation = [50.0");
    assert_eq!(
        folder.message(),
        "calibration.toml, line 21: depth.translation = [50.0, 0.0, 0.0], expected metres from the colour to the depth \
         camera, at most 10"
    );
    folder.edit("calibration.toml", "fx = 7.0\nfy = 7.5\ncx = 1.5", "fx = 0.0\nfy = 7.5\ncx = 1.5");
    assert!(
        folder.message().starts_with("calibration.toml, line 16: depth.fx = 0, expected a focal"),
        "{}",
        folder.message()
    );
}

#[test]
fn saturated_unsure_and_masked_depth_is_missing() {
    let folder = Folder::complete();
    let depth = ImageBuffer::from_fn(WIDTH, HEIGHT, |x, _| Luma([if x == 7 { u16::MAX } else { 500_u16 }]));
    depth.save(folder.path.join("depth/0.png")).unwrap();
    for name in ["confidence", "mask"] {
        fs::create_dir(folder.path.join(name)).unwrap();
    }
    let confidence =
        GrayImage::from_fn(WIDTH, HEIGHT, |x, _| Luma([if x < 2 { 0 } else { x as u8 % 2 + 1 }]));
    confidence.save(folder.path.join("confidence/0.png")).unwrap();
    let mask = GrayImage::from_fn(WIDTH, HEIGHT, |_, y| Luma([if y == 1 { 0 } else { 255 }]));
    mask.save(folder.path.join("mask/0.png.png")).unwrap();
    let dataset = folder.open();
    let frame = dataset.frame(0).unwrap();
    assert_eq!(frame.depth[..8], [0, 0, 500, 500, 500, 500, 500, 0]);
    assert_eq!(frame.depth[8..16], [0; 8]);
    assert_eq!(frame.depth[16..24], frame.depth[..8]);
    assert_eq!(dataset.frame(1).unwrap().depth[0], 200, "a frame without a map of confidence and a mask");
    // A mask of another size belongs to other images.
    GrayImage::new(3, 3).save(folder.path.join("mask/0.png.png")).unwrap();
    let message = folder.shortened(&folder.open().frame(0).unwrap_err());
    assert_eq!(message, "mask/0.png.png has 3 x 3 pixels, the calibration says 8 x 6");
}
