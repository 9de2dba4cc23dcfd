//! MCAP files, version 0: records one after the other, most of them in chunks.

use std::collections::HashMap;
use std::path::Path;

use super::chunk::{LARGEST_CHUNK, decompress};
use super::container::{Container, Handle, Message, Topic, type_name};
use super::wire::Encoding;
use crate::ImportError;
use crate::stream::Stream;
use crate::time::Time;

pub(super) const CONTAINER: Container = Container { topics, read };

/// First and last bytes of a file.
pub(super) const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];

/// Kinds of records.
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const DATA_END: u8 = 0x0F;

/// Bytes of a footer with its kind and length, and of the magic after it.
const END: u64 = 1 + 8 + 20 + 8;

/// Bytes before the data of a message: channel, running number, times of recording and of publishing.
const MESSAGE_HEADER: usize = 2 + 4 + 8 + 8;

/// Bytes of the largest record that is no message or chunk: definitions of messages.
const LARGEST_DEFINITION: u64 = 16 << 20;

/// Topics by the number of their channel; none for those in an encoding that is not read.
#[derive(Default)]
struct Channels {
    schemas: HashMap<u16, String>,
    topics: HashMap<u16, Option<(Topic, Encoding)>>,
}

/// Reads the fields of a record one after the other.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn u16(&mut self) -> Option<u16> {
        self.take(2)?.try_into().ok().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take(4)?.try_into().ok().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.take(8)?.try_into().ok().map(u64::from_le_bytes)
    }

    fn text(&mut self) -> Option<&'a str> {
        let count = self.u32()? as usize;
        std::str::from_utf8(self.take(count)?).ok()
    }
}

impl Channels {
    fn add_schema(&mut self, record: &[u8]) -> Option<()> {
        let mut fields = Fields(record);
        let (id, name) = (fields.u16()?, fields.text()?);
        self.schemas.insert(id, type_name(name));
        Some(())
    }

    fn add_channel(&mut self, record: &[u8]) -> Option<()> {
        let mut fields = Fields(record);
        let (id, schema, name, encoding) = (fields.u16()?, fields.u16()?, fields.text()?, fields.text()?);
        let encoding = match encoding {
            "ros1" => Some(Encoding::Ros1),
            "cdr" => Some(Encoding::Cdr),
            _ => None,
        };
        let message_type = self.schemas.get(&schema).cloned().unwrap_or_default();
        let topic = Topic { name: name.to_owned(), message_type };
        self.topics.insert(id, encoding.map(|encoding| (topic, encoding)));
        Some(())
    }

    /// Takes up a record that describes topics.
    fn add(&mut self, kind: u8, record: &[u8]) -> Option<()> {
        match kind {
            SCHEMA => self.add_schema(record),
            CHANNEL => self.add_channel(record),
            _ => Some(()),
        }
    }

    /// The topic of a message, if it can be read.
    fn topic(&self, id: u16) -> Result<Option<&(Topic, Encoding)>, String> {
        let known = self
            .topics
            .get(&id)
            .ok_or_else(|| format!("a message belongs to channel {id}, which is not there"))?;
        Ok(known.as_ref())
    }

    fn list(self) -> Vec<Topic> {
        let mut topics: Vec<Topic> = self.topics.into_values().flatten().map(|(topic, _)| topic).collect();
        topics.sort_by(|a, b| a.name.cmp(&b.name));
        topics
    }
}

fn open(path: &Path) -> Result<Stream, ImportError> {
    let mut stream = Stream::open(path)?;
    if stream.array::<8>()? == MAGIC {
        Ok(stream)
    } else {
        Err(stream.damaged("it is no MCAP file of version 0"))
    }
}

/// The topics that the summary at the end lists, or else all of the file.
fn topics(path: &Path) -> Result<Vec<Topic>, ImportError> {
    let mut channels = Channels::default();
    let mut stream = open(path)?;
    if let Some(start) = summary_start(&mut stream)? {
        stream.go_to(start)?;
        let mut record = Vec::new();
        loop {
            let (kind, length) = (stream.array::<1>()?[0], stream.u64()?);
            match kind {
                FOOTER => break,
                SCHEMA | CHANNEL => {
                    stream.read(length, LARGEST_DEFINITION, &mut record)?;
                    channels
                        .add(kind, &record)
                        .ok_or_else(|| stream.damaged("its summary makes no sense"))?;
                }
                _ => stream.skip(length)?,
            }
        }
    }
    if channels.topics.is_empty() {
        // Without a summary: through the whole file, for its topics only.
        let none_wanted = |_: &Topic| false;
        channels = walk(path, &none_wanted, &mut |_| Ok(()), &|_, _| ())?;
    }
    Ok(channels.list())
}

