//! Damaged recordings: an error that names the file, or what is left of them, but no panic and no memory for what is only
//! claimed.

use std::fs;
use std::path::Path;

use mba_import::{ImportOptions, Source, import};

use crate::place::data;

/// Most memory of the whole process, bytes.
const MOST_MEMORY: u64 = 300 << 20;

/// The largest memory that the process has had, where the system tells.
fn peak_memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10)
}

/// Brings in what may be damaged; the message of an error names the file.
fn attempt(bytes: &[u8], name: &str, folder: &Path) -> Result<(), String> {
    let (path, out) = (folder.join(name), folder.join("data"));
    fs::write(&path, bytes).unwrap();
    let _ = fs::remove_dir_all(&out);
    let attempted = Source::recognise(&path)
        .and_then(|source| import(&source, &out, &ImportOptions::default(), &|_, _| ()));
    let failed = attempted.map(drop).map_err(|error| error.to_string());
    if let Err(message) = &failed {
        assert!(message.contains(name) || message.contains("data/"), "{message}");
        assert!(!out.exists(), "what was written goes again: {message}");
    }
    failed
}

/// Where what a file depends on ends: an MCAP file has a summary after it, whose place its last bytes tell.
fn end_of_data(bytes: &[u8], name: &str) -> usize {
    match bytes.len() {
        length if name.ends_with(".mcap") => {
            u64::from_le_bytes(bytes[length - 28..length - 20].try_into().unwrap()) as usize
        }
        length => length,
    }
}

fn damage(path: &str) {
    let folder = tempfile::tempdir().unwrap();
    let bytes = fs::read(data(path)).unwrap();
    let name = path.rsplit('/').next().unwrap();
    attempt(&bytes, name, folder.path()).unwrap();
    for cut in (0..end_of_data(&bytes, name)).step_by(211) {
        attempt(&bytes[..cut], name, folder.path()).expect_err("a file that is cut off");
    }
    for at in (0..bytes.len()).step_by(97) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        let _ = attempt(&damaged, name, folder.path());
        // Lengths beyond everything, or of about the largest part that is read.
        let end = (at + 8).min(damaged.len());
        let huge = if at % 2 == 0 { [0xFF; 8] } else { [0xF0, 0xFF, 0xFF, 0x07, 0, 0, 0, 0] };
        damaged[at..end].copy_from_slice(&huge[..end - at]);
        let _ = attempt(&damaged, name, folder.path());
    }
    if let Some(bytes) = peak_memory() {
        assert!(bytes < MOST_MEMORY, "{bytes} bytes of memory");
    }
}

#[test]
fn damaged_mcap_files() {
    ["zstd.mcap", "lz4.mcap", "plain.mcap"].into_iter().for_each(damage);
}

#[test]
fn damaged_bags() {
    ["none.bag", "bz2.bag", "lz4.bag"].into_iter().for_each(damage);
}

#[test]
fn damaged_files_of_telephones_and_recorders() {
    ["folders/recording.r3d", "folders/scene.sens"].into_iter().for_each(damage);
}
