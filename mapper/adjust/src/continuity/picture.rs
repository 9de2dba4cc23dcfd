//! How well a frame at some exposure agrees with other frames: in light and in depth, blur included.
//!
//! Both pictures are blurred, each along its own path. Blurring each once more along the path of the other makes them
//! equal where the paths are right, without any sharp picture: blur along one path commutes with blur along another.

use mba_io::statistics::quantile;
use mba_raster::exposure::RowTimes;
use mba_tracker::geometry::{PinholeCamera, RigidTransform};
use mba_tracker::trajectory::{ExposureTrajectory, SampleRule};
use nalgebra::Vector3;

use super::evidence::Mismatch;

/// Virtual views of each path.
const VIEWS: usize = 13;

/// Side of the cells, in pixels, of which each gives one point: the one with the steepest light.
const CELL: usize = 6;

/// Fewest points that two frames have to share for a comparison.
const FEWEST_POINTS: usize = 40;

/// Standard deviations below which differences say nothing: of linear light, and of inverse depth in 1/m.
const LEAST_SIGMA: [f64; 2] = [0.003, 0.002];

/// Difference, in standard deviations, that costs half of the most it can.
const HALF_COST: f64 = 3.0;

/// Standard deviation of normal numbers whose absolute values have the median 1.
const SIGMA_OF_MEDIAN: f64 = 1.4826;

/// Refinements of the row in which a rolling shutter sees a point.
const ROW_STEPS: usize = 3;

/// What a frame shows, at the resolution of the comparison.
#[derive(Clone, Debug)]
pub struct FramePicture {
    /// Camera of this resolution.
    pub camera: PinholeCamera,
    /// Linear light, row by row.
    pub light: Vec<f32>,
    /// Depth in metres, row by row; 0 where missing.
    pub depth: Vec<f32>,
    /// When the rows were exposed; the path is the exposure of the middle row.
    pub times: RowTimes,
}

impl FramePicture {
    /// Light between pixels, `None` outside of the picture.
    fn light_at(&self, [u, v]: [f64; 2]) -> Option<f64> {
        let (width, height) = (self.camera.width, self.camera.height);
        let inside = u >= 0.0 && v >= 0.0 && u < (width - 1) as f64 && v < (height - 1) as f64;
        if !inside {
            return None;
        }
        let (left, top) = (u as usize, v as usize);
        let (right, down) = (u - left as f64, v - top as f64);
        let at = |column: usize, row: usize| f64::from(self.light[row * width + column]);
        let along = |row: usize| at(left, row) * (1.0 - right) + at(left + 1, row) * right;
        Some(along(top) * (1.0 - down) + along(top + 1) * down)
    }

    /// Depth of the nearest pixel, `None` outside of the picture or where it is missing.
    fn depth_at(&self, [u, v]: [f64; 2]) -> Option<f64> {
        let (column, row) = ((u + 0.5).floor(), (v + 0.5).floor());
        let inside = column >= 0.0
            && row >= 0.0
            && column < self.camera.width as f64
            && row < self.camera.height as f64;
        let depth = inside.then(|| self.depth[row as usize * self.camera.width + column as usize])?;
        (depth > 0.0).then_some(f64::from(depth))
    }

    /// The pixel with the steepest light of every cell that has a depth.
    fn points(&self) -> Vec<[usize; 2]> {
        let (width, height) = (self.camera.width, self.camera.height);
        let steepness = |[column, row]: [usize; 2]| {
            let at = row * width + column;
            let along = self.light[at + 1] - self.light[at - 1];
            let down = self.light[at + width] - self.light[at - width];
            along * along + down * down
        };
        let mut points = Vec::new();
        for top in (1..height.saturating_sub(CELL)).step_by(CELL) {
            for left in (1..width.saturating_sub(CELL)).step_by(CELL) {
                let pixels = (top..top + CELL).flat_map(|row| (left..left + CELL).map(move |u| [u, row]));
                let measured = pixels.filter(|&[u, row]| self.depth[row * width + u] > 0.0);
                points.extend(measured.max_by(|a, b| steepness(*a).total_cmp(&steepness(*b))));
            }
        }
        points
    }
}

