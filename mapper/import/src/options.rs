//! What a user may choose.

/// How to bring a recording in.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions {
    /// Topic of the colour images of a bag; without it the likeliest.
    pub colour_topic: Option<String>,
    /// Topic of the depth images of a bag; without it the likeliest.
    pub depth_topic: Option<String>,
}
