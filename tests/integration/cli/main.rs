//! The program as its users meet it: a process with arguments, exit code, stdout and stderr.

mod bad_input;
mod bench;
mod commands;
mod covariances;
mod eval_images;
mod export;
#[cfg(unix)]
mod interrupts;
mod keyframes;
#[cfg(unix)]
mod kill_campaign;
#[cfg(unix)]
mod kills;
mod map;
mod mesh;
mod outputs;
mod real_camera;
mod render;
mod sensors;
mod shell;
mod simd;
mod slam;
#[cfg(unix)]
mod submaps;

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use mba_tests::small_dataset;
use tempfile::TempDir;

/// What a process left behind.
struct Outcome {
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

impl Outcome {
    /// Asserts an error: its code, one line that contains all of `parts`, and one line of advice.
    fn assert_error(&self, code: i32, parts: &[&str]) {
        assert_eq!(self.code, Some(code), "{}", self.stderr);
        let errors: Vec<&str> = self.stderr.lines().filter(|line| line.starts_with("error: ")).collect();
        assert_eq!(errors.len(), 1, "{}", self.stderr);
        for part in parts {
            assert!(errors[0].contains(part), "\"{part}\" is missing in: {}", self.stderr);
        }
        assert!(self.stderr.lines().last().is_some_and(|line| line.starts_with("hint: ")), "{}", self.stderr);
        assert_eq!(self.stdout, "");
    }

    fn json(&self) -> serde_json::Value {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        serde_json::from_str(&self.stdout).unwrap()
    }
}

fn mba<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Outcome {
    let output = Command::new(env!("CARGO_BIN_EXE_mba-under-test")).args(arguments).output().unwrap();
    Outcome {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// A temporary folder with the small data set in `data`.
struct Workplace {
    folder: TempDir,
}

impl Workplace {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("data")).unwrap();
        small_dataset::write(&folder.path().join("data")).unwrap();
        Self { folder }
    }

    fn path(&self, relative: &str) -> PathBuf {
        self.folder.path().join(relative)
    }

    fn track(&self) -> Outcome {
        let [data, run] = [self.path("data"), self.path("run")];
        mba([Path::new("track"), &data, Path::new("--out"), &run, Path::new("--json")])
    }

    /// Replaces `old`, which must be there, in a text file.
    fn edit(&self, relative: &str, old: &str, new: &str) {
        let text = std::fs::read_to_string(self.path(relative)).unwrap();
        assert!(text.contains(old), "{relative} has no {old}");
        std::fs::write(self.path(relative), text.replacen(old, new, 1)).unwrap();
    }
}
