//! Where the light of an ideal pinhole image lies in a distorted one.
//!
//! The map is computed once per camera; every frame then only gathers ([`super::remap_bilinear`]). All memory is the
//! caller's.

use crate::geometry::{Distortion, PinholeCamera};

/// Column and row, in pixels of the captured image, whose light belongs to one ideal pixel; [`NO_SOURCE`] or
/// any other position outside `[0, width - 1] x [0, height - 1]` where the captured image has none.
///
/// Single precision: 1/16384 of a pixel or better for images up to 1024 columns.
pub type SourcePosition = [f32; 2];

/// The source position of an ideal pixel that the captured image does not show.
pub const NO_SOURCE: SourcePosition = [-1.0, -1.0];

/// Steps along the squared radius in the search for the point where the lens model folds back.
const FOLD_SEARCH_STEPS: usize = 256;

/// A buffer does not hold exactly the number of elements that the image size asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferSizeError {
    /// Elements that the image size asks for.
    pub expected: usize,
    /// Elements of the buffer.
    pub found: usize,
}

impl core::fmt::Display for BufferSizeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "buffer of {} elements, expected {}", self.found, self.expected)
    }
}

impl core::error::Error for BufferSizeError {}

/// Fills `map` (row-major, one entry per pixel of `ideal`) with the position of each ideal pixel in the image
/// that `captured` took through a lens with `distortion`.
///
/// The two cameras may differ in size and intrinsics: the same map then also rescales. Beyond the radius where
/// the radial polynomial stops growing the model would show the same pixels again, so there is no source there.
///
/// # Errors
///
/// [`BufferSizeError`] if `map` does not hold `ideal.width * ideal.height` entries.
pub fn fill_source_map(
    ideal: &PinholeCamera,
    captured: &PinholeCamera,
    distortion: &Distortion,
    map: &mut [SourcePosition],
) -> Result<(), BufferSizeError> {
    check_len(map.len(), ideal.width * ideal.height)?;
    let r2_limit = monotone_radius_squared(distortion, largest_radius_squared(ideal));
    for (index, source) in map.iter_mut().enumerate() {
        let ray = ideal.ray((index % ideal.width) as f64, (index / ideal.width) as f64);
        if ray.x * ray.x + ray.y * ray.y > r2_limit {
            *source = NO_SOURCE;
            continue;
        }
        let (x, y) = distortion.distort(ray.x, ray.y);
        let u = captured.fx * x + captured.cx;
        let v = captured.fy * y + captured.cy;
        let inside = |p: f64, n: usize| p >= 0.0 && p + 1.0 <= n as f64;
        let seen = inside(u, captured.width) && inside(v, captured.height);
        *source = if seen { [u as f32, v as f32] } else { NO_SOURCE };
    }
    Ok(())
}

/// A rectangle of whole pixels; the right and bottom ends are not part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRectangle {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// One past the last column.
    pub right: usize,
    /// One past the last row.
    pub bottom: usize,
}

impl PixelRectangle {
    /// The pixels of pyramid level `level` that lie wholly in the rectangle.
    #[must_use]
    pub fn at_level(&self, level: usize) -> Self {
        let block = 1usize << level;
        Self {
            left: self.left.div_ceil(block),
            top: self.top.div_ceil(block),
            right: self.right / block,
            bottom: self.bottom / block,
        }
    }

    /// The rectangle without a border of `margin` pixels; empty if nothing is left.
    #[must_use]
    pub fn shrunk(&self, margin: usize) -> Self {
        let (left, top) = (self.left + margin, self.top + margin);
        Self {
            left,
            top,
            right: self.right.saturating_sub(margin).max(left),
            bottom: self.bottom.saturating_sub(margin).max(top),
        }
    }

    /// Whether pixel `(u, v)` lies in the rectangle.
    #[must_use]
    #[inline]
    pub fn contains(&self, u: i32, v: i32) -> bool {
        u >= self.left as i32 && v >= self.top as i32 && u < self.right as i32 && v < self.bottom as i32
    }
}

