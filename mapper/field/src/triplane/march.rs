//! The first surface along rays.

use super::prepared::{FieldSamples, Prepared};

/// Most steps along a ray.
const MOST_STEPS: usize = 300;

/// Refinements of the place where the sign changes.
const REFINEMENTS: u32 = 2;

/// Above this distance, truncations, space counts as free.
const FREE: f32 = 0.9;

/// Step in free space, truncations: behind a surface distances are negative for one truncation.
const FREE_STEP: f32 = 1.5;

/// Least step, truncations.
const LEAST_STEP: f32 = 0.2;

/// A ray in the coordinates of a field; its parameter z is depth along the optical axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) origin: [f32; 3],
    pub(super) direction: [f32; 3],
    /// Range that is searched.
    pub(super) range: [f32; 2],
}

impl Ray {
    pub(super) fn at(&self, z: f32) -> [f32; 3] {
        [0, 1, 2].map(|i| self.origin[i] + z * self.direction[i])
    }
}

/// Where a search stands.
#[derive(Clone, Copy, Debug)]
struct Search {
    ray: Ray,
    z: f32,
    /// Last place in front of the surface, with its distance.
    front: Option<[f32; 2]>,
    /// First place behind it, with its distance.
    behind: Option<[f32; 2]>,
    refinements: u32,
    found: Option<f32>,
    done: bool,
}

impl Search {
    fn new(ray: &Ray) -> Self {
        let done = ray.range[0] >= ray.range[1];
        let z = ray.range[0];
        Self { ray: *ray, z, front: None, behind: None, refinements: 0, found: None, done }
    }

    /// Goes on with the distance at the current place.
    fn advance(&mut self, distance: f32, truncation: f32) {
        let here = Some([self.z, distance]);
        match (distance > 0.0, self.front) {
            (true, _) => self.front = here,
            // The camera is inside of something that nobody has seen.
            (false, None) => (),
            (false, Some(_)) => self.behind = here,
        }
        if let (Some(front), Some(behind)) = (self.front, self.behind) {
            self.z = front[0] + (behind[0] - front[0]) * front[1] / (front[1] - behind[1]);
            self.done = self.refinements == REFINEMENTS;
            self.found = Some(self.z);
            self.refinements += 1;
        } else {
            let step = if distance > FREE { FREE_STEP } else { distance.abs().max(LEAST_STEP) };
            self.z += truncation * step;
            self.done = self.z > self.ray.range[1];
        }
    }
}

/// Depth of the first surface that each ray meets from the front, or `None`.
pub(super) fn first_surfaces(
    field: &Prepared<'_>,
    rays: &[Ray],
    samples: &mut FieldSamples<1>,
) -> Vec<Option<f32>> {
    let truncation = field.field.settings.truncation;
    let mut searches: Vec<Search> = rays.iter().map(Search::new).collect();
    for _ in 0..MOST_STEPS {
        samples.clear();
        let running = searches.iter_mut().filter(|search| !search.done);
        running.for_each(|search| samples.push(search.ray.at(search.z)));
        if samples.len() == 0 {
            break;
        }
        field.distances(samples);
        let running = searches.iter_mut().filter(|search| !search.done);
        running.zip(&samples.values).for_each(|(search, [distance])| search.advance(*distance, truncation));
    }
    searches.iter().map(|search| search.found).collect()
}
