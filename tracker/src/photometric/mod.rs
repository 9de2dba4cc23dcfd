//! The camera's response: from encoded bytes to linear light.

mod response;

pub use response::{InverseResponse, LuminanceTable};
