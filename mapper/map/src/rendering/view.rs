//! One view: colours as the camera would have stored them, and depth.

use std::path::Path;
use std::sync::Arc;

use mba_tracker::SimdLevel;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::photometric::InverseResponse;

use mba_io::FileError;
use mba_io::png::{encode_depth, encode_rgb};
use mba_io::whole_file::write_together;
use mba_raster::raster::RasterImage;
use mba_raster::sensor::ForwardResponse;
use rayon::prelude::*;

use crate::infill;
use crate::map::{Scene, SceneRenderer};

/// Above this alpha a pixel shows the map, below it mostly what is behind: nothing, and no depth.
pub const SOLID_ALPHA: f32 = 0.5;

/// Renders views of one map with one camera; memory is kept from view to view.
#[derive(Debug)]
pub struct ViewRenderer<'a> {
    map: Scene<'a>,
    camera: PinholeCamera,
    depth_scale: f32,
    response: ForwardResponse,
    falloff: Option<Arc<[f32]>>,
    inverse: InverseResponse,
    renderer: SceneRenderer,
}

/// What is seen where the map is transparent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Behind<'a> {
    /// Nothing.
    Black,
    /// The colours of the surroundings, where the map is not solid.
    Surroundings,
    /// The frame that was captured from there.
    Captured {
        /// Red, green and blue as stored, one plane each, as large as the view.
        colour: &'a [Vec<u8>; 3],
        /// Gain on the map's light that makes it as bright as the frame.
        gain: f32,
    },
}

/// A rendered view in the form of files.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedView {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Red, green, blue of each pixel, row-major.
    pub rgb: Vec<u8>,
    /// Depth along the optical axis in raw units, row-major; 0 where the map is not solid or the depth does not fit.
    pub depth: Vec<u16>,
    /// Share (0 to 1) of the pixels with an alpha above [`SOLID_ALPHA`].
    pub solid: f64,
}

impl<'a> ViewRenderer<'a> {
    /// Renders `map` as `camera` with that response sees it, with the instructions `simd`; depth gets `depth_scale` units per
    /// metre.
    #[must_use]
    pub fn new(
        simd: SimdLevel,
        map: impl Into<Scene<'a>>,
        camera: PinholeCamera,
        response: &InverseResponse,
        depth_scale: f64,
    ) -> Self {
        Self {
            map: map.into(),
            camera,
            depth_scale: depth_scale as f32,
            response: ForwardResponse::new(response),
            inverse: response.clone(),
            falloff: None,
            renderer: SceneRenderer::new(simd),
        }
    }

    /// The same through a lens that lets this share of light through to each pixel, row by row; none for all of it
    /// everywhere.
    #[must_use]
    pub fn through(self, falloff: Option<Arc<[f32]>>) -> Self {
        Self { falloff, ..self }
    }

    /// The view from a pose. It does not depend on the number of threads.
    #[must_use]
    pub fn render(&mut self, world_from_camera: &RigidTransform, behind: Behind<'_>) -> RenderedView {
        self.renderer.render(self.map, self.camera, world_from_camera);
        let image = &mut self.renderer.image;
        match behind {
            Behind::Black => dim(image, self.falloff.as_deref()),
            Behind::Surroundings => {
                fill_holes(image);
                dim(image, self.falloff.as_deref());
            }
            Behind::Captured { colour, gain } => {
                // A captured image is dimmed already.
                dim(image, self.falloff.as_deref());
                put_in_front(image, &self.inverse, colour, gain);
            }
        }
        let RasterImage { width, height, colour: [red, green, blue], depth, alpha } = &self.renderer.image;
        let colours = red.iter().zip(green).zip(blue).map(|((red, green), blue)| [*red, *green, *blue]);
        let solid = alpha.iter().filter(|alpha| **alpha > SOLID_ALPHA).count();
        RenderedView {
            size: [*width, *height],
            rgb: colours.flatten().map(|light| self.response.encode(light)).collect(),
            depth: depth.iter().zip(alpha).map(|(depth, alpha)| self.raw_depth(*depth, *alpha)).collect(),
            solid: solid as f64 / alpha.len().max(1) as f64,
        }
    }

    /// The stored value for the weighted sum of depths `depth`, metres.
    fn raw_depth(&self, depth: f32, alpha: f32) -> u16 {
        let raw = (depth / alpha * self.depth_scale).round();
        if alpha > SOLID_ALPHA && raw <= f32::from(u16::MAX) { raw as u16 } else { 0 }
    }
}

/// How much of what is behind is seen. A map is fitted in front of black, so its light is whole wherever it is solid.
fn share_behind(alpha: f32) -> f32 {
    (1.0 - alpha / SOLID_ALPHA).max(0.0)
}

/// Takes the light that the lens keeps away.
fn dim(image: &mut RasterImage, falloff: Option<&[f32]>) {
    let Some(falloff) = falloff else { return };
    for plane in &mut image.colour {
        plane.iter_mut().zip(falloff).for_each(|(light, share)| *light *= share);
    }
}

/// Multiplies the light by `gain` and puts it in front of a captured image; nothing happens for one of another size.
fn put_in_front(image: &mut RasterImage, inverse: &InverseResponse, captured: &[Vec<u8>; 3], gain: f32) {
    for (plane, captured) in image.colour.iter_mut().zip(captured) {
        for ((light, alpha), byte) in plane.iter_mut().zip(&image.alpha).zip(captured) {
            *light = gain * *light + share_behind(*alpha) * inverse.linear_light(*byte);
        }
    }
}