/// A picture with the poses from which it was taken.
struct Taken<'a> {
    picture: &'a FramePicture,
    /// `world_from_camera` of every virtual view, by row; one row for all where they are exposed together.
    poses: Vec<[RigidTransform; VIEWS]>,
    /// `world_from_camera` of every row of depth.
    depth_poses: Vec<RigidTransform>,
}

impl<'a> Taken<'a> {
    fn new(picture: &'a FramePicture, path: &ExposureTrajectory) -> Self {
        let height = picture.camera.height;
        let times = &picture.times;
        let rows = |rolls: bool| if rolls { height } else { 1 };
        let views = |row: usize| {
            std::array::from_fn(|k| {
                path.at(times.view_time(SampleRule::Midpoint.time(k, VIEWS), row as f64, height))
            })
        };
        let depth = |row: usize| path.at(times.depth_time(row as f64, height));
        Self {
            picture,
            poses: (0..rows(times.readout != 0.0)).map(views).collect(),
            depth_poses: (0..rows(times.depth_readout != 0.0)).map(depth).collect(),
        }
    }

    /// Poses of the virtual views of the row at `v`.
    fn row(&self, v: f64) -> &[RigidTransform; VIEWS] {
        &self.poses[row_index(v, self.poses.len())]
    }

    fn depth_row(&self, v: f64) -> &RigidTransform {
        &self.depth_poses[row_index(v, self.depth_poses.len())]
    }

    /// Where a point of the world is seen at the middle of the exposure of its own row, and how far away.
    fn sees(&self, point: &Vector3<f64>) -> Option<([f64; 2], f64)> {
        self.seen_by(point, |v| &self.row(v)[VIEWS / 2], self.poses.len())
    }

    /// The same at the time of the depth image.
    fn depth_sees(&self, point: &Vector3<f64>) -> Option<([f64; 2], f64)> {
        self.seen_by(point, |v| self.depth_row(v), self.depth_poses.len())
    }

    fn seen_by<'p>(
        &self,
        point: &Vector3<f64>,
        pose: impl Fn(f64) -> &'p RigidTransform,
        rows: usize,
    ) -> Option<([f64; 2], f64)> {
        let mut v = 0.5 * self.picture.camera.height as f64;
        let mut seen = None;
        for _ in 0..if rows > 1 { 1 + ROW_STEPS } else { 1 } {
            let local = pose(v).inverse().transform_point(point);
            if local.z <= 0.0 {
                return None;
            }
            let pixel = self.picture.camera.project(&local);
            v = pixel.y;
            seen = Some(([pixel.x, pixel.y], local.z));
        }
        seen
    }

    /// Mean light of `other` along the path of this picture at a point that this picture sees at `v`.
    fn blurs(&self, point: &Vector3<f64>, v: f64, other: &Taken<'_>) -> Option<f64> {
        let poses = self.row(v);
        let local = poses[VIEWS / 2].inverse().transform_point(point);
        let mut sum = 0.0;
        for pose in poses {
            let (pixel, _) = other.sees(&pose.transform_point(&local))?;
            sum += other.picture.light_at(pixel)?;
        }
        Some(sum / VIEWS as f64)
    }

    /// The point of the world that a pixel's depth was measured at.
    fn point(&self, [column, row]: [usize; 2]) -> Vector3<f64> {
        let camera = &self.picture.camera;
        let depth = f64::from(self.picture.depth[row * camera.width + column]);
        let local = camera.ray(column as f64, row as f64) * depth;
        self.depth_row(row as f64).transform_point(&local)
    }
}

fn row_index(v: f64, rows: usize) -> usize {
    // Casts saturate: above the picture the first row, below it the last.
    ((v + 0.5) as usize).min(rows - 1)
}

/// What one point shows in two pictures.
#[derive(Clone, Copy, Default)]
struct Sighting {
    /// Light of either picture, blurred along both paths.
    lights: Option<[f64; 2]>,
    /// Difference of inverse depths, 1/m.
    depth: Option<f64>,
}

