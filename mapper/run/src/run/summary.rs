//! `summary.json`.

use mba_eval::evaluation::{BlurFigures, MotionPlausibility, TrajectoryFigures};
use mba_io::dataset::Dataset;
use mba_io::statistics::quantile;
use serde::{Deserialize, Serialize};

use super::{FrameRecord, FrameStatus, RunCamera, Upright, stored_path};

/// Version of the summary's layout.
const FORMAT: u32 = 1;

/// What a run was started with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunSettings {
    /// Program and version, e.g. `mba 0.1.0`.
    pub program: String,
    /// The data set's folder.
    pub dataset: String,
    /// Frames per second of the data set: one over it is the time a frame may take.
    pub frame_rate: f64,
    /// Camera of the data set; absent in runs of old versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<RunCamera>,
    /// Options of the command by name.
    pub options: serde_json::Map<String, serde_json::Value>,
}

impl RunSettings {
    /// Those of a run of `program` on `dataset`, without options.
    #[must_use]
    pub fn new(program: &str, dataset: &Dataset) -> Self {
        let calibration = dataset.calibration();
        Self {
            program: program.to_owned(),
            dataset: stored_path(dataset.folder()),
            frame_rate: calibration.frame_rate,
            camera: Some(calibration.into()),
            options: serde_json::Map::new(),
        }
    }
}

/// Settings, counts and figures of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Version of this layout.
    pub format: u32,
    /// Whether the run reached the end of its input.
    pub complete: bool,
    /// What the run was started with.
    #[serde(flatten)]
    pub settings: RunSettings,
    /// Frames by status.
    pub frames: FrameCounts,
    /// Keyframes whose deblurred image lies in the folder.
    #[serde(default)]
    pub deblurred_keyframes: usize,
    /// Tracking time per frame in milliseconds, over all frames that were tried.
    pub milliseconds: Option<Spread>,
    /// Estimated blur length in pixels, over all frames that were not lost.
    pub blur_px: Option<Spread>,
    /// Figures of merit, when the data set has ground truth.
    pub trajectory: Option<TrajectoryFigures>,
    /// Figures of merit of the exposures, when the data set has ground truth for them.
    pub blur: Option<BlurFigures>,
    /// Whether the motions within exposures are possible, which needs no ground truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plausibility: Option<MotionPlausibility>,
    /// What is known of the map, when the run made one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MapFigures>,
    /// What is known of tracking and mapping at the same time, when the run did that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slam: Option<SlamFigures>,
    /// How the frames were found in the map of another run, when that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub localisation: Option<LocalisationFigures>,
    /// Present where the z axis of the world points up; the world is that of the first camera otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upright: Option<Upright>,
    /// Oddities of the input, one sentence each.
    pub warnings: Vec<String>,
}

/// Frames by status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameCounts {
    /// All frames of the input so far.
    pub total: usize,
    /// Aligned.
    pub ok: usize,
    /// Aligned with doubt.
    pub weak: usize,
    /// Not aligned, including the skipped ones.
    pub lost: usize,
    /// Not tried because an image was missing or damaged.
    pub skipped: usize,
    /// Frames that became keyframes.
    pub keyframes: usize,
}

impl FrameCounts {
    /// Share (0 to 1) of the frames that are not lost; 0 without frames.
    #[must_use]
    pub fn tracked_share(&self) -> f64 {
        (self.ok + self.weak) as f64 / self.total.max(1) as f64
    }
}

/// What making a map took and how good the map is. Images are compared as 8-bit display values, means are over
/// images; each figure of merit is absent when the data set lacks the images for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MapFigures {
    /// Gaussians in the map; 0 for a tri-plane field.
    pub gaussians: usize,
    /// Bytes of its file.
    pub map_file_bytes: u64,
    /// Iterations of the optimiser.
    pub iterations: usize,
    /// Time for making the map, seconds.
    pub seconds: f64,
    /// Most memory that the process had at a time, bytes; 0 where the system does not tell.
    pub peak_memory_bytes: u64,
    /// Loss at the end, finite.
    pub loss: f64,
    /// Keyframes that took part.
    pub keyframes: usize,
    /// Tracked frames that the map was not made of, whose captured pictures were compared with what it predicts.
    #[serde(skip_serializing_if = "is_zero")]
    pub predicted_frames: usize,
    /// Mean PSNR of these predictions against the captured pictures, dB: blur, rows and gain are predicted, too. It needs no
    /// truth. Only path and gain of such a frame are fitted to its picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_psnr: Option<f64>,
    /// PSNR of the captured keyframes against the data set's sharp images, dB.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keyframe_psnr_captured: Option<f64>,
    /// PSNR of the deblurred keyframes against the data set's sharp images, dB.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keyframe_psnr: Option<f64>,
    /// SSIM of the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keyframe_ssim: Option<f64>,
    /// PSNR of rendered views against the data set's held-out ones, dB.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heldout_psnr: Option<f64>,
    /// SSIM of the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heldout_ssim: Option<f64>,
    /// PSNR of the same over the pixels that show the map, dB: held-out views look beyond what the frames saw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heldout_psnr_mapped: Option<f64>,
    /// Share (0 to 1) of these pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heldout_mapped_share: Option<f64>,
}

