//! Checkpoints of tracks, maps and SLAM runs, forged with a checksum that is right: a resumed run may make a wrong map of
//! them, or refuse them, and nothing else.

use std::cell::RefCell;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use mba_mapper::bundle::BundleState;
use mba_mapper::checkpoint::{Identity, load};
use mba_mapper::dataset::{Dataset, open};
use mba_mapper::mapping::{MapError, MapSettings, map_dataset};
use mba_mapper::output::{OutputFolder, Permission};
use mba_mapper::run::{FrameRecord, FrameStatus, Run, RunSettings, RunWriter};
use mba_mapper::slam::{SlamError, SlamProgress, SlamSettings, run_slam};
use mba_mapper::synth::{SynthConfig, SynthSequence, write_dataset};
use mba_mapper::tracking::{TrackingCheckpoint, TrackingError, TrackingOptions, track_and_keep};
use tempfile::TempDir;

use super::numbers::Numbers;
use super::place::{Kept, in_place};

/// Bytes of the header up to the length of the payload, and all of it.
const LENGTH_AT: usize = 52;
const IDENTITY_AT: usize = 12;
const HEADER_LEN: usize = 64;

/// Makes length and checksum in the header right.
fn repair(file: &mut [u8]) {
    let length = (file.len() - HEADER_LEN) as u64;
    file[LENGTH_AT..LENGTH_AT + 8].copy_from_slice(&length.to_le_bytes());
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&file[IDENTITY_AT..LENGTH_AT + 8]);
    hasher.update(&file[HEADER_LEN..]);
    file[LENGTH_AT + 8..HEADER_LEN].copy_from_slice(&hasher.finalize().to_le_bytes());
}

/// Map and paths in a payload, behind a header that is right.
pub fn checkpoint(data: &[u8]) {
    thread_local!(static KEPT: Kept = const { RefCell::new(None) });
    in_place(
        &KEPT,
        |_| (),
        |place| {
            let mut file = b"MBACKPT\n\x02\0\0\0".to_vec();
            file.resize(HEADER_LEN, 0);
            file.extend(data);
            repair(&mut file);
            let path = place.write("checkpoint", &file);
            // The figures of the steps follow the state.
            let _ = load::<(BundleState, [f64; 3])>(&path, &Identity::default());
        },
    );
}

/// Four small frames, a run of their true poses, and checkpoints of all kinds made from them.
struct Bench {
    folder: TempDir,
    dataset: Dataset,
    run: Run,
    checkpoints: Vec<Vec<u8>>,
}

