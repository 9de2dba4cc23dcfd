//! A tiny sharp RGB-D sequence with known motion, in the layout of the TUM benchmark.

use std::fs;
use std::io;
use std::path::Path;

use image::{ImageBuffer, Luma, Rgb};

/// Columns of the images.
pub const WIDTH: u32 = 160;
/// Rows of the images.
pub const HEIGHT: u32 = 120;
/// Number of frames.
pub const FRAMES: usize = 8;
/// Focal length in pixels.
pub const FOCAL: f64 = 130.0;
/// Distance of the wall that the camera looks at, metres.
pub const WALL: f64 = 2.0;

/// Time of a frame, seconds.
#[must_use]
pub fn timestamp(frame: usize) -> f64 {
    1.0 + frame as f64 / 30.0
}

/// Position of the camera at a frame, metres; it looks along z all the time.
#[must_use]
pub fn position(frame: usize) -> [f64; 2] {
    let k = frame as f64;
    [0.012 * k, 0.02 * (0.5 * k).sin()]
}

/// Writes the sequence into the existing, empty `folder`: a textured wall in front of a camera that moves sideways.
///
/// # Errors
/// When a file cannot be written.
pub fn write(folder: &Path) -> io::Result<()> {
    fs::create_dir(folder.join("rgb"))?;
    fs::create_dir(folder.join("depth"))?;
    let mut lists = [String::new(), String::new(), String::new()];
    for frame in 0..FRAMES {
        let t = timestamp(frame);
        let name = format!("{frame:06}.png");
        let [x, y] = position(frame);
        let colour = ImageBuffer::from_fn(WIDTH, HEIGHT, |u, v| Rgb(wall_colour(x, y, u, v)));
        let depth = ImageBuffer::from_pixel(WIDTH, HEIGHT, Luma([(1000.0 * WALL) as u16]));
        colour.save(folder.join("rgb").join(&name)).map_err(io::Error::other)?;
        depth.save(folder.join("depth").join(&name)).map_err(io::Error::other)?;
        lists[0] += &format!("{t:.6} rgb/{name}\n");
        lists[1] += &format!("{t:.6} depth/{name}\n");
        lists[2] += &format!("{t:.6} {x:.9} {y:.9} 0 0 0 0 1\n");
    }
    for (list, name) in lists.iter().zip(["rgb.txt", "depth.txt", "groundtruth.txt"]) {
        fs::write(folder.join(name), list)?;
    }
    fs::write(folder.join("calibration.toml"), calibration(WIDTH, FOCAL))
}

/// The calibration file, with a width and focal length of choice.
#[must_use]
pub fn calibration(width: u32, focal: f64) -> String {
    format!(
        "width = {width}\nheight = {HEIGHT}\nfx = {focal:?}\nfy = {focal:?}\ncx = 79.5\ncy = 59.5\n\
         depth_scale = 1000.0\nexposure_seconds = 0.001\nframe_rate = 30.0\nresponse = \"linear\"\n\
         readout = \"global\"\n"
    )
}

/// The wall's colour where pixel (u, v) of a camera at (x, y) sees it: a sum of waves of different directions.
fn wall_colour(x: f64, y: f64, u: u32, v: u32) -> [u8; 3] {
    let wall_x = x + (f64::from(u) - 79.5) / FOCAL * WALL;
    let wall_y = y + (f64::from(v) - 59.5) / FOCAL * WALL;
    let waves = [[7.0, 3.0], [-11.0, 17.0], [23.0, -5.0], [13.0, 29.0], [-31.0, -19.0], [37.0, 2.0]];
    let sum: f64 =
        waves.iter().enumerate().map(|(k, w)| (w[0] * wall_x + w[1] * wall_y + k as f64).sin()).sum();
    let grey = (127.0 + 20.0 * sum).round().clamp(0.0, 255.0) as u8;
    [grey; 3]
}
