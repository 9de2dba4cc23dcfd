//! Deblurring one colour image with the motion that was estimated for it.

use mba_io::dataset::{FrameReadError, RgbdFrame};
use mba_io::trajectory_file::TimedExposure;
use mba_tracker::deblur::DeblurScratch;
use mba_tracker::geometry::PinholeCamera;
use mba_tracker::image::{DepthView, ExtentError, PixelRectangle};
use mba_tracker::keyframe::RectifyScratch;
use mba_tracker::photometric::InverseResponse;
use mba_tracker::surface::{InverseDepthMap, SurfacePlanes};
use mba_tracker::trajectory::{BowedTrajectory, ExposureTrajectory, FrameTiming};
use mba_tracker::transfer::MAX_VIRTUAL_VIEWS;
use mba_tracker::workspace::{ARENA_ALIGNMENT, Arena, WorkspaceError, slice_bytes};
use mba_tracker::{Readout, SimdLevel, TrackerConfig};

use mba_raster::sensor::ForwardResponse;

/// Longest motion within an image, pixels, that is worth deblurring: below, rounding to bytes and noise hide it;
/// above, the virtual views lie too far apart to describe it.
const BLUR_RANGE: std::ops::RangeInclusive<f32> = 0.5..=2.0 * MAX_VIRTUAL_VIEWS as f32;

/// Richardson-Lucy iterations. One for each pixel of the longest path: a longer blur needs more to become sharp, and
/// each amplifies noise and what is wrong with the path, until edges ring.
const ITERATIONS: std::ops::RangeInclusive<usize> = 2..=10;

/// Inverse depth, 1/m, of an image without any depth.
const FALLBACK_INVERSE_DEPTH: f32 = 0.5;

