//! The map of a short blurred sequence, from tracked, true and wrong exposures.

mod field;
mod quality;
mod recovery;
mod rolling;
mod settings;
mod third_kind;
