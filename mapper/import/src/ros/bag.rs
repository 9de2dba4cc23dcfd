//! Bags of ROS 1, version 2.0: records of a header with named fields and data, most of them in chunks.

use std::collections::HashMap;
use std::path::Path;

use super::chunk::{LARGEST_CHUNK, decompress};
use super::container::{Container, Handle, Message, Topic, type_name};
use super::wire::Encoding;
use crate::ImportError;
use crate::stream::Stream;
use crate::time::Time;

pub(super) const CONTAINER: Container = Container { topics, read };

/// First bytes of a file.
pub(super) const MAGIC: &[u8; 13] = b"#ROSBAG V2.0\n";

/// Kinds of records.
const MESSAGE: u8 = 0x02;
const BAG_HEADER: u8 = 0x03;
const CHUNK: u8 = 0x05;
const CONNECTION: u8 = 0x07;

/// Bytes of the largest header, and of the largest description of a topic.
const LARGEST_HEADER: u64 = 1 << 20;
const LARGEST_DESCRIPTION: u64 = 16 << 20;

/// The fields of a header. Names are short and few.
struct Header<'a>(&'a [u8]);

impl<'a> Header<'a> {
    fn field(&self, name: &str) -> Option<&'a [u8]> {
        let mut rest = self.0;
        while let Some((length, after)) = rest.split_at_checked(4) {
            // Every field comes after its own length.
            let length = u32::from_le_bytes(length.try_into().ok()?) as usize;
            let (field, next) = after.split_at_checked(length)?;
            // A field is its name, the first equals sign, and any bytes.
            let equals = field.iter().position(|byte| *byte == b'=')?;
            if &field[..equals] == name.as_bytes() {
                return Some(&field[equals + 1..]);
            }
            rest = next;
        }
        None
    }

    fn u32(&self, name: &str) -> Option<u32> {
        self.field(name)?.try_into().ok().map(u32::from_le_bytes)
    }

    fn u64(&self, name: &str) -> Option<u64> {
        self.field(name)?.try_into().ok().map(u64::from_le_bytes)
    }

    fn text(&self, name: &str) -> Option<&'a str> {
        std::str::from_utf8(self.field(name)?).ok()
    }

    fn kind(&self) -> Option<u8> {
        match self.field("op")? {
            [kind] => Some(*kind),
            _ => None,
        }
    }
}

/// Topics by the number of their connection.
type Connections = HashMap<u32, Topic>;

fn add_connection(connections: &mut Connections, header: &Header<'_>, data: &[u8]) -> Option<()> {
    let message_type = Header(data).text("type")?;
    let topic = Topic { name: header.text("topic")?.to_owned(), message_type: type_name(message_type) };
    connections.insert(header.u32("conn")?, topic);
    Some(())
}

/// Opens a bag; returns also where its index begins and how many chunks it has, both 0 if it was not closed.
fn open(path: &Path) -> Result<(Stream, u64, u32), ImportError> {
    let mut stream = Stream::open(path)?;
    if stream.array::<13>()? != *MAGIC {
        return Err(stream.damaged("it is no bag of version 2.0"));
    }
    let mut bytes = Vec::new();
    read_header(&mut stream, &mut bytes)?;
    let header = Header(&bytes);
    let index = header.u64("index_pos").filter(|_| header.kind() == Some(BAG_HEADER));
    let (Some(index), Some(chunks)) = (index, header.u32("chunk_count")) else {
        return Err(stream.damaged("the header of the bag makes no sense"));
    };
    // The header is filled up, so that it can be written again when the bag is closed.
    let padding = stream.u32()?;
    stream.skip(u64::from(padding))?;
    Ok((stream, index, chunks))
}

fn read_header(stream: &mut Stream, header: &mut Vec<u8>) -> Result<(), ImportError> {
    let length = stream.u32()?;
    stream.read(u64::from(length), LARGEST_HEADER, header)
}

/// The topics that the index at the end lists, or else all of the file.
fn topics(path: &Path) -> Result<Vec<Topic>, ImportError> {
    let (mut stream, index, _) = open(path)?;
    let mut connections = Connections::new();
    if index != 0 {
        stream.go_to(index)?;
        let (mut header, mut data) = (Vec::new(), Vec::new());
        while !stream.is_at_end() {
            read_header(&mut stream, &mut header)?;
            let length = u64::from(stream.u32()?);
            if Header(&header).kind() == Some(CONNECTION) {
                stream.read(length, LARGEST_DESCRIPTION, &mut data)?;
                add_connection(&mut connections, &Header(&header), &data)
                    .ok_or_else(|| stream.damaged("a topic makes no sense"))?;
            } else {
                stream.skip(length)?;
            }
        }
    } else {
        connections = walk(path, &|_| false, &mut |_| Ok(()), &|_, _| ())?;
    }
    let mut topics: Vec<Topic> = connections.into_values().collect();
    topics.sort_by(|a, b| a.name.cmp(&b.name));
    // Several programs may have written to one.
    topics.dedup();
    Ok(topics)
}

