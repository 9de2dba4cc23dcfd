//! Sparse clouds of points, from which other programs start.

use mba_mesh::Mesh;
use mba_raster::gaussians::Gaussians;
use mba_raster::sensor::ForwardResponse;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::photometric::InverseResponse;

use super::frame_images::FrameImages;

/// Logit of the opacity of one tenth. What is fainter shows no surface by itself.
const FAINTEST_LOGIT: f32 = -2.197_224_6;

/// Most points that come from depth.
const MOST_DEPTH_POINTS: usize = 100_000;

/// The centres of the Gaussians that are not faint, in the world in metres, with the colours that the images have.
#[must_use]
pub fn cloud_of_gaussians(map: &Gaussians, response: &InverseResponse) -> Mesh {
    let response = ForwardResponse::new(response);
    let mut cloud = Mesh::default();
    for gaussian in (0..map.len()).filter_map(|index| map.get(index)) {
        let is_finite = gaussian.to_array().iter().all(|value| value.is_finite());
        if is_finite && gaussian.opacity_logit >= FAINTEST_LOGIT {
            cloud.vertices.push(gaussian.mean);
            cloud.colours.push(gaussian.colour.map(|light| response.encode(light)));
        }
    }
    cloud
}

/// Every how many-th column and row of `frames` images of this camera gives a point, so that there are not too many.
pub(super) fn depth_step(camera: &PinholeCamera, frames: usize) -> usize {
    let points = |step: usize| {
        camera.width.div_ceil(step).saturating_mul(camera.height.div_ceil(step)).saturating_mul(frames)
    };
    let longest = camera.width.max(camera.height).max(1);
    (1..longest).find(|step| points(*step) <= MOST_DEPTH_POINTS).unwrap_or(longest)
}

/// Appends the points that a frame's depth shows, of every `step`-th column and row from the middle of the first step on.
pub(super) fn add_depth_points(
    cloud: &mut Mesh,
    images: &FrameImages,
    camera: &PinholeCamera,
    world_from_camera: &RigidTransform,
    step: usize,
) {
    for v in (step / 2..camera.height).step_by(step) {
        for u in (step / 2..camera.width).step_by(step) {
            let pixel = v * camera.width + u;
            let (depth, colour) = (images.depth[pixel], &images.rgb[3 * pixel..3 * pixel + 3]);
            if depth == 0 {
                continue;
            }
            let z = f64::from(depth) * super::DEPTH_UNIT;
            let point = world_from_camera.transform_point(&(camera.ray(u as f64, v as f64) * z));
            cloud.vertices.push([point.x, point.y, point.z].map(|coordinate| coordinate as f32));
            cloud.colours.push([colour[0], colour[1], colour[2]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;
    use mba_raster::gaussians::Gaussian;

    #[test]
    fn faint_gaussians_are_no_points() {
        let solid = Gaussian {
            mean: [1.0, 2.0, 3.0],
            rotation: [1.0, 0.0, 0.0, 0.0],
            colour: [1.0, 0.214_041_14, -0.5],
            ..Gaussian::default()
        };
        let faint = Gaussian { opacity_logit: -2.2, ..solid };
        let lost = Gaussian { mean: [f32::NAN; 3], ..solid };
        let cloud = cloud_of_gaussians(&[faint, solid, lost].into_iter().collect(), &InverseResponse::srgb());
        assert_eq!(cloud.vertices, [[1.0, 2.0, 3.0]]);
        // Half of the display's range is linear 0.214.
        assert!(cloud.colours == [[255, 127, 0]] || cloud.colours == [[255, 128, 0]], "{:?}", cloud.colours);
    }

    #[test]
    fn depth_becomes_points_of_the_world() {
        let camera = PinholeCamera { width: 4, height: 2, fx: 2.0, fy: 2.0, cx: 1.0, cy: 0.0 };
        let mut images = FrameImages { rgb: (0..24).collect(), depth: vec![0; 8] };
        images.depth[7] = 2000;
        let pose = RigidTransform::new(UnitQuaternion::identity(), Vector3::new(10.0, 20.0, 30.0));
        let mut cloud = Mesh::default();
        add_depth_points(&mut cloud, &images, &camera, &pose, 1);
        // Pixel (3, 1): two pixels to the right of the axis and one below it, at 2 m.
        assert_eq!(cloud.vertices, [[12.0, 21.0, 32.0]]);
        assert_eq!(cloud.colours, [[21, 22, 23]]);
    }

    #[test]
    fn points_from_depth_are_limited() {
        let camera = |width, height| PinholeCamera { width, height, fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0 };
        assert_eq!(depth_step(&camera(160, 120), 5), 1);
        assert_eq!(depth_step(&camera(640, 480), 1), 2);
        assert_eq!(depth_step(&camera(640, 480), usize::MAX), 640);
    }
}
