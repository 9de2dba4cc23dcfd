//! Nearest neighbours among points in space.
//!
//! A balanced tree without pointers (Bentley 1975): the middle point of a range splits it along its widest axis, the
//! halves lie on either side. A page of code, against a dependency with generic dimensions, metrics and storage.

use rayon::prelude::*;

/// Ranges of at most this many points are searched one by one.
const LEAF: usize = 12;

/// Ranges above this many points are built by several threads.
const PARALLEL: usize = 1 << 14;

/// Points in an order that makes the nearest quick to find.
#[derive(Clone, Debug)]
pub struct KdTree {
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    point: [f32; 3],
    /// Axis along which the point splits its range.
    axis: u8,
}

impl KdTree {
    /// A tree of finite points.
    #[must_use]
    pub fn new(points: &[[f32; 3]]) -> Self {
        let mut nodes: Vec<Node> = points.iter().map(|&point| Node { point, axis: 0 }).collect();
        build(&mut nodes);
        Self { nodes }
    }

    /// The point nearest to `query`; `None` if there are none.
    #[must_use]
    pub fn nearest(&self, query: &[f32; 3]) -> Option<[f32; 3]> {
        self.nearest_beyond(query, -1.0)
    }

    /// The nearest point that is at another place than `query`, for the spacing of points.
    #[must_use]
    pub fn nearest_other(&self, query: &[f32; 3]) -> Option<[f32; 3]> {
        self.nearest_beyond(query, 0.0)
    }

    /// The distances of all `queries` to their nearest points, in the unit of the points; none without points.
    #[must_use]
    pub fn distances(&self, queries: &[[f32; 3]]) -> Vec<f64> {
        let distances =
            queries.par_iter().map(|query| self.nearest(query).map(|found| distance(query, &found)));
        distances.collect::<Option<_>>().unwrap_or_default()
    }

    /// The nearest of the points whose squared distance is above `beyond`.
    fn nearest_beyond(&self, query: &[f32; 3], beyond: f32) -> Option<[f32; 3]> {
        let mut best = Best { squared: f32::INFINITY, beyond, point: None };
        search(&self.nodes, query, &mut best);
        best.point
    }
}

/// Distance of two points.
pub(super) fn distance(a: &[f32; 3], b: &[f32; 3]) -> f64 {
    (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).powi(2)).sum::<f64>().sqrt()
}

struct Best {
    squared: f32,
    beyond: f32,
    point: Option<[f32; 3]>,
}

impl Best {
    fn offer(&mut self, query: &[f32; 3], point: &[f32; 3]) {
        let squared = (0..3).map(|k| (query[k] - point[k]).powi(2)).sum();
        if squared < self.squared && squared > self.beyond {
            (self.squared, self.point) = (squared, Some(*point));
        }
    }
}

fn build(nodes: &mut [Node]) {
    if nodes.len() <= LEAF {
        return;
    }
    let axis = widest_axis(nodes);
    let middle = nodes.len() / 2;
    let (below, node, above) =
        nodes.select_nth_unstable_by(middle, |a, b| a.point[axis].total_cmp(&b.point[axis]));
    node.axis = axis as u8;
    if below.len() > PARALLEL {
        rayon::join(|| build(below), || build(above));
    } else {
        build(below);
        build(above);
    }
}

fn widest_axis(nodes: &[Node]) -> usize {
    let width = |axis: usize| {
        let values = nodes.iter().map(|node| node.point[axis]);
        let [low, high] = values
            .fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
        high - low
    };
    let widths = [width(0), width(1), width(2)];
    (0..3).fold(0, |widest, axis| if widths[axis] > widths[widest] { axis } else { widest })
}

fn search(nodes: &[Node], query: &[f32; 3], best: &mut Best) {
    if nodes.len() <= LEAF {
        nodes.iter().for_each(|node| best.offer(query, &node.point));
        return;
    }
    let (below, rest) = nodes.split_at(nodes.len() / 2);
    let [node, above @ ..] = rest else { return };
    let axis = usize::from(node.axis);
    let beside = query[axis] - node.point[axis];
    let (near, far) = if beside < 0.0 { (below, above) } else { (above, below) };
    search(near, query, best);
    best.offer(query, &node.point);
    if beside * beside < best.squared {
        search(far, query, best);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a sequence that fills the unit cube evenly, every tenth of them twice.
    fn points(count: usize, shift: f32) -> Vec<[f32; 3]> {
        let point =
            |k: usize| [0.819_172_5, 0.671_043_6, 0.549_7].map(|step| (k as f32 * step + shift) % 1.0);
        (0..count).map(|k| point(if k % 10 == 1 { k - 1 } else { k })).collect()
    }

    #[test]
    fn it_finds_what_trying_all_points_finds() {
        for count in [1, LEAF, LEAF + 1, 700] {
            let (points, queries) = (points(count, 0.0), points(200, 0.4));
            let found = KdTree::new(&points).distances(&queries);
            for (query, found) in queries.iter().zip(found) {
                let nearest = points.iter().map(|point| distance(query, point)).fold(f64::INFINITY, f64::min);
                assert!((found - nearest).abs() < 1e-6, "{found} instead of {nearest} among {count}");
            }
        }
        assert!(KdTree::new(&[]).distances(&points(3, 0.0)).is_empty());
    }

    #[test]
    fn the_nearest_other_point_is_at_another_place() {
        let points = points(500, 0.0);
        let tree = KdTree::new(&points);
        for point in &points {
            let others = points.iter().map(|other| distance(point, other)).filter(|distance| *distance > 0.0);
            let found = distance(point, &tree.nearest_other(point).unwrap());
            assert!((found - others.fold(f64::INFINITY, f64::min)).abs() < 1e-6);
        }
        assert_eq!(KdTree::new(&[[1.0; 3]; 40]).nearest_other(&[1.0; 3]), None);
    }
}
