//! A picture and a rendering of it that is nearly right, 640x480.

use mba_mapper::losses::Ssim;
use mba_tracker::simd::Level;

const SIZE: [usize; 2] = [640, 480];

/// Two images and room for the gradient.
pub struct SsimInput {
    ssim: Ssim,
    reference: [Vec<f32>; 3],
    estimate: [Vec<f32>; 3],
    gradient: [Vec<f32>; 3],
}

impl SsimInput {
    /// Waves of several lengths; the estimate is shifted by half a pixel.
    #[must_use]
    pub fn new(level: Level) -> Self {
        let value = |k: usize, channel: usize, shift: f32| {
            let (x, y) = ((k % SIZE[0]) as f32 + shift, (k / SIZE[0]) as f32);
            let waves = (0.9 * x).sin() * (0.4 * y).cos() + (0.02 * x * y + channel as f32).sin();
            0.5 + 0.25 * waves
        };
        let image = |shift: f32| {
            [0, 1, 2].map(|channel| (0..SIZE[0] * SIZE[1]).map(|k| value(k, channel, shift)).collect())
        };
        let gradient = [(); 3].map(|()| vec![0.0; SIZE[0] * SIZE[1]]);
        Self { ssim: Ssim::new(level), reference: image(0.0), estimate: image(0.5), gradient }
    }

    /// Similarity and gradient.
    pub fn run(&mut self) -> f64 {
        let [reference, estimate] =
            [&self.reference, &self.estimate].map(|image| image.each_ref().map(Vec::as_slice));
        let [red, green, blue] = self.gradient.each_mut().map(Vec::as_mut_slice);
        self.ssim.add_gradient(SIZE, reference, estimate, 1.0, [red, green, blue])
    }
}
