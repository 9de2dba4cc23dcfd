//! Draws the frames that the program embeds, and puts the memory map where the linker finds it.

use std::{env, fs, io, path::Path};

const WIDTH: usize = 160;
const HEIGHT: usize = 120;
const FRAMES: usize = 6;
const FOCAL: f64 = 140.0;

/// A wall 2 m away, seen by a camera that slides 12 mm to the right per frame with the shutter open half of the time.
fn light(frame: usize, u: usize, v: usize) -> f64 {
    const VIEWS: usize = 9;
    let sum: f64 = (0..VIEWS)
        .map(|view| {
            let time = frame as f64 + 0.5 * ((view as f64 + 0.5) / VIEWS as f64 - 0.5);
            let x = 0.012 * time + (u as f64 - 79.5) / FOCAL * 2.0;
            let y = (v as f64 - 59.5) / FOCAL * 2.0;
            let (a, b) = (9.0 * x + 4.0 * (5.0 * y).sin(), 11.0 * y - 3.0 * (7.0 * x).sin());
            0.45 + 0.15 * a.sin() + 0.15 * b.sin() + 0.1 * (23.0 * x + 17.0 * y).sin()
        })
        .sum();
    sum / VIEWS as f64
}

fn main() -> io::Result<()> {
    let out = env::var_os("OUT_DIR").ok_or_else(|| io::Error::other("OUT_DIR is not set"))?;
    let out = Path::new(&out);
    let pixels = (0..FRAMES * HEIGHT * WIDTH)
        .map(|k| light(k / (WIDTH * HEIGHT), k % WIDTH, k / WIDTH % HEIGHT))
        .map(|light| (255.0 * light).round() as u8);
    fs::write(out.join("frames.grey"), pixels.collect::<Vec<_>>())?;
    fs::copy("memory.x", out.join("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=memory.x");
    Ok(())
}
