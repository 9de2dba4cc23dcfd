//! What the terms of the loss of a field count.

/// Weights of the terms of the loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldWeights {
    /// Of the mean absolute difference of display values.
    pub colour: f32,
    /// Of the mean squared difference of rendered and measured depth, 1/m^2.
    pub depth: f32,
    /// Of the mean squared difference of signed distances from 1 in front of the band.
    pub free_space: f32,
    /// Of the mean squared error of distances near the surface, 1/m^2.
    pub centre: f32,
    /// Of the mean squared error of distances in the rest of the band, 1/m^2.
    pub tail: f32,
}

impl Default for FieldWeights {
    /// Those of ESLAM's mapping in units of its colour weight, but for centre and tail, which are 10 and 50 times as
    /// strong: colours then find their surface much sooner.
    fn default() -> Self {
        Self { colour: 1.0, depth: 0.02, free_space: 1.0, centre: 400.0, tail: 100.0 }
    }
}
