//! All that a tracker knows as bytes, so that it can go on later as if nothing had been between.
//!
//! Saving and restoring walk over the same places in the same order: neither can forget what the other has. Numbers keep
//! every bit, in the byte order of the machine.

use core::fmt;

use bytemuck::Pod;
use nalgebra::SVector;

use crate::geometry::RigidTransform;
use crate::trajectory::{BowedTrajectory, FrameTiming};

/// What a saved session starts with: the version of its layout. On a machine of another byte order it is another number.
const LAYOUT: u64 = 0x6d62_6173_6573_0003;

/// A walk over the places of a session, which takes or fills them.
pub(crate) struct Walk<'a> {
    way: Way<'a>,
}

enum Way<'a> {
    Save(&'a mut dyn FnMut(&[u8])),
    /// What was not read yet; none after there was too little.
    Restore(Option<&'a [u8]>),
}

impl<'a> Walk<'a> {
    /// A walk that gives all bytes to `write`, one part after the other.
    pub(crate) fn save(write: &'a mut dyn FnMut(&[u8])) -> Self {
        let mut walk = Self { way: Way::Save(write) };
        walk.value(&mut { LAYOUT });
        walk
    }

    /// A walk that fills all places from the bytes of a saved session.
    ///
    /// # Errors
    /// [`SessionError::Layout`] when they are none.
    pub(crate) fn restore(bytes: &'a [u8]) -> Result<Self, SessionError> {
        let mut walk = Self { way: Way::Restore(Some(bytes)) };
        let mut layout = 0;
        walk.value(&mut layout);
        if layout == LAYOUT { Ok(walk) } else { Err(SessionError::Layout) }
    }

    /// Ends the walk.
    ///
    /// # Errors
    /// [`SessionError::Length`] when there were not as many bytes as places.
    pub(crate) fn end(self) -> Result<(), SessionError> {
        match self.way {
            Way::Save(_) | Way::Restore(Some([])) => Ok(()),
            Way::Restore(_) => Err(SessionError::Length),
        }
    }

    /// Visits plain values.
    pub(crate) fn values<T: Pod>(&mut self, place: &mut [T]) {
        let place = bytemuck::cast_slice_mut::<T, u8>(place);
        match &mut self.way {
            Way::Save(write) => write(place),
            Way::Restore(rest) => {
                *rest = rest.and_then(|bytes| bytes.split_at_checked(place.len())).map(|(read, rest)| {
                    place.copy_from_slice(read);
                    rest
                });
            }
        }
    }

    /// Visits one plain value.
    pub(crate) fn value<T: Pod>(&mut self, place: &mut T) {
        self.values(core::slice::from_mut(place));
    }

    /// Visits a number of things.
    pub(crate) fn count(&mut self, place: &mut usize) {
        let mut number = *place as u64;
        self.value(&mut number);
        *place = usize::try_from(number).unwrap_or(usize::MAX);
    }

    /// Visits a truth value.
    pub(crate) fn flag(&mut self, place: &mut bool) {
        let mut byte = u8::from(*place);
        self.value(&mut byte);
        *place = byte != 0;
    }

    /// Visits what may be there or not with `visit`; it starts from `any` when something has to be made.
    pub(crate) fn option<T>(&mut self, place: &mut Option<T>, any: T, visit: impl FnOnce(&mut Self, &mut T)) {
        let mut is_there = place.is_some();
        self.flag(&mut is_there);
        if is_there {
            visit(self, place.get_or_insert(any));
        } else {
            *place = None;
        }
    }

    /// Visits the numbers of a vector.
    pub(crate) fn vector<const N: usize>(&mut self, place: &mut SVector<f64, N>) {
        self.values(place.as_mut_slice());
    }

    /// Visits a pose; nothing is normalised, which would change the last bit.
    pub(crate) fn pose(&mut self, place: &mut RigidTransform) {
        self.values(place.translation.as_mut_slice());
        self.values(place.rotation.as_mut_unchecked().coords.as_mut_slice());
    }

    /// Visits a path.
    pub(crate) fn path(&mut self, place: &mut BowedTrajectory) {
        self.pose(&mut place.linear.start);
        self.pose(&mut place.linear.end);
        self.vector(&mut place.bow);
        self.vector(&mut place.jerk);
    }

    /// Visits the times of a frame's parts.
    pub(crate) fn timing(&mut self, place: &mut FrameTiming) {
        let FrameTiming { exposure, readout, bands, depth_time, depth_readout } = place;
        [exposure, readout, depth_time, depth_readout].into_iter().for_each(|time| self.value(time));
        self.count(bands);
    }
}

/// Whether all values are finite.
pub(crate) fn are_finite(values: &[f32]) -> bool {
    values.iter().all(|value| value.is_finite())
}

/// Why a session cannot be restored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SessionError {
    /// The bytes are no session, or one of another version or machine.
    Layout,
    /// The session is that of a tracker with another configuration, or was cut.
    Length,
    /// No tracker can have come to what the session says.
    Unsound,
}

impl fmt::Display for SessionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Layout => "not a session of this version of the tracker on this kind of machine",
            Self::Length => "the session is cut, or that of a tracker with another configuration",
            Self::Unsound => "no tracker can have come to what the session says",
        })
    }
}

impl core::error::Error for SessionError {}