/// Completes the colours where the map is not solid from where it is.
fn fill_holes(image: &mut RasterImage) {
    let RasterImage { width, colour, alpha, .. } = image;
    let known: Vec<f32> = alpha.iter().map(|alpha| if *alpha > SOLID_ALPHA { 1.0 } else { 0.0 }).collect();
    colour.par_iter_mut().for_each(|plane| {
        let mut behind = plane.clone();
        infill::fill(*width, &mut behind, &known);
        for ((light, alpha), behind) in plane.iter_mut().zip(&*alpha).zip(behind) {
            *light += share_behind(*alpha) * behind;
        }
    });
}

impl RenderedView {
    /// Writes both images as PNG; none is replaced before both are on the disk.
    ///
    /// # Errors
    /// [`FileError::Unwritable`].
    pub fn write(&self, colour_path: &Path, depth_path: &Path) -> Result<(), FileError> {
        let unwritable = |path: &Path| {
            let path = path.to_owned();
            move |reason| FileError::Unwritable { path, reason }
        };
        write_together(&[
            (colour_path.to_owned(), encode_rgb(self.size, &self.rgb).map_err(unwritable(colour_path))?),
            (depth_path.to_owned(), encode_depth(self.size, &self.depth).map_err(unwritable(depth_path))?),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mba_raster::gaussians::{Gaussian, Gaussians};

    /// A grey ball of 10 cm, three metres in front of the camera, that hides half of what is behind its centre.
    fn render(opacity_logit: f32, distance: f32, depth_scale: f64) -> RenderedView {
        let ball = Gaussian {
            mean: [0.0, 0.0, distance],
            log_scale: [0.1_f32.ln(); 3],
            rotation: [1.0, 0.0, 0.0, 0.0],
            opacity_logit,
            colour: [0.5; 3],
        };
        let map: Gaussians = [ball].into_iter().collect();
        let camera = PinholeCamera { width: 33, height: 25, fx: 100.0, fy: 100.0, cx: 16.0, cy: 12.0 };
        let mut renderer =
            ViewRenderer::new(SimdLevel::new(), &map, camera, &InverseResponse::srgb(), depth_scale);
        renderer.render(&RigidTransform::identity(), Behind::Black)
    }

    #[test]
    fn the_centre_has_the_depth_and_the_encoded_light_of_the_ball() {
        let view = render(4.0, 3.0, 5000.0);
        let centre = 12 * 33 + 16;
        assert_eq!(view.depth[centre], 15_000);
        // sigmoid(4) = 0.98201, so the light is 0.49101; sRGB: 255 (1.055 * 0.49101^(1/2.4) - 0.055) = 186.0.
        assert_eq!(view.rgb[3 * centre..3 * centre + 3], [186; 3]);
        assert_eq!((view.depth[0], &view.rgb[..3]), (0, &[0; 3][..]));
        // Alpha is above one half within r^2 < 2 ln(2 * 0.98201) sigma^2, sigma^2 = (10/3)^2 + 0.3: r < 3.92.
        let solid = view.depth.iter().filter(|depth| **depth > 0).count();
        let inside = (-16..17_i32).flat_map(|x| (-12..13_i32).map(move |y| x * x + y * y));
        assert_eq!(solid, inside.filter(|r2| f64::from(*r2) < 3.92 * 3.92).count());
        assert_eq!(view.solid, solid as f64 / (33.0 * 25.0));
    }

    #[test]
    fn there_is_no_depth_where_the_map_is_thin_or_too_far_for_the_unit() {
        assert!(render(-0.1, 3.0, 5000.0).depth.iter().all(|depth| *depth == 0));
        assert!(render(4.0, 14.0, 5000.0).depth.iter().all(|depth| *depth == 0));
        assert!(render(4.0, 14.0, 4000.0).depth.contains(&56_000));
    }

    #[test]
    fn files_hold_what_was_rendered() {
        let folder = tempfile::tempdir().unwrap();
        let [colour, depth] = ["colour.png", "depth.png"].map(|name| folder.path().join(name));
        let view = render(4.0, 3.0, 1000.0);
        view.write(&colour, &depth).unwrap();
        assert_eq!(image::open(&colour).unwrap().into_rgb8().into_raw(), view.rgb);
        assert_eq!(image::open(&depth).unwrap().into_luma16().into_raw(), view.depth);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "no partial file is left");
    }

    #[test]
    fn what_is_behind_is_seen_where_the_map_is_thin_and_nowhere_else() {
        let (width, height) = (33, 25);
        let camera = PinholeCamera { width, height, fx: 100.0, fy: 100.0, cx: 16.0, cy: 12.0 };
        let ball = Gaussian {
            mean: [0.0, 0.0, 3.0],
            log_scale: [0.1_f32.ln(); 3],
            rotation: [1.0, 0.0, 0.0, 0.0],
            opacity_logit: 2.0,
            colour: [0.5; 3],
        };
        let map: Gaussians = [ball].into_iter().collect();
        let mut renderer =
            ViewRenderer::new(SimdLevel::new(), &map, camera, &InverseResponse::linear(), 5000.0);
        let pose = RigidTransform::identity();
        let captured = [const { 90 }; 3].map(|byte| vec![byte; width * height]);
        let [black, filled, in_front] =
            [Behind::Black, Behind::Surroundings, Behind::Captured { colour: &captured, gain: 2.0 }]
                .map(|behind| renderer.render(&pose, behind).rgb);
        let centre = 3 * (12 * width + 16);
        // sigmoid(2) 0.5 is 0.4404 of full scale; the gain doubles it, and nothing behind adds to it.
        assert_eq!((black[centre], filled[centre], in_front[centre]), (112, 112, 225));
        assert_eq!((black[0], in_front[0]), (0, 90));
        assert!((56..=112).contains(&filled[0]), "a corner has the light of the ball: {}", filled[0]);
    }
}
