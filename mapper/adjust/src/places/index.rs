//! The stored views.

use mba_tracker::geometry::RigidTransform;

use super::PlaceDescriptor;

/// Descriptors of views, each with a number of the caller's. It grows with every [`PlaceIndex::push`]; a search compares
/// with all of them, in some ten microseconds each.
#[derive(Clone, Debug, Default)]
pub struct PlaceIndex {
    places: Vec<(usize, PlaceDescriptor)>,
}

/// A stored view that looks like the one searched for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaceCandidate {
    /// The number it was stored with.
    pub id: usize,
    /// Correlation, at most 1.
    pub similarity: f32,
    /// A guess of the motion between the views, right within a few degrees: a rotation, no translation.
    pub stored_from_query: RigidTransform,
}

impl PlaceIndex {
    /// Number of stored views.
    #[must_use]
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether nothing is stored.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Stores a view under a number.
    pub fn push(&mut self, id: usize, descriptor: PlaceDescriptor) {
        self.places.push((id, descriptor));
    }

    /// Forgets the views whose number is not kept.
    pub fn retain(&mut self, is_kept: impl Fn(usize) -> bool) {
        self.places.retain(|(id, _)| is_kept(*id));
    }

    /// The views that look most like `query`, best first: at most `most` of those whose similarity is at least
    /// `min_similarity` (-1 to 1) and whose number is eligible. Of equal similarity, the lower number comes first.
    #[must_use]
    pub fn candidates(
        &self,
        query: &PlaceDescriptor,
        most: usize,
        min_similarity: f32,
        is_eligible: impl Fn(usize) -> bool,
    ) -> Vec<PlaceCandidate> {
        let compared = self.places.iter().filter(|(id, _)| is_eligible(*id)).map(|(id, stored)| {
            let (similarity, stored_from_query) = query.compare(stored);
            PlaceCandidate { id: *id, similarity, stored_from_query }
        });
        let mut found: Vec<_> = compared.filter(|candidate| candidate.similarity >= min_similarity).collect();
        found.sort_by(|a, b| b.similarity.total_cmp(&a.similarity).then(a.id.cmp(&b.id)));
        found.truncate(most);
        found
    }
}
