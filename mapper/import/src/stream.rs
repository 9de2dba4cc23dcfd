//! Reading a large file from its beginning to its end.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::ImportError;

/// Bytes that are asked for at once.
const BUFFER: usize = 1 << 20;

/// A file of which the place is known, so that errors can tell it and lengths are checked before memory is taken.
pub(crate) struct Stream {
    reader: BufReader<File>,
    path: PathBuf,
    bytes: u64,
    at: u64,
}

impl Stream {
    pub(crate) fn open(path: &Path) -> Result<Self, ImportError> {
        let unreadable = |reason| ImportError::unreadable(path, reason);
        let metadata = path.metadata().map_err(unreadable)?;
        // A pipe or device may have no end.
        if !metadata.is_file() {
            return Err(ImportError::damaged(path, "it is no file"));
        }
        let file = File::open(path).map_err(unreadable)?;
        Ok(Self {
            reader: BufReader::with_capacity(BUFFER, file),
            path: path.to_owned(),
            bytes: metadata.len(),
            at: 0,
        })
    }

    /// Bytes in all, and bytes before this place.
    pub(crate) fn place(&self) -> (u64, u64) {
        (self.bytes, self.at)
    }

    pub(crate) fn is_at_end(&self) -> bool {
        self.at >= self.bytes
    }

    /// What is wrong, with the place.
    pub(crate) fn damaged(&self, reason: impl std::fmt::Display) -> ImportError {
        ImportError::damaged(&self.path, format!("{reason} (at byte {})", self.at))
    }

    /// Whether `count` more bytes are there.
    fn check(&self, count: u64) -> Result<(), ImportError> {
        let left = self.bytes.saturating_sub(self.at);
        if count <= left {
            return Ok(());
        }
        Err(self.damaged(format!("it is cut off: {count} bytes are announced and {left} are left")))
    }

    /// The next `count` bytes, at most `most`, in place of what is in `bytes`.
    pub(crate) fn read(&mut self, count: u64, most: u64, bytes: &mut Vec<u8>) -> Result<(), ImportError> {
        if count > most {
            return Err(
                self.damaged(format!("{count} bytes are announced where {most} are the most that is read"))
            );
        }
        self.check(count)?;
        bytes.clear();
        // So many are there.
        bytes.reserve_exact(count as usize);
        let read = (&mut self.reader).take(count).read_to_end(bytes);
        let read = read.map_err(|reason| ImportError::unreadable(&self.path, reason))? as u64;
        self.at += read;
        // A file may shrink while it is read.
        if read == count { Ok(()) } else { Err(self.damaged("it ends before it should")) }
    }

    /// The next bytes, as many as there are in the array.
    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], ImportError> {
        self.check(N as u64)?;
        let mut bytes = [0; N];
        self.reader.read_exact(&mut bytes).map_err(|reason| ImportError::unreadable(&self.path, reason))?;
        self.at += N as u64;
        Ok(bytes)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, ImportError> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Result<u64, ImportError> {
        self.array().map(u64::from_le_bytes)
    }

    pub(crate) fn skip(&mut self, count: u64) -> Result<(), ImportError> {
        self.check(count)?;
        let step = i64::try_from(count).map_err(|_| self.damaged("it is too large"))?;
        self.reader.seek_relative(step).map_err(|reason| ImportError::unreadable(&self.path, reason))?;
        self.at += count;
        Ok(())
    }

    /// Goes to a place in the file.
    pub(crate) fn go_to(&mut self, at: u64) -> Result<(), ImportError> {
        if at > self.bytes {
            return Err(
                self.damaged(format!("it is cut off: its index begins at byte {at} of {}", self.bytes))
            );
        }
        self.reader
            .seek(SeekFrom::Start(at))
            .map_err(|reason| ImportError::unreadable(&self.path, reason))?;
        self.at = at;
        Ok(())
    }
}
