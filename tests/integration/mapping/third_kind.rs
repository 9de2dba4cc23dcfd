//! A third kind of map, a box of one colour, through adjustment, views and a mesh: it takes one type that says how it is
//! rendered and fitted.

use mba_mapper::bundle::{
    BundleAdjustment, BundleSettings, DepthSource, FrameState, MapKeyframe, MapModel, MappedFrame, PathPrior,
    Schedule, SeedView, StepPlan,
};
use mba_mapper::dataset::RgbdFrame;
use mba_mapper::exposure::{ExposurePath, RowTiming};
use mba_mapper::losses::{Exposure, ExposureLoss, LossTerms};
use mba_mapper::map::{MapKind, MapSize, RenderedMap, Scene, SceneRenderer};
use mba_mapper::raster::RasterImage;
use mba_mapper::sensor::{ObservationPyramid, Sensor};
use mba_mapper::surfaces::{FusionSettings, MapViews, Trim, surface_of_map};
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::image::PixelRectangle;
use mba_tracker::photometric::InverseResponse;
use mba_tracker::simd::Level;
use nalgebra::{SVector, Vector3};

const CAMERA: PinholeCamera = PinholeCamera { width: 96, height: 72, fx: 80.0, fy: 80.0, cx: 47.5, cy: 35.5 };

/// Half the edges of the box around the origin of the world, metres; the camera is inside.
const HALF: [f64; 3] = [1.5, 1.2, 2.0];

/// A box seen from inside, all walls of which have the same light.
#[derive(Clone, Debug, PartialEq)]
struct ColourBox {
    light: f32,
    is_seeded: bool,
}

/// What a step needs of the exposure before: the gradient by the light.
type Gradient = f64;

impl RenderedMap for ColourBox {
    fn render(&self, camera: &PinholeCamera, world_from_camera: &RigidTransform) -> RasterImage {
        let mut image = RasterImage::zeros(camera.width, camera.height);
        let eye = world_from_camera.translation;
        for pixel in 0..camera.width * camera.height {
            let ray = camera.ray((pixel % camera.width) as f64, (pixel / camera.width) as f64);
            let direction = world_from_camera.rotation * ray;
            let exits =
                (0..3).map(|axis| (HALF[axis].copysign(direction[axis]) - eye[axis]) / direction[axis]);
            // The ray has length one along the optical axis: where it leaves the box is the depth.
            image.depth[pixel] = exits.fold(f64::INFINITY, f64::min) as f32;
            image.alpha[pixel] = 1.0;
            image.colour.iter_mut().for_each(|plane| plane[pixel] = self.light);
        }
        image
    }
}

impl MapModel for ColourBox {
    type Context = Gradient;

    fn scene(&self) -> Scene<'_> {
        Scene::Other(self)
    }

    fn is_empty(&self) -> bool {
        !self.is_seeded
    }

    fn size(&self) -> MapSize {
        MapSize::FieldBytes(size_of::<Self>())
    }

    fn seed(&mut self, _: &mut Gradient, _: &SeedView<'_>, _: usize) {
        self.is_seeded = true;
    }

    /// Mean squared difference of light, whose response is linear here.
    fn evaluate(
        &self,
        gradient: &mut Gradient,
        exposure: Exposure<'_>,
        _: &StepPlan,
        _: u64,
    ) -> ExposureLoss {
        let values = exposure.seen.colour.iter().flatten();
        let count = 3.0 * exposure.seen.depth.len() as f64;
        let off = values.map(|byte| f64::from(self.light) - f64::from(*byte) / 255.0);
        let (sum, squares) = off.fold((0.0, 0.0), |(sum, squares), off| (sum + off, squares + off * off));
        *gradient = 2.0 * sum / count;
        let terms =
            LossTerms { colour: squares / count, mean_square: squares / count, ..LossTerms::default() };
        ExposureLoss { terms, grad_path: SVector::zeros(), grad_log_gain: 0.0 }
    }

    fn step(&mut self, gradient: &mut Gradient, plan: &StepPlan) {
        self.light -= 0.2 * plan.shrink * *gradient as f32;
    }
}

