//! Recordings of other programs and cameras as data sets of mba.
//!
//! [`Source::recognise`] says what a file or folder is, and [`import`] writes it in the native layout: lists of images with
//! their times, `calibration.toml`, and what else was recorded of exposures, poses and inertia. Images are copied as they
//! are, or stored without loss where the source has bare pixels; times are kept to the nanosecond.
//!
//! What a source does not tell is not made up: it is left out, as everywhere in mba, or a note says what is assumed.
//!
//! ```no_run
//! use std::path::Path;
//! use mba_import::{ImportOptions, Source, import};
//!
//! let source = Source::recognise(Path::new("recording.mcap"))?;
//! let imported = import(&source, Path::new("data"), &ImportOptions::default(), &|_, _| ())?;
//! println!("{} colour images, {} of depth", imported.colour_images, imported.depth_images);
//! # Ok::<(), mba_import::ImportError>(())
//! ```

mod destination;
mod error;
mod facts;
mod folders;
mod format;
mod lens;
mod lists;
mod options;
mod picture;
mod pose;
mod record3d;
mod ros;
mod sens;
mod source;
mod stream;
mod time;

pub use destination::Imported;
pub use error::ImportError;
pub use options::ImportOptions;
pub use source::{Source, import};
