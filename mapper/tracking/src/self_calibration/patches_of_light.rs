//! The light of plain patches of surface, as two frames see them in different places of the image.

use mba_tracker::geometry::PinholeCamera;
use mba_tracker::photometric::InverseResponse;
use nalgebra::Vector3;

use super::window::Tracked;
use mba_io::dataset::RgbdFrame;

/// Pixels along a side of a patch: a fast hand moves the rows of a frame by about as much.
const SIDE: usize = 8;

/// Largest deviation of light within a patch, as a share of its mean: what has no texture is the same light wherever exactly
/// it is cut out.
const PLAIN: f32 = 0.15;

/// Least light of a patch: below, the noise of a sensor is a large part of it.
const DARK: f32 = 0.02;

/// Bytes that are not taken for light, being too near to both ends, and the share of a patch that may have them.
const TRUSTED: std::ops::RangeInclusive<u8> = 8..=245;
const MAX_CLIPPED: f32 = 0.02;

/// Largest spread of depth within a patch, and largest difference between two views of one, as a share of depth.
const SAME_SURFACE: f32 = 0.05;

/// Least distance from a camera, metres.
const NEAREST: f64 = 0.1;

/// The patches of a frame, row by row.
pub(super) struct Patches {
    columns: usize,
    rows: usize,
    /// Mean linear light; 0 where it is not to be trusted.
    light: Vec<f32>,
    /// Metres; 0 where there is no single surface.
    depth: Vec<f32>,
    is_plain: Vec<bool>,
}

/// One patch of surface in two frames.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shared {
    /// Logarithm of the light in the first frame over that in the second.
    pub(super) log_ratio: f64,
    /// Pixels of its middle in the first and in the second frame.
    pub(super) pixels: [[f64; 2]; 2],
}

impl Patches {
    /// Divides a frame; `depth_scale` is raw units per metre.
    pub(super) fn of(frame: &RgbdFrame, response: &InverseResponse, depth_scale: f64) -> Self {
        let (columns, rows) = (frame.width / SIDE, frame.height / SIDE);
        let mut patches = Self {
            columns,
            rows,
            light: Vec::with_capacity(columns * rows),
            depth: Vec::with_capacity(columns * rows),
            is_plain: Vec::with_capacity(columns * rows),
        };
        for patch in 0..columns * rows {
            let corner = patch / columns * SIDE * frame.width + patch % columns * SIDE;
            let pixels = (0..SIDE * SIDE).map(|k| corner + k / SIDE * frame.width + k % SIDE);
            let (light, is_plain) = light_of(frame, response, pixels.clone());
            patches.light.push(light);
            patches.is_plain.push(is_plain);
            patches.depth.push(depth_of(frame, pixels, depth_scale));
        }
        patches
    }

    /// Pixel in the middle of a patch.
    fn middle(&self, patch: usize) -> [f64; 2] {
        let at = |place: usize| (place * SIDE) as f64 + 0.5 * (SIDE as f64 - 1.0);
        [at(patch % self.columns), at(patch / self.columns)]
    }

    /// Light and depth around a pixel, between the four patches next to it; none if one of them is not to be trusted.
    fn sample(&self, [u, v]: [f64; 2]) -> Option<[f32; 2]> {
        let place = |pixel: f64| (pixel - 0.5 * (SIDE as f64 - 1.0)) / SIDE as f64;
        let (x, y) = (place(u), place(v));
        let is_inside = |place: f64, count: usize| place >= 0.0 && place < count as f64 - 1.0;
        if !(is_inside(x, self.columns) && is_inside(y, self.rows)) {
            return None;
        }
        let (across, down) = (x.fract() as f32, y.fract() as f32);
        let first = y as usize * self.columns + x as usize;
        let corners = [first, first + 1, first + self.columns, first + self.columns + 1];
        let weights =
            [(1.0 - across) * (1.0 - down), across * (1.0 - down), (1.0 - across) * down, across * down];
        let mean = |values: &[f32]| {
            let is_known = corners.iter().all(|&corner| values[corner] > 0.0);
            is_known
                .then(|| corners.iter().zip(weights).map(|(&corner, weight)| values[corner] * weight).sum())
        };
        Some([mean(&self.light)?, mean(&self.depth)?])
    }

    /// The plain patches of this frame that are seen in another frame, too. `frames` are the poses of both.
    pub(super) fn shared_with(
        &self,
        other: &Self,
        frames: [&Tracked; 2],
        camera: &PinholeCamera,
    ) -> Vec<Shared> {
        let [own, its] = frames.map(|frame| &frame.world_from_mid);
        let other_from_own = its.inverse().compose(own);
        let shared = |patch: usize| {
            let (light, depth) = (self.light[patch], self.depth[patch]);
            if !(self.is_plain[patch] && light > DARK && depth > 0.0) {
                return None;
            }
            // The middle of the patch, put into space by its depth and seen from the other frame.
            let [u, v] = self.middle(patch);
            let point: Vector3<f64> = other_from_own.transform_point(&(camera.ray(u, v) * f64::from(depth)));
            if point.z < NEAREST {
                return None;
            }
            let seen = camera.project(&point);
            let [other_light, other_depth] = other.sample([seen.x, seen.y])?;
            // Something else is in front of it there, or it is in front of what was there.
            let is_hidden = (other_depth - point.z as f32).abs() > SAME_SURFACE * other_depth;
            (!is_hidden && other_light > DARK).then(|| Shared {
                log_ratio: f64::from(light).ln() - f64::from(other_light).ln(),
                pixels: [[u, v], [seen.x, seen.y]],
            })
        };
        (0..self.light.len()).filter_map(shared).collect()
    }
}