/// Sightings of the points of both pictures.
fn sightings(one: &Taken<'_>, other: &Taken<'_>, points: [&[[usize; 2]]; 2]) -> Vec<Sighting> {
    let sighting = |from: &Taken<'_>, to: &Taken<'_>, pixel: [usize; 2]| {
        let point = from.point(pixel);
        let lights = from.sees(&point).zip(to.sees(&point)).and_then(|(([_, v], _), ([_, w], _))| {
            Some([from.blurs(&point, v, to)?, to.blurs(&point, w, from)?])
        });
        let depth = to
            .depth_sees(&point)
            .and_then(|(pixel, z)| to.picture.depth_at(pixel).map(|measured| 1.0 / measured - 1.0 / z));
        Sighting { lights, depth }
    };
    let [own, others] = points;
    let forth = own.iter().map(|&pixel| sighting(one, other, pixel));
    let back = others.iter().map(|&pixel| {
        let Sighting { lights, depth } = sighting(other, one, pixel);
        // Always the light along the first picture's path first.
        Sighting { lights: lights.map(|[a, b]| [b, a]), depth }
    });
    forth.chain(back).collect()
}

/// Differences of light and of inverse depth, with the brightness of the pictures made equal.
fn differences(sightings: &[Sighting]) -> [Vec<Option<f64>>; 2] {
    let lights = sightings.iter().filter_map(|sighting| sighting.lights);
    let sums = lights.fold([0.0; 2], |[a, b], [x, y]| [a + x, b + y]);
    // Exposure control or another response between the two: one factor for all points.
    let gain = if sums[0] > 0.0 { sums[1] / sums[0] } else { 1.0 };
    [
        sightings.iter().map(|s| s.lights.map(|[a, b]| gain * a - b)).collect(),
        sightings.iter().map(|s| s.depth).collect(),
    ]
}

/// How badly `picture` at two exposures agrees with `references` at theirs. `None` where it shares too few points with
/// them.
#[must_use]
pub fn compare_exposures(
    picture: &FramePicture,
    [measured, suggested]: [&ExposureTrajectory; 2],
    references: &[(&FramePicture, ExposureTrajectory)],
) -> Option<Mismatch> {
    // Each picture is taken along both candidates and compared with the same references.
    let candidates = [measured, suggested].map(|path| Taken::new(picture, path));
    let own = picture.points();
    let mut sums = [0.0; 2];
    let mut count = 0.0;
    for (reference, path) in references {
        let taken = Taken::new(reference, path);
        let others = reference.points();
        let found = candidates.each_ref().map(|one| differences(&sightings(one, &taken, [&own, &others])));
        for kind in [0, 1] {
            let pair = found.each_ref().map(|differences| differences[kind].as_slice());
            if let Some(costs) = mean_costs(pair, LEAST_SIGMA[kind]) {
                sums = [sums[0] + costs[0], sums[1] + costs[1]];
                count += 1.0;
            }
        }
    }
    (count > 0.0).then(|| Mismatch { measured: sums[0] / count, suggested: sums[1] / count })
}

/// Mean robust costs of two lists of differences of the same points; a point that only one of them has costs the
/// other as much as a difference can. The unit is the spread of the smaller differences.
fn mean_costs(lists: [&[Option<f64>]; 2], least_sigma: f64) -> Option<[f64; 2]> {
    let spread = |list: &[Option<f64>]| {
        let present: Vec<f64> = list.iter().flatten().map(|difference| difference.abs()).collect();
        (present.len() >= FEWEST_POINTS).then(|| quantile(&present, 0.5)).flatten()
    };
    let spreads = lists.map(spread);
    let smaller = spreads.into_iter().flatten().fold(f64::INFINITY, f64::min);
    if smaller == f64::INFINITY {
        return None;
    }
    let half = HALF_COST * (SIGMA_OF_MEDIAN * smaller).max(least_sigma);
    let cost = |difference: Option<f64>| {
        // Geman and McClure's: bounded, so that what is hidden or has moved counts once.
        difference.map_or(1.0, |difference| {
            let squared = (difference / half).powi(2);
            squared / (1.0 + squared)
        })
    };
    let mut sums = [0.0; 2];
    let mut count = 0.0;
    for (a, b) in lists[0].iter().zip(lists[1]).filter(|(a, b)| a.is_some() || b.is_some()) {
        sums = [sums[0] + cost(*a), sums[1] + cost(*b)];
        count += 1.0;
    }
    Some(sums.map(|sum| sum / count))
}
