//! How many Gaussians a scene is worth: by what keyframes see of it, and how finely.

use std::collections::HashMap;

use mba_raster::sensor::Observation;
use mba_tracker::geometry::RigidTransform;

/// Edge of a cell of space, as a share of the typical depth: large beside the noise of depth, so that a surface counts in the
/// same cells from everywhere, and small beside a picture.
const CELL: f64 = 1.0 / 16.0;

/// Surface elements per Gaussian: walls need fewer, edges more. With fewer elements maps get better by tenths of a decibel, and
/// take time and memory in proportion.
const ELEMENTS_PER_GAUSSIAN: usize = 10;

/// Pixels of a picture per Gaussian at the most: what little is seen is seen often, and shows more.
const PIXELS_PER_GAUSSIAN: usize = 3;

/// Fewest Gaussians, for small pictures.
const LEAST: usize = 2000;

/// Most Gaussians that are made for a wide scene without being asked for. With the virtual views of an exposure each takes about
/// 4 kB, so they take 650 MB beside the pictures.
const MOST: usize = 160_000;

/// Counts distinct elements of surface, each as large as a pixel of the view that sees it best.
///
/// Space is divided into cells. What a view sees in a cell are its pixels there; what all views see in it is what the one sees
/// that has most pixels in it. So views of the same surface count once, nearer ones more, and what is hidden not at all.
#[derive(Debug)]
pub struct SeenSurface {
    /// Edge of a cell, metres.
    cell: f64,
    /// Pixels of the view that has most of them, by cell.
    most: HashMap<[i32; 3], usize>,
    /// Pixels of all views, and those with a depth.
    pixels: [usize; 2],
}

impl SeenSurface {
    /// Nothing seen yet, of a scene whose typical depth is so many metres.
    #[must_use]
    pub fn new(typical_depth: f64) -> Self {
        Self { cell: (CELL * typical_depth).max(f64::MIN_POSITIVE), most: HashMap::new(), pixels: [0; 2] }
    }

    /// Adds what a view sees; `shrink` is how many times as large its pixels are as those that are counted, along each axis.
    pub fn add(&mut self, seen: &Observation, world_from_camera: &RigidTransform, shrink: usize) {
        let width = seen.camera.width;
        let mut here: HashMap<[i32; 3], usize> = HashMap::new();
        for (pixel, depth) in seen.depth.iter().enumerate().filter(|(_, depth)| **depth > 0.0) {
            let ray = seen.camera.ray((pixel % width) as f64, (pixel / width) as f64);
            let point = world_from_camera.transform_point(&(ray * f64::from(*depth)));
            // Casts saturate.
            let cell = [point.x, point.y, point.z].map(|x| (x / self.cell).floor() as i32);
            *here.entry(cell).or_default() += shrink * shrink;
        }
        let measured = here.values().sum::<usize>();
        self.pixels[0] += seen.depth.len() * shrink * shrink;
        self.pixels[1] += measured;
        for (cell, pixels) in here {
            let most = self.most.entry(cell).or_default();
            *most = pixels.max(*most);
        }
    }

    /// Number of elements. Where no depth was measured there are as many to a picture as elsewhere.
    #[must_use]
    pub fn elements(&self) -> usize {
        let [all, measured] = self.pixels.map(|pixels| pixels as f64);
        let found: usize = self.most.values().sum();
        (found as f64 * all / measured.max(1.0)) as usize
    }

    /// Number of Gaussians that describe them, seen in pictures of so many pixels.
    #[must_use]
    pub fn gaussians(&self, picture: usize) -> usize {
        let by_elements = (self.elements() / ELEMENTS_PER_GAUSSIAN).min(MOST);
        by_elements.max(picture / PIXELS_PER_GAUSSIAN).max(LEAST)
    }
}

#[cfg(test)]
mod tests {
    use mba_raster::exposure::RowTimes;
    use mba_tracker::geometry::PinholeCamera;
    use mba_tracker::image::PixelRectangle;
    use nalgebra::Vector3;

    use super::*;

    /// A wall that fills the picture.
    fn wall(depth: f32) -> Observation {
        let (width, height) = (160, 120);
        Observation {
            camera: PinholeCamera { width, height, fx: 120.0, fy: 120.0, cx: 79.5, cy: 59.5 },
            colour: [const { Vec::new() }; 3],
            depth: vec![depth; width * height],
            region: PixelRectangle { left: 0, top: 0, right: width, bottom: height },
            times: RowTimes::GLOBAL,
            falloff: None,
        }
    }

    /// Elements in pictures, of views of the wall from `(x, z)`, it being at z = 2.
    fn pictures(views: &[(f64, f64)]) -> f64 {
        let mut surface = SeenSurface::new(2.0);
        for &(x, z) in views {
            let pose = RigidTransform { translation: Vector3::new(x, 0.0, z), ..RigidTransform::identity() };
            surface.add(&wall((2.0 - z + 0.01) as f32), &pose, 1);
        }
        surface.elements() as f64 / (160.0 * 120.0)
    }

    #[test]
    fn the_same_surface_counts_once_and_at_its_finest() {
        assert_eq!(pictures(&[(0.0, 0.0)]), 1.0);
        let again = pictures(&[(0.0, 0.0), (0.03, 0.0), (-0.05, 0.0), (0.0, 0.0)]);
        assert!((1.0..1.15).contains(&again), "{again}");
        // A picture is 2.67 m wide.
        let beside = pictures(&[(0.0, 0.0), (1.33, 0.0)]);
        assert!((beside - 1.5).abs() < 0.1, "{beside}");
        // From half as far, a quarter of it is seen with four times as many pixels.
        let nearer = pictures(&[(0.0, 0.0), (0.0, 1.0)]);
        assert!((nearer - 1.75).abs() < 0.15, "{nearer}");
    }

    #[test]
    fn surfaces_without_depth_count_like_others() {
        let mut seen = wall(2.0);
        seen.depth[..160 * 60].fill(0.0);
        let mut surface = SeenSurface::new(2.0);
        assert_eq!(surface.elements(), 0);
        surface.add(&seen, &RigidTransform::identity(), 1);
        assert_eq!(surface.elements(), 160 * 120);
    }

    #[test]
    fn coarser_pixels_stand_for_several_and_numbers_are_bounded() {
        let picture = 160 * 120;
        let mut surface = SeenSurface::new(2.0);
        assert_eq!((surface.gaussians(60), surface.gaussians(picture)), (LEAST, picture / 3));
        surface.add(&wall(2.0), &RigidTransform::identity(), 3);
        assert_eq!(surface.elements(), 9 * picture);
        assert_eq!((surface.gaussians(60), surface.gaussians(picture)), (9 * picture / 10, 9 * picture / 10));
        surface.add(&wall(2.0), &RigidTransform::identity(), 100);
        assert_eq!((surface.gaussians(picture), surface.gaussians(1_000_000)), (MOST, 333_333));
    }
}
