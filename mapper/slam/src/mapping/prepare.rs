//! From a run to a bundle that can be adjusted.

use mba_adjust::bundle::{
    BundleAdjustment, FrameState, MapKeyframe, MappedFrame, NOTICEABLE, PathPrior, log_brightness,
};
use mba_adjust::continuity::{ContinuitySettings, FrameVerdict, Suspicion, predict_motions};
use mba_io::dataset::Dataset;
use mba_io::statistics::quantile;
use mba_io::trajectory_file::TimedExposure;
use mba_raster::exposure::{ExposurePath, motion_of};
use mba_raster::sensor::Sensor;
use nalgebra::Vector6;
use rayon::prelude::*;

use super::evidence::FrameEvidence;
use super::observations::{observation, sensor};
use super::run_continuity::{RepairedRun, repair_run, run_frames};
use super::{MapError, MapSettings};
use crate::run::{FrameRecord, FrameStatus, Run};

/// Largest difference between the times of a frame in the run and in the data set, seconds.
const SAME_TIME: f64 = 1e-4;

/// What every frame of the data set starts with.
pub(super) struct Frames {
    /// Tracked exposures, repaired.
    pub(super) exposures: Vec<TimedExposure>,
    /// What was said of them when they were tracked.
    pub(super) records: Vec<FrameRecord>,
    /// First estimates of the paths over all the time in which anything of a frame was measured.
    paths: Vec<ExposurePath>,
    /// How many times as long as the exposures the paths are.
    stretches: Vec<f64>,
    /// What the neighbours say about each motion.
    pub(super) priors: Vec<PathPrior>,
    /// What was odd, one sentence each.
    pub(super) warnings: Vec<String>,
    /// Whether neighbours say anything about a frame.
    continuity: bool,
}

impl Frames {
    /// Repairs the exposures of a run, unless `continuity` is left out.
    pub(super) fn new(dataset: &Dataset, run: &Run, continuity: bool) -> Result<Self, MapError> {
        check_frames(dataset, run)?;
        Self::of(dataset, &run.exposures, &run.frames, continuity)
    }

    /// Repairs the exposures of all frames of the data set. Without `continuity` all of them stay as they are, and no
    /// frame says anything about another.
    pub(super) fn of(
        dataset: &Dataset,
        exposures: &[TimedExposure],
        records: &[FrameRecord],
        continuity: bool,
    ) -> Result<Self, MapError> {
        if !continuity {
            let prior = |(exposure, record): (_, &FrameRecord)| PathPrior {
                middle: motion_of(exposure).mid(),
                is_measured: record.status == FrameStatus::Ok,
                motion: None,
            };
            let priors = exposures.iter().zip(records).map(prior).collect();
            let (exposures, records) = (exposures.to_vec(), records.to_vec());
            return Ok(Self::on_paths(dataset, exposures, records, priors, Vec::new(), continuity));
        }
        let seconds = exposure_seconds(dataset);
        let settings = ContinuitySettings::default();
        let evidence = FrameEvidence::new(dataset);
        let compare = |suspicion: &Suspicion<'_>| evidence.compare(suspicion);
        // Repairs first: predictions look at the repaired neighbours.
        let repaired = repair_run(exposures, records, &seconds, &settings, &compare)?;
        let frames = run_frames(&repaired.exposures, records, &seconds)?;
        let motions = predict_motions(&frames, &settings).into_iter();
        let is_in_place =
            |verdict: FrameVerdict| matches!(verdict, FrameVerdict::Kept | FrameVerdict::Reversed);
        let prior = |(index, (motion, exposure)): (usize, (_, &TimedExposure))| PathPrior {
            middle: motion_of(exposure).mid(),
            is_measured: records[index].status == FrameStatus::Ok
                && is_in_place(repaired.continuity.verdicts[index]),
            motion,
        };
        let priors: Vec<PathPrior> = motions.zip(&repaired.exposures).enumerate().map(prior).collect();
        let warnings = repairs(&repaired, "before");
        let records = records.to_vec();
        Ok(Self::on_paths(dataset, repaired.exposures, records, priors, warnings, continuity))
    }

