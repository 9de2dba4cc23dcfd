//! Which virtual views the rays of a pixel belong to.

use mba_tracker::trajectory::SampleRule;

use mba_raster::exposure::RowTimes;

/// Most bands of rows with views of their own: within one, rows count as exposed together.
const BANDS: usize = 64;

/// How the rays of a pixel follow from its row: rays of light in all views of its band, and one along which depth is
/// compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RayViews {
    /// Rays of a pixel.
    pub(super) per_pixel: usize,
    /// Those of light come first.
    pub(super) of_light: usize,
    /// The ray along which depth is compared.
    pub(super) of_depth: usize,
    bands: usize,
    height: usize,
}

impl RayViews {
    /// `views` rays of light per pixel, an even number of them one more.
    ///
    /// If all rows are exposed together with depth, depth is compared along the ray in the middle; else it has a ray of
    /// its own.
    pub(super) fn new(times: &RowTimes, views: usize, height: usize) -> Self {
        let views = views | 1;
        if times.is_global() {
            return Self { per_pixel: views, of_light: views, of_depth: views / 2, bands: 1, height };
        }
        let rolls = times.readout != 0.0 || times.depth_readout != 0.0;
        let bands = if rolls { BANDS.min(height).max(1) } else { 1 };
        Self { per_pixel: views + 1, of_light: views, of_depth: views, bands, height }
    }

    /// Path times of all views, band by band.
    pub(super) fn times(&self, times: &RowTimes) -> Vec<f64> {
        let middle = |band: usize| (band as f64 + 0.5) * self.height as f64 / self.bands as f64 - 0.5;
        let of_band = |band: usize| {
            let v = middle(band);
            let light = (0..self.of_light).map(move |k| SampleRule::Midpoint.time(k, self.of_light));
            let light = light.map(move |s| times.view_time(s, v, self.height));
            light.chain((self.of_depth == self.of_light).then(|| times.depth_time(v, self.height)))
        };
        (0..self.bands).flat_map(of_band).collect()
    }

    /// The first of the views of the pixels in row `v`.
    pub(super) fn first(&self, v: usize) -> usize {
        v * self.bands / self.height.max(1) * self.per_pixel
    }

    /// The view of depth of the band of a view.
    pub(super) fn depth_of(&self, view: usize) -> usize {
        view - view % self.per_pixel + self.of_depth
    }
}