/// Why an image cannot be deblurred.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeblurError {
    /// The frame cannot be read.
    #[error(transparent)]
    Unreadable(#[from] FrameReadError),
    /// The frame does not have the size of the camera's images.
    #[error("the image has {} x {} pixels, the camera {} x {}", .found.0, .found.1, .expected.0, .expected.1)]
    Size {
        /// Columns and rows of the frame.
        found: (usize, usize),
        /// Columns and rows of the camera.
        expected: (usize, usize),
    },
    /// One of the frame's buffers is shorter than its size asks for.
    #[error(transparent)]
    Buffer(#[from] ExtentError),
    /// The memory is that of a deblurrer for smaller images.
    #[error(transparent)]
    Memory(#[from] WorkspaceError),
}

/// A colour image after deblurring.
#[derive(Clone, Debug, PartialEq)]
pub struct Deblurred {
    /// Red, green, blue of each pixel, encoded as the camera does, row-major, `3 * width * height` values.
    pub rgb: Vec<u8>,
    /// Whether the image was sharpened; else it is the captured one, because there was nothing to do or because the
    /// sharper image, blurred again, explained the captured one no better.
    pub sharpened: bool,
}

/// Deblurs the colour images of one camera. It can be shared by threads; each needs a [`DeblurMemory`] of its own.
#[derive(Clone, Debug)]
pub struct KeyframeDeblurrer {
    pub(super) camera: PinholeCamera,
    metres_per_unit: f32,
    pub(super) surface_level: usize,
    region: PixelRectangle,
    inverse: InverseResponse,
    forward: ForwardResponse,
    pub(super) readout: Readout,
    pub(super) simd: SimdLevel,
}

/// Memory for deblurring images of one size, one after the other.
#[derive(Clone, Debug)]
pub struct DeblurMemory(pub(super) Vec<u8>);

impl KeyframeDeblurrer {
    /// A deblurrer with the camera, its response and the depth maps of a tracker; `simd` is the instruction
    /// set to run on.
    #[must_use]
    pub fn new(config: &TrackerConfig, simd: SimdLevel) -> Self {
        Self {
            camera: config.camera,
            metres_per_unit: config.metres_per_unit,
            surface_level: config.surface_level,
            region: config.region,
            inverse: config.response.clone(),
            forward: ForwardResponse::new(&config.response),
            readout: config.readout,
            simd,
        }
    }

    /// Memory for [`Self::deblur`].
    #[must_use]
    pub fn memory(&self) -> DeblurMemory {
        let PinholeCamera { width, height, .. } = self.camera;
        let surface = slice_bytes::<f32>((width >> self.surface_level) * (height >> self.surface_level));
        let light = slice_bytes::<f32>(width * height);
        let rectify = RectifyScratch::bytes(width, height, self.surface_level, self.rolls(), self.rolls());
        let deblur = DeblurScratch::bytes(width, height);
        DeblurMemory(vec![0; ARENA_ALIGNMENT + deblur + rectify + 4 * surface + light])
    }

    /// Whether the rows of colour images have times of their own.
    pub(super) fn rolls(&self) -> bool {
        self.readout.colour_rolls()
    }

    /// Deblurs the colours of `frame`, whose camera moved through the poses of `exposure` (`reference_from_camera` in any
    /// reference frame, metres) while the shutter was open. The sharp image is what the camera sees at mid exposure, all
    /// rows at the same time.
    ///
    /// Each colour is linearised and deblurred by Richardson-Lucy iterations along the path that its own depth map
    /// gives every pixel (the image formation of MBA-SLAM eq. 5, inverted).
    ///
    /// # Errors
    /// [`DeblurError::Size`], [`DeblurError::Buffer`] or [`DeblurError::Memory`].
    pub fn deblur(
        &self,
        frame: &RgbdFrame,
        exposure: &TimedExposure,
        memory: &mut DeblurMemory,
    ) -> Result<Deblurred, DeblurError> {
        self.check(frame)?;
        let (width, height) = (frame.width, frame.height);
        let mut arena = Arena::new(&mut memory.0);
        let mut scratch = DeblurScratch::carve(&mut arena, width, height)?;
        let light = arena.take::<f32>(width * height)?;
        let mut rectify =
            RectifyScratch::carve(&mut arena, &self.camera, self.surface_level, self.rolls(), self.rolls())?;
        let path = FramePath::new(frame, exposure, &self.readout);
        let surface = self.surface(frame, &path, &mut rectify, &mut arena)?;
        let longest = self.fill_flow(&path, &surface, &mut scratch);
        let captured = || Deblurred { rgb: frame.rgb.clone(), sharpened: false };
        if !BLUR_RANGE.contains(&longest) && !self.rolls() {
            return Ok(captured());
        }
        let iterations = (longest.round() as usize).clamp(*ITERATIONS.start(), *ITERATIONS.end());
        let mut rgb = frame.rgb.clone();
        for channel in 0..3 {
            self.linearise(&frame.rgb, channel, light);
            rectify.capture(light, surface.map.values);
            if BLUR_RANGE.contains(&longest) {
                scratch.capture(light);
                // Blur lies along the motion of each row, so rows are given one time afterwards.
                let sharp = if self.rolls() { rectify.image() } else { &mut *light };
                if !scratch.deblur(self.simd, longest, iterations, sharp).kept && !self.rolls() {
                    // One blurred colour among sharp ones would show as coloured edges.
                    return Ok(captured());
                }
            }
            rectify.rectify_image(
                self.simd,
                &path.reference_from_camera,
                &path.timing,
                &self.camera,
                light,
                &surface.map,
            );
            self.develop(light, channel, &mut rgb);
        }
        Ok(Deblurred { rgb, sharpened: true })
    }

    pub(super) fn check(&self, frame: &RgbdFrame) -> Result<(), DeblurError> {
        let (found, expected) = ((frame.width, frame.height), (self.camera.width, self.camera.height));
        if found != expected {
            return Err(DeblurError::Size { found, expected });
        }
        let needed = 3 * frame.width * frame.height;
        if frame.rgb.len() < needed {
            return Err(ExtentError { needed, got: frame.rgb.len() }.into());
        }
        Ok(())
    }

    /// Depth and planes as seen at mid exposure.
    pub(super) fn surface<'m>(
        &self,
        frame: &RgbdFrame,
        path: &FramePath,
        rectify: &mut RectifyScratch<'m>,
        arena: &mut Arena<'m>,
    ) -> Result<Surface<'m>, DeblurError> {
        let raw = DepthView::new(&frame.depth, frame.width, frame.height, frame.width)?;
        let mut map = InverseDepthMap::carve(arena, &self.camera, self.surface_level)?;
        let mut planes = SurfacePlanes::carve(arena, &self.camera, self.surface_level)?;
        map.fill(self.simd, &raw, self.metres_per_unit);
        if self.rolls() {
            let depth_time = 0.5 + path.timing.depth_time;
            let camera_then = path.reference_from_camera.at(depth_time);
            rectify.move_depth(self.simd, &camera_then, &self.camera, &mut map);
        }
        planes.fit(self.simd, &map);
        Ok(Surface { map, planes })
    }

    /// Computes the path of every block of the image; returns the longest in pixels.
    pub(super) fn fill_flow(&self, path: &FramePath, surface: &Surface, scratch: &mut DeblurScratch) -> f32 {
        let typical = median_measured(surface.map.values);
        scratch.flow.fill(
            &path.reference_from_camera,
            &path.timing,
            &self.camera,
            &surface.planes,
            self.surface_level,
            typical,
        )
    }

    /// Linear light of one colour. Where undistortion left no data, the nearest data is continued: its black border
    /// would be taken for an edge.
    pub(super) fn linearise(&self, rgb: &[u8], channel: usize, light: &mut [f32]) {
        let PixelRectangle { left, top, right, bottom } = self.region;
        let (last_u, last_v) = (right.saturating_sub(1).max(left), bottom.saturating_sub(1).max(top));
        let width = self.camera.width;
        for (v, row) in light.chunks_exact_mut(width).enumerate() {
            let source = v.clamp(top, last_v) * width;
            for (u, light) in row.iter_mut().enumerate() {
                let byte = rgb.get(3 * (source + u.clamp(left, last_u)) + channel);
                *light = byte.map_or(0.0, |byte| self.inverse.linear_light(*byte));
            }
        }
    }

    /// Encodes one colour where there is data.
    pub(super) fn develop(&self, light: &[f32], channel: usize, rgb: &mut [u8]) {
        let PixelRectangle { left, top, right, bottom } = self.region;
        for v in top..bottom.min(self.camera.height) {
            for index in (left..right.min(self.camera.width)).map(|u| v * self.camera.width + u) {
                rgb[3 * index + channel] = self.forward.encode(light[index]);
            }
        }
    }
}

