//! What bags and MCAP files have in common.

use std::path::Path;

use super::wire::Encoding;
use crate::ImportError;
use crate::time::Time;

/// A stream of messages of one type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Topic {
    pub(super) name: String,
    /// Package and type, as `sensor_msgs/Image`.
    pub(super) message_type: String,
}

/// A message of a topic.
pub(super) struct Message<'a> {
    pub(super) topic: &'a Topic,
    pub(super) encoding: Encoding,
    /// When it was recorded.
    pub(super) recorded: Time,
    pub(super) data: &'a [u8],
}

/// What is done with each message.
pub(super) type Handle<'a> = dyn FnMut(&Message<'_>) -> Result<(), ImportError> + 'a;

/// Whether messages of a topic are handed over.
pub(super) type IsWanted<'a> = dyn Fn(&Topic) -> bool + 'a;

/// Hands over the messages of topics that are wanted, in the order of the file, and tells the bytes that are done and all.
pub(super) type ReadMessages =
    fn(&Path, &IsWanted<'_>, &mut Handle<'_>, &dyn Fn(u64, u64)) -> Result<(), ImportError>;

/// A kind of file that holds messages.
pub(super) struct Container {
    /// All topics, by the index of the file where it has one.
    pub(super) topics: fn(&Path) -> Result<Vec<Topic>, ImportError>,
    pub(super) read: ReadMessages,
}

/// The same type without the folder that ROS 2 puts in between.
pub(super) fn type_name(name: &str) -> String {
    name.replacen("/msg/", "/", 1)
}