impl Bench {
    fn new(size: [usize; 2]) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let data = folder.path().join("data");
        let [width, height] = size;
        let config = SynthConfig { frames: 4, width, height, mean_blur_px: 1.0, ..SynthConfig::default() };
        write_dataset(&SynthSequence::new(config).expect("settings in range"), &data, |_, _| ())
            .expect("a writable folder");
        let dataset = open(&data).expect("a data set");
        let run = true_run(&dataset, &folder.path().join("run"));
        Self { folder, dataset, run, checkpoints: Vec::new() }
    }

    /// Puts a forged checkpoint into the place of the output.
    fn forge(&self, data: &[u8]) {
        let mut numbers = Numbers::new(data);
        let genuine = &self.checkpoints[numbers.below(self.checkpoints.len())];
        let mut file = genuine.clone();
        edit(&mut file, &mut numbers);
        repair(&mut file);
        fs::write(self.folder.path().join("out/checkpoint"), file).expect("a writable folder");
    }

    fn keep_checkpoint(&mut self) {
        let path = self.folder.path().join("out/checkpoint");
        self.checkpoints.push(fs::read(path).expect("a checkpoint"));
    }

    fn output(&self) -> OutputFolder {
        OutputFolder::for_run(&self.folder.path().join("out"), &Permission::default())
            .expect("a folder for a run")
    }

    /// Tracks until there are `frames` frames, from the checkpoint if there is one.
    fn track(&self, frames: usize) -> Result<(), TrackingError> {
        let options = TrackingOptions::default();
        let out = self.output();
        let mut checkpoint =
            TrackingCheckpoint::new(out.path(), &self.dataset, &options, Duration::ZERO, true)?;
        let mut writer = RunWriter::create(out, describe())?;
        let mut left = frames.saturating_sub(checkpoint.frames());
        track_and_keep(&self.dataset, &options, &mut writer, Some(&mut checkpoint), |_| {
            left = left.saturating_sub(1);
            if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        writer.finish(|_| ()).map(|_| ()).map_err(TrackingError::from)
    }

    /// One step of a map, from the checkpoint if there is one.
    fn map(&self) -> Result<(), MapError> {
        let settings = MapSettings { max_gaussians: Some(100), ..MapSettings::default() };
        let stop = |_| ControlFlow::Break(());
        map_dataset(&self.dataset, &self.run, &settings, self.output(), true, describe(), stop).map(|_| ())
    }

    /// SLAM until `is_enough`, from the checkpoint if there is one.
    fn slam(&self, is_enough: impl Fn(SlamProgress) -> bool) -> Result<(), SlamError> {
        let checkpoint_interval = Duration::ZERO;
        let settings =
            SlamSettings { max_gaussians: Some(100), checkpoint_interval, ..SlamSettings::default() };
        let observe = |at| if is_enough(at) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        run_slam(&self.dataset, &settings, self.output(), true, describe(), observe).map(|_| ())
    }
}

fn describe() -> RunSettings {
    RunSettings {
        program: "fuzz".to_owned(),
        dataset: String::new(),
        frame_rate: 30.0,
        camera: None,
        options: Default::default(),
    }
}

/// A run that found the true poses.
fn true_run(dataset: &Dataset, folder: &Path) -> Run {
    let mut writer = RunWriter::create_in(folder, describe()).expect("a writable folder");
    for exposure in dataset.ground_truth_exposures() {
        let record = FrameRecord::without_figures(exposure.timestamp, FrameStatus::Ok);
        writer.push(*exposure, record).expect("a writable folder");
    }
    writer.finish(|_| ()).expect("a writable folder");
    Run::open(folder).expect("a run")
}

/// Changes the payload of a checkpoint, edit by edit.
fn edit(file: &mut Vec<u8>, numbers: &mut Numbers<'_>) {
    while !numbers.is_empty() && file.len() > HEADER_LEN {
        let payload = file.len() - HEADER_LEN;
        let kind = numbers.byte();
        let [a, b, c, d] = numbers.bytes();
        let near = usize::from(u16::from_le_bytes([a, b])) % payload;
        // What is not an array is near the beginning or near the end.
        let at = HEADER_LEN
            + match kind / 8 % 3 {
                0 => near,
                1 => payload - 1 - near,
                _ => u32::from_le_bytes([a, b, c, d]) as usize % payload,
            };
        match kind % 6 {
            0 => file[at] = numbers.byte(),
            1 => {
                let number = numbers.near(0.0, 10.0).to_le_bytes();
                file[at..].iter_mut().zip(number).for_each(|(old, new)| *old = new);
            }
            2 => {
                let number = (numbers.near(0.0, 10.0) as f32).to_le_bytes();
                file[at..].iter_mut().zip(number).for_each(|(old, new)| *old = new);
            }
            3 => drop(file.drain(at..(at + 1 + numbers.below(8)).min(file.len()))),
            4 => file.insert(at, numbers.byte()),
            _ => file[at] ^= 1 << (d % 8),
        }
    }
}

/// `mba track --resume`: the frames that are left, from a forged checkpoint.
pub fn resume_track(data: &[u8]) {
    thread_local!(static KEPT: RefCell<Option<Bench>> = const { RefCell::new(None) });
    KEPT.with_borrow_mut(|kept| {
        let bench = kept.get_or_insert_with(|| {
            let mut bench = Bench::new([64, 48]);
            let stopped = bench.track(3);
            assert!(matches!(stopped, Err(TrackingError::Stopped)), "{stopped:?}");
            bench.keep_checkpoint();
            bench
        });
        bench.forge(data);
        let _ = bench.track(usize::MAX);
    });
}

/// `mba map --resume`: one step from a forged checkpoint.
pub fn resume_map(data: &[u8]) {
    thread_local!(static KEPT: RefCell<Option<Bench>> = const { RefCell::new(None) });
    KEPT.with_borrow_mut(|kept| {
        let bench = kept.get_or_insert_with(|| {
            let mut bench = Bench::new([32, 24]);
            assert!(matches!(bench.map(), Err(MapError::Stopped)));
            bench.keep_checkpoint();
            bench
        });
        bench.forge(data);
        let _ = bench.map();
    });
}

/// `mba slam --resume`: the frames that are left, or one step of the refinement, from a forged checkpoint.
pub fn resume_slam(data: &[u8]) {
    thread_local!(static KEPT: RefCell<Option<Bench>> = const { RefCell::new(None) });
    KEPT.with_borrow_mut(|kept| {
        let bench = kept.get_or_insert_with(|| {
            let mut bench = Bench::new([96, 72]);
            let growing = bench.slam(|at| matches!(at, SlamProgress::Frames { frames: 2.., .. }));
            assert!(matches!(growing, Err(SlamError::Stopped)), "{growing:?}");
            bench.keep_checkpoint();
            let refining = bench.slam(|at| matches!(at, SlamProgress::Refinement { .. }));
            assert!(matches!(refining, Err(SlamError::Stopped)), "{refining:?}");
            bench.keep_checkpoint();
            bench
        });
        bench.forge(data);
        let _ = bench.slam(|at| matches!(at, SlamProgress::Refinement { .. }));
    });
}
