//! Meshes as binary glTF 2.0 (<https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>).
//!
//! One mesh with `POSITION` (32-bit floats, metres), `COLOR_0` (16-bit red, green, blue and alpha) and indices (32 bit).
//! glTF takes vertex colours for linear light, so display colours are converted. They hold the light of the scene already:
//! the material is unlit (`KHR_materials_unlit`). glTF is y-up: a mesh whose y points down gets a node that turns it by
//! half a turn about x.

use serde_json::{Value, json};

use crate::triangles::Mesh;

/// A mesh does not fit into its format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the mesh takes {bytes} bytes, more than the 4 GiB of a GLB file")]
pub struct MeshTooLarge {
    /// Bytes of the file.
    pub bytes: usize,
}

/// What the text starts with.
const START: &str = r#"{"asset":{"generator":"mba","version":"2.0"},"#;

/// Bytes of the header of the file and of a chunk.
const HEADERS: [usize; 2] = [12, 8];

/// Bytes of a position, a colour and a triangle.
const SIZES: [usize; 3] = [12, 8, 12];

/// Which way the y axis of a mesh points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum YAxis {
    /// Up, or somewhere unknown: the mesh keeps its axes.
    AsIs,
    /// Down, as in the world of a run, which is that of its first camera.
    Down,
}

/// The content of a file. Colours are left out unless there is one per vertex.
///
/// # Errors
/// [`MeshTooLarge`] above 4 GiB.
pub(super) fn format_glb(mesh: &Mesh, y_axis: YAxis) -> Result<Vec<u8>, MeshTooLarge> {
    let colours: &[[u8; 3]] = if mesh.colours.len() == mesh.vertices.len() { &mesh.colours } else { &[] };
    let counts = [mesh.vertices.len(), colours.len(), mesh.triangles.len()];
    let lengths: [usize; 3] = std::array::from_fn(|k| SIZES[k].saturating_mul(counts[k]));
    let data = lengths.iter().fold(0, |sum: usize, length| sum.saturating_add(*length));
    let rest = describe(mesh, counts, lengths, y_axis).to_string();
    let mut text = [START.as_bytes(), rest.as_bytes().get(1..).unwrap_or_default()].concat();
    // Chunks have whole words.
    text.resize(text.len().next_multiple_of(4), b' ');
    let total = data.saturating_add(text.len() + HEADERS[0] + 2 * HEADERS[1]);
    // Lengths in the file have 32 bits.
    let total = u32::try_from(total).map_err(|_| MeshTooLarge { bytes: total })?;
    let mut bytes = Vec::with_capacity(total as usize);
    bytes.extend(b"glTF");
    bytes.extend([2, total, text.len() as u32].into_iter().flat_map(u32::to_le_bytes));
    bytes.extend(b"JSON");
    bytes.extend(text);
    bytes.extend((data as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(mesh.vertices.as_flattened().iter().flat_map(|coordinate| coordinate.to_le_bytes()));
    // Colours of vertices are linear light in this format.
    let linear: [u16; 256] = std::array::from_fn(|byte| linear_light(byte as u8));
    for colour in colours {
        let [r, g, b] = colour.map(|byte| linear[usize::from(byte)]);
        bytes.extend([r, g, b, u16::MAX].into_iter().flat_map(u16::to_le_bytes));
    }
    bytes.extend(mesh.triangles.as_flattened().iter().flat_map(|vertex| vertex.to_le_bytes()));
    Ok(bytes)
}

/// Whether a file that begins with `start` is one of [`format_glb`].
#[must_use]
pub(super) fn is_own_glb(start: &[u8]) -> bool {
    start.starts_with(b"glTF")
        && start.get(HEADERS[0] + HEADERS[1]..).is_some_and(|text| text.starts_with(START.as_bytes()))
}

/// The text of the file without [`START`], for so many positions, colours and triangles, and for their bytes.
fn describe(mesh: &Mesh, counts: [usize; 3], lengths: [usize; 3], y_axis: YAxis) -> Value {
    let (low, high) = bounds(mesh);
    let mut attributes = json!({"POSITION": 0});
    // Component types: 5126 single precision, 5125 `u32`, 5123 `u16`. Targets: 34962 vertices, 34963 indices.
    let mut accessors = vec![
        json!({"bufferView": 0, "componentType": 5126, "count": counts[0],
            "type": "VEC3", "min": low, "max": high}),
        json!({"bufferView": 1, "componentType": 5125, "count": 3 * counts[2], "type": "SCALAR"}),
    ];
    let mut views = vec![
        json!({"buffer": 0, "byteOffset": 0, "byteLength": lengths[0], "target": 34962}),
        json!({"buffer": 0, "byteOffset": lengths[0] + lengths[1], "byteLength": lengths[2], "target": 34963}),
    ];
    if counts[1] > 0 {
        attributes["COLOR_0"] = json!(2);
        accessors
            .push(json!({"bufferView": 2, "componentType": 5123, "normalized": true, "count": counts[1],
            "type": "VEC4"}));
        views.push(json!({"buffer": 0, "byteOffset": lengths[0], "byteLength": lengths[1], "target": 34962}));
    }
    let mut node = json!({"mesh": 0});
    if y_axis == YAxis::Down {
        // Half a turn about x.
        node["rotation"] = json!([1, 0, 0, 0]);
    }
    let data: usize = lengths.iter().sum();
    json!({
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": data}],
        "extensionsUsed": ["KHR_materials_unlit"],
        "materials": [{
            "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1},
            "extensions": {"KHR_materials_unlit": {}},
            "doubleSided": true,
        }],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 1, "material": 0}]}],
        "nodes": [node],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
    })
}

