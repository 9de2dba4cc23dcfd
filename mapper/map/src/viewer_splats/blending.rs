//! The matrix of blending weights, as rendering and its gradient multiply with it.

use mba_raster::gaussians::{COLOUR, Gaussians};
use mba_raster::raster::{GaussianGradients, RasterImage, RasterScratch, RasterView, Rasterizer};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::simd::Level;

/// Red, green and blue: a number per Gaussian each, or per pixel of a view.
pub(super) type Colours = [Vec<f32>; 3];

/// Views of Gaussians whose colours are given from outside.
pub(super) struct Blending {
    rasterizer: Rasterizer,
    camera: PinholeCamera,
    poses: Vec<RigidTransform>,
    painted: Gaussians,
    scratch: RasterScratch,
    image: RasterImage,
    gradients: GaussianGradients,
}

impl Blending {
    /// Views of `gaussians`, whatever their colours, from `poses`, camera-to-world.
    pub(super) fn new(
        gaussians: &Gaussians,
        camera: PinholeCamera,
        poses: Vec<RigidTransform>,
        level: Level,
    ) -> Self {
        Self {
            rasterizer: Rasterizer::new(level),
            camera,
            poses,
            painted: gaussians.clone(),
            scratch: RasterScratch::default(),
            image: RasterImage::default(),
            gradients: GaussianGradients::default(),
        }
    }

    /// What `of` makes of every view of `map`, in front of black.
    pub(super) fn views(&mut self, map: &Gaussians, of: impl Fn(&RasterImage) -> Colours) -> Vec<Colours> {
        let views = self.poses.iter().map(|pose| view(self.camera, pose));
        let render = |view| {
            self.rasterizer.forward(map, &view, &mut self.scratch, &mut self.image);
            of(&self.image)
        };
        views.map(render).collect()
    }

    /// Multiplies with the matrix, lets `change` turn each view's pixels into others, and multiplies with the transpose:
    /// the sum over all views.
    pub(super) fn there_and_back(
        &mut self,
        colours: &Colours,
        mut change: impl FnMut(usize, &mut Colours),
    ) -> Colours {
        let planes = self.painted.planes_mut().planes;
        for (plane, colour) in planes.into_iter().skip(COLOUR).zip(colours) {
            plane.copy_from_slice(colour);
        }
        self.gradients.reset(self.painted.len());
        let Self { rasterizer, painted, scratch, image, gradients, .. } = self;
        for (k, pose) in self.poses.iter().enumerate() {
            let mut tape = rasterizer.forward(painted, &view(self.camera, pose), scratch, image);
            change(k, &mut image.colour);
            image.depth.fill(0.0);
            image.alpha.fill(0.0);
            tape.backward(image, gradients);
        }
        let planes = &gradients.parameters.planes()[COLOUR..];
        core::array::from_fn(|channel| planes[channel].clone())
    }
}

fn view(camera: PinholeCamera, pose: &RigidTransform) -> RasterView {
    RasterView { camera, world_from_camera: *pose, background: [0.0; 3] }
}