/// A large rectangle of `map` (row-major, `width` columns) in which every pixel has a source: outside it black
/// corners of the undistorted image would be taken for edges.
///
/// Found by cutting, again and again, the side with the largest share of pixels without source. Empty
/// (`left == right` or `top == bottom`) if nothing is left.
#[must_use]
pub fn region_with_source(map: &[SourcePosition], width: usize) -> PixelRectangle {
    let height = map.len().checked_div(width).unwrap_or(0);
    let mut region = PixelRectangle { left: 0, top: 0, right: width, bottom: height };
    let missing = |column: usize, row: usize| usize::from(map[row * width + column][0] < 0.0);
    while region.left < region.right && region.top < region.bottom {
        let PixelRectangle { left, top, right, bottom } = region;
        let row_share =
            |row| (left..right).map(|c| missing(c, row)).sum::<usize>() as f64 / (right - left) as f64;
        let column_share =
            |column| (top..bottom).map(|r| missing(column, r)).sum::<usize>() as f64 / (bottom - top) as f64;
        let shares = [column_share(left), row_share(top), column_share(right - 1), row_share(bottom - 1)];
        let worst = shares.iter().copied().fold(0.0, f64::max);
        if worst == 0.0 {
            break;
        }
        match shares.iter().position(|s| *s == worst) {
            Some(0) => region.left += 1,
            Some(1) => region.top += 1,
            Some(2) => region.right -= 1,
            _ => region.bottom -= 1,
        }
    }
    region
}

/// Whether a buffer has the number of elements that it should have.
pub(super) fn check_len(found: usize, expected: usize) -> Result<(), BufferSizeError> {
    if found == expected { Ok(()) } else { Err(BufferSizeError { expected, found }) }
}

/// Squared radius, at unit depth, of the image corner farthest from the optical axis.
fn largest_radius_squared(camera: &PinholeCamera) -> f64 {
    let (right, bottom) = (camera.width as f64 - 1.0, camera.height as f64 - 1.0);
    [(0.0, 0.0), (right, 0.0), (0.0, bottom), (right, bottom)]
        .into_iter()
        .map(|(u, v)| {
            let ray = camera.ray(u, v);
            ray.x * ray.x + ray.y * ray.y
        })
        .fold(0.0, f64::max)
}

