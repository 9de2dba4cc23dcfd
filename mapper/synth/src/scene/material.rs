//! What surfaces look like: reflected share of light at surface coordinates in metres.

use glam::{IVec2, Vec2, Vec3};

use super::pattern::{edge, hash, layered_noise, noise, random, split, stripe, text, visibility};
use super::print;

/// Look of a surface. Colours are linear; sizes are in metres.
#[derive(Clone, Copy)]
pub(super) enum Material {
    /// Paint or plaster with stains of the given strength.
    Plaster {
        colour: Vec3,
        stain: f32,
    },
    Bricks {
        brick: Vec3,
        mortar: Vec3,
    },
    /// Planks of this width along the first coordinate.
    Wood {
        colour: Vec3,
        plank: f32,
    },
    /// Woven diamonds.
    Carpet {
        base: Vec3,
        figure: Vec3,
    },
    /// Square tiles of this size in two colours.
    Tiles {
        a: Vec3,
        b: Vec3,
        size: f32,
    },
    /// Striped and dotted wallpaper.
    Wallpaper {
        base: Vec3,
        figure: Vec3,
    },
    /// A printed picture with caption, of this half size.
    Poster {
        half: Vec2,
        seed: u32,
    },
    /// A page or screen of text.
    Page {
        paper: Vec3,
        ink: Vec3,
        letter: f32,
    },
    /// Brown board with tape, label and print.
    Cardboard {
        half: f32,
        seed: u32,
    },
    /// Back of a book.
    Spine {
        colour: Vec3,
        half: Vec2,
        seed: u32,
    },
    /// Veins and clouds.
    Marble {
        base: Vec3,
        vein: Vec3,
    },
    /// Rings of two colours.
    Rings {
        a: Vec3,
        b: Vec3,
        width: f32,
    },
    /// Leaves.
    Foliage,
}

impl Material {
    /// The same kind of look with other colours and prints; number 0 is the look itself.
    pub(super) fn varied(self, number: u32) -> Self {
        // Channels change places: another hue.
        let dye = |colour: Vec3| match number % 3 {
            0 => colour,
            1 => Vec3::new(colour.y, colour.z, colour.x),
            _ => Vec3::new(colour.z, colour.x, colour.y),
        };
        // Further apart than the seeds of one room.
        let seed = |seed: u32| seed + 1000 * number;
        match self {
            Self::Plaster { colour, stain } => Self::Plaster { colour: dye(colour), stain },
            Self::Bricks { brick, mortar } => Self::Bricks { brick: dye(brick), mortar: dye(mortar) },
            Self::Wood { colour, plank } => Self::Wood { colour: dye(colour), plank },
            Self::Carpet { base, figure } => Self::Carpet { base: dye(base), figure: dye(figure) },
            Self::Tiles { a, b, size } => Self::Tiles { a: dye(a), b: dye(b), size },
            Self::Wallpaper { base, figure } => Self::Wallpaper { base: dye(base), figure: dye(figure) },
            Self::Poster { half, seed: print } => Self::Poster { half, seed: seed(print) },
            Self::Cardboard { half, seed: print } => Self::Cardboard { half, seed: seed(print) },
            Self::Spine { colour, half, seed: print } => {
                Self::Spine { colour: dye(colour), half, seed: seed(print) }
            }
            Self::Marble { base, vein } => Self::Marble { base: dye(base), vein: dye(vein) },
            Self::Rings { a, b, width } => Self::Rings { a: dye(a), b: dye(b), width },
            Self::Page { .. } | Self::Foliage => self,
        }
    }

