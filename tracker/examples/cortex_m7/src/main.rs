//! Tracks a few embedded frames: on a bare-metal Cortex-M7 through semihosting, and on the host for comparison.
//!
//! One line per frame: `frame k status` and the poses at shutter opening and closing (translation in metres, then the
//! quaternion x y z w).
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board;
mod sequence;

#[cfg(not(target_os = "none"))]
fn main() {
    let mut memory = vec![0; sequence::MEMORY];
    let tracked = sequence::track(&mut memory, |line| println!("{line}"));
    if !tracked {
        std::process::exit(1);
    }
}
