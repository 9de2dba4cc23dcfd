//! Access to `data/reference_values.json`: test vectors computed with 60 decimal digits.

use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use nalgebra::{Quaternion, SMatrix, UnitQuaternion, Vector3};
use serde_json::Value;

/// One test vector.
pub struct ReferenceVector {
    /// Name within its group.
    pub name: String,
    input: Value,
    output: Value,
    tolerance: f64,
}

/// The test vectors of a group.
///
/// # Panics
///
/// If the file has no such group.
#[must_use]
pub fn group(name: &str) -> Vec<ReferenceVector> {
    let text = include_str!("../data/reference_values.json");
    let file: Value = serde_json::from_str(text).expect("the file is valid JSON");
    let vectors = file["groups"][name].as_array().expect("the group exists");
    assert!(!vectors.is_empty(), "group {name} is empty");
    vectors.iter().map(|vector| ReferenceVector::new(vector, &file["tolerance"])).collect()
}

/// The amplitude, two wave numbers and phase of every wave of the analytic test image.
#[must_use]
pub fn image_waves() -> Vec<[f64; 4]> {
    let text = include_str!("../data/reference_values.json");
    let file: Value = serde_json::from_str(text).expect("the file is valid JSON");
    let terms = numbers(&file["test_image"]["terms_A_ku_kv_phase"]);
    terms.chunks_exact(4).map(|term| [term[0], term[1], term[2], term[3]]).collect()
}

impl ReferenceVector {
    fn new(vector: &Value, tolerance: &Value) -> Self {
        let name = vector["name"].as_str().expect("a vector has a name").to_owned();
        let hard = name.contains("near_pi") || name.contains("grazing");
        let tolerance = &tolerance[if hard { "near_pi_or_grazing" } else { "default" }];
        Self {
            name,
            input: vector["in"].clone(),
            output: vector["out"].clone(),
            tolerance: tolerance.as_f64().expect("the tolerance is a number"),
        }
    }

    /// An input number.
    #[must_use]
    pub fn number(&self, key: &str) -> f64 {
        numbers(&self.input[key])[0]
    }

    /// An input string.
    #[must_use]
    pub fn text(&self, key: &str) -> &str {
        self.input[key].as_str().unwrap_or_default()
    }

    /// An input vector.
    #[must_use]
    pub fn vector(&self, key: &str) -> Vector3<f64> {
        Vector3::from_row_slice(&numbers(&self.input[key]))
    }

    /// The input pixel.
    #[must_use]
    pub fn pixel(&self) -> (f64, f64) {
        let uv = numbers(&self.input["uv"]);
        (uv[0], uv[1])
    }

    /// An input quaternion, normalised.
    #[must_use]
    pub fn rotation(&self, key: &str) -> UnitQuaternion<f64> {
        let q = numbers(&self.input[key]);
        UnitQuaternion::from_quaternion(Quaternion::new(q[3], q[0], q[1], q[2]))
    }

    /// The input pose with rotation `rotation` and translation `translation`.
    #[must_use]
    pub fn pose(&self, rotation: &str, translation: &str) -> RigidTransform {
        RigidTransform::new(self.rotation(rotation), self.vector(translation))
    }

    /// The input camera `K`; the file states no image size.
    #[must_use]
    pub fn camera(&self, width: usize, height: usize) -> PinholeCamera {
        let k = numbers(&self.input["K"]);
        PinholeCamera { width, height, fx: k[0], fy: k[1], cx: k[2], cy: k[3] }
    }

    /// The expected numbers of an output, row by row; empty where the file says `null`.
    #[must_use]
    pub fn expected(&self, key: &str) -> Vec<f64> {
        numbers(&self.output[key])
    }

    /// Whether the output `valid` is true.
    #[must_use]
    pub fn expects_valid(&self) -> bool {
        self.output["valid"].as_bool().expect("transfer vectors say whether they are valid")
    }

    /// Compares with an output matrix at the tolerance that the file states.
    pub fn check<const R: usize, const C: usize>(&self, key: &str, got: &SMatrix<f64, R, C>) {
        let row_by_row: Vec<f64> = got.transpose().iter().copied().collect();
        self.check_slice(key, &row_by_row, self.tolerance);
    }

    /// Compares with an output quaternion, up to sign.
    pub fn check_rotation(&self, key: &str, got: &UnitQuaternion<f64>) {
        let want = self.expected(key);
        let dot: f64 = got.coords.iter().zip(&want).map(|(a, b)| a * b).sum();
        self.check(key, &(got.coords * dot.signum()));
    }

    /// Compares with an output, relative to its largest entry, or absolutely where all are zero.
    pub fn check_slice(&self, key: &str, got: &[f64], tolerance: f64) {
        let largest = self.expected(key).iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        self.check_absolute(key, got, tolerance * if largest > 0.0 { largest } else { 1.0 });
    }

    /// Compares with an output.
    ///
    /// # Panics
    ///
    /// If an entry deviates by more than `bound`.
    pub fn check_absolute(&self, key: &str, got: &[f64], bound: f64) {
        let want = self.expected(key);
        assert_eq!(got.len(), want.len(), "{}: {key} has another size", self.name);
        for (got, want) in got.iter().zip(&want) {
            assert!((got - want).abs() <= bound, "{}: {key}: {got:e} instead of {want:e}", self.name);
        }
    }
}

/// All numbers of a scalar, an array or an array of arrays, in order.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(entries) => entries.iter().flat_map(numbers).collect(),
        other => other.as_f64().into_iter().collect(),
    }
}
