//! A mesh whose edges are collapsed one after the other.

use nalgebra::Vector3;

use super::quadric::Quadric;
use crate::triangles::Mesh;

/// Weight of the plane that stands on a border, times the square of the edge: borders stay where they are.
const BORDER: f64 = 4.0;

/// Weight of a vertex's own place, per area around it: on a plane, where every place is as good, short edges go first.
const PLACE: f64 = 1e-3;

/// Least cosine between the normals of a triangle before and after.
const LEAST_COSINE: f64 = 0.3;

/// Where an edge collapses to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Collapse {
    pub(super) place: Vector3<f64>,
    /// Sum of squared distances there, by area.
    pub(super) cost: f64,
}

/// Vertices, their colours and quadrics, and the triangles around each.
pub(super) struct Surface {
    places: Vec<Vector3<f64>>,
    colours: Vec<[f32; 3]>,
    quadrics: Vec<Quadric>,
    around: Vec<Vec<u32>>,
    /// Triangles that are left; without area, corners are those at the end.
    triangles: Vec<Option<[u32; 3]>>,
    left: usize,
}

impl Surface {
    /// A mesh of which all triangles have three corners that are vertices; others are left out.
    pub(super) fn new(mesh: &Mesh) -> Self {
        let count = mesh.vertices.len();
        let is_sound = |&[a, b, c]: &[u32; 3]| {
            a != b && b != c && c != a && [a, b, c].iter().all(|corner| (*corner as usize) < count)
        };
        let triangles: Vec<Option<[u32; 3]>> =
            mesh.triangles.iter().copied().filter(is_sound).map(Some).collect();
        let mut surface = Self {
            places: mesh.vertices.iter().map(|place| Vector3::from(place.map(f64::from))).collect(),
            colours: mesh.colours.iter().map(|colour| colour.map(f32::from)).collect(),
            quadrics: vec![Quadric::default(); count],
            around: vec![Vec::new(); count],
            left: triangles.len(),
            triangles,
        };
        for (index, corners) in surface.triangles.iter().enumerate() {
            for corner in corners.iter().flatten() {
                surface.around[*corner as usize].push(index as u32);
            }
        }
        surface.add_quadrics();
        surface
    }

