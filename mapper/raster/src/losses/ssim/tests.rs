use mba_tracker::simd::{Level, level_name, levels_up_to};

use super::Ssim;
use super::definition::mean_ssim;

type Planes<T> = [Vec<T>; 3];

/// Two images that are alike in places, with flat, bright and dark parts.
fn images([width, height]: [usize; 2]) -> [Planes<f32>; 2] {
    let value = |channel: usize, k: usize, shift: f64| {
        let (x, y, c) = ((k % width) as f64, (k / width) as f64, channel as f64);
        let wave = (0.31 * x + 0.7 * c + shift).sin() * (0.23 * y - 0.4 * c).cos();
        let grain = ((12.9898 * x + 78.233 * y + 3.7 * c + 40.0 * shift).sin() * 43_758.545_3).fract();
        (0.5 + 0.6 * wave + 0.1 * grain * shift.signum()).clamp(0.0, 1.0) as f32
    };
    let image =
        |shift: f64| [0, 1, 2].map(|channel| (0..width * height).map(|k| value(channel, k, shift)).collect());
    [image(0.0), image(0.4)]
}

fn slices(planes: &Planes<f32>) -> [&[f32]; 3] {
    planes.each_ref().map(Vec::as_slice)
}

fn zeros(size: [usize; 2]) -> Planes<f32> {
    [(); 3].map(|()| vec![0.0; size[0] * size[1]])
}

fn with_gradient(
    ssim: &mut Ssim,
    size: [usize; 2],
    [reference, estimate]: &[Planes<f32>; 2],
) -> (f64, Planes<f32>) {
    let mut gradient = zeros(size);
    let [red, green, blue] = gradient.each_mut().map(Vec::as_mut_slice);
    let value = ssim.add_gradient(size, slices(reference), slices(estimate), 1.0, [red, green, blue]);
    (value, gradient)
}

fn in_doubles(planes: &Planes<f32>) -> Planes<f64> {
    planes.each_ref().map(|plane| plane.iter().map(|&value| f64::from(value)).collect())
}

fn levels() -> impl Iterator<Item = Level> {
    levels_up_to(Level::new()).into_iter()
}

#[test]
fn the_value_is_that_of_double_precision() {
    // Widths around multiples of the vector, one to three bands, and the smallest image there is.
    for size in [[11, 11], [16, 90], [83, 24], [90, 161], [31, 85]] {
        let images = images(size);
        let [reference, estimate] = images.each_ref().map(in_doubles);
        let expected: f64 =
            reference.iter().zip(&estimate).map(|(a, b)| mean_ssim(size, a, b, 1.0)).sum::<f64>() / 3.0;
        assert!(expected < 0.95, "the images are too much alike to tell: {expected}");
        for level in levels() {
            let (value, _) = with_gradient(&mut Ssim::new(level), size, &images);
            assert!((value - expected).abs() < 2e-6, "{size:?} {}: {value}, {expected}", level_name(level));
        }
    }
}

#[test]
fn the_gradient_is_that_of_finite_differences() {
    const STEP: f64 = 1e-5;
    for size in [[19, 17], [11, 94]] {
        let images = images(size);
        let [reference, estimate] = images.each_ref().map(in_doubles);
        let results: Vec<_> =
            levels().map(|level| with_gradient(&mut Ssim::new(level), size, &images)).collect();
        let mut largest: f64 = 0.0;
        for channel in 0..3 {
            let mut moved = estimate[channel].clone();
            let mut value_at = |pixel: usize, value: f64| {
                let old = core::mem::replace(&mut moved[pixel], value);
                let similarity = mean_ssim(size, &reference[channel], &moved, 1.0) / 3.0;
                moved[pixel] = old;
                similarity
            };
            for (pixel, &value) in estimate[channel].iter().enumerate() {
                let difference = value_at(pixel, value + STEP) - value_at(pixel, value - STEP);
                let expected = difference / (2.0 * STEP);
                largest = largest.max(expected.abs());
                for (_, gradient) in &results {
                    let found = f64::from(gradient[channel][pixel]);
                    assert!(
                        (found - expected).abs() < 3e-6,
                        "{size:?} {channel} {pixel}: {found}, {expected}"
                    );
                }
            }
        }
        assert!(largest > 3e-3, "the gradient is too small to tell: {largest}");
    }
}

#[test]
fn the_number_of_threads_and_earlier_images_do_not_matter() {
    let size = [101, 250];
    let images = images(size);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| with_gradient(&mut Ssim::new(Level::new()), size, &images))
    };
    let one = with(1);
    assert!(one == with(2) && one == with(5));
    let mut used = Ssim::new(Level::new());
    for other in [[203, 170], [40, 300], [12, 11]] {
        with_gradient(&mut used, other, &self::images(other));
    }
    assert!(one == with_gradient(&mut used, size, &images));
}

#[test]
fn the_gradient_is_weighted_and_added() {
    let size = [24, 24];
    let [reference, estimate] = images(size);
    let mut ssim = Ssim::new(Level::new());
    let (_, once) = with_gradient(&mut ssim, size, &[reference.clone(), estimate.clone()]);
    let mut twice = once.clone();
    let [red, green, blue] = twice.each_mut().map(Vec::as_mut_slice);
    ssim.add_gradient(size, slices(&reference), slices(&estimate), -2.0, [red, green, blue]);
    for (once, sum) in once.iter().flatten().zip(twice.iter().flatten()) {
        assert!((sum + once).abs() <= 1e-6 * once.abs(), "{once} {sum}");
    }
}

#[test]
fn equal_images_are_at_the_maximum() {
    let size = [40, 30];
    let [image, _] = images(size);
    let (value, gradient) = with_gradient(&mut Ssim::new(Level::new()), size, &[image.clone(), image]);
    assert!((value - 1.0).abs() < 1e-6, "{value}");
    let largest = gradient.iter().flatten().fold(0.0, |largest: f32, value: &f32| largest.max(value.abs()));
    assert!(largest < 1e-6, "{largest}");
}

#[test]
fn an_image_without_a_window_has_no_gradient() {
    let mut ssim = Ssim::new(Level::new());
    for size in [[10, 60], [60, 10], [0, 0]] {
        assert_eq!(with_gradient(&mut ssim, size, &images(size)), (1.0, zeros(size)));
    }
}

#[test]
#[should_panic(expected = "a plane of 400 values is no image of 20 x 21 pixels")]
fn planes_of_another_size_are_refused() {
    let images = images([20, 20]);
    let mut gradient = zeros([20, 20]);
    let [red, green, blue] = gradient.each_mut().map(Vec::as_mut_slice);
    let [reference, estimate] = images.each_ref().map(slices);
    Ssim::new(Level::new()).add_gradient([20, 21], reference, estimate, 1.0, [red, green, blue]);
}
