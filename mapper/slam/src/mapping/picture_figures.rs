//! How good the pictures of a map are, where the data set knows.

use std::path::Path;

use mba_adjust::bundle::BundleAdjustment;
use mba_eval::evaluation::{DEFAULT_MAX_DT, align_poses, psnr, ssim};
use mba_io::dataset::{Dataset, read_image};
use mba_io::trajectory_file::{TimedExposure, TimedPose, read_trajectory};
use mba_map::map::Scene;
use mba_map::rendering::{Behind, RenderedView, ViewRenderer};

use super::observations::sensor;
use crate::run::{MapFigures, deblurred_path, mid_pose};

/// Name of a data set's folder of sharp images, one per frame or for some frames, named by the frame's index.
const SHARP_FOLDER: &str = "sharp";

/// Name of a data set's folder of sharp views that no frame has.
const HELD_OUT_FOLDER: &str = "heldout_views";

/// Mean of what pictures score: PSNR in dB, and a second figure.
#[derive(Default)]
struct Scores {
    sums: [f64; 2],
    count: usize,
}

impl Scores {
    fn add(&mut self, scores: [f64; 2]) {
        self.sums.iter_mut().zip(scores).for_each(|(sum, score)| *sum += score);
        self.count += 1;
    }

    /// Adds PSNR and SSIM of a picture of the same size as the truth.
    fn add_picture(&mut self, truth: &Picture, rgb: &[u8]) {
        if let (Ok(psnr), Ok(ssim)) = (psnr(&truth.rgb, rgb), ssim(truth.size, &truth.rgb, rgb)) {
            self.add([psnr, ssim]);
        }
    }

    /// Adds the PSNR over the pixels that show the map, and their share.
    fn add_mapped(&mut self, truth: &Picture, view: &RenderedView) {
        let mapped = |rgb: &[u8]| -> Vec<u8> {
            let pixels = rgb.chunks_exact(3).zip(&view.depth);
            pixels.filter(|(_, depth)| **depth > 0).flat_map(|(rgb, _)| rgb.to_vec()).collect()
        };
        if let Ok(psnr) = psnr(&mapped(&truth.rgb), &mapped(&view.rgb)) {
            self.add([psnr, view.solid]);
        }
    }

    fn means(&self) -> Option<[f64; 2]> {
        (self.count > 0).then(|| self.sums.map(|sum| sum / self.count as f64))
    }
}

struct Picture {
    size: [usize; 2],
    rgb: Vec<u8>,
}

/// The figures of merit of the pictures of a map; those without a truth are absent. `keyframes` are indices in the data set,
/// their deblurred images lie in `folder`; `exposures` are those of all frames.
#[must_use]
pub fn picture_figures<'a>(
    dataset: &Dataset,
    map: impl Into<Scene<'a>>,
    keyframes: &[usize],
    folder: &Path,
    exposures: &[TimedExposure],
) -> MapFigures {
    let read = |&index: &usize| Some((index, dataset.frame(index).ok()?.rgb));
    let captured = keyframe_scores(dataset, keyframes.iter().filter_map(read), folder);
    figures(captured, held_out_scores(dataset, map.into(), exposures))
}

/// As [`picture_figures`], with the pictures that the bundle has in memory.
pub(super) fn of_bundle(
    dataset: &Dataset,
    bundle: &BundleAdjustment,
    folder: &Path,
    exposures: &[TimedExposure],
) -> MapFigures {
    let keyframes = bundle.frames.iter().map(|frame| &frame.keyframe);
    let captured = keyframes.map(|keyframe| (keyframe.index, keyframe.observation.level(0).rgb()));
    let keyframes = keyframe_scores(dataset, captured, folder);
    figures(keyframes, held_out_scores(dataset, (&bundle.map).into(), exposures))
}

fn figures([captured, deblurred]: [Scores; 2], [held_out, mapped]: [Scores; 2]) -> MapFigures {
    let mean = |scores: &Scores, which: usize| scores.means().map(|means| means[which]);
    MapFigures {
        keyframe_psnr_captured: mean(&captured, 0),
        keyframe_psnr: mean(&deblurred, 0),
        keyframe_ssim: mean(&deblurred, 1),
        heldout_psnr: mean(&held_out, 0),
        heldout_ssim: mean(&held_out, 1),
        heldout_psnr_mapped: mean(&mapped, 0),
        heldout_mapped_share: mean(&mapped, 1),
        ..MapFigures::default()
    }
}

/// Captured and deblurred keyframes against the sharp images; keyframes come with their index and captured picture.
fn keyframe_scores(
    dataset: &Dataset,
    keyframes: impl Iterator<Item = (usize, Vec<u8>)>,
    folder: &Path,
) -> [Scores; 2] {
    let mut scores: [Scores; 2] = Default::default();
    for (index, captured) in keyframes {
        let name = format!("{index:06}.png");
        let Some(truth) = read(&dataset.folder().join(SHARP_FOLDER).join(name)) else { continue };
        let Some(deblurred) = read(&deblurred_path(folder, index)) else { continue };
        scores[0].add_picture(&truth, &captured);
        scores[1].add_picture(&truth, &deblurred.rgb);
    }
    scores
}

/// Rendered views against the held-out ones, after alignment with the true trajectory: all of them, and where they show
/// the map.
fn held_out_scores(dataset: &Dataset, map: Scene<'_>, exposures: &[TimedExposure]) -> [Scores; 2] {
    let mut scores: [Scores; 2] = Default::default();
    let folder = dataset.folder().join(HELD_OUT_FOLDER);
    let Ok(poses) = read_trajectory(&folder.join("poses.txt")) else { return scores };
    let estimate: Vec<TimedPose> = exposures.iter().map(mid_pose).collect();
    let Ok(alignment) = align_poses(dataset.ground_truth(), &estimate, DEFAULT_MAX_DT) else { return scores };
    let map_from_truth = alignment.reference_from_estimate.inverse();
    let calibration = dataset.calibration();
    let (camera, response) = (calibration.camera, calibration.response.inverse());
    let mut renderer = ViewRenderer::new(dataset.simd(), map, camera, &response, calibration.depth_scale)
        .through(sensor(dataset).falloff);
    for (index, pose) in poses.iter().enumerate() {
        let Some(truth) = read(&folder.join(format!("{index:06}.png"))) else { continue };
        let view = renderer.render(&map_from_truth.compose(&pose.world_from_camera), Behind::Surroundings);
        scores[0].add_picture(&truth, &view.rgb);
        scores[1].add_mapped(&truth, &view);
    }
    scores
}

/// An image, or none if it cannot be read: then there is no figure for it.
fn read(path: &Path) -> Option<Picture> {
    let image = read_image(path).ok()?.into_rgb8();
    let size = [image.width() as usize, image.height() as usize];
    Some(Picture { size, rgb: image.into_raw() })
}