/// The largest squared radius up to `r2_max` below which `r (1 + k1 r^2 + k2 r^4 + k3 r^6)` grows with r.
fn monotone_radius_squared(distortion: &Distortion, r2_max: f64) -> f64 {
    let slope =
        |r2: f64| 1.0 + r2 * (3.0 * distortion.k1 + r2 * (5.0 * distortion.k2 + r2 * 7.0 * distortion.k3));
    let step = r2_max / FOLD_SEARCH_STEPS as f64;
    (1..=FOLD_SEARCH_STEPS)
        .map(|k| k as f64 * step)
        .find(|r2| slope(*r2) <= 0.0)
        .map_or(f64::INFINITY, |r2| r2 - step)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: PinholeCamera = PinholeCamera {
        width: 640,
        height: 480,
        fx: 517.306408,
        fy: 516.469215,
        cx: 318.643040,
        cy: 255.313989,
    };
    const LENS: Distortion =
        Distortion { k1: 0.262383, k2: -0.953104, p1: -0.005358, p2: 0.002628, k3: 1.163314 };
    const PIXELS: usize = CAMERA.width * CAMERA.height;

    fn lens_map() -> std::vec::Vec<SourcePosition> {
        let mut map = std::vec![[0.0; 2]; PIXELS];
        fill_source_map(&CAMERA, &CAMERA, &LENS, &mut map).unwrap();
        map
    }

    /// The ideal pixel of a position in the captured image, by iterating the lens equation.
    fn undistorted([u, v]: SourcePosition) -> [f64; 2] {
        let (xd, yd) = ((f64::from(u) - CAMERA.cx) / CAMERA.fx, (f64::from(v) - CAMERA.cy) / CAMERA.fy);
        let (mut x, mut y) = (xd, yd);
        for _ in 0..200 {
            let (xs, ys) = LENS.distort(x, y);
            (x, y) = (x + 0.7 * (xd - xs), y + 0.7 * (yd - ys));
        }
        [CAMERA.fx * x + CAMERA.cx, CAMERA.fy * y + CAMERA.cy]
    }

    #[test]
    fn map_agrees_with_the_lens_model_written_out() {
        let map = lens_map();
        for (column, row) in [(30, 40), (320, 240), (600, 100), (50, 420), (500, 450)] {
            let x = (column as f64 - 318.643040) / 517.306408;
            let y = (row as f64 - 255.313989) / 516.469215;
            let r2 = x.powi(2) + y.powi(2);
            let radial = 1.0 + 0.262383 * r2 - 0.953104 * r2.powi(2) + 1.163314 * r2.powi(3);
            let xd = x * radial - 2.0 * 0.005358 * x * y + 0.002628 * (r2 + 2.0 * x.powi(2));
            let yd = y * radial - 0.005358 * (r2 + 2.0 * y.powi(2)) + 2.0 * 0.002628 * x * y;
            let [u, v] = map[row * CAMERA.width + column];
            assert!((f64::from(u) - (xd * 517.306408 + 318.643040)).abs() < 1e-4, "column {column}");
            assert!((f64::from(v) - (yd * 516.469215 + 255.313989)).abs() < 1e-4, "row {row}");
        }
    }

    #[test]
    fn map_and_iterated_inverse_return_to_the_ideal_pixel() {
        let map = lens_map();
        let mut checked = 0;
        for index in (0..PIXELS).step_by(997).filter(|index| map[*index] != NO_SOURCE) {
            let [u, v] = undistorted(map[index]);
            assert!((u - (index % CAMERA.width) as f64).abs() < 1e-3, "pixel {index}: {u}");
            assert!((v - (index / CAMERA.width) as f64).abs() < 1e-3, "pixel {index}: {v}");
            checked += 1;
        }
        assert!(checked > 250, "{checked}");
    }

    #[test]
    fn region_holds_no_pixel_without_source_and_most_of_the_image() {
        let map = lens_map();
        let PixelRectangle { left, top, right, bottom } = region_with_source(&map, CAMERA.width);
        assert!((top..bottom).all(|row| (left..right).all(|c| map[row * CAMERA.width + c] != NO_SOURCE)));
        assert!((right - left) * (bottom - top) > PIXELS * 88 / 100);
        assert!(map[0] == NO_SOURCE, "the corner of this lens is outside the captured image");
    }

    #[test]
    fn region_cuts_the_worst_side_first() {
        let (o, x) = ([1.0, 1.0], NO_SOURCE);
        // All of the first row is missing; then one pixel of three in the first column against one of five in
        // the last row.
        let map = [x, x, x, x, x, o, o, o, o, o, o, o, o, o, o, x, o, o, o, o];
        let expected = PixelRectangle { left: 1, top: 1, right: 5, bottom: 4 };
        assert_eq!(region_with_source(&map, 5), expected);
        assert_eq!(region_with_source(&[], 0), PixelRectangle { left: 0, top: 0, right: 0, bottom: 0 });
        let nothing = region_with_source(&[x; 4], 2);
        assert!(nothing.left == nothing.right || nothing.top == nothing.bottom);
    }

    #[test]
    fn another_camera_rescales() {
        let captured = CAMERA;
        let ideal = CAMERA.at_level(1);
        let mut map = std::vec![[0.0; 2]; ideal.width * ideal.height];
        fill_source_map(&ideal, &captured, &Distortion::default(), &mut map).unwrap();
        // The centre of a coarse pixel lies between two fine ones.
        let [u, v] = map[100 * ideal.width + 7];
        assert!((u - 14.5).abs() < 1e-4 && (v - 200.5).abs() < 1e-4, "{u} {v}");
    }

    #[test]
    fn beyond_the_fold_of_the_lens_there_is_no_source() {
        // r (1 - 0.4 r^2) stops growing at r^2 = 1/1.2.
        let lens = Distortion { k1: -0.4, ..Distortion::default() };
        let camera = PinholeCamera { width: 201, height: 1, fx: 50.0, fy: 50.0, cx: 100.0, cy: 0.0 };
        let mut map = [[0.0; 2]; 201];
        fill_source_map(&camera, &camera, &lens, &mut map).unwrap();
        assert!(map[100 + 45] != NO_SOURCE, "r = 0.90");
        assert!(map[100 + 47] == NO_SOURCE, "r = 0.94");
    }

    #[test]
    fn wrong_buffers_are_errors() {
        let error = fill_source_map(&CAMERA, &CAMERA, &LENS, &mut [[0.0; 2]; 3]).unwrap_err();
        assert_eq!(error, BufferSizeError { expected: 307_200, found: 3 });
    }
}