    /// Gives every frame a path over all the time in which anything of it was measured.
    fn on_paths(
        dataset: &Dataset,
        exposures: Vec<TimedExposure>,
        records: Vec<FrameRecord>,
        mut priors: Vec<PathPrior>,
        warnings: Vec<String>,
        continuity: bool,
    ) -> Self {
        let sensor = sensor(dataset);
        let stretch = |index: usize| {
            // How much longer than the exposure the time is in which rows and depth are measured.
            let offset = dataset.depth_timestamp(index) - dataset.timestamp(index);
            sensor.times(dataset.exposure_seconds(index), offset).1
        };
        let stretches: Vec<f64> = (0..dataset.len()).map(stretch).collect();
        let tracked = |index: usize| records[index].status != FrameStatus::Lost;
        let paths: Vec<ExposurePath> = (0..exposures.len())
            .map(|index| {
                let seconds = dataset.exposure_seconds(index);
                // Lost frames hold a pose, and say nothing of the acceleration.
                let beside =
                    |other: Option<usize>| other.filter(|k| tracked(*k)).and_then(|k| exposures.get(k));
                let neighbours =
                    [beside(index.checked_sub(1)), beside(Some(index + 1).filter(|k| *k < exposures.len()))];
                long_path(&exposures[index], neighbours, seconds, stretches[index])
            })
            .collect();
        for ((prior, path), stretch) in priors.iter_mut().zip(&paths).zip(&stretches) {
            // Priors of motions are over the same time as the paths.
            if *stretch != 1.0 {
                prior.middle = path.ends.mid();
                prior.motion = prior.motion.map(|motion| motion.times(*stretch));
            }
        }
        Self { exposures, records, paths, stretches, priors, warnings, continuity }
    }

    /// Repairs exposures that were refined, unless continuity is left out, and tells what was done.
    pub(super) fn repair(
        &self,
        dataset: &Dataset,
        refined: &[TimedExposure],
    ) -> Result<(Vec<TimedExposure>, Vec<String>), MapError> {
        if !self.continuity {
            return Ok((refined.to_vec(), Vec::new()));
        }
        let settings = ContinuitySettings::default();
        let evidence = FrameEvidence::new(dataset);
        let compare = |suspicion: &Suspicion<'_>| evidence.compare(suspicion);
        let seconds = exposure_seconds(dataset);
        let repaired = repair_run(refined, &self.records, &seconds, &settings, &compare)?;
        let warnings = repairs(&repaired, "after");
        Ok((repaired.exposures, warnings))
    }

    /// A refined exposure as it is written: its motion as the map shows it, its middle where it was tracked, if it was measured
    /// there. A map explains its own keyframes with moved cameras as well as without; no pixel that it has not seen confirms
    /// such a move.
    pub(super) fn in_place(&self, index: usize, refined: &TimedExposure) -> TimedExposure {
        if !self.priors[index].is_measured {
            return *refined;
        }
        let mid = self.exposures[index].mid;
        TimedExposure { mid, ..refined.seen_from(&mid.compose(&refined.mid.inverse())) }
    }

    /// The exposure of a frame with that state.
    pub(super) fn exposure_of(&self, index: usize, state: &FrameState) -> TimedExposure {
        state.path.stretched(1.0 / self.stretches[index]).timed(self.exposures[index].timestamp)
    }

    /// First estimate of a frame's path.
    pub(super) fn state(&self, index: usize, settings: &MapSettings) -> FrameState {
        let path = self.paths[index];
        FrameState::new(if settings.blur { path } else { ExposurePath::still(path.mid()) })
    }
}

/// The bundle of the chosen keyframes, ascending indices in the data set, with an empty map; frames that cannot be read are
/// left out with a warning.
pub(super) fn bundle(
    dataset: &Dataset,
    frames: &mut Frames,
    chosen: &[usize],
    settings: &MapSettings,
) -> Result<BundleAdjustment, MapError> {
    let sensor = sensor(dataset);
    // Images are read side by side, and kept in the order of the frames.
    let load = |&index: &usize| (index, observation(dataset, &sensor, index));
    let loaded: Vec<_> = chosen.par_iter().map(load).collect();
    let mut mapped = Vec::new();
    for (index, observation) in loaded {
        match observation {
            Ok(observation) => mapped.push(MappedFrame {
                keyframe: MapKeyframe::new(index, observation, frames.priors[index]),
                state: frames.state(index, settings),
            }),
            Err(reason) => frames.warnings.push(format!("keyframe {index} left out: {reason}")),
        }
    }
    if mapped.is_empty() {
        let reason = frames.warnings.last().cloned().unwrap_or_else(|| "all frames are lost".to_owned());
        return Err(MapError::NoKeyframe(reason));
    }
    set_gains(&sensor, &mut mapped);
    let picture = sensor.camera.width * sensor.camera.height;
    let mut bundle = BundleAdjustment::new(dataset.simd(), sensor, settings.bundle(), mapped);
    if settings.max_gaussians.is_none() {
        bundle.set_max_gaussians(bundle.seen_surface().gaussians(picture));
    }
    Ok(bundle)
}

