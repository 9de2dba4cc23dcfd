//! Words for describing scenes: solids that stand on things, shelves, tables, crates.

use glam::Vec3;

use crate::synth::noise::random2;
use crate::synth::pattern::{Material, Paint};
use crate::synth::scene::Solid;
use crate::synth::shape::Shape;

/// Solids collected one by one; every piece gets a seed of its own.
pub(super) struct Furniture {
    pub(super) solids: Vec<Solid>,
}

impl Furniture {
    /// Starts with a room of the given size whose floor is centred on the origin. Paints: +x, -x, ceiling, floor,
    /// +z, -z.
    pub(super) fn room(size: Vec3, materials: [Material; 6]) -> Self {
        let mut this = Self { solids: Vec::new() };
        let centre = Vec3::new(0.0, 0.5 * size.y, 0.0);
        this.add(Shape::Room { half: 0.5 * size }, centre, 0.0, &materials, 1.0);
        this
    }

    fn add(&mut self, shape: Shape, centre: Vec3, yaw: f32, materials: &[Material], detail: f32) {
        let first = 0x51 + 16 * self.solids.len() as u32;
        let paints =
            materials.iter().zip(first..).map(|(material, seed)| Paint::new(*material, seed)).collect();
        self.solids.push(Solid { shape, centre, yaw, paints, detail });
    }

    /// A box of `size` whose bottom centre is at `foot`.
    pub(super) fn block(&mut self, foot: Vec3, size: Vec3, yaw: f32, material: Material) {
        self.block_with(foot, size, yaw, [material; 6]);
    }

    /// A box with a material for each face: +x, -x, +y, -y, +z, -z.
    pub(super) fn block_with(&mut self, foot: Vec3, size: Vec3, yaw: f32, materials: [Material; 6]) {
        let detail = if size.max_element() < 0.7 { 2.0 } else { 1.2 };
        self.add(Shape::Block { half: 0.5 * size }, foot + Vec3::Y * 0.5 * size.y, yaw, &materials, detail);
    }

    /// A ball lying on `foot`.
    pub(super) fn ball(&mut self, foot: Vec3, radius: f32, yaw: f32, material: Material) {
        self.add(Shape::Ball { radius }, foot + Vec3::Y * radius, yaw, &[material], 1.6);
    }

    /// An upright cylinder standing on `foot`: materials of side and caps.
    pub(super) fn drum(&mut self, foot: Vec3, radius: f32, height: f32, side: Material, caps: Material) {
        let shape = Shape::Drum { radius, half_height: 0.5 * height };
        let detail = if height < 1.0 { 2.0 } else { 1.2 };
        self.add(shape, foot + Vec3::Y * 0.5 * height, 0.0, &[side, caps, caps], detail);
    }

    /// A picture of `width` and `height` whose centre is at `at`, facing the direction `yaw` (0 = +z).
    pub(super) fn picture(&mut self, at: Vec3, width: f32, height: f32, yaw: f32, material: Material) {
        let wood = Material::Wood(Vec3::new(0.30, 0.18, 0.08));
        let size = Vec3::new(width, height, 0.03);
        let centre = at;
        let materials = [wood, wood, wood, wood, material, wood];
        self.add(Shape::Block { half: 0.5 * size }, centre, yaw, &materials, 1.5);
    }

    /// A table with four legs; `size` is its outline.
    pub(super) fn table(&mut self, foot: Vec3, size: Vec3, top: Material, legs: Material) {
        const THICKNESS: f32 = 0.04;
        let board = Vec3::new(size.x, THICKNESS, size.z);
        self.block(foot + Vec3::Y * (size.y - THICKNESS), board, 0.0, top);
        for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
            let corner = Vec3::new(sx * (0.5 * size.x - 0.06), 0.0, sz * (0.5 * size.z - 0.06));
            self.block(foot + corner, Vec3::new(0.06, size.y - THICKNESS, 0.06), 0.0, legs);
        }
    }

    /// A row of standing books along x from `start`, their spines towards +z.
    pub(super) fn books(&mut self, start: Vec3, length: f32, seed: u32) {
        let mut x = 0.0;
        for k in 0.. {
            let random = |what: i32| random2(k, what, seed);
            let size = Vec3::new(0.025 + 0.035 * random(0), 0.17 + 0.10 * random(1), 0.14 + 0.05 * random(2));
            x += size.x + 0.002;
            if x > length {
                break;
            }
            if random(3) > 0.08 {
                let foot = start + Vec3::new(x - 0.5 * size.x, 0.0, 0.5 * size.z);
                self.block(foot, size, 0.0, Material::Book);
            }
        }
    }

    /// A pile of lying books.
    pub(super) fn pile(&mut self, foot: Vec3, count: usize, seed: u32) {
        let mut y = 0.0;
        for k in 0..count as i32 {
            let random = |what: i32| random2(k, what, seed);
            let size = Vec3::new(0.26 - 0.02 * k as f32, 0.025 + 0.03 * random(0), 0.19);
            self.block(foot + Vec3::Y * y, size, 0.9 * (random(1) - 0.5), Material::Book);
            y += size.y;
        }
    }

    /// A shelf against a wall behind it, open towards +z: `levels` boards with books. `foot` is the middle of its
    /// bottom edge at the back.
    pub(super) fn shelf(&mut self, foot: Vec3, size: Vec3, levels: usize, wood: Material) {
        let side = Vec3::new(0.03, size.y, size.z);
        let middle = foot + Vec3::Z * 0.5 * size.z;
        for sign in [-1.0, 1.0] {
            self.block(middle + Vec3::X * sign * 0.5 * (size.x - 0.03), side, 0.0, wood);
        }
        let board = Vec3::new(size.x - 0.06, 0.025, size.z);
        for level in 0..=levels {
            let y = (size.y - 0.025) * level as f32 / levels as f32;
            self.block(middle + Vec3::Y * y, board, 0.0, wood);
            if level < levels {
                let start = foot + Vec3::new(-0.5 * size.x + 0.04, y + 0.025, 0.03);
                self.books(start, size.x - 0.08, 31 * level as u32 + 7);
            }
        }
    }

    /// A chair that faces along +z.
    pub(super) fn chair(&mut self, foot: Vec3, wood: Material, seat: Material) {
        for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
            let height = if sz < 0.0 { 0.95 } else { 0.44 };
            self.block(foot + Vec3::new(sx * 0.19, 0.0, sz * 0.19), Vec3::new(0.04, height, 0.04), 0.0, wood);
        }
        self.block(foot + Vec3::Y * 0.44, Vec3::new(0.44, 0.04, 0.44), 0.0, seat);
        for y in [0.62, 0.80] {
            self.block(foot + Vec3::new(0.0, y, -0.19), Vec3::new(0.36, 0.09, 0.025), 0.0, wood);
        }
    }
}