/// Where the summary begins, if the file has one.
fn summary_start(stream: &mut Stream) -> Result<Option<u64>, ImportError> {
    let (bytes, _) = stream.place();
    if bytes < MAGIC.len() as u64 + END {
        return Ok(None);
    }
    stream.go_to(bytes - END)?;
    let (kind, length, start) = (stream.array::<1>()?[0], stream.u64()?, stream.u64()?);
    // Behind the start of the summary: that of its own index, and a checksum.
    stream.skip(8 + 4)?;
    let is_footer = kind == FOOTER && length == 20 && stream.array::<8>()? == MAGIC;
    Ok(Some(start).filter(|start| is_footer && *start != 0))
}

fn read(
    path: &Path,
    is_wanted: &dyn Fn(&Topic) -> bool,
    handle: &mut Handle<'_>,
    progress: &dyn Fn(u64, u64),
) -> Result<(), ImportError> {
    walk(path, is_wanted, handle, progress).map(drop)
}

/// Goes through all records up to the end of the data.
fn walk(
    path: &Path,
    is_wanted: &dyn Fn(&Topic) -> bool,
    handle: &mut Handle<'_>,
    progress: &dyn Fn(u64, u64),
) -> Result<Channels, ImportError> {
    let mut stream = open(path)?;
    let mut channels = Channels::default();
    let (mut record, mut chunk) = (Vec::new(), Vec::new());
    loop {
        if stream.is_at_end() {
            return Err(stream.damaged("it is cut off: the end of the data is missing"));
        }
        let (kind, length) = (stream.array::<1>()?[0], stream.u64()?);
        match kind {
            DATA_END | FOOTER => return Ok(channels),
            SCHEMA | CHANNEL => {
                stream.read(length, LARGEST_DEFINITION, &mut record)?;
                channels.add(kind, &record).ok_or_else(|| stream.damaged("a topic makes no sense"))?;
            }
            MESSAGE => {
                stream.read(length, LARGEST_CHUNK, &mut record)?;
                message(&channels, &record, &stream, is_wanted, handle)?;
            }
            CHUNK => {
                stream.read(length, LARGEST_CHUNK, &mut record)?;
                unpack(&record, &mut chunk).map_err(|reason| stream.damaged(reason))?;
                walk_chunk(&chunk, &mut channels, &stream, is_wanted, handle)?;
            }
            _ => stream.skip(length)?,
        }
        let (bytes, at) = stream.place();
        progress(at, bytes);
    }
}

/// The records of a chunk.
fn unpack(record: &[u8], chunk: &mut Vec<u8>) -> Result<(), String> {
    let mut fields = Fields(record);
    let mut header = || {
        // First and last time.
        let _ = (fields.u64()?, fields.u64()?);
        let (bytes, checksum, compression) = (fields.u64()?, fields.u32()?, fields.text()?);
        let packed = usize::try_from(fields.u64()?).ok()?;
        Some((bytes, checksum, compression, fields.take(packed)?))
    };
    let (bytes, checksum, compression, packed) = header().ok_or("a chunk is shorter than it should be")?;
    decompress(compression, packed, bytes, chunk)?;
    let found = crc32fast::hash(chunk);
    // Zero stands for none.
    if checksum != 0 && found != checksum {
        return Err(format!("a chunk is damaged: its checksum is {found:08x}, expected {checksum:08x}"));
    }
    Ok(())
}

fn walk_chunk(
    chunk: &[u8],
    channels: &mut Channels,
    stream: &Stream,
    is_wanted: &dyn Fn(&Topic) -> bool,
    handle: &mut Handle<'_>,
) -> Result<(), ImportError> {
    let mut fields = Fields(chunk);
    while !fields.0.is_empty() {
        let mut next = || {
            let kind = fields.take(1)?[0];
            let length = usize::try_from(fields.u64()?).ok()?;
            Some((kind, fields.take(length)?))
        };
        let (kind, record) = next().ok_or_else(|| stream.damaged("a chunk ends within a record"))?;
        match kind {
            MESSAGE => message(channels, record, stream, is_wanted, handle)?,
            _ => channels.add(kind, record).ok_or_else(|| stream.damaged("a topic makes no sense"))?,
        }
    }
    Ok(())
}

fn message(
    channels: &Channels,
    record: &[u8],
    stream: &Stream,
    is_wanted: &dyn Fn(&Topic) -> bool,
    handle: &mut Handle<'_>,
) -> Result<(), ImportError> {
    let (header, data) = record
        .split_at_checked(MESSAGE_HEADER)
        .ok_or_else(|| stream.damaged("a message is shorter than its header"))?;
    let mut fields = Fields(header);
    let mut parse = || {
        let (channel, _, recorded) = (fields.u16()?, fields.u32()?, fields.u64()?);
        Some((channel, Time::from_nanoseconds(recorded)?))
    };
    let (channel, recorded) =
        parse().ok_or_else(|| stream.damaged("the time of a message makes no sense"))?;
    match channels.topic(channel).map_err(|reason| stream.damaged(reason))? {
        Some((topic, encoding)) if is_wanted(topic) => {
            handle(&Message { topic, encoding: *encoding, recorded, data })
        }
        _ => Ok(()),
    }
}