/// Depth and planes of an image.
pub(super) struct Surface<'m> {
    pub(super) map: InverseDepthMap<'m>,
    planes: SurfacePlanes<'m>,
}

/// How a frame moved, seen from its own mid pose; s = 0 and 1 are opening and closing of the middle row.
pub(super) struct FramePath {
    pub(super) reference_from_camera: BowedTrajectory,
    pub(super) timing: FrameTiming,
}

impl FramePath {
    pub(super) fn new(frame: &RgbdFrame, exposure: &TimedExposure, readout: &Readout) -> Self {
        let span = frame.exposure_seconds;
        if !readout.colour_rolls() || span <= 0.0 {
            let linear = ExposureTrajectory { start: exposure.start, end: exposure.end };
            let seen_from_mid = linear.seen_from(&linear.mid().inverse());
            let reference_from_camera = BowedTrajectory::without_bow(seen_from_mid);
            return Self { reference_from_camera, timing: FrameTiming::GLOBAL };
        }
        let path = BowedTrajectory::through(&exposure.start, &exposure.mid, &exposure.end);
        // Times in units of the exposure, of which the path is the unit.
        let timing = FrameTiming {
            exposure: 1.0,
            readout: readout.colour / span,
            bands: readout.bands,
            depth_time: (frame.depth_timestamp - frame.timestamp) / span,
            depth_readout: readout.depth / span,
        };
        Self { reference_from_camera: path.seen_from(&exposure.mid.inverse()), timing }
    }
}

