//! How good the pictures of a map are, where the data set knows.

use std::path::Path;

use image::ImageReader;

use crate::bundle::BundleAdjustment;
use crate::dataset::Dataset;
use crate::evaluation::{DEFAULT_MAX_DT, align_poses, psnr, ssim};
use crate::rendering::{Behind, ViewRenderer};
use crate::run::{MapFigures, deblurred_path, mid_pose};
use crate::trajectory_file::{TimedExposure, TimedPose, read_trajectory};

/// Name of a data set's folder of sharp images, one per frame or for some frames, named by the frame's index.
const SHARP_FOLDER: &str = "sharp";

/// Name of a data set's folder of sharp views that no frame has.
const HELD_OUT_FOLDER: &str = "heldout_views";

/// Mean of what pictures score.
#[derive(Default)]
struct Scores {
    psnr: f64,
    ssim: f64,
    count: usize,
}

impl Scores {
    fn add(&mut self, truth: &Picture, rgb: &[u8]) {
        if let (Ok(psnr), Ok(ssim)) = (psnr(&truth.rgb, rgb), ssim(truth.size, &truth.rgb, rgb)) {
            self.psnr += psnr;
            self.ssim += ssim;
            self.count += 1;
        }
    }

    fn means(&self) -> Option<[f64; 2]> {
        (self.count > 0).then(|| [self.psnr, self.ssim].map(|sum| sum / self.count as f64))
    }
}

struct Picture {
    size: [usize; 2],
    rgb: Vec<u8>,
}

/// The figures of merit of the pictures; those without a truth are absent. The deblurred keyframes lie in `folder`.
pub(super) fn image_figures(
    dataset: &Dataset,
    bundle: &BundleAdjustment,
    folder: &Path,
    exposures: &[TimedExposure],
) -> MapFigures {
    let [captured, deblurred] = keyframe_scores(dataset, bundle, folder);
    let held_out = held_out_scores(dataset, bundle, exposures);
    let mean = |scores: &Scores, which: usize| scores.means().map(|means| means[which]);
    MapFigures {
        keyframe_psnr_captured: mean(&captured, 0),
        keyframe_psnr: mean(&deblurred, 0),
        keyframe_ssim: mean(&deblurred, 1),
        heldout_psnr: mean(&held_out, 0),
        heldout_ssim: mean(&held_out, 1),
        ..MapFigures::default()
    }
}

/// Captured and deblurred keyframes against the sharp images.
fn keyframe_scores(dataset: &Dataset, bundle: &BundleAdjustment, folder: &Path) -> [Scores; 2] {
    let mut scores: [Scores; 2] = Default::default();
    for keyframe in bundle.keyframes() {
        let name = format!("{:06}.png", keyframe.index);
        let Some(truth) = read(&dataset.folder().join(SHARP_FOLDER).join(name)) else { continue };
        let Some(deblurred) = read(&deblurred_path(folder, keyframe.index)) else { continue };
        scores[0].add(&truth, &interleaved(&keyframe.observation.level(0).colour));
        scores[1].add(&truth, &deblurred.rgb);
    }
    scores
}

/// Rendered views against the held-out ones, after alignment with the true trajectory.
fn held_out_scores(dataset: &Dataset, bundle: &BundleAdjustment, exposures: &[TimedExposure]) -> Scores {
    let mut scores = Scores::default();
    let folder = dataset.folder().join(HELD_OUT_FOLDER);
    let Ok(poses) = read_trajectory(&folder.join("poses.txt")) else { return scores };
    let estimate: Vec<TimedPose> = exposures.iter().map(mid_pose).collect();
    let Ok(alignment) = align_poses(dataset.ground_truth(), &estimate, DEFAULT_MAX_DT) else { return scores };
    let map_from_truth = alignment.reference_from_estimate.inverse();
    let calibration = dataset.calibration();
    let (camera, response) = (calibration.camera, calibration.response.inverse());
    let mut renderer = ViewRenderer::new(&bundle.state.gaussians, camera, &response, calibration.depth_scale);
    for (index, pose) in poses.iter().enumerate() {
        let Some(truth) = read(&folder.join(format!("{index:06}.png"))) else { continue };
        let view = renderer.render(&map_from_truth.compose(&pose.world_from_camera), Behind::Surroundings);
        scores.add(&truth, &view.rgb);
    }
    scores
}

/// An image, or none if it cannot be read: then there is no figure for it.
fn read(path: &Path) -> Option<Picture> {
    let image = ImageReader::open(path).ok()?.decode().ok()?.into_rgb8();
    let size = [image.width() as usize, image.height() as usize];
    Some(Picture { size, rgb: image.into_raw() })
}

fn interleaved([red, green, blue]: &[Vec<u8>; 3]) -> Vec<u8> {
    red.iter().zip(green).zip(blue).flat_map(|((red, green), blue)| [*red, *green, *blue]).collect()
}