/// Mean light of some pixels, 0 if too many are clipped, and whether they are alike.
fn light_of(
    frame: &RgbdFrame,
    response: &InverseResponse,
    pixels: impl Iterator<Item = usize>,
) -> (f32, bool) {
    let (mut sum, mut squares, mut clipped, mut count) = (0.0, 0.0, 0.0, 0.0);
    for pixel in pixels {
        let bytes = &frame.rgb[3 * pixel..3 * pixel + 3];
        let light = bytes.iter().map(|&byte| response.linear_light(byte)).sum::<f32>() / 3.0;
        let is_trusted = bytes.iter().all(|byte| TRUSTED.contains(byte));
        sum += light;
        squares += light * light;
        clipped += f32::from(u8::from(!is_trusted));
        count += 1.0;
    }
    let mean = sum / count;
    let variance = (squares / count - mean * mean).max(0.0);
    let light = if clipped > MAX_CLIPPED * count { 0.0 } else { mean };
    (light, variance.sqrt() < PLAIN * mean)
}

/// Middle depth of some pixels in metres; 0 unless all were measured on one surface.
fn depth_of(frame: &RgbdFrame, pixels: impl Iterator<Item = usize>, depth_scale: f64) -> f32 {
    let mut depths: Vec<u16> = pixels.map(|pixel| frame.depth[pixel]).collect();
    depths.sort_unstable();
    let [nearest, .., farthest] = depths[..] else { return 0.0 };
    let middle = depths[depths.len() / 2];
    let is_one = nearest > 0 && f32::from(farthest - nearest) < SAME_SURFACE * f32::from(middle);
    if is_one { (f64::from(middle) / depth_scale) as f32 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use mba_tracker::geometry::RigidTransform;
    use mba_tracker::trajectory::ExposureTrajectory;
    use nalgebra::Vector6;

    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 };

    fn frame(byte: u8, raw_depth: u16) -> RgbdFrame {
        RgbdFrame {
            index: 0,
            timestamp: 0.0,
            depth_timestamp: 0.0,
            exposure_seconds: 0.01,
            width: 64,
            height: 48,
            rgb: vec![byte; 3 * 64 * 48],
            depth: vec![raw_depth; 64 * 48],
        }
    }

    fn tracked(pose: RigidTransform) -> Tracked {
        Tracked {
            index: 0,
            timestamp: 0.0,
            is_found: true,
            world_from_mid: pose,
            world_from_camera: ExposureTrajectory::still(pose),
            reference: 0,
            gain: 1.0,
            residual: 1.0,
        }
    }

    #[test]
    fn a_wall_is_seen_at_other_pixels_after_a_step_aside() {
        let response = InverseResponse::linear();
        let [first, second] = [200, 100].map(|byte| Patches::of(&frame(byte, 2000), &response, 1000.0));
        // 0.4 m to the right at 2 m: what was in the middle lies 12 pixels to the left.
        let moved = RigidTransform::identity().perturbed(&Vector6::new(0.4, 0.0, 0.0, 0.0, 0.0, 0.0));
        let poses = [tracked(RigidTransform::identity()), tracked(moved)];
        let shared = first.shared_with(&second, [&poses[0], &poses[1]], &CAMERA);
        assert!(shared.len() > 20, "{}", shared.len());
        for Shared { log_ratio, pixels: [[u, v], [other_u, other_v]] } in shared {
            assert!((log_ratio - 2f64.ln()).abs() < 1e-6);
            assert!((other_u - (u - 12.0)).abs() < 1e-9 && (other_v - v).abs() < 1e-9);
        }
    }

    #[test]
    fn what_is_clipped_textured_or_without_depth_is_left_out() {
        let response = InverseResponse::linear();
        let poses = [tracked(RigidTransform::identity()), tracked(RigidTransform::identity())];
        let count = |frame: &RgbdFrame| {
            let patches = Patches::of(frame, &response, 1000.0);
            patches.shared_with(&patches, [&poses[0], &poses[1]], &CAMERA).len()
        };
        let plain = frame(100, 2000);
        assert!(count(&plain) > 20);
        assert_eq!(count(&frame(250, 2000)), 0, "clipped");
        assert_eq!(count(&frame(100, 0)), 0, "without depth");
        let mut textured = plain.clone();
        textured
            .rgb
            .iter_mut()
            .enumerate()
            .for_each(|(k, byte)| *byte = if k / 3 % 2 == 0 { 60 } else { 140 });
        assert_eq!(count(&textured), 0);
        let mut stepped = plain;
        stepped.depth.iter_mut().enumerate().for_each(|(k, raw)| *raw += 300 * (k % 2) as u16);
        assert_eq!(count(&stepped), 0, "two surfaces");
    }
}