/// A frame that sees every pixel with the value `byte`.
fn keyframe(sensor: &Sensor, index: usize, byte: u8) -> MapKeyframe {
    let (width, height) = (CAMERA.width, CAMERA.height);
    let frame = RgbdFrame {
        index,
        timestamp: index as f64,
        depth_timestamp: index as f64,
        exposure_seconds: 0.01,
        width,
        height,
        rgb: vec![byte; 3 * width * height],
        depth: vec![10_000; width * height],
    };
    let observation = ObservationPyramid::new(sensor, &frame, 2).expect("the frame has the camera's size");
    MapKeyframe::new(
        index,
        observation,
        PathPrior { middle: RigidTransform::identity(), is_measured: true, motion: None },
    )
}

#[test]
fn a_box_of_one_colour_is_fitted_rendered_and_meshed() {
    let sensor = Sensor {
        camera: CAMERA,
        inverse_response: InverseResponse::linear(),
        depth_scale: 5000.0,
        region: PixelRectangle { left: 0, top: 0, right: CAMERA.width, bottom: CAMERA.height },
        rows: RowTiming { readout_seconds: 0.0, depth_readout_seconds: 0.0 },
        falloff: None,
    };
    let still = || FrameState::new(ExposurePath::still(RigidTransform::identity()));
    let frames = [(0, 100), (1, 120)]
        .map(|(index, byte)| MappedFrame { keyframe: keyframe(&sensor, index, byte), state: still() });
    let settings =
        BundleSettings { kind: MapKind::default(), blur: false, max_views: 1, max_gaussians: 0, seed: 1 };
    let map = ColourBox { light: 0.9, is_seeded: false };
    let mut bundle = BundleAdjustment::with_map(
        (map, 0.0),
        Schedule::finish(60),
        Level::new(),
        sensor,
        settings,
        frames.into(),
    );
    bundle.seed_from(0, DepthSource::Measured);
    assert!(!bundle.map.is_empty());
    assert_eq!(bundle.uncovered_fraction(&RigidTransform::identity(), 0), 0.0);
    for k in 1..=60 {
        bundle.step(false, |_| f64::from(k) / 60.0).expect("there are keyframes");
    }
    // The mean of what both frames show, (100 + 120)/2.
    let map = &bundle.map;
    assert!((map.light - 110.0 / 255.0).abs() < 0.02, "{}", map.light);

    let mut renderer = SceneRenderer::new(Level::new());
    renderer.render(map.scene(), CAMERA, &RigidTransform::identity());
    let middle = 36 * CAMERA.width + 48;
    assert_eq!(renderer.image.colour[1][middle], map.light);
    assert!((renderer.image.depth[middle] - 2.0).abs() < 1e-5, "{}", renderer.image.depth[middle]);

    // A look around in eight directions shows most of the walls.
    let turned = |k: usize| {
        let turn = Vector3::new(0.0, k as f64 * std::f64::consts::FRAC_PI_4, 0.0);
        RigidTransform::new(nalgebra::UnitQuaternion::from_scaled_axis(turn), Vector3::zeros())
    };
    let poses: Vec<RigidTransform> = (0..8).map(turned).collect();
    let mut views = MapViews::new(Level::new(), map.scene(), CAMERA, poses);
    let fusion = FusionSettings { voxel: 0.05, ..FusionSettings::default() };
    let mesh = surface_of_map(Level::new(), map.scene(), &mut views, &fusion, &Trim { least_area: 0.01 })
        .expect("the box has a surface");
    assert!(mesh.area() > 12.0, "{} square metres", mesh.area());
    let off_the_walls = |vertex: &[f32; 3]| {
        (0..3).map(|axis| (f64::from(vertex[axis]).abs() - HALF[axis]).abs()).fold(f64::INFINITY, f64::min)
    };
    let worst = mesh.vertices.iter().map(off_the_walls).fold(0.0, f64::max);
    assert!(worst < 0.05, "a vertex is {worst} m off the walls");
}
