//! Parameters of Gaussians, one plane of numbers per parameter.

use serde::de::{Deserialize, Deserializer, Error};
use serde::ser::{Serialize, Serializer};

use mba_io::checkpoint::exact_floats;

/// Number of parameters of a Gaussian.
pub const PARAMETERS: usize = 14;

/// First of the three planes of centres in the world, metres.
pub const MEAN: usize = 0;

/// First of the three planes of natural logarithms of the standard deviations along the own axes, metres.
pub const LOG_SCALE: usize = 3;

/// First of the four planes of quaternions w x y z from the own axes to the world; any length but zero.
pub const ROTATION: usize = 6;

/// The plane of opacities as logits, `ln(o/(1 - o))`.
pub const OPACITY_LOGIT: usize = 10;

/// First of the three planes of colours, linear RGB, the same from all sides (spherical harmonics of degree 0).
pub const COLOUR: usize = 11;

/// The parameters of one Gaussian, in the units of the planes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gaussian {
    /// Centre, see [`MEAN`].
    pub mean: [f32; 3],
    /// See [`LOG_SCALE`].
    pub log_scale: [f32; 3],
    /// Quaternion w x y z, see [`ROTATION`].
    pub rotation: [f32; 4],
    /// See [`OPACITY_LOGIT`].
    pub opacity_logit: f32,
    /// Linear RGB, see [`COLOUR`].
    pub colour: [f32; 3],
}

impl Gaussian {
    /// The parameters in the order of the planes.
    #[must_use]
    pub fn to_array(&self) -> [f32; PARAMETERS] {
        let ([x, y, z], [sx, sy, sz], [r, g, b]) = (self.mean, self.log_scale, self.colour);
        let [qw, qx, qy, qz] = self.rotation;
        [x, y, z, sx, sy, sz, qw, qx, qy, qz, self.opacity_logit, r, g, b]
    }

    /// The inverse of [`Self::to_array`].
    #[must_use]
    pub fn from_array(values: [f32; PARAMETERS]) -> Self {
        let [x, y, z, sx, sy, sz, qw, qx, qy, qz, opacity_logit, r, g, b] = values;
        Self {
            mean: [x, y, z],
            log_scale: [sx, sy, sz],
            rotation: [qw, qx, qy, qz],
            opacity_logit,
            colour: [r, g, b],
        }
    }
}

/// A set of Gaussians, or one number per parameter of such a set: a gradient, a moment of an optimiser.
///
/// All planes have the same length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gaussians {
    planes: [Vec<f32>; PARAMETERS],
}

impl Gaussians {
    /// `count` Gaussians with all parameters zero; as a gradient, none.
    #[must_use]
    pub fn zeros(count: usize) -> Self {
        Self { planes: core::array::from_fn(|_| vec![0.0; count]) }
    }

    /// Number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.planes[0].len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Appends a Gaussian.
    pub fn push(&mut self, gaussian: &Gaussian) {
        for (plane, value) in self.planes.iter_mut().zip(gaussian.to_array()) {
            plane.push(value);
        }
    }

    /// Gaussian `index`, or `None` if there are fewer.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<Gaussian> {
        (index < self.len()).then(|| Gaussian::from_array(core::array::from_fn(|k| self.planes[k][index])))
    }

    /// Replaces Gaussian `index`.
    ///
    /// # Panics
    /// If there are fewer.
    pub fn set(&mut self, index: usize, gaussian: &Gaussian) {
        let count = self.len();
        assert!(index < count, "Gaussian {index} of a map of {count} Gaussians");
        for (plane, value) in self.planes.iter_mut().zip(gaussian.to_array()) {
            plane[index] = value;
        }
    }

    /// Keeps the first `count` Gaussians, or appends zeros until there are as many.
    pub fn resize(&mut self, count: usize) {
        self.planes.iter_mut().for_each(|plane| plane.resize(count, 0.0));
    }

    /// The Gaussians with these indices, in their order; indices beyond the set are left out.
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        let pick = |plane: &Vec<f32>| indices.iter().filter_map(|&i| plane.get(i).copied()).collect();
        Self { planes: self.planes.each_ref().map(pick) }
    }

    /// Sets all parameters to zero.
    pub fn fill_zero(&mut self) {
        self.planes.iter_mut().for_each(|plane| plane.fill(0.0));
    }

    /// All planes in the order of the constants of this module, e.g. [`MEAN`].
    #[must_use]
    pub fn planes(&self) -> &[Vec<f32>; PARAMETERS] {
        &self.planes
    }

    /// All planes, to be changed but not resized.
    #[must_use]
    pub fn planes_mut(&mut self) -> PlanesMut<'_> {
        PlanesMut { planes: self.planes.each_mut().map(Vec::as_mut_slice) }
    }
}

impl FromIterator<Gaussian> for Gaussians {
    fn from_iter<I: IntoIterator<Item = Gaussian>>(gaussians: I) -> Self {
        let mut all = Self::default();
        gaussians.into_iter().for_each(|gaussian| all.push(&gaussian));
        all
    }
}

impl Serialize for Gaussians {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(serde::Serialize)]
        struct Plane<'a>(#[serde(with = "exact_floats")] &'a Vec<f32>);
        self.planes.each_ref().map(Plane).serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Gaussians {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(serde::Deserialize)]
        struct Plane(#[serde(with = "exact_floats")] Vec<f32>);
        let planes = <[Plane; PARAMETERS]>::deserialize(deserializer)?.map(|plane| plane.0);
        let count = planes[0].len();
        if planes.iter().any(|plane| plane.len() != count) {
            return Err(D::Error::custom("the planes of a map have different lengths"));
        }
        Ok(Self { planes })
    }
}

/// A range of Gaussians that can be changed, to hand disjoint ranges to threads.
#[derive(Debug)]
pub struct PlanesMut<'a> {
    /// The range of every plane; all of one length.
    pub planes: [&'a mut [f32]; PARAMETERS],
}

impl PlanesMut<'_> {
    /// Number of Gaussians in the range.
    #[must_use]
    pub fn len(&self) -> usize {
        self.planes[0].len()
    }

    /// Whether the range is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The range before Gaussian `middle` of it, at most all of it, and the rest.
    #[must_use]
    pub fn split_at(self, middle: usize) -> (Self, Self) {
        let middle = middle.min(self.len());
        let mut tails: [&mut [f32]; PARAMETERS] = Default::default();
        let mut k = 0;
        let heads = self.planes.map(|plane| {
            let (head, tail) = plane.split_at_mut(middle);
            tails[k] = tail;
            k += 1;
            head
        });
        (Self { planes: heads }, Self { planes: tails })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_of_unequal_length_are_no_map() {
        #[derive(serde::Serialize)]
        struct Plane(#[serde(with = "exact_floats")] Vec<f32>);
        let stored = |planes: &[Plane; PARAMETERS]| postcard::to_stdvec(planes).unwrap();
        let equal = core::array::from_fn(|_| Plane(vec![1.0; 3]));
        assert_eq!(postcard::from_bytes::<Gaussians>(&stored(&equal)).unwrap().len(), 3);
        let last_is_short =
            core::array::from_fn(|k| Plane(vec![1.0; if k + 1 < PARAMETERS { 3 } else { 2 }]));
        assert!(postcard::from_bytes::<Gaussians>(&stored(&last_is_short)).is_err());
    }
}