/// Whether there is nothing to count.
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// How tracking and mapping at the same time went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SlamFigures {
    /// Frames of the data set over the time from the first frame to the last file, per second.
    pub frames_per_second: f64,
    /// Frames over the time until the last one was tracked and mapped, per second.
    pub live_frames_per_second: f64,
    /// ATE (RMSE after SE(3) alignment) in metres of the poses as they were tracked, before the refinement; absent
    /// without ground truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracked_ate_m: Option<f64>,
    /// Frames that were aligned with a view of the map.
    pub frames_on_map: usize,
    /// Frames that came too late for the tracker.
    pub late_frames: usize,
    /// Loops that were closed.
    pub loops: usize,
    /// Times that a lost tracker was told where it is.
    pub relocalisations: usize,
    /// Keyframes that were given up.
    pub retired_keyframes: usize,
}

/// How finding a recording in the map of another run went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct LocalisationFigures {
    /// Views of the map that a place could be recognised by.
    pub places: usize,
    /// Frames that were aligned with a view of the map; the others with one another.
    pub frames_on_map: usize,
    /// Times that the camera's place was recognised without any before it.
    pub recognised: usize,
    /// Lost frames that were found from their neighbours in the end.
    pub recovered: usize,
}

/// Where the bulk and the tail of a quantity lie.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Arithmetic mean.
    pub mean: f64,
    /// Middle value.
    pub median: f64,
    /// 95 % of the values are not larger.
    pub p95: f64,
    /// 99 % of the values are not larger.
    pub p99: f64,
    /// Largest value.
    pub max: f64,
}

impl Spread {
    /// Of the finite ones of `values`; `None` without any.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        Some(Self {
            mean: finite.iter().sum::<f64>() / finite.len().max(1) as f64,
            median: quantile(&finite, 0.5)?,
            p95: quantile(&finite, 0.95)?,
            p99: quantile(&finite, 0.99)?,
            max: quantile(&finite, 1.0)?,
        })
    }
}

impl Summary {
    /// The summary of the frames so far, without figures of merit.
    pub(super) fn of(settings: &RunSettings, frames: &[FrameRecord], skipped: usize) -> Self {
        let count = |status| frames.iter().filter(|f| f.status == status).count();
        let times: Vec<f64> = frames.iter().map(|f| f.ms).collect();
        // The blur of a lost frame is that of the one before.
        let blurs: Vec<f64> =
            frames.iter().filter(|f| f.status != FrameStatus::Lost).map(|f| f.blur_px).collect();
        Self {
            format: FORMAT,
            complete: false,
            settings: settings.clone(),
            frames: FrameCounts {
                total: frames.len(),
                ok: count(FrameStatus::Ok),
                weak: count(FrameStatus::Weak),
                lost: count(FrameStatus::Lost),
                skipped,
                keyframes: frames.iter().filter(|f| f.keyframe != 0).count(),
            },
            deblurred_keyframes: 0,
            milliseconds: Spread::of(&times),
            blur_px: Spread::of(&blurs),
            // Figures of merit come with the end of the run.
            trajectory: None,
            blur: None,
            plausibility: None,
            map: None,
            slam: None,
            localisation: None,
            upright: None,
            warnings: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_a_map_may_be_missing() {
        let figures: MapFigures = serde_json::from_str(r#"{"gaussians": 7, "keyframe_psnr": 30.5}"#).unwrap();
        assert_eq!(figures, MapFigures { gaussians: 7, keyframe_psnr: Some(30.5), ..Default::default() });
        let text = serde_json::to_string(&figures).unwrap();
        assert!(text.contains("\"loss\":0.0") && !text.contains("heldout"), "{text}");
    }
}
