//! Lines of a text file: comments, fields, finite numbers, timestamps in order.

use std::path::{Path, PathBuf};

use crate::FileError;
use crate::whole_file::read_text;

/// A whole text file; lines that are blank or start with `#` are skipped but counted.
pub struct TextFile {
    path: PathBuf,
    text: String,
}

/// One line and where it stands.
#[derive(Clone, Copy)]
pub struct Line<'a> {
    path: &'a Path,
    /// From 1.
    pub number: usize,
    /// Without surrounding white space.
    pub text: &'a str,
}

impl TextFile {
    /// Reads a file.
    ///
    /// # Errors
    /// See [`read_text`].
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Ok(Self { path: path.to_owned(), text: read_text(path)? })
    }

    /// The lines that say something.
    pub fn lines(&self) -> impl Iterator<Item = Line<'_>> {
        self.text
            .lines()
            .enumerate()
            .map(|(index, text)| Line { path: &self.path, number: index + 1, text: text.trim() })
            .filter(|line| !line.text.is_empty() && !line.text.starts_with('#'))
    }
}

/// Results are written with six decimals: times that are equal then could not be told apart.
fn in_microseconds(seconds: f64) -> f64 {
    (seconds * 1e6).round()
}

impl<'a> Line<'a> {
    /// Splits at white space and commas, as the TUM tools do.
    pub fn fields(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.text.split([' ', '\t', ',']).filter(|field| !field.is_empty())
    }

    /// All fields as finite numbers, exactly `N` of them.
    pub fn numbers<const N: usize>(&self, expected: &'static str) -> Result<[f64; N], FileError> {
        let mut numbers = [0.0; N];
        let mut fields = self.fields();
        for number in &mut numbers {
            let field = fields.next().ok_or_else(|| self.malformed(expected))?;
            *number = self.number(field, expected)?;
        }
        if fields.next().is_some() {
            return Err(self.malformed(expected));
        }
        Ok(numbers)
    }

    /// One field of this line as a finite number.
    pub fn number(&self, field: &str, expected: &'static str) -> Result<f64, FileError> {
        let number: f64 = field.parse().map_err(|_| self.malformed(expected))?;
        if number.is_finite() {
            Ok(number)
        } else {
            Err(FileError::NotFinite {
                path: self.path.to_owned(),
                line: self.number,
                value: field.to_owned(),
            })
        }
    }

    /// The error of a line that is not `expected`.
    pub fn malformed(&self, expected: &'static str) -> FileError {
        FileError::MalformedLine {
            path: self.path.to_owned(),
            line: self.number,
            found: self.text.chars().take(120).collect(),
            expected,
        }
    }

    /// Whether `timestamp`, found on this line, lies after `previous`.
    pub(crate) fn check_order(&self, timestamp: f64, previous: Option<f64>) -> Result<(), FileError> {
        let (path, line) = (self.path.to_owned(), self.number);
        match previous {
            Some(previous) if timestamp < previous => {
                Err(FileError::TimestampOrder { path, line, timestamp, previous })
            }
            Some(previous) if in_microseconds(timestamp) == in_microseconds(previous) => {
                Err(FileError::TimestampDoubled { path, line, timestamp })
            }
            _ => Ok(()),
        }
    }

    /// The file.
    pub fn path(&self) -> &'a Path {
        self.path
    }
}
