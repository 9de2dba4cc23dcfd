//! Settings of an alignment, with the reason for each default.

/// Settings of an alignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignSettings {
    /// Whether the motion during the exposure is modelled; otherwise every frame is one sharp view.
    pub blur: bool,
    /// Whether the depth term takes part.
    pub depth_term: bool,
    /// Distance between neighbouring virtual views along the longest blur, pixels of the level. Below 2 px the
    /// sampled mean follows the integral to well under the noise.
    pub view_spacing: f32,
    /// Upper bound of virtual views per exposure.
    pub max_views: usize,
    /// Linearisations per pyramid level, at the most.
    pub max_iterations: usize,
    /// Huber threshold in robust standard deviations.
    pub huber: f32,
    /// Pixels of a patch that count as one independent measurement: model errors are shared by neighbours.
    pub photometric_correlation: f64,
    /// Depth blocks that count as one independent measurement: sensor noise is smooth over several pixels.
    pub depth_correlation: f64,
    /// Least standard deviation of inverse depth, 1/m: the rounding of the depth map.
    pub min_depth_sigma: f32,
    /// Variance of intensity at zero light divided by that per unit of light.
    pub dark_intensity: f32,
    /// Standard deviation of the gain between a frame and its reference.
    pub gain_sigma: f64,
    /// Standard deviation of the offset, linear light.
    pub offset_sigma: f64,
    /// A patch is dropped when its mean cost exceeds this multiple of the median over patches.
    pub outlier_factor: f32,
    /// Iterations stop when a step moves the image by less than this many pixels of the level; coarse levels may
    /// stop earlier.
    pub min_step: f64,
}

impl Default for AlignSettings {
    fn default() -> Self {
        Self {
            blur: true,
            depth_term: true,
            view_spacing: 1.75,
            max_views: crate::transfer::MAX_VIRTUAL_VIEWS,
            max_iterations: 8,
            huber: 1.345,
            photometric_correlation: 8.0,
            depth_correlation: 20.0,
            min_depth_sigma: 3e-5,
            dark_intensity: 0.02,
            gain_sigma: 0.05,
            offset_sigma: 0.005,
            outlier_factor: 6.0,
            min_step: 0.03,
        }
    }
}
