//! The caller's memory, handed out once at construction.

use core::fmt;
use core::mem::{align_of, size_of};

use bytemuck::Pod;

/// Alignment in bytes of every slice that an [`Arena`] hands out: one cache line.
pub const ARENA_ALIGNMENT: usize = 64;

/// Bytes that a slice of `count` values of type `T` occupies in an [`Arena`].
#[must_use]
pub const fn slice_bytes<T>(count: usize) -> usize {
    (count * size_of::<T>()).div_ceil(ARENA_ALIGNMENT) * ARENA_ALIGNMENT
}

/// Hands out aligned, disjoint, zeroed slices of one buffer.
#[derive(Debug)]
pub struct Arena<'m> {
    rest: &'m mut [u8],
}

impl<'m> Arena<'m> {
    /// An arena over `memory`; up to [`ARENA_ALIGNMENT`] - 1 bytes are lost to alignment.
    #[must_use]
    pub fn new(memory: &'m mut [u8]) -> Self {
        let skip = memory.as_ptr().align_offset(ARENA_ALIGNMENT).min(memory.len());
        Self { rest: &mut memory[skip..] }
    }

    /// Takes `count` zeroed values.
    ///
    /// # Errors
    /// [`WorkspaceError::TooSmall`] when fewer bytes are left.
    pub fn take<T: Pod>(&mut self, count: usize) -> Result<&'m mut [T], WorkspaceError> {
        const { assert!(align_of::<T>() <= ARENA_ALIGNMENT) };
        let bytes = slice_bytes::<T>(count);
        let rest = core::mem::take(&mut self.rest);
        if rest.len() < bytes {
            return Err(WorkspaceError::TooSmall { missing: bytes - rest.len() });
        }
        let (taken, rest) = rest.split_at_mut(bytes);
        self.rest = rest;
        taken.fill(0);
        let values = bytemuck::try_cast_slice_mut(&mut taken[..count * size_of::<T>()])
            .map_err(|_| WorkspaceError::Misaligned)?;
        Ok(values)
    }
}

/// Why the caller's memory cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkspaceError {
    /// The buffer is shorter than what is taken from it.
    TooSmall {
        /// Bytes missing for the slice that did not fit.
        missing: usize,
    },
    /// A slice could not be aligned.
    Misaligned,
}

impl fmt::Display for WorkspaceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooSmall { missing } => write!(f, "workspace too small: at least {missing} bytes missing"),
            Self::Misaligned => f.write_str("workspace cannot be aligned"),
        }
    }
}

impl core::error::Error for WorkspaceError {}
