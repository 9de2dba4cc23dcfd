//! The camera of a run, as its summary keeps it.

use mba_tracker::geometry::PinholeCamera;
use mba_tracker::photometric::InverseResponse;
use serde::{Deserialize, Serialize};

use mba_io::dataset::{Calibration, InvalidValue, Response, check_camera, check_positive};

/// Units of depth per metre of the TUM benchmark, for cameras of which nothing is known.
const TUM_DEPTH_SCALE: f64 = 5000.0;

/// What is needed to render views as the data set's camera would have stored them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunCamera {
    /// Columns of the undistorted images.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal length along x in pixels.
    pub fx: f64,
    /// Focal length along y in pixels.
    pub fy: f64,
    /// Column of the principal point; the centre of the top-left pixel is `(0, 0)`.
    pub cx: f64,
    /// Row of the principal point.
    pub cy: f64,
    /// Raw depth units per metre.
    pub depth_scale: f64,
    /// How light becomes bytes.
    pub response: RunResponse,
}

/// How light becomes bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RunResponse {
    /// The sRGB transfer function.
    Srgb,
    /// Proportional to light.
    Linear,
    /// Linear light of every byte, 256 numbers.
    Table(Vec<f32>),
}

impl From<&Calibration> for RunCamera {
    fn from(calibration: &Calibration) -> Self {
        let PinholeCamera { width, height, fx, fy, cx, cy } = calibration.camera;
        let response = match &calibration.response {
            Response::Srgb => RunResponse::Srgb,
            Response::Linear => RunResponse::Linear,
            Response::Table(table) => {
                RunResponse::Table((0..=u8::MAX).map(|byte| table.linear_light(byte)).collect())
            }
        };
        Self { width, height, fx, fy, cx, cy, depth_scale: calibration.depth_scale, response }
    }
}

impl RunCamera {
    /// A camera of `width` x `height` pixels with sRGB images and the depth units of the TUM benchmark; `focal` is
    /// the focal length in pixels, the principal point is the middle of the image.
    #[must_use]
    pub fn simple(width: usize, height: usize, focal: f64) -> Self {
        let (cx, cy) = (0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
        let (depth_scale, response) = (TUM_DEPTH_SCALE, RunResponse::Srgb);
        Self { width, height, fx: focal, fy: focal, cx, cy, depth_scale, response }
    }

    /// The camera with another number of pixels and the same field of view.
    #[must_use]
    pub fn resized(&self, width: usize, height: usize) -> Self {
        let (x, y) = (width as f64 / self.width as f64, height as f64 / self.height as f64);
        Self {
            width,
            height,
            fx: self.fx * x,
            fy: self.fy * y,
            cx: (self.cx + 0.5) * x - 0.5,
            cy: (self.cy + 0.5) * y - 0.5,
            ..self.clone()
        }
    }

    /// The camera with another focal length in pixels, along x and y, and the principal point in the middle.
    #[must_use]
    pub fn refocused(&self, focal: f64) -> Self {
        let Self { depth_scale, response, .. } = self.clone();
        Self { depth_scale, response, ..Self::simple(self.width, self.height, focal) }
    }

    /// Checks every number.
    ///
    /// # Errors
    /// The first value out of its range.
    pub fn check(&self) -> Result<(), InvalidValue> {
        check_camera(&self.pinhole())?;
        check_positive("depth_scale", self.depth_scale, "a positive number of raw units per metre")?;
        self.inverse_response().map(|_| ())
    }

    /// The intrinsics.
    #[must_use]
    pub fn pinhole(&self) -> PinholeCamera {
        let Self { width, height, fx, fy, cx, cy, .. } = *self;
        PinholeCamera { width, height, fx, fy, cx, cy }
    }

    /// Linear light of every byte.
    ///
    /// # Errors
    /// If a table does not have 256 increasing numbers.
    pub fn inverse_response(&self) -> Result<InverseResponse, InvalidValue> {
        match &self.response {
            RunResponse::Srgb => Ok(InverseResponse::srgb()),
            RunResponse::Linear => Ok(InverseResponse::linear()),
            RunResponse::Table(values) => {
                let table = values.as_slice().try_into().ok().and_then(InverseResponse::from_table);
                table.ok_or_else(|| InvalidValue {
                    key: "response",
                    value: format!("a table of {} numbers", values.len()),
                    expected: "256 increasing numbers, the first not negative",
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_size_keeps_the_field_of_view() {
        let camera =
            RunCamera { fx: 500.0, fy: 520.0, cx: 300.0, cy: 250.0, ..RunCamera::simple(640, 480, 1.0) };
        let half = camera.resized(320, 240);
        // The edges of the image, half a pixel outside of the outer pixels' centres, stay on the same rays.
        for (edge, half_edge) in [([-0.5, -0.5], [-0.5, -0.5]), ([639.5, 479.5], [319.5, 239.5])] {
            let [ray, half_ray] =
                [(&camera, edge), (&half, half_edge)].map(|(c, [u, v])| c.pinhole().ray(u, v));
            assert!((ray - half_ray).norm() < 1e-12);
        }
        let refocused = half.refocused(200.0);
        assert_eq!((refocused.fx, refocused.fy, refocused.cx, refocused.cy), (200.0, 200.0, 159.5, 119.5));
    }

    #[test]
    fn a_measured_response_survives_the_file() {
        let table: Vec<f32> = (0..256).map(|k| ((k * k + k) as f32).sqrt() / 255.5).collect();
        let camera =
            RunCamera { response: RunResponse::Table(table), fx: 1.1 + 2.2, ..RunCamera::simple(8, 6, 5.0) };
        let json = serde_json::to_string(&camera).unwrap();
        assert_eq!(serde_json::from_str::<RunCamera>(&json).unwrap(), camera);
        assert!(camera.check().is_ok());
        let json = serde_json::to_value(RunCamera::simple(8, 6, 5.0)).unwrap();
        assert_eq!(json["response"], "srgb");
    }

    #[test]
    fn absurd_values_are_named() {
        let good = RunCamera::simple(8, 6, 5.0);
        let cases = [
            (RunCamera { fx: -3.0, ..good.clone() }, "fx is -3, expected a focal length"),
            (RunCamera { width: 0, ..good.clone() }, "width is 0, expected a size"),
            (RunCamera { depth_scale: 0.0, ..good.clone() }, "depth_scale is 0, expected a positive"),
            (
                RunCamera { response: RunResponse::Table(vec![1.0; 9]), ..good },
                "response is a table of 9 numbers",
            ),
        ];
        for (camera, expected) in cases {
            let message = camera.check().unwrap_err().to_string();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}
