//! The caller's memory: as long as promised, wherever it lies.

use mba_tests::handheld::{camera_of_width, tracker_config};
use mba_tracker::error::ConfigError;
use mba_tracker::workspace::WorkspaceError;
use mba_tracker::{SimdLevel, Tracker, TrackerConfig, workspace_len};

/// A device reserves the memory in a static array.
const STATIC_LEN: usize = workspace_len(160, 120, 3, 0);

fn configs() -> Vec<TrackerConfig> {
    let mut configs: Vec<_> = [64, 160, 333, 640].map(|w| tracker_config(camera_of_width(w))).into();
    let mut other = tracker_config(camera_of_width(320));
    (other.levels, other.surface_level) = (2, 1);
    configs.push(other.clone());
    (other.levels, other.surface_level) = (4, 3);
    configs.push(other);
    configs
}

#[test]
fn stated_length_suffices_at_every_address() {
    assert_eq!(STATIC_LEN, tracker_config(camera_of_width(160)).workspace_len());
    for config in configs() {
        let len = config.workspace_len();
        let mut memory = vec![0; len + 64];
        for offset in [0, 1, 7, 8, 31, 32, 63, 64] {
            let tracker = Tracker::new(&config, SimdLevel::new(), &mut memory[offset..offset + len]);
            assert!(tracker.is_ok(), "{}x{}, offset {offset}", config.camera.width, config.camera.height);
        }
    }
}

#[test]
fn shorter_memory_is_refused_with_what_is_missing() {
    for config in configs() {
        let len = config.workspace_len();
        let mut memory = vec![0; len + 64];
        let aligned = memory.as_ptr().align_offset(64);
        // At an aligned address nothing of the 64 bytes of slack is needed; at the worst address all but one are.
        for (offset, shortest) in [(aligned, len - 64), (aligned + 1, len - 1)] {
            let mut outcome = |len: usize| {
                Tracker::new(&config, SimdLevel::new(), &mut memory[offset..offset + len]).map(|_| ())
            };
            assert_eq!(outcome(shortest), Ok(()), "{shortest} bytes suffice at this address");
            let missing = ConfigError::Workspace(WorkspaceError::TooSmall { missing: 1 });
            assert_eq!(outcome(shortest - 1), Err(missing));
        }
        for short in [0, 1, 64, len / 3] {
            let result = Tracker::new(&config, SimdLevel::new(), &mut memory[..short]).map(|_| ());
            assert!(matches!(result, Err(ConfigError::Workspace(_))), "{short} bytes: {result:?}");
        }
    }
}

#[test]
fn a_vga_tracker_needs_less_than_sixteen_megabytes() {
    let len = tracker_config(camera_of_width(640)).workspace_len();
    assert!(len <= 16 << 20, "{len} bytes");
}
