//! The tracker for C, declared in `include/mba_tracker.h`.
//!
//! Every function returns one of the [`codes`] and never unwinds. Pointers are checked as far as they can be: null and
//! misaligned ones, sizes that exceed a stated length and memory that holds no tracker are refused. What cannot be
//! checked is the caller's part:
//!
//! * a pointer that is neither null nor misaligned points to as many valid bytes as its type or the stated length says;
//! * images, configurations and poses are only read, and only during the call;
//! * outputs are written only when a function returns [`codes::MBA_OK`], and do not overlap any input;
//! * the memory given to [`mba_tracker_init`] belongs to the tracker from then on. It may be reused or freed at any
//!   time, there is nothing to destroy; the tracker must not be used afterwards, nor be moved;
//! * what is given for a tracker has at least eight initialised bytes;
//! * a tracker is used by one thread at a time; different trackers are independent.

pub mod codes;
mod convert;
mod functions;
mod pointers;
pub mod types;

pub use functions::*;
