//! The folder of a run, and its export to the formats of other programs.

pub mod export;
pub mod run;
