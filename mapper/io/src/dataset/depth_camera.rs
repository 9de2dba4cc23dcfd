//! A depth camera of its own beside the colour camera, and the section of `calibration.toml` that describes it.

use mba_tracker::geometry::{Distortion, PinholeCamera, RigidTransform};
use nalgebra::{UnitQuaternion, Vector3};
use serde::Deserialize;

use super::validity::{InvalidValue, ROTATION, check_camera, rotation_of};

/// Largest distance between colour and depth camera, metres: several times that of any housing.
const FARTHEST: f64 = 10.0;

/// The camera of depth images that are not registered to colour pixel by pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthCamera {
    /// Size and intrinsics of the stored depth images.
    pub camera: PinholeCamera,
    /// Distortion of the stored depth images.
    pub distortion: Distortion,
    /// Takes points in the depth camera's axes to those of the colour camera, metres.
    pub colour_from_depth: RigidTransform,
}

impl DepthCamera {
    /// The camera of depth images of another size that show what the colour `camera` sees, edge to edge.
    pub(super) fn same_view(camera: &PinholeCamera, (width, height): (usize, usize)) -> Self {
        let [across, down] = [width as f64 / camera.width as f64, height as f64 / camera.height as f64];
        // Edges of the images coincide; the centre of a pixel is half a pixel from its edge.
        let scaled = |centre: f64, scale: f64| (centre + 0.5) * scale - 0.5;
        let camera = PinholeCamera {
            width,
            height,
            fx: camera.fx * across,
            fy: camera.fy * down,
            cx: scaled(camera.cx, across),
            cy: scaled(camera.cy, down),
        };
        Self { camera, distortion: Distortion::default(), colour_from_depth: RigidTransform::identity() }
    }

    /// Whether both cameras look from the same place in the same direction.
    pub(super) fn is_in_place(&self) -> bool {
        self.colour_from_depth == RigidTransform::identity()
    }

    /// Checks every number. Names of values have the section before them.
    pub(super) fn check(&self) -> Result<(), InvalidValue> {
        check_camera(&self.camera).map_err(of_section)?;
        let Distortion { k1, k2, p1, p2, k3 } = self.distortion;
        let invalid = |key, value, expected| Err(InvalidValue { key, value, expected });
        if let Some(bad) = [k1, k2, p1, p2, k3].into_iter().find(|k| !k.is_finite()) {
            return invalid("depth.distortion", bad.to_string(), "finite numbers");
        }
        let translation = &self.colour_from_depth.translation;
        let is_near = translation.norm() <= FARTHEST;
        if !is_near {
            let expected = "metres from the colour to the depth camera, at most 10";
            return invalid("depth.translation", format!("{:?}", translation.as_slice()), expected);
        }
        Ok(())
    }
}

/// The value with the name of the section before that of its key.
fn of_section(invalid: InvalidValue) -> InvalidValue {
    let key = match invalid.key {
        "width" => "depth.width",
        "height" => "depth.height",
        "fx" => "depth.fx",
        "fy" => "depth.fy",
        "cx" => "depth.cx",
        _ => "depth.cy",
    };
    InvalidValue { key, ..invalid }
}

/// The keys of the section.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DepthKeys {
    width: usize,
    height: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    distortion: Option<[f64; 5]>,
    rotation: Option<[f64; 9]>,
    translation: Option<[f64; 3]>,
}

impl DepthKeys {
    pub(super) fn camera(&self) -> Result<DepthCamera, InvalidValue> {
        let [k1, k2, p1, p2, k3] = self.distortion.unwrap_or_default();
        let rotation = match self.rotation {
            None => UnitQuaternion::identity(),
            Some(rows) => {
                let rotation = rotation_of(&rows).ok_or_else(|| InvalidValue {
                    key: "depth.rotation",
                    value: format!("{rows:?}"),
                    expected: ROTATION,
                })?;
                UnitQuaternion::from_rotation_matrix(&rotation)
            }
        };
        let translation = Vector3::from(self.translation.unwrap_or_default());
        Ok(DepthCamera {
            camera: PinholeCamera {
                width: self.width,
                height: self.height,
                fx: self.fx,
                fy: self.fy,
                cx: self.cx,
                cy: self.cy,
            },
            distortion: Distortion { k1, k2, p1, p2, k3 },
            colour_from_depth: RigidTransform::new(rotation, translation),
        })
    }
}

/// The section as text, which reads back as the same camera but for rounding of the rotation.
pub(super) fn section(depth: &DepthCamera) -> String {
    let PinholeCamera { width, height, fx, fy, cx, cy } = depth.camera;
    let mut text = format!(
        "\n[depth]\nwidth = {width}\nheight = {height}\nfx = {fx:?}\nfy = {fy:?}\ncx = {cx:?}\ncy = {cy:?}\n"
    );
    let Distortion { k1, k2, p1, p2, k3 } = depth.distortion;
    if !depth.distortion.is_none() {
        text += &format!("distortion = {:?}\n", [k1, k2, p1, p2, k3]);
    }
    if !depth.is_in_place() {
        // The columns of the transpose are the rows.
        let rows = depth.colour_from_depth.rotation_matrix().transpose();
        text += &format!("rotation = {:?}\n", rows.as_slice());
        text += &format!("translation = {:?}\n", depth.colour_from_depth.translation.as_slice());
    }
    text
}
