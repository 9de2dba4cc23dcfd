//! What cameras have seen of a surface: the rest is dropped, and what was seen gets its colour.

use mba_mesh::Mesh;
use mba_raster::sensor::ForwardResponse;
use mba_tracker::photometric::InverseResponse;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::components;
use super::view::{ColouredDepth, SurfaceView};

/// Weight of a colour where the view has no depth to be trusted: it counts where there is no other.
const DOUBTFUL: f32 = 1e-6;

/// How far colours reach beyond what has one, in triangles.
const LENDING_STEPS: usize = 4;

/// Where there is no colour.
const GREY: [u8; 3] = [128; 3];

/// What views have shown of each vertex so far.
#[derive(Clone, Debug)]
pub struct Sight {
    vertices: Vec<Vertex>,
}

/// What is dropped beside unseen triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trim {
    /// Parts of the surface that are connected with nothing else go if they have less than this area, square metres.
    pub least_area: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Vertex {
    seen: bool,
    /// Weighted sum of linear light, and of the weights.
    colour: [f32; 4],
}

impl Sight {
    /// Nothing of the mesh is seen yet.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        Self { vertices: vec![Vertex::default(); mesh.vertices.len()] }
    }

    /// Takes another view into account: a vertex of `mesh`, the one this began with, is seen if it is in front of the
    /// camera, within the image and not deeper than the view's depth there by more than `tolerance` metres. Its colour
    /// is that of the view, if it is not nearer than the depth by more than that either.
    pub fn look(&mut self, mesh: &Mesh, view: &ColouredDepth, tolerance: f64) {
        let surface = SurfaceView::new(view);
        let vertices = self.vertices.par_iter_mut().zip(&mesh.vertices);
        vertices.for_each(|(vertex, position)| vertex.look(position, view, &surface, tolerance as f32));
    }

    /// The mesh without triangles of which no corner was seen and without small parts. Colours are means over the
    /// views, weighted by trust in their depth, as sRGB; those of vertices without any come from nearby, or else
    /// stay as they were.
    #[must_use]
    pub fn trim(&self, mesh: &Mesh, trim: &Trim) -> Mesh {
        let seen = |vertex: &u32| self.vertices.get(*vertex as usize).is_some_and(|vertex| vertex.seen);
        let coloured = Mesh {
            vertices: mesh.vertices.clone(),
            colours: self.colours(mesh),
            triangles: mesh.triangles.iter().filter(|corners| corners.iter().any(seen)).copied().collect(),
        };
        let large = components::large(&coloured, trim.least_area);
        coloured.with_triangles(|corners| large[corners[0] as usize])
    }

    fn colours(&self, mesh: &Mesh) -> Vec<[u8; 3]> {
        let response = ForwardResponse::new(&InverseResponse::srgb());
        let own = |vertex: &Vertex| {
            let [red, green, blue, weight] = vertex.colour;
            (weight > 0.0).then(|| [red, green, blue].map(|sum| response.encode(sum / weight)))
        };
        let mut colours: Vec<Option<[u8; 3]>> = self.vertices.iter().map(own).collect();
        for _ in 0..LENDING_STEPS {
            lend(&mesh.triangles, &mut colours);
        }
        let earlier = |k: usize| mesh.colours.get(k).copied().unwrap_or(GREY);
        colours.iter().enumerate().map(|(k, own)| own.unwrap_or_else(|| earlier(k))).collect()
    }
}

/// Gives vertices without a colour that of another corner of a triangle.
fn lend(triangles: &[[u32; 3]], colours: &mut [Option<[u8; 3]>]) {
    for corners in triangles {
        let lent = corners.iter().find_map(|corner| colours[*corner as usize]);
        corners.iter().for_each(|corner| colours[*corner as usize] = colours[*corner as usize].or(lent));
    }
}

impl Vertex {
    fn look(&mut self, position: &[f32; 3], view: &ColouredDepth, surface: &SurfaceView, tolerance: f32) {
        let at = surface.camera_from_world.transform_point(&Vector3::from(position.map(f64::from)));
        let image = view.camera.project(&at);
        let (width, height) = (view.camera.width, view.camera.height);
        let [u, v] = [image.x.round(), image.y.round()];
        let inside = u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64;
        if at.z <= 0.0 || !inside {
            return;
        }
        let pixel = v as usize * width + u as usize;
        let depth = view.depth.get(pixel).copied().unwrap_or_default();
        let behind = at.z as f32 - depth;
        if depth <= 0.0 || behind > tolerance {
            return;
        }
        self.seen = true;
        if let Some(colour) = view.colour.get(pixel)
            && behind > -tolerance
        {
            let surface = surface.at(image.x as f32, image.y as f32);
            let weight = surface.map_or(DOUBTFUL, |surface| surface.weight(depth));
            let [red, green, blue] = colour.map(|light| light * weight);
            self.colour.iter_mut().zip([red, green, blue, weight]).for_each(|(sum, added)| *sum += added);
        }
    }
}
