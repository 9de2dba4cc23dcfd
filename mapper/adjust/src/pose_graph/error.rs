//! What can be wrong with a pose graph.

/// A pose graph cannot be optimised.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseGraphError {
    /// An edge names a node that does not exist.
    #[error("edge {edge} names node {node}; there are {nodes} nodes")]
    NodeOutOfRange {
        /// Index of the edge.
        edge: usize,
        /// The node it names.
        node: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// An edge leads from a node to itself.
    #[error("edge {edge} leads from node {node} to itself")]
    SelfEdge {
        /// Index of the edge.
        edge: usize,
        /// The node.
        node: usize,
    },
    /// The pose of a node is not finite or its quaternion not of unit length.
    #[error("the pose of node {node} is not a finite rigid motion")]
    NodePose {
        /// Index of the node.
        node: usize,
    },
    /// The measurement of an edge is not finite or its quaternion not of unit length.
    #[error("the measurement of edge {edge} is not a finite rigid motion")]
    EdgePose {
        /// Index of the edge.
        edge: usize,
    },
    /// A standard deviation is not positive and finite.
    #[error("edge {edge}: standard deviations {translation} m and {rotation} rad, both have to be positive")]
    Sigma {
        /// Index of the edge.
        edge: usize,
        /// That of the translation, metres.
        translation: f64,
        /// That of the rotation, radians.
        rotation: f64,
    },
    /// A setting is out of its range.
    #[error("pose graph setting {name} = {value}: expected {expected}")]
    Setting {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The valid range in words.
        expected: &'static str,
    },
}
