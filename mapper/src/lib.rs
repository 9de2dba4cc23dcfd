//! Data sets, synthetic sequences, evaluation and offline refinement for motion-blur-aware RGB-D SLAM.

pub mod evaluation;
