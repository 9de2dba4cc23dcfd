//! The map: planes, decoders, and how sharp surfaces are.

use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};

use super::layers::Layers;
use super::planes::FeaturePlanes;
use super::region::Region;
use super::settings::FieldSettings;

/// Signed distances start at about the hyperbolic tangent of this: space is empty until something was seen in it.
const EMPTY: f32 = 0.5;

/// Streams of random numbers.
const DECODER_STREAM: u64 = 0x6465_636f;

/// A field of signed distance and colour in a box of space: features on axis-aligned planes at two resolutions, with
/// two small decoders (MBA-SLAM section 3.4; ESLAM). Colours are linear light, 0 to 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TriplaneField {
    pub(super) region: Region,
    pub(super) settings: FieldSettings,
    pub(super) seed: u64,
    /// Planes of geometry, coarse and fine.
    pub(super) geometry: [FeaturePlanes; 2],
    /// Planes of colour, coarse and fine.
    pub(super) colour: [FeaturePlanes; 2],
    /// From features to signed distance.
    pub(super) distance_decoder: Layers<1>,
    /// From features to red, green and blue.
    pub(super) colour_decoder: Layers<3>,
    /// Natural logarithm of the sharpness of surfaces.
    pub(super) log_sharpness: f32,
}

impl TriplaneField {
    /// A field over `region` without any surface; the same `seed` gives the same field.
    #[must_use]
    pub fn new(region: Region, settings: FieldSettings, seed: u64) -> Self {
        let mut random = Pcg32::new(seed, DECODER_STREAM);
        let mut distance_decoder = Layers::random(&mut random);
        distance_decoder.last_bias = [EMPTY];
        let colour_decoder = Layers::random(&mut random);
        let [geometry, colour] = planes(&region, &settings, seed);
        let log_sharpness = settings.sharpness.ln();
        Self { region, settings, seed, geometry, colour, distance_decoder, colour_decoder, log_sharpness }
    }

    /// The box that the field covers.
    #[must_use]
    pub fn region(&self) -> &Region {
        &self.region
    }

    /// Its resolution.
    #[must_use]
    pub fn settings(&self) -> &FieldSettings {
        &self.settings
    }

    /// How sharp surfaces are: the factor beta of the opacity.
    #[must_use]
    pub fn sharpness(&self) -> f32 {
        self.log_sharpness.exp()
    }

    /// Makes the box so large that `region` lies in it. What is known stays.
    pub fn grow(&mut self, region: &Region) {
        let larger = self.region.union(region);
        if larger == self.region {
            return;
        }
        let [geometry, colour] = planes(&larger, &self.settings, self.seed);
        for (mut new, old) in [(geometry, &mut self.geometry), (colour, &mut self.colour)] {
            new.iter_mut().zip(&*old).for_each(|(new, old)| new.copy_from(&larger, old, &self.region));
            *old = new;
        }
        self.region = larger;
    }

    /// Bytes of all planes and decoders in memory; an optimiser needs four times as much.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let planes = self.geometry.iter().chain(&self.colour).flat_map(|planes| &planes.values);
        let values: usize = planes.map(|plane| plane.0.len()).sum();
        4 * (values + Layers::<1>::COUNT + Layers::<3>::COUNT)
    }
}

/// First values of the planes of geometry and of colour.
fn planes(region: &Region, settings: &FieldSettings, seed: u64) -> [[FeaturePlanes; 2]; 2] {
    let set = |fine: u32, set: u64| {
        let at = |level: u64, cells| FeaturePlanes::random(region, cells, seed ^ (2 * set + level + 1) << 32);
        [at(0, 1), at(1, fine)]
    };
    [set(settings.geometry_cells, 0), set(settings.colour_cells, 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_that_grows_keeps_what_it_knows() {
        let region = Region::around([0.0; 3], [0.48; 3]);
        let mut field = TriplaneField::new(region, FieldSettings::default(), 3);
        field.geometry[1].values[0].0.fill(5.0);
        let count = field.geometry[1].values[0].0.len();
        field.grow(&Region::around([-0.1, 0.0, 0.0], [0.1; 3]));
        assert_eq!(field.region().cells, [3, 2, 2]);
        assert_eq!(field.geometry[1].values[0].0.iter().filter(|value| **value == 5.0).count(), count);
        let bytes = field.bytes();
        field.grow(&region);
        assert_eq!(field.bytes(), bytes);
    }
}
