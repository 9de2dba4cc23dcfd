//! Lenses that are described by another model than that of OpenCV's five coefficients.

use mba_tracker::geometry::{Distortion, PinholeCamera};
use nalgebra::{Matrix5, Vector5};

/// Points along each side of an image from which a lens is fitted.
const GRID: usize = 33;

/// Largest error of a fitted lens, pixels.
const LARGEST_ERROR: f64 = 0.5;

/// The lens of a camera, by the name that ROS and RealSense have for its model and its coefficients.
///
/// `plumb_bob` is the model of mba. Rational polynomials and RealSense's inverse model are fitted by it, least squares over
/// the image; returns also the largest error of that in pixels, 0 where there is none.
///
/// # Errors
/// Why the lens cannot be described.
pub(crate) fn distortion(
    model: &str,
    coefficients: &[f64],
    camera: &PinholeCamera,
) -> Result<(Distortion, f64), String> {
    if coefficients.iter().any(|k| !k.is_finite()) {
        return Err("coefficients of the lens are no numbers".to_owned());
    }
    let at = |index: usize| coefficients.get(index).copied().unwrap_or(0.0);
    let first = Distortion { k1: at(0), k2: at(1), p1: at(2), p2: at(3), k3: at(4) };
    let name = model.to_lowercase().replace([' ', '_'], "");
    let rest = coefficients.get(5..).unwrap_or_default();
    if rest.iter().chain(coefficients).all(|k| *k == 0.0) {
        return Ok((Distortion::default(), 0.0));
    }
    let fitted = match name.as_str() {
        "plumbbob" | "brownconrady" | "" | "none" => return Ok((first, 0.0)),
        "rationalpolynomial" if rest.iter().all(|k| *k == 0.0) => return Ok((first, 0.0)),
        "rationalpolynomial" if rest.len() <= 3 || rest[3..].iter().all(|k| *k == 0.0) => {
            let [k4, k5, k6] = [at(5), at(6), at(7)];
            fit(camera, |x, y| {
                let r2 = x * x + y * y;
                let (dx, dy) = first.distort(x, y);
                // The tangential part is not divided.
                let numerator = 1.0 + r2 * (first.k1 + r2 * (first.k2 + r2 * first.k3));
                let change = numerator / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))) - numerator;
                ([x, y], [dx + x * change, dy + y * change])
            })
        }
        // It takes distorted points to ideal ones.
        "inversebrownconrady" => fit(camera, |x, y| {
            let (ideal_x, ideal_y) = first.distort(x, y);
            ([ideal_x, ideal_y], [x, y])
        }),
        _ => return Err(format!("the lens is described by the model {model}, which is not read")),
    };
    match fitted {
        Some((lens, error)) if error <= LARGEST_ERROR => Ok((lens, error)),
        _ => Err(format!("the lens of the model {model} is too far from one of five coefficients")),
    }
}

/// The lens that takes the first of each pair of points, at unit depth, to the second; with its largest error in pixels.
/// `pair` gets points all over the image.
fn fit(camera: &PinholeCamera, pair: impl Fn(f64, f64) -> ([f64; 2], [f64; 2])) -> Option<(Distortion, f64)> {
    let along = |index: usize, side: usize| index as f64 * (side as f64 - 1.0) / (GRID - 1) as f64;
    let pairs: Vec<_> = (0..GRID * GRID)
        .map(|index| {
            let ray = camera.ray(along(index % GRID, camera.width), along(index / GRID, camera.height));
            pair(ray.x, ray.y)
        })
        .collect();
    // The displacement is linear in the coefficients.
    let (mut normal, mut right) = (Matrix5::zeros(), Vector5::zeros());
    for ([x, y], [to_x, to_y]) in &pairs {
        let r2 = x * x + y * y;
        for (row, moved) in [
            (Vector5::new(x * r2, x * r2 * r2, 2.0 * x * y, r2 + 2.0 * x * x, x * r2 * r2 * r2), to_x - x),
            (Vector5::new(y * r2, y * r2 * r2, r2 + 2.0 * y * y, 2.0 * x * y, y * r2 * r2 * r2), to_y - y),
        ] {
            normal += row * row.transpose();
            right += row * moved;
        }
    }
    let solution = normal.lu().solve(&right)?;
    let [k1, k2, p1, p2, k3] = solution.into();
    let lens = Distortion { k1, k2, p1, p2, k3 };
    let error = |([x, y], [to_x, to_y]): &([f64; 2], [f64; 2])| {
        let (found_x, found_y) = lens.distort(*x, *y);
        (camera.fx * (found_x - to_x)).hypot(camera.fy * (found_y - to_y))
    };
    let largest = pairs.iter().map(error).fold(0.0, f64::max);
    largest.is_finite().then_some((lens, largest))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: PinholeCamera =
        PinholeCamera { width: 640, height: 480, fx: 610.0, fy: 611.0, cx: 322.0, cy: 243.0 };

    #[test]
    fn the_inverse_model_is_turned_round() {
        let coefficients = [-0.055, 0.068, -0.0003, 0.0006, -0.021];
        let (lens, error) = distortion("Inverse Brown Conrady", &coefficients, &CAMERA).unwrap();
        assert!(error < 0.02, "{error}");
        // Through both models a point comes back.
        let [k1, k2, p1, p2, k3] = coefficients;
        let (x, y) = (Distortion { k1, k2, p1, p2, k3 }).distort(0.4, -0.3);
        let (x, y) = lens.distort(x, y);
        assert!((x - 0.4).abs() < 3e-5 && (y + 0.3).abs() < 3e-5, "{x} {y}");
    }

    #[test]
    fn a_rational_polynomial_is_fitted_or_refused() {
        // Of an Azure Kinect: numerator and denominator nearly cancel.
        let azure = [0.519, -2.73, 0.0008, -0.0001, 1.60, 0.395, -2.55, 1.53];
        let (lens, error) = distortion("rational_polynomial", &azure, &CAMERA).unwrap();
        assert!(error < 0.1, "{error}");
        // 0.3 from the centre: 1 + 0.519 * 0.09 - 2.73 * 0.0081 + 1.60 * 0.000729, and so on.
        let ratio = (1.0 + 0.046_71 - 0.022_113 + 0.001_166_4) / (1.0 + 0.035_55 - 0.020_655 + 0.001_115_37);
        let (x, _) = lens.distort(0.3, 0.0);
        let tangential = -0.0001 * 3.0 * 0.09;
        assert!((x - 0.3 * ratio - tangential).abs() < 1e-4, "{x}");
        let message = distortion("equidistant", &[0.1], &CAMERA).unwrap_err();
        assert_eq!(message, "the lens is described by the model equidistant, which is not read");
        assert_eq!(distortion("equidistant", &[0.0; 4], &CAMERA), Ok((Distortion::default(), 0.0)));
    }
}