fn read(
    path: &Path,
    is_wanted: &dyn Fn(&Topic) -> bool,
    handle: &mut Handle<'_>,
    progress: &dyn Fn(u64, u64),
) -> Result<(), ImportError> {
    walk(path, is_wanted, handle, progress).map(drop)
}

/// Goes through all records of a bag.
fn walk(
    path: &Path,
    is_wanted: &dyn Fn(&Topic) -> bool,
    handle: &mut Handle<'_>,
    progress: &dyn Fn(u64, u64),
) -> Result<Connections, ImportError> {
    let (mut stream, index, announced) = open(path)?;
    let mut connections = Connections::new();
    let (mut header, mut data, mut chunk) = (Vec::new(), Vec::new(), Vec::new());
    let mut chunks = 0;
    while !stream.is_at_end() {
        read_header(&mut stream, &mut header)?;
        let fields = Header(&header);
        let length = u64::from(stream.u32()?);
        match fields.kind() {
            Some(CONNECTION) => {
                stream.read(length, LARGEST_DESCRIPTION, &mut data)?;
                add_connection(&mut connections, &fields, &data)
                    .ok_or_else(|| stream.damaged("a topic makes no sense"))?;
            }
            Some(MESSAGE) => {
                stream.read(length, LARGEST_CHUNK, &mut data)?;
                message(&connections, &fields, &data, &stream, is_wanted, handle)?;
            }
            Some(CHUNK) => {
                chunks += 1;
                stream.read(length, LARGEST_CHUNK, &mut data)?;
                unpack(&fields, &mut data, &mut chunk).map_err(|reason| stream.damaged(reason))?;
                walk_chunk(&chunk, &mut connections, &stream, is_wanted, handle)?;
            }
            // Indices help whoever looks for something, and all is read here.
            Some(_) => stream.skip(length)?,
            None => return Err(stream.damaged("a record does not say what it is")),
        }
        let (bytes, at) = stream.place();
        progress(at, bytes);
    }
    // A bag that was not closed announces nothing, and is read as far as it goes.
    if index != 0 && chunks < announced {
        return Err(stream.damaged(format!("it is cut off: it has {chunks} of {announced} chunks")));
    }
    Ok(connections)
}

/// The records of a chunk. Without compression `data` and `chunk` change places.
fn unpack(header: &Header<'_>, data: &mut Vec<u8>, chunk: &mut Vec<u8>) -> Result<(), String> {
    let known = (header.text("compression"), header.u32("size"));
    let (Some(compression), Some(size)) = known else {
        return Err("a chunk does not say how it is compressed".to_owned());
    };
    if compression == "none" {
        std::mem::swap(data, chunk);
        return Ok(());
    }
    decompress(compression, data, u64::from(size), chunk)
}

fn walk_chunk(
    chunk: &[u8],
    connections: &mut Connections,
    stream: &Stream,
    is_wanted: &dyn Fn(&Topic) -> bool,
    handle: &mut Handle<'_>,
) -> Result<(), ImportError> {
    let mut rest = chunk;
    while !rest.is_empty() {
        let record = part(&mut rest).and_then(|header| Some((Header(header), part(&mut rest)?)));
        let (header, data) = record.ok_or_else(|| stream.damaged("a chunk ends within a record"))?;
        match header.kind() {
            Some(MESSAGE) => message(connections, &header, data, stream, is_wanted, handle)?,
            Some(CONNECTION) => add_connection(connections, &header, data)
                .ok_or_else(|| stream.damaged("a topic makes no sense"))?,
            _ => {}
        }
    }
    Ok(())
}

/// Takes a length and as many bytes from the beginning of `rest`.
fn part<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, after) = rest.split_at_checked(4)?;
    let length = u32::from_le_bytes(length.try_into().ok()?) as usize;
    let (taken, next) = after.split_at_checked(length)?;
    *rest = next;
    Some(taken)
}

fn message(
    connections: &Connections,
    header: &Header<'_>,
    data: &[u8],
    stream: &Stream,
    is_wanted: &dyn Fn(&Topic) -> bool,
    handle: &mut Handle<'_>,
) -> Result<(), ImportError> {
    let parse = || {
        // Seconds and nanoseconds.
        let time = header.u64("time")?;
        let recorded = Time::from_parts(i64::from(time as u32), (time >> 32) as u32)?;
        Some((header.u32("conn")?, recorded))
    };
    let (connection, recorded) =
        parse().ok_or_else(|| stream.damaged("the header of a message makes no sense"))?;
    let topic = connections.get(&connection).ok_or_else(|| {
        stream.damaged(format!("a message belongs to connection {connection}, which is not there"))
    })?;
    if is_wanted(topic) {
        handle(&Message { topic, encoding: Encoding::Ros1, recorded, data })
    } else {
        Ok(())
    }
}
