//! The header: which records a file has, and which numbers a record has.

use std::path::Path;

use super::error::PlyError;

/// How the numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    Text,
    LittleEndian,
}

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    F32,
    F64,
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
}

/// One number, or a list of them with its length in front.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Number(Scalar),
    List { length: Scalar, item: Scalar },
}

/// A named part of a record.
#[derive(Clone, Debug)]
pub(crate) struct Property {
    pub name: String,
    pub kind: Kind,
}

/// A run of like records.
#[derive(Clone, Debug)]
pub struct Element {
    /// Name, e.g. `vertex`.
    pub name: String,
    /// Number of records.
    pub count: u64,
    /// What a record consists of, in this order.
    pub(crate) properties: Vec<Property>,
}

/// What the header says.
#[derive(Debug)]
pub struct Header<'a> {
    /// How numbers are written.
    pub encoding: Encoding,
    /// What follows the header.
    pub body: &'a [u8],
    /// In the order of the file.
    pub elements: Vec<Element>,
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

    /// The number that the first bytes hold, if there are enough.
    pub(super) fn decode(self, bytes: &[u8]) -> Option<f64> {
        let mut eight = [0; 8];
        eight[..self.size()].copy_from_slice(bytes.get(..self.size())?);
        let [a, b, c, d, ..] = eight;
        Some(match self {
            Self::F32 => f32::from_le_bytes([a, b, c, d]).into(),
            Self::F64 => f64::from_le_bytes(eight),
            Self::U8 => a.into(),
            Self::I8 => i8::from_le_bytes([a]).into(),
            Self::U16 => u16::from_le_bytes([a, b]).into(),
            Self::I16 => i16::from_le_bytes([a, b]).into(),
            Self::U32 => u32::from_le_bytes([a, b, c, d]).into(),
            Self::I32 => i32::from_le_bytes([a, b, c, d]).into(),
        })
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

    /// The property that a line describes by type and name.
    fn property(&self, kind: Option<Kind>, name: &str, line: &str) -> Result<Property, PlyError> {
        let kind = kind.ok_or_else(|| self.error("a known type", line))?;
        Ok(Property { name: name.to_owned(), kind })
    }
}

impl<'a> Header<'a> {
    /// Reads the header of the file `path` with the content `bytes`.
    pub fn parse(path: &Path, bytes: &'a [u8]) -> Result<Self, PlyError> {
        let mut lines = Lines { path, rest: bytes, line: 0 };
        if !bytes.starts_with(super::MAGIC) || lines.next()? != "ply" {
            return Err(PlyError::NotPly { path: path.to_owned() });
        }
        // Lines of words until the end of the header; properties belong to the element before them.
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        loop {
            let line = lines.next()?;
            let property = match *line.split_whitespace().collect::<Vec<_>>() {
                ["end_header"] => break,
                [] | ["comment" | "obj_info", ..] => continue,
                ["format", name, _] => {
                    let known = encoding_of(name);
                    encoding =
                        Some(known.ok_or_else(|| lines.error("format ascii or binary_little_endian", line))?);
                    continue;
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| lines.error("a number of elements", line))?;
                    elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                    continue;
                }
                ["property", "list", length, item, name] => {
                    let scalars = Scalar::from_name(length).zip(Scalar::from_name(item));
                    let kind = scalars.map(|(length, item)| Kind::List { length, item });
                    lines.property(kind, name, line)?
                }
                ["property", scalar, name] => {
                    lines.property(Scalar::from_name(scalar).map(Kind::Number), name, line)?
                }
                _ => return Err(lines.error("a line of a PLY header", line)),
            };
            let element = elements.last_mut().ok_or_else(|| lines.error("an element first", line))?;
            element.properties.push(property);
        }
        // Without its format the body means nothing.
        let encoding = encoding.ok_or_else(|| lines.error("a line \"format\" before", "end_header"))?;
        Ok(Self { encoding, body: lines.rest, elements })
    }
}

impl Element {
    /// Where the number called `name` is among the properties.
    pub fn number(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|p| p.name == name && matches!(p.kind, Kind::Number(_)))
    }

    /// Where the first list with one of these names is.
    pub fn list(&self, names: &[&str]) -> Option<usize> {
        let listed = |p: &Property| names.contains(&&*p.name) && matches!(p.kind, Kind::List { .. });
        self.properties.iter().position(listed)
    }

    /// The records in words.
    pub(super) fn plural(&self) -> String {
        match &*self.name {
            "vertex" => "vertices".to_owned(),
            name => format!("{name}s"),
        }
    }
}

fn encoding_of(name: &str) -> Option<Encoding> {
    match name {
        "ascii" => Some(Encoding::Text),
        "binary_little_endian" => Some(Encoding::LittleEndian),
        _ => None,
    }
}
