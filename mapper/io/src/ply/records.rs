//! The records behind the header, one after the other.

use std::path::Path;

use super::error::PlyError;
use super::header::{Element, Encoding, Header, Kind, Scalar};

/// Reads records in the order of the file; memory grows with what is there, not with what the header announces.
#[derive(Debug)]
pub struct Records<'a, 'p> {
    path: &'p Path,
    encoding: Encoding,
    rest: &'a [u8],
}

/// The content of one record, by the index of the property.
#[derive(Debug, Default)]
pub struct Record {
    /// A number each; 0 for lists.
    pub numbers: Vec<f64>,
    /// The items of each list; none for numbers.
    pub lists: Vec<Vec<f64>>,
}

/// Why a record is of no use.
enum Flaw {
    Ended,
    /// Property and what is there in place of a number.
    NoNumber(usize, String),
}

impl<'a, 'p> Records<'a, 'p> {
    /// The records behind `header` in the file `path`.
    pub fn new(path: &'p Path, header: &Header<'a>) -> Self {
        Self { path, encoding: header.encoding, rest: header.body }
    }

    /// Calls `each` with all records of `element`, which is the next in the file. The properties with the indices
    /// `needed` are finite, in single precision too; others, if they are no numbers, are NaN.
    pub fn read(
        &mut self,
        element: &Element,
        needed: &[usize],
        mut each: impl FnMut(u64, &Record) -> Result<(), PlyError>,
    ) -> Result<(), PlyError> {
        let properties = element.properties.len();
        let mut record = Record { numbers: vec![0.0; properties], lists: vec![Vec::new(); properties] };
        // Without properties there is nothing to read, however many of them there are.
        let count = if properties == 0 { 0 } else { element.count };
        for index in 0..count {
            let read = match self.encoding {
                Encoding::LittleEndian => self.read_binary(element, needed, &mut record),
                Encoding::Text => self.read_line(element, needed, &mut record),
            };
            read.map_err(|flaw| self.error(element, index, flaw))?;
            each(index, &record)?;
        }
        Ok(())
    }

    fn read_binary(&mut self, element: &Element, needed: &[usize], record: &mut Record) -> Result<(), Flaw> {
        for (index, property) in element.properties.iter().enumerate() {
            let check = |number: f64| finite(number, index, needed, || number.to_string());
            match property.kind {
                Kind::Number(scalar) => record.numbers[index] = check(self.take(scalar)?)?,
                Kind::List { length, item } => {
                    record.lists[index].clear();
                    for _ in 0..self.take(length)? as u64 {
                        let item = check(self.take(item)?)?;
                        record.lists[index].push(item);
                    }
                }
            }
        }
        Ok(())
    }

    /// The next number of a binary file.
    fn take(&mut self, scalar: Scalar) -> Result<f64, Flaw> {
        let number = scalar.decode(self.rest).ok_or(Flaw::Ended)?;
        self.rest = &self.rest[scalar.size()..];
        Ok(number)
    }

    fn read_line(&mut self, element: &Element, needed: &[usize], record: &mut Record) -> Result<(), Flaw> {
        let line = String::from_utf8_lossy(self.line().ok_or(Flaw::Ended)?);
        let mut words = line.split_whitespace();
        for (index, property) in element.properties.iter().enumerate() {
            let mut next = || {
                let word = words.next().unwrap_or_default();
                let number = word.parse().unwrap_or(f64::NAN);
                finite(number, index, needed, || word.chars().take(40).collect())
            };
            if let Kind::Number(_) = property.kind {
                record.numbers[index] = next()?;
                continue;
            }
            record.lists[index].clear();
            // More items than the line has bytes are an error sooner or later; an unneeded list is cut.
            for _ in 0..(next()? as u64).min(line.len() as u64) {
                record.lists[index].push(next()?);
            }
        }
        Ok(())
    }

    /// The next line that is not empty.
    fn line(&mut self) -> Option<&'a [u8]> {
        while !self.rest.is_empty() {
            let end = self.rest.iter().position(|&byte| byte == b'\n').unwrap_or(self.rest.len());
            let (line, rest) = self.rest.split_at(end);
            self.rest = rest.get(1..).unwrap_or_default();
            if !line.trim_ascii().is_empty() {
                return Some(line);
            }
        }
        None
    }

    fn error(&self, element: &Element, index: u64, flaw: Flaw) -> PlyError {
        let path = self.path.to_owned();
        match flaw {
            Flaw::Ended => {
                let records = element.plural();
                PlyError::Truncated { path, records, announced: element.count, found: index }
            }
            Flaw::NoNumber(property, found) => {
                let property = element.properties[property].name.clone();
                PlyError::NotFinite { path, element: element.name.clone(), index, property, found }
            }
        }
    }
}

/// The number, if it is finite in single precision too or not needed; else what is there, from `found`.
fn finite(number: f64, property: usize, needed: &[usize], found: impl Fn() -> String) -> Result<f64, Flaw> {
    let fits = (number as f32).is_finite() || !needed.contains(&property);
    if fits { Ok(number) } else { Err(Flaw::NoNumber(property, found())) }
}