    /// Colour at `uv` on the face across `axis` where a pixel covers `pixel` metres.
    pub(super) fn colour(&self, uv: Vec2, axis: usize, pixel: f32) -> Vec3 {
        match *self {
            Self::Plaster { colour, stain } => plaster(uv, colour, stain, pixel),
            Self::Bricks { brick, mortar } => bricks(uv, brick, mortar, pixel),
            Self::Wood { colour, plank } => wood(uv, colour, plank, pixel),
            Self::Carpet { base, figure } => carpet(uv, base, figure, pixel),
            Self::Tiles { a, b, size } => tiles(uv, a, b, size, pixel),
            Self::Wallpaper { base, figure } => wallpaper(uv, base, figure, pixel),
            Self::Poster { half, seed } => print::poster(uv, half, pixel, seed),
            Self::Page { paper, ink, letter } => {
                paper.lerp(ink, text(uv, letter, pixel, 77)) * (1.0 + 0.06 * noise(uv * 3.0, 8))
            }
            Self::Cardboard { half, seed } => print::cardboard(uv, axis, half, pixel, seed),
            Self::Spine { colour, half, seed } => print::spine(uv, colour, half, pixel, seed),
            Self::Marble { base, vein } => marble(uv, base, vein, pixel),
            Self::Rings { a, b, width } => rings(uv, a, b, width, pixel),
            Self::Foliage => foliage(uv, pixel),
        }
    }
}

fn plaster(uv: Vec2, colour: Vec3, stain: f32, pixel: f32) -> Vec3 {
    let clouds = layered_noise(uv, 0.5, 6, pixel, 11);
    let specks = visibility(0.012, pixel) * noise(uv / 0.012, 12).max(0.45) - 0.45;
    colour * (1.0 + stain * clouds - 0.5 * specks)
}

/// Running bond, bricks 21 x 6.5 cm with 1.2 cm joints.
fn bricks(uv: Vec2, brick: Vec3, mortar: Vec3, pixel: f32) -> Vec3 {
    const PITCH: Vec2 = Vec2::new(0.222, 0.077);
    // Every second course is shifted by half a brick.
    let course = split(uv / PITCH).0.y;
    let shifted = Vec2::new(uv.x + 0.5 * PITCH.x * (course & 1) as f32, uv.y) / PITCH;
    let (cell, f) = split(shifted);
    // Edges are not quite straight.
    let wobble = 0.002 * noise(uv / 0.03, 31) * visibility(0.03, pixel);
    let to_joint = (f.min(Vec2::ONE - f) * PITCH).min_element() - 0.006 + wobble;
    let share = edge(to_joint, 0.0, pixel);
    let joint = mortar * (1.0 + 0.2 * noise(uv / 0.015, 36) * visibility(0.015, pixel));
    if share == 0.0 {
        return joint;
    }
    // No two bricks have the same colour.
    let tone = 0.62 + 0.6 * random(cell, 32);
    let grain = 1.0 + 0.32 * layered_noise(uv, 0.05, 4, pixel, 33);
    let tint = Vec3::new(1.0, 0.8 + 0.35 * random(cell, 34), 0.8 + 0.3 * random(cell, 35));
    joint.lerp(brick * tint * tone * grain, share)
}

fn wood(uv: Vec2, colour: Vec3, plank: f32, pixel: f32) -> Vec3 {
    let row = split(uv / plank).0.y;
    let start = 1.3 * random(IVec2::new(row, 0), 41);
    let (cell, f) = split(Vec2::new((uv.x + start) / (11.0 * plank), uv.y / plank));
    let place = uv + Vec2::new(7.0 * random(cell, 42), 3.0 * random(cell, 43));
    let bend = 0.012 * noise(place * Vec2::new(2.5, 9.0), 44);
    let grain = layered_noise((place + Vec2::new(0.0, bend)) * Vec2::new(0.06, 1.0), 0.022, 4, pixel, 45);
    let clouds = noise(place * Vec2::new(2.0, 8.0), 46);
    let gap = Vec2::new(f.x.min(1.0 - f.x) * 11.0, f.y.min(1.0 - f.y)).min_element() * plank;
    let tone = 0.75 + 0.4 * random(cell, 47) + 0.26 * grain + 0.1 * clouds;
    let warm = Vec3::new(1.0, 0.94 + 0.1 * grain, 0.86 + 0.16 * grain);
    colour * warm * (tone * (0.3 + 0.7 * edge(gap, 0.0015, pixel)))
}

