//! The header: which numbers a vertex has, and where they are.

use std::path::Path;

use super::NAMES;
use super::error::PlyError;
use crate::gaussians::PARAMETERS;

/// How the numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Text,
    LittleEndian,
}

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    F32,
    F64,
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
}

/// A property of interest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Field {
    pub(super) scalar: Scalar,
    /// Bytes before it in a vertex, and properties before it.
    pub(super) offset: usize,
    pub(super) index: usize,
}

/// What the header says.
#[derive(Debug)]
pub(super) struct Header<'a> {
    pub(super) encoding: Encoding,
    /// The first byte of what follows.
    pub(super) body: &'a [u8],
    /// Bytes, or lines of text, in front of the vertices.
    pub(super) skip: u64,
    pub(super) vertices: u64,
    /// Bytes per vertex.
    pub(super) stride: usize,
    /// In the order of [`NAMES`].
    pub(super) fields: [Field; PARAMETERS],
}

/// A run of like records.
struct Element {
    is_vertex: bool,
    count: u64,
    stride: usize,
    has_list: bool,
    properties: usize,
}

/// Lines of the header, with what is needed to complain.
struct Lines<'a, 'p> {
    path: &'p Path,
    rest: &'a [u8],
    line: usize,
}

impl Scalar {
    pub(super) const fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::F32 | Self::U32 | Self::I32 => 4,
            Self::F64 => 8,
        }
    }

    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            "uchar" | "uint8" => Self::U8,
            "char" | "int8" => Self::I8,
            "ushort" | "uint16" => Self::U16,
            "short" | "int16" => Self::I16,
            "uint" | "uint32" => Self::U32,
            "int" | "int32" => Self::I32,
            _ => return None,
        })
    }
}

impl<'a> Lines<'a, '_> {
    /// The next line without its end.
    fn next(&mut self) -> Result<&'a str, PlyError> {
        self.line += 1;
        let end = self.rest.iter().position(|&byte| byte == b'\n');
        let (line, rest) = self.rest.split_at(end.ok_or_else(|| self.error("end_header", "end of file"))?);
        self.rest = &rest[1..];
        let text = str::from_utf8(line).map_err(|_| self.error("text", "bytes that are no text"))?;
        Ok(text.trim())
    }

    fn error(&self, expected: &'static str, found: &str) -> PlyError {
        let found = found.chars().take(80).collect();
        PlyError::Header { path: self.path.to_owned(), line: self.line, expected, found }
    }
}

impl<'a> Header<'a> {
    /// Reads the header of the file `path` with the content `bytes`.
    pub(super) fn parse(path: &Path, bytes: &'a [u8]) -> Result<Self, PlyError> {
        let mut lines = Lines { path, rest: bytes, line: 0 };
        if !bytes.starts_with(b"ply") || lines.next()? != "ply" {
            return Err(PlyError::NotPly { path: path.to_owned() });
        }
        let mut encoding = None;
        let mut elements = Vec::new();
        let mut fields = [None; PARAMETERS];
        loop {
            let line = lines.next()?;
            match *line.split_whitespace().collect::<Vec<_>>() {
                ["end_header"] => break,
                [] | ["comment" | "obj_info", ..] => {}
                ["format", name, _] => {
                    encoding = Some(
                        encoding_of(name)
                            .ok_or_else(|| lines.error("format ascii or binary_little_endian", line))?,
                    )
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| lines.error("a number of elements", line))?;
                    elements.push(Element::new(name, count));
                }
                ["property", "list", _, _, _] => {
                    let element = elements.last_mut().ok_or_else(|| lines.error("an element first", line))?;
                    element.has_list = true;
                }
                ["property", scalar, name] => {
                    let scalar =
                        Scalar::from_name(scalar).ok_or_else(|| lines.error("a known type", line))?;
                    let element = elements.last_mut().ok_or_else(|| lines.error("an element first", line))?;
                    element.add(scalar, name, &mut fields);
                }
                _ => return Err(lines.error("a line of a PLY header", line)),
            }
        }
        let encoding = encoding.ok_or_else(|| lines.error("a line \"format\" before", "end_header"))?;
        let (skip, vertices) = find_vertices(&elements, encoding)
            .ok_or_else(|| lines.error("an element \"vertex\" without lists up to it", "end_header"))?;
        let missing = |name| PlyError::MissingProperty { path: path.to_owned(), name };
        let mut found = [Field { scalar: Scalar::F32, offset: 0, index: 0 }; PARAMETERS];
        for ((found, field), name) in found.iter_mut().zip(fields).zip(NAMES) {
            *found = field.ok_or_else(|| missing(name))?;
        }
        let (count, stride) = vertices;
        Ok(Self { encoding, body: lines.rest, skip, vertices: count, stride, fields: found })
    }
}

impl Element {
    fn new(name: &str, count: u64) -> Self {
        Self { is_vertex: name == "vertex", count, stride: 0, has_list: false, properties: 0 }
    }

    /// Adds a property, and keeps it if it is one of interest.
    fn add(&mut self, scalar: Scalar, name: &str, fields: &mut [Option<Field>; PARAMETERS]) {
        let known = NAMES.iter().position(|known| *known == name);
        if let Some(field) = known.filter(|_| self.is_vertex).and_then(|known| fields.get_mut(known)) {
            *field = Some(Field { scalar, offset: self.stride, index: self.properties });
        }
        self.stride += scalar.size();
        self.properties += 1;
    }
}

fn encoding_of(name: &str) -> Option<Encoding> {
    match name {
        "ascii" => Some(Encoding::Text),
        "binary_little_endian" => Some(Encoding::LittleEndian),
        _ => None,
    }
}

/// What lies in front of the vertices, in bytes or lines; their number and size.
fn find_vertices(elements: &[Element], encoding: Encoding) -> Option<(u64, (u64, usize))> {
    let mut skip = 0_u64;
    for element in elements {
        if element.has_list {
            return None;
        }
        if element.is_vertex {
            return Some((skip, (element.count, element.stride)));
        }
        let size = match encoding {
            Encoding::Text => 1,
            Encoding::LittleEndian => element.stride as u64,
        };
        skip = skip.checked_add(element.count.checked_mul(size)?)?;
    }
    None
}