    fn add_quadrics(&mut self) {
        for corners in self.triangles.clone().into_iter().flatten() {
            let cross = self.cross(&corners);
            let area = 0.5 * cross.norm();
            let Some(normal) = cross.try_normalize(0.0) else { continue };
            for corner in corners {
                let place = self.places[corner as usize];
                self.quadrics[corner as usize] += Quadric::plane(&normal, &place, area);
                self.quadrics[corner as usize] += Quadric::point(&place, PLACE * area);
            }
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                if self.shared(a, b).count() == 1 {
                    self.add_border(a, b, &normal);
                }
            }
        }
    }

    fn add_border(&mut self, a: u32, b: u32, normal: &Vector3<f64>) {
        let edge = self.places[b as usize] - self.places[a as usize];
        let Some(across) = edge.cross(normal).try_normalize(0.0) else { return };
        let plane = Quadric::plane(&across, &self.places[a as usize], BORDER * edge.norm_squared());
        self.quadrics[a as usize] += plane;
        self.quadrics[b as usize] += plane;
    }

    /// Number of triangles that are left.
    pub(super) fn left(&self) -> usize {
        self.left
    }

    /// All edges, each once, the smaller vertex first, in order.
    pub(super) fn edges(&self) -> Vec<[u32; 2]> {
        let sides = |[a, b, c]: [u32; 3]| [[a.min(b), a.max(b)], [b.min(c), b.max(c)], [c.min(a), c.max(a)]];
        let mut edges: Vec<[u32; 2]> = self.triangles.iter().flatten().copied().flat_map(sides).collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// The vertices next to `vertex`, in order.
    pub(super) fn neighbours(&self, vertex: u32) -> Vec<u32> {
        let corners = self.triangles_around(vertex).flat_map(|(_, corners)| corners);
        let mut neighbours: Vec<u32> = corners.filter(|corner| *corner != vertex).collect();
        neighbours.sort_unstable();
        neighbours.dedup();
        neighbours
    }

    /// The best that the edge from `a` to `b` can collapse to.
    pub(super) fn collapse(&self, a: u32, b: u32) -> Collapse {
        let mut sum = self.quadrics[a as usize];
        sum += self.quadrics[b as usize];
        let (from, to) = (self.places[a as usize], self.places[b as usize]);
        let middle = 0.5 * (from + to);
        let length = (to - from).norm();
        // What is least far away is a place where planes meet that are nearly the same.
        let place = sum.least().filter(|place| (place - middle).norm() <= 2.0 * length).unwrap_or(middle);
        Collapse { place, cost: sum.at(&place) }
    }

    /// Moves `a` to a place and puts it in place of `b`. Nothing happens, and it is false, where that would turn a triangle
    /// over or join sheets.
    pub(super) fn apply(&mut self, a: u32, b: u32, place: &Vector3<f64>) -> bool {
        if !self.is_simple(a, b) || self.turns_over(a, b, place) || self.turns_over(b, a, place) {
            return false;
        }
        self.mix_colours(a, b, place);
        self.places[a as usize] = *place;
        let other = self.quadrics[b as usize];
        self.quadrics[a as usize] += other;
        for index in core::mem::take(&mut self.around[b as usize]) {
            let Some(corners) = self.triangles[index as usize] else { continue };
            if corners.contains(&a) {
                self.triangles[index as usize] = None;
                self.left -= 1;
            } else {
                self.triangles[index as usize] =
                    Some(corners.map(|corner| if corner == b { a } else { corner }));
                self.around[a as usize].push(index);
            }
        }
        let Self { around, triangles, .. } = self;
        around[a as usize].retain(|index| triangles[*index as usize].is_some());
        true
    }

    /// Whether the triangles at the edge are all that its ends have in common, one or two.
    fn is_simple(&self, a: u32, b: u32) -> bool {
        let beside = self.shared(a, b).count();
        let others = self.neighbours(b);
        let common =
            self.neighbours(a).into_iter().filter(|vertex| others.binary_search(vertex).is_ok()).count();
        (1..=2).contains(&beside) && common == beside
    }

    /// Whether a triangle at `moved`, but not at `gone`, would face elsewhere with its corner at `place`.
    fn turns_over(&self, moved: u32, gone: u32, place: &Vector3<f64>) -> bool {
        self.triangles_around(moved).filter(|(_, corners)| !corners.contains(&gone)).any(|(_, corners)| {
            let before = self.cross(&corners);
            let at = |corner: u32| if corner == moved { *place } else { self.places[corner as usize] };
            let [p, q, r] = corners.map(at);
            let after = (q - p).cross(&(r - p));
            before.dot(&after) < LEAST_COSINE * before.norm() * after.norm() || after.norm_squared() == 0.0
        })
    }

    /// The colour of `a` becomes that of the place between `a` and `b`.
    fn mix_colours(&mut self, a: u32, b: u32, place: &Vector3<f64>) {
        let (from, to) = (self.places[a as usize], self.places[b as usize]);
        let share = (place - from).dot(&(to - from)) / (to - from).norm_squared();
        let share = if share.is_finite() { share.clamp(0.0, 1.0) as f32 } else { 0.5 };
        if let (Some(first), Some(second)) = (self.colours.get(a as usize), self.colours.get(b as usize)) {
            let mixed = core::array::from_fn(|k| first[k] + share * (second[k] - first[k]));
            self.colours[a as usize] = mixed;
        }
    }

    fn triangles_around(&self, vertex: u32) -> impl Iterator<Item = (u32, [u32; 3])> {
        let all = self.around[vertex as usize].iter();
        all.filter_map(|index| Some((*index, self.triangles[*index as usize]?)))
    }

    /// The triangles at the edge from `a` to `b`.
    fn shared(&self, a: u32, b: u32) -> impl Iterator<Item = (u32, [u32; 3])> {
        self.triangles_around(a).filter(move |(_, corners)| corners.contains(&b))
    }

    fn cross(&self, corners: &[u32; 3]) -> Vector3<f64> {
        let [p, q, r] = corners.map(|corner| self.places[corner as usize]);
        (q - p).cross(&(r - p))
    }

    /// What is left as a mesh, without the vertices that no triangle uses.
    pub(super) fn mesh(&self) -> Mesh {
        let all = Mesh {
            vertices: self.places.iter().map(|place| [place.x, place.y, place.z].map(|x| x as f32)).collect(),
            colours: self.colours.iter().map(|colour| colour.map(|channel| channel.round() as u8)).collect(),
            triangles: self.triangles.iter().flatten().copied().collect(),
        };
        all.with_triangles(|_| true)
    }
}