fn carpet(uv: Vec2, base: Vec3, figure: Vec3, pixel: f32) -> Vec3 {
    let diagonal = Vec2::new(uv.x + uv.y, uv.x - uv.y) / 0.17;
    let (cell, f) = split(diagonal);
    let ring = (f - 0.5).abs().max_element() * 0.17;
    let kind = hash(cell, 51) % 3;
    let mut share = stripe(ring, 0.065, 0.009, pixel);
    share = share.max(if kind == 0 { edge(0.03, ring, pixel) } else { stripe(ring, 0.03, 0.005, pixel) });
    let fibre = 1.0 + 0.4 * layered_noise(uv, 0.02, 3, pixel, 52);
    let worn = 1.0 + 0.15 * noise(uv * 2.3, 53);
    base.lerp(figure, share) * (fibre * worn)
}

fn tiles(uv: Vec2, a: Vec3, b: Vec3, size: f32, pixel: f32) -> Vec3 {
    let (cell, f) = split(uv / size);
    let even = (cell.x + cell.y) & 1 == 0;
    let to_joint = f.min(Vec2::ONE - f).min_element() * size;
    let tone =
        0.85 + 0.25 * random(cell, 61) + 0.16 * layered_noise(uv + cell.as_vec2() * 3.7, 0.09, 5, pixel, 62);
    let joint = 0.35 + 0.65 * edge(to_joint, 0.003, pixel);
    (if even { a } else { b }) * (tone * joint)
}

fn wallpaper(uv: Vec2, base: Vec3, figure: Vec3, pixel: f32) -> Vec3 {
    let (cell, f) = split(uv / Vec2::new(0.24, 0.2));
    let line = stripe(f.x * 0.24, 0.02, 0.006, pixel).max(stripe(f.x * 0.24, 0.04, 0.003, pixel));
    let place = Vec2::new((f.x - 0.58) * 0.24, (f.y - 0.5) * 0.2);
    let turn = place.y.atan2(place.x);
    let petals = 0.045 * (0.72 + 0.28 * (5.0 * turn + 6.0 * random(cell, 71)).cos());
    let radius = place.length();
    let flower = edge(petals, radius, pixel) * (0.4 + 0.6 * edge(radius, 0.014, pixel));
    let paper = 1.0 + 0.09 * layered_noise(uv, 0.3, 6, pixel, 72);
    base.lerp(figure, line.max(flower)) * paper
}

fn marble(uv: Vec2, base: Vec3, vein: Vec3, pixel: f32) -> Vec3 {
    let bend = 0.16 * layered_noise(uv, 0.35, 5, pixel, 81);
    let phase = (uv.x + 0.6 * uv.y + bend) * 26.0;
    let line = (1.0 - phase.sin().abs()).powi(5);
    base.lerp(vein, 0.85 * line * visibility(0.03, pixel))
        * (1.0 + 0.12 * layered_noise(uv, 0.08, 4, pixel, 82))
}

fn rings(uv: Vec2, a: Vec3, b: Vec3, width: f32, pixel: f32) -> Vec3 {
    let (cell, f) = split(Vec2::new(0.0, uv.y / (2.0 * width)));
    let share = stripe(f.y * 2.0 * width, width, 0.5 * width, pixel);
    let grain = 1.0 + 0.15 * layered_noise(uv, 0.03, 4, pixel, 91);
    let tone = 0.8 + 0.4 * random(IVec2::new(cell.y, 3), 92);
    a.lerp(b * tone, share) * grain
}

fn foliage(uv: Vec2, pixel: f32) -> Vec3 {
    let leaf = layered_noise(uv, 0.05, 4, pixel, 95);
    let light = 0.5 + 0.38 * leaf;
    Vec3::new(0.05, 0.17, 0.035).lerp(Vec3::new(0.3, 0.48, 0.09), light.clamp(0.0, 1.0)) * (0.6 + 0.5 * light)
}
