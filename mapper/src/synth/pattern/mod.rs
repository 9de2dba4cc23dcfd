//! Procedural surface colours: the albedo of every chart as a function of the position on it.

mod lettering;
mod picture;
mod print;
mod stone;
mod wood;

use glam::{Vec2, Vec3};

use super::noise::{fractal2, fractal3, noise2, random2, smoothstep};

/// Where on a surface a colour is wanted.
pub(super) struct Spot {
    /// Chart position, metres, v downwards.
    pub(super) uv: Vec2,
    /// Size of the chart, metres.
    pub(super) size: Vec2,
    /// The surface point in the frame of its object, metres.
    pub(super) local: Vec3,
}

/// What a surface is made of.
#[derive(Clone, Copy, Debug)]
pub(super) enum Material {
    /// Painted plaster with stains and scratches.
    Plaster(Vec3),
    /// Brickwork.
    Bricks,
    /// Rough blocks of natural stone.
    Ashlar,
    /// Striped wallpaper with an ornament, above a wooden panelling.
    Wallpaper,
    /// Floor boards along u.
    Boards(Vec3),
    /// One piece of wood, grain along the longer side.
    Wood(Vec3),
    /// A crate's side: boards, frame and stencilled letters.
    Crate,
    /// Checkered stone tiles of this size.
    Tiles(f32),
    /// Veined stone.
    Marble(Vec3),
    /// Square ceiling panels with holes.
    Panels,
    /// A woven rug with borders and diamonds.
    Rug,
    /// Coarse cloth.
    Cloth(Vec3),
    /// A page with headline and letters with dots of this size.
    Page(f32),
    /// Spine and covers of a book.
    Book,
    /// A framed picture.
    Picture(Picture),
    /// A board with chalk writing.
    Blackboard,
    /// Land, sea and degree grid of a globe.
    Globe,
    /// Bands of bright colours around the vertical axis.
    Bands,
    /// Brushed metal or smooth plastic with a few marks.
    Plain(Vec3),
    /// A keyboard's keys.
    Keys,
}

/// Motifs of framed pictures.
#[derive(Clone, Copy, Debug)]
pub(super) enum Picture {
    /// Mountains under a low sun.
    Mountains,
    /// Overlapping discs and bars.
    Shapes,
    /// Letters that get smaller from line to line.
    EyeChart,
    /// A map with coasts, roads and names.
    Map,
    /// Concentric rings of many colours.
    Rings,
}

/// A material and the seed that makes this piece of it unlike any other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Paint {
    pub(super) material: Material,
    pub(super) seed: u32,
}

impl Paint {
    pub(super) fn new(material: Material, seed: u32) -> Self {
        Self { material, seed }
    }

    /// Albedo in linear light, each channel in `[0, 1]`.
    pub(super) fn albedo(&self, spot: &Spot) -> Vec3 {
        let seed = self.seed;
        let colour = match self.material {
            Material::Plaster(colour) => plaster(spot.uv, colour, seed),
            Material::Bricks => stone::bricks(spot.uv, seed),
            Material::Ashlar => stone::ashlar(spot.uv, seed),
            Material::Wallpaper => print::wallpaper(spot, seed),
            Material::Boards(colour) => wood::boards(spot.uv, colour, seed),
            Material::Wood(colour) => wood::piece(spot, colour, seed),
            Material::Crate => wood::crate_side(spot, seed),
            Material::Tiles(side) => stone::tiles(spot.uv, side, seed),
            Material::Marble(colour) => stone::marble(spot.local, colour, seed),
            Material::Panels => stone::panels(spot.uv, seed),
            Material::Rug => print::rug(spot, seed),
            Material::Cloth(colour) => cloth(spot.uv, colour, seed),
            Material::Page(dot) => lettering::page(spot, dot, PAPER, INK, seed),
            Material::Book => print::book(spot, seed),
            Material::Picture(motif) => picture::framed(spot, motif, seed),
            Material::Blackboard => print::blackboard(spot, seed),
            Material::Globe => picture::globe(spot.local, seed),
            Material::Bands => print::bands(spot, seed),
            Material::Plain(colour) => plain(spot, colour, seed),
            Material::Keys => print::keys(spot, seed),
        };
        colour.clamp(Vec3::ZERO, Vec3::ONE)
    }
}

const PAPER: Vec3 = Vec3::new(0.78, 0.76, 0.68);
const INK: Vec3 = Vec3::new(0.03, 0.03, 0.05);

/// A bright, saturated colour.
fn vivid(seed: u32) -> Vec3 {
    const COLOURS: [Vec3; 9] = [
        Vec3::new(0.60, 0.06, 0.05),
        Vec3::new(0.05, 0.16, 0.45),
        Vec3::new(0.70, 0.42, 0.04),
        Vec3::new(0.04, 0.30, 0.12),
        Vec3::new(0.62, 0.58, 0.50),
        Vec3::new(0.30, 0.06, 0.28),
        Vec3::new(0.03, 0.33, 0.36),
        Vec3::new(0.60, 0.20, 0.04),
        Vec3::new(0.07, 0.07, 0.09),
    ];
    let shade = 0.7 + 0.5 * random2(7, 3, seed);
    COLOURS[super::noise::hash(seed ^ 0x3ade) as usize % COLOURS.len()] * shade
}

fn plaster(uv: Vec2, colour: Vec3, seed: u32) -> Vec3 {
    let stains = fractal2(uv.x * 1.3, uv.y * 1.3, 4, seed);
    let grain = fractal2(uv.x * 60.0, uv.y * 60.0, 3, seed ^ 0x11);
    let flake = smoothstep(0.60, 0.66, fractal2(uv.x * 5.0, uv.y * 5.0, 5, seed ^ 0x22));
    let painted = colour * (0.75 + 0.3 * stains) * (0.80 + 0.4 * grain);
    painted.lerp(Vec3::new(0.36, 0.31, 0.26) * (0.7 + 0.6 * grain), flake)
}

fn cloth(uv: Vec2, colour: Vec3, seed: u32) -> Vec3 {
    let thread = |x: f32| 0.5 + 0.5 * mba_tracker::math::sin(f64::from(x)) as f32;
    let weave = thread(uv.x * 900.0) * thread(uv.y * 900.0);
    let stripe = if ((uv.x * 9.0).fract() - 0.5).abs() < 0.09 { 1.5 } else { 1.0 };
    let wear = fractal2(uv.x * 12.0, uv.y * 12.0, 4, seed);
    colour * stripe * (0.55 + 0.5 * wear) * (0.8 + 0.4 * weave)
}

fn plain(spot: &Spot, colour: Vec3, seed: u32) -> Vec3 {
    let smudge = fractal3(spot.local * 14.0, 3, seed);
    let scratch = smoothstep(0.78, 0.84, noise2(spot.uv.x * 400.0, spot.uv.y * 18.0, seed ^ 0x5));
    colour * (0.8 + 0.4 * smudge) * (1.0 - 0.35 * scratch)
}