/// Median of the inverse depths that are not missing.
fn median_measured(values: &[f32]) -> f32 {
    let mut measured: Vec<f32> = values.iter().copied().filter(|rho| *rho > 0.0).collect();
    if measured.is_empty() {
        return FALLBACK_INVERSE_DEPTH;
    }
    let middle = measured.len() / 2;
    *measured.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use mba_eval::evaluation::psnr;
    use mba_synth::{SynthConfig, SynthSequence};

    pub(in crate::deblurring) fn timed(path: &ExposureTrajectory) -> TimedExposure {
        TimedExposure { timestamp: 0.0, start: path.start, mid: path.mid(), end: path.end }
    }

    pub(in crate::deblurring) fn sequence() -> SynthSequence {
        let config =
            SynthConfig { frames: 3, width: 160, height: 120, mean_blur_px: 4.0, ..SynthConfig::default() };
        SynthSequence::new(config).unwrap()
    }

    pub(in crate::deblurring) fn deblurrer(sequence: &SynthSequence) -> KeyframeDeblurrer {
        let config = TrackerConfig::new(sequence.camera(), 1.0 / 5000.0, InverseResponse::srgb());
        KeyframeDeblurrer::new(&config, SimdLevel::new())
    }

    #[test]
    fn the_true_motion_brings_the_image_nearer_to_the_truth() {
        let sequence = sequence();
        let deblurrer = deblurrer(&sequence);
        let mut memory = deblurrer.memory();
        for index in 0..sequence.len() {
            let frame = sequence.render_frame(index).into_captured(0);
            let deblurred = deblurrer.deblur(&frame, &timed(&sequence.exposure(index)), &mut memory).unwrap();
            let truth = sequence.render_sharp(index);
            let [before, after] = [&frame.rgb, &deblurred.rgb].map(|image| psnr(&truth, image).unwrap());
            assert!(
                deblurred.sharpened && after > before + 0.4,
                "frame {index}: {before} dB, then {after} dB"
            );
        }
    }

    #[test]
    fn pixels_without_data_stay_black_and_cast_no_rings() {
        let sequence = sequence();
        let mut frame = sequence.render_frame(0).into_captured(0);
        let grey = frame.rgb.iter_mut().enumerate();
        grey.for_each(|(k, byte)| *byte = if k / 3 % 160 < 10 { 0 } else { 150 });
        let region = PixelRectangle { left: 10, top: 0, right: 160, bottom: 120 };
        let deblurrer = KeyframeDeblurrer { region, ..deblurrer(&sequence) };
        let deblurred =
            deblurrer.deblur(&frame, &timed(&sequence.exposure(0)), &mut deblurrer.memory()).unwrap();
        assert_eq!(deblurred.rgb, frame.rgb);
    }

    #[test]
    fn without_motion_the_image_stays_as_it_is() {
        let sequence = sequence();
        let deblurrer = deblurrer(&sequence);
        let frame = sequence.render_frame(0).into_captured(0);
        let still = ExposureTrajectory::still(sequence.exposure(0).mid());
        let deblurred = deblurrer.deblur(&frame, &timed(&still), &mut deblurrer.memory()).unwrap();
        assert_eq!(deblurred, Deblurred { rgb: frame.rgb, sharpened: false });
    }

    #[test]
    fn buffers_that_do_not_fit_are_refused() {
        let sequence = sequence();
        let deblurrer = deblurrer(&sequence);
        let still = ExposureTrajectory::still(sequence.exposure(0).mid());
        let refused =
            |frame: &RgbdFrame| deblurrer.deblur(frame, &timed(&still), &mut deblurrer.memory()).unwrap_err();
        let good = sequence.render_frame(0).into_captured(0);
        let narrow = RgbdFrame { width: 159, ..good.clone() };
        assert!(matches!(refused(&narrow), DeblurError::Size { found: (159, 120), expected: (160, 120) }));
        let cut = RgbdFrame { rgb: good.rgb[1..].to_vec(), ..good.clone() };
        assert!(matches!(refused(&cut), DeblurError::Buffer(_)));
        let shallow = RgbdFrame { depth: good.depth[1..].to_vec(), ..good };
        assert!(matches!(refused(&shallow), DeblurError::Buffer(_)));
    }
}
