//! Pictures of a small scene.

use std::fs;

use mba_mapper::synth::{SynthConfig, SynthSequence, write_dataset};

use super::numbers::Numbers;
use super::place::Place;

/// A grey PNG of 4 by 3 pixels with 16 bits each.
pub(super) const GREY_4X3: &[u8] = &GREY_4X3_BYTES;

/// Writes lists and images of four frames of 32x24 pixels, at 1.0, 1.1, 1.2 and 1.3 s.
pub(super) fn write_frames(place: &Place) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let made = folder.path().join("made");
    let config =
        SynthConfig { frames: 4, width: 32, height: 24, mean_blur_px: 1.0, ..SynthConfig::default() };
    write_dataset(&SynthSequence::new(config).expect("settings in range"), &made, |_, _| ())
        .expect("a writable folder");
    for images in ["rgb", "depth"] {
        fs::create_dir(place.path(images)).expect("a folder");
        let mut list = String::new();
        for k in 0..4 {
            fs::copy(made.join(format!("{images}/{k:06}.png")), place.path(&format!("{images}/{k}.png")))
                .expect("an image");
            list += &format!("{:.6} {images}/{k}.png\n", 1.0 + 0.1 * f64::from(k));
        }
        place.write(&format!("{images}.txt"), list.as_bytes());
    }
}

#[rustfmt::skip]
const GREY_4X3_BYTES: [u8; 72] = [
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52,
    0x00, 0x00, 0x00, 0x04, 0x00, 0x00, 0x00, 0x03, 0x10, 0x00, 0x00, 0x00, 0x00, 0xc1, 0x0f, 0x2d,
    0x59, 0x00, 0x00, 0x00, 0x0f, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x60, 0x7e, 0x01, 0x81,
    0x0c, 0x18, 0x0c, 0x00, 0x8f, 0x73, 0x0b, 0x05, 0x95, 0x93, 0xe7, 0xc2, 0x00, 0x00, 0x00, 0x00,
    0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82,
];

/// What a camera sees of a textured wall, as the bytes of an input describe it.
pub(super) struct Picture {
    pub(super) grey: Vec<u8>,
    pub(super) depth: Vec<u16>,
}

impl Picture {
    /// Pixels of `width` columns and `height` rows; most inputs describe a wall that moves a little.
    pub(super) fn new(width: usize, height: usize, numbers: &mut Numbers<'_>) -> Self {
        let [x, y, blur] = numbers.bytes::<3>().map(|byte| f32::from(byte.cast_signed()) / 16.0);
        let wall = |u: usize, v: usize, shift: f32| {
            let [u, v] = [u as f32 + x + shift, v as f32 + y];
            let waves = [[0.9, 0.3], [-0.4, 0.7], [0.2, -0.5], [1.3, 1.1]];
            let sum: f32 = waves.iter().enumerate().map(|(k, [a, b])| (a * u + b * v + k as f32).sin()).sum();
            127.0 + 30.0 * sum
        };
        let noise = |k: usize| (k as u32).wrapping_mul(2_654_435_761).rotate_left(9);
        let kind = numbers.byte();
        let grey = |k: usize| match kind % 16 {
            13 => 0,
            14 => 255,
            15 => (noise(k) >> 24) as u8,
            _ => {
                let views = [-0.5, -0.25, 0.0, 0.25, 0.5].map(|time| wall(k % width, k / width, time * blur));
                (views.iter().sum::<f32>() / 5.0).clamp(0.0, 255.0) as u8
            }
        };
        let [distance, slope] = numbers.bytes();
        let depth = |k: usize| match kind / 16 {
            12 => 0,
            13 => u16::MAX,
            14 => (noise(k) >> 16) as u16,
            15 => u16::from(noise(k) & 1 == 0),
            _ => 500 + 16 * u16::from(distance) + (k % width) as u16 * u16::from(slope / 32),
        };
        let pixels = width * height;
        Self { grey: (0..pixels).map(grey).collect(), depth: (0..pixels).map(depth).collect() }
    }
}
