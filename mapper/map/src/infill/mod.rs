//! Values for pixels that have none, from those around them (push-pull, Gortler et al. 1996).

/// A plane of values, each with a weight in `[0, 1]`.
#[derive(Clone, Debug, Default)]
struct Weighted {
    width: usize,
    height: usize,
    /// Weighted values: zero where the weight is.
    values: Vec<f32>,
    weights: Vec<f32>,
}

/// Completes a plane of `width` columns: each value counts with its weight in `[0, 1]`, the rest comes from the
/// neighbourhood, as far away as it has to. Where no pixel has a weight, all become zero.
///
/// Values and weights are row by row and of the same length, a multiple of `width`; else nothing happens.
pub fn fill(width: usize, values: &mut [f32], weights: &[f32]) {
    if width == 0 || values.len() != weights.len() || !values.len().is_multiple_of(width) {
        return;
    }
    let height = values.len() / width;
    let weighted = values.iter().zip(weights).map(|(v, w)| if *w > 0.0 { v * w } else { 0.0 }).collect();
    let full = Weighted { width, height, values: weighted, weights: weights.to_vec() };
    let mut levels = vec![full];
    while let Some(last) = levels.last()
        && (last.width > 1 || last.height > 1)
    {
        let coarser = last.halved();
        levels.push(coarser);
    }
    let mut filled: Vec<f32> = Vec::new();
    let mut filled_width = 1;
    for level in levels.iter().rev() {
        filled = level.completed(&filled, filled_width);
        filled_width = level.width;
    }
    values.copy_from_slice(&filled);
}

impl Weighted {
    /// Half the size; a weight says how much is known in a block, up to all of it.
    fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut coarse =
            Self { width, height, values: vec![0.0; width * height], weights: vec![0.0; width * height] };
        for y in 0..self.height {
            for x in 0..self.width {
                let (from, to) = (y * self.width + x, y / 2 * width + x / 2);
                coarse.values[to] += self.values[from];
                coarse.weights[to] += self.weights[from];
            }
        }
        for (value, weight) in coarse.values.iter_mut().zip(&mut coarse.weights) {
            let excess = weight.max(1.0);
            *value /= excess;
            *weight /= excess;
        }
        coarse
    }

    /// The values, completed by the coarser level.
    fn completed(&self, coarser: &[f32], coarser_width: usize) -> Vec<f32> {
        let pixels = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        let complete = |((x, y), (value, weight)): ((usize, usize), (&f32, &f32))| {
            let behind = interpolated(coarser, coarser_width, x, y);
            value + (1.0 - weight) * behind
        };
        pixels.zip(self.values.iter().zip(&self.weights)).map(complete).collect()
    }
}

/// Bilinear value of the coarser level at pixel (x, y) of the finer one; zero without a coarser level.
fn interpolated(coarser: &[f32], width: usize, x: usize, y: usize) -> f32 {
    if coarser.is_empty() {
        return 0.0;
    }
    let height = coarser.len() / width;
    // The centre of coarse pixel u lies at 2u + 1/2: a quarter of the way to one neighbour.
    let along = |x: usize, size: usize| {
        let near = x / 2;
        let far = if x.is_multiple_of(2) { near.saturating_sub(1) } else { (near + 1).min(size - 1) };
        (near, far)
    };
    let ((x0, x1), (y0, y1)) = (along(x, width), along(y, height));
    let at = |x: usize, y: usize| coarser[y * width + x];
    0.75 * (0.75 * at(x0, y0) + 0.25 * at(x1, y0)) + 0.25 * (0.75 * at(x0, y1) + 0.25 * at(x1, y1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values_stay_and_a_constant_fills_everything() {
        let mut values = vec![0.0; 35];
        let mut weights = vec![0.0; 35];
        for pixel in [3, 20, 34] {
            (values[pixel], weights[pixel]) = (0.7, 1.0);
        }
        fill(7, &mut values, &weights);
        assert!(values.iter().all(|value| (value - 0.7).abs() < 1e-6), "{values:?}");
    }

    #[test]
    fn a_hole_lies_between_its_borders() {
        let (mut values, mut weights) = (vec![0.0; 64], vec![1.0; 64]);
        for x in 0..64 {
            values[x] = if x < 24 { 1.0 } else { 3.0 };
            if (20..28).contains(&x) {
                (values[x], weights[x]) = (f32::NAN, 0.0);
            }
        }
        fill(64, &mut values, &weights);
        assert_eq!((values[19], values[28]), (1.0, 3.0));
        assert!(values[20..28].iter().all(|value| (1.0..=3.0).contains(value)));
        assert!(values[21] < 1.7 && values[26] > 2.3, "{:?}", &values[20..28]);
    }

    #[test]
    fn nothing_known_is_zero_and_odd_lengths_are_left_alone() {
        let mut values = [5.0; 6];
        fill(3, &mut values, &[0.0; 6]);
        assert_eq!(values, [0.0; 6]);
        let mut values = [5.0; 5];
        fill(3, &mut values, &[0.0; 5]);
        assert_eq!(values, [5.0; 5]);
    }
}
