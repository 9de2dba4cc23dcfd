//! From tracked exposures to a sharp map: exposures that do not fit are repaired, map and paths adjusted together, loops spread
//! over a graph of poses, places recognised, and keyframes deblurred.

pub mod bundle;
pub mod continuity;
pub mod deblurring;
pub mod places;
pub mod pose_graph;
