//! Values of a field at points, for those who look for its surface.

use mba_tracker::simd::Level;
use rayon::prelude::*;

use super::field::TriplaneField;
use super::prepared::{FieldSamples, Prepared};

/// Points per piece of work.
const PIECE: usize = 1024;

impl TriplaneField {
    /// Signed distances from the surface, metres, at points of the world (metres): positive in front of it, bounded to one
    /// truncation. Outside of the box a point counts as the nearest one inside.
    #[must_use]
    pub fn distances(&self, level: Level, points: &[[f64; 3]]) -> Vec<f32> {
        let prepared = Prepared::new(level, self);
        let truncation = self.settings.truncation;
        let pieces = points.par_chunks(PIECE).map_init(FieldSamples::<1>::default, |samples, piece| {
            fill(&prepared, samples, piece);
            prepared.distances(samples);
            let values = samples.values[..piece.len()].iter();
            values.map(|[value]| value * truncation).collect::<Vec<_>>()
        });
        pieces.collect::<Vec<_>>().concat()
    }

    /// Colours at points of the world (metres), linear light.
    #[must_use]
    pub fn colours(&self, level: Level, points: &[[f64; 3]]) -> Vec<[f32; 3]> {
        let prepared = Prepared::new(level, self);
        let pieces = points.par_chunks(PIECE).map_init(FieldSamples::<3>::default, |samples, piece| {
            fill(&prepared, samples, piece);
            prepared.colours(samples);
            samples.values[..piece.len()].to_vec()
        });
        pieces.collect::<Vec<_>>().concat()
    }
}

fn fill<const OUTPUTS: usize>(
    field: &Prepared<'_>,
    samples: &mut FieldSamples<OUTPUTS>,
    points: &[[f64; 3]],
) {
    samples.clear();
    let origin = field.origin;
    points.iter().for_each(|point| samples.push([0, 1, 2].map(|axis| (point[axis] - origin[axis]) as f32)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triplane::reference::lively_field;

    #[test]
    fn a_long_list_of_points_has_the_values_of_its_points() {
        let field = lively_field();
        let origin = field.region().origin();
        let point = |k: usize| [0.001, 0.0007, 0.0005].map(|step| (k % 997) as f64 * step);
        let points: Vec<[f64; 3]> =
            (0..3000).map(point).map(|[x, y, z]| [origin.x + x, origin.y + y, origin.z + z]).collect();
        let (distances, colours) =
            (field.distances(Level::new(), &points), field.colours(Level::new(), &points));
        assert_eq!((distances.len(), colours.len()), (3000, 3000));
        for k in [0, 500, 1023, 1024, 2999] {
            assert_eq!(field.distances(Level::new(), &points[k..=k]), [distances[k]]);
            assert_eq!(field.colours(Level::new(), &points[k..=k]), [colours[k]]);
        }
        assert!(distances.iter().all(|distance| distance.abs() <= field.settings().truncation));
    }
}