/// First estimates of the gains, from keyframe to keyframe, where they differ by more than the adjustment finds itself.
/// The map is as bright as the median keyframe.
fn set_gains(sensor: &Sensor, mapped: &mut [MappedFrame]) {
    let ratios: Vec<f64> = mapped
        .par_windows(2)
        .map(|pair| {
            let [before, here] = [0, 1].map(|k| pair[k].placed(1));
            log_brightness(&sensor.inverse_response, before, here).unwrap_or(0.0)
        })
        .collect();
    let mut log_gains = vec![0.0];
    // Ratios between neighbours add up along the sequence.
    ratios.iter().for_each(|ratio| log_gains.push(log_gains[log_gains.len() - 1] + ratio));
    if log_gains.iter().any(|log_gain| log_gain.abs() > NOTICEABLE) {
        let median = quantile(&log_gains, 0.5).unwrap_or(0.0);
        mapped
            .iter_mut()
            .zip(log_gains)
            .for_each(|(frame, log_gain)| frame.state.log_gain = log_gain - median);
    }
}

/// The path over `stretch` times the exposure time, `seconds`. A straight exposure says nothing about a bow, which
/// matters over a longer time: there the acceleration follows from the neighbours, as far as they are tracked.
fn long_path(
    exposure: &TimedExposure,
    neighbours: [Option<&TimedExposure>; 2],
    seconds: f64,
    stretch: f64,
) -> ExposurePath {
    let path = ExposurePath::through(exposure);
    if stretch == 1.0 {
        return path;
    }
    let mid = exposure.mid;
    // The straight motion goes on to both ends of the longer path.
    let half_motion = motion_of(exposure).motion() * (0.5 * stretch);
    let acceleration = match neighbours {
        [Some(before), Some(after)] => {
            // Second difference of three poses at uneven times.
            let rate = |other: &TimedExposure| {
                let time = other.timestamp - exposure.timestamp;
                (mid.tangent_to(&other.mid) / time, time)
            };
            let ((into, since), (out, until)) = (rate(before), rate(after));
            (out - into) * (2.0 / (until - since))
        }
        _ => Vector6::zeros(),
    };
    let half_time = 0.5 * stretch * seconds;
    let lift = acceleration * (0.5 * half_time * half_time);
    let [start, end] = [lift - half_motion, lift + half_motion].map(|tangent| mid.perturbed(&tangent));
    ExposurePath::through(&TimedExposure { timestamp: exposure.timestamp, start, mid, end })
}

fn check_frames(dataset: &Dataset, run: &Run) -> Result<(), MapError> {
    if run.exposures.len() != dataset.len() || run.frames.len() != dataset.len() {
        return Err(MapError::Frames { run: run.exposures.len(), dataset: dataset.len() });
    }
    for (index, exposure) in run.exposures.iter().enumerate() {
        let (run, dataset) = (exposure.timestamp, dataset.timestamp(index));
        if (run - dataset).abs() > SAME_TIME {
            return Err(MapError::Timestamp { index, run, dataset });
        }
    }
    Ok(())
}

fn exposure_seconds(dataset: &Dataset) -> Vec<f64> {
    (0..dataset.len()).map(|index| dataset.exposure_seconds(index)).collect()
}

/// One sentence per kind of repair.
fn repairs(repaired: &RepairedRun, when: &str) -> Vec<String> {
    let kinds = [
        (FrameVerdict::Reversed, "start and end exchanged"),
        (FrameVerdict::Replaced, "replaced by the path of their neighbours"),
        (FrameVerdict::Bridged, "lost and bridged"),
    ];
    let sentence = |(verdict, what): (FrameVerdict, &str)| {
        let frames = repaired.continuity.frames_with(verdict);
        (!frames.is_empty()).then(|| format!("{when} refinement, exposures {what}: frames {frames:?}"))
    };
    kinds.into_iter().filter_map(sentence).collect()
}