/// The smallest and largest coordinates of all vertices.
fn bounds(mesh: &Mesh) -> ([f32; 3], [f32; 3]) {
    let first = mesh.vertices.first().copied().unwrap_or_default();
    mesh.vertices.iter().fold((first, first), |(low, high), vertex| {
        (std::array::from_fn(|k| low[k].min(vertex[k])), std::array::from_fn(|k| high[k].max(vertex[k])))
    })
}

/// Linear light (sRGB, IEC 61966-2-1) of a display value, with 65535 for all of it.
fn linear_light(byte: u8) -> u16 {
    let display = f64::from(byte) / 255.0;
    let linear = if display <= 0.040_45 { display / 12.92 } else { ((display + 0.055) / 1.055).powf(2.4) };
    (linear * 65535.0).round() as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> Mesh {
        Mesh {
            vertices: vec![[0.0, 0.5, -2.0], [1.0, 0.0, 0.0], [0.25, 1.0, 3.0]],
            colours: vec![[0, 255, 188], [10, 0, 0], [255; 3]],
            triangles: vec![[0, 1, 2], [0, 2, 1]],
        }
    }

    fn word(bytes: &[u8], at: usize) -> u32 {
        u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
    }

    /// The text and the data of a file.
    fn parts(bytes: &[u8]) -> (Value, &[u8]) {
        assert_eq!((&bytes[..4], word(bytes, 4), word(bytes, 8)), (&b"glTF"[..], 2, bytes.len() as u32));
        let length = word(bytes, 12) as usize;
        assert_eq!((&bytes[16..20], length % 4), (&b"JSON"[..], 0));
        let data = &bytes[20 + length..];
        assert_eq!((word(data, 0) as usize, &data[4..8]), (data.len() - 8, &b"BIN\0"[..]));
        (serde_json::from_slice(&bytes[20..20 + length]).unwrap(), &data[8..])
    }

    #[test]
    fn the_data_are_where_the_text_says() {
        let bytes = format_glb(&triangle(), YAxis::Down).unwrap();
        let (text, data) = parts(&bytes);
        let primitive = &text["meshes"][0]["primitives"][0];
        let section = |accessor: &Value| {
            let accessor = &text["accessors"][accessor.as_u64().unwrap() as usize];
            let view = &text["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
            let [at, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
            (accessor["count"].as_u64().unwrap(), &data[at..at + length])
        };
        let (count, positions) = section(&primitive["attributes"]["POSITION"]);
        let floats: Vec<f32> = (0..9).map(|k| f32::from_bits(word(positions, 4 * k))).collect();
        assert_eq!((count, floats), (3, triangle().vertices.as_flattened().to_vec()));
        let (count, colours) = section(&primitive["attributes"]["COLOR_0"]);
        let half = |k: usize| u16::from_le_bytes([colours[2 * k], colours[2 * k + 1]]);
        // sRGB 188 is linear 0.50289, sRGB 10 is 10/255/12.92 = 0.0030353.
        let first: Vec<u16> = (0..5).map(half).collect();
        assert_eq!((count, first), (3, vec![0, 65535, 32957, 65535, 199]));
        let (count, indices) = section(&primitive["indices"]);
        assert_eq!((count, indices.len()), (6, 24));
        assert_eq!((0..6).map(|k| word(indices, 4 * k)).collect::<Vec<_>>(), [0, 1, 2, 0, 2, 1]);
        let [low, high] = ["min", "max"].map(|key| &text["accessors"][0][key]);
        assert_eq!((low, high), (&json!([0.0, 0.0, -2.0]), &json!([1.0, 1.0, 3.0])));
        assert_eq!(text["asset"], json!({"version": "2.0", "generator": "mba"}));
        assert_eq!(text["nodes"][0]["rotation"], json!([1, 0, 0, 0]));
    }

    #[test]
    fn axes_and_colours_are_not_made_up() {
        let plain = Mesh { colours: Vec::new(), ..triangle() };
        let bytes = format_glb(&plain, YAxis::AsIs).unwrap();
        let (text, data) = parts(&bytes);
        assert!(text["nodes"][0]["rotation"].is_null());
        assert!(text["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"].is_null());
        assert_eq!((data.len(), &text["buffers"][0]["byteLength"]), (60, &json!(60)));
    }

    #[test]
    fn own_files_are_known() {
        let bytes = format_glb(&triangle(), YAxis::AsIs).unwrap();
        assert!(is_own_glb(&bytes));
        assert!(!is_own_glb(b"glTF") && !is_own_glb(&bytes[4..]));
        let other = String::from_utf8_lossy(&bytes).replace("mba", "abc");
        assert!(!is_own_glb(other.as_bytes()));
    }
}
