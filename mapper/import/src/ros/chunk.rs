//! Parts of a file that are compressed by themselves.

use std::io::Read;

use bzip2::read::BzDecoder;
use lz4_flex::frame::FrameDecoder;
use ruzstd::decoding::StreamingDecoder;

/// Bytes of the largest chunk, compressed or not. Recorders make chunks of about a megabyte; one with a single image may be
/// as large as that.
pub(super) const LARGEST_CHUNK: u64 = 128 << 20;

/// Takes the compression from a chunk of `expected` bytes into `bytes`, whose memory is used again.
///
/// # Errors
/// What is wrong with it.
pub(super) fn decompress(
    compression: &str,
    compressed: &[u8],
    expected: u64,
    bytes: &mut Vec<u8>,
) -> Result<(), String> {
    if expected > LARGEST_CHUNK {
        return Err(format!("a chunk of {expected} bytes is larger than the {LARGEST_CHUNK} that are read"));
    }
    bytes.clear();
    match compression {
        "" | "none" => bytes.extend_from_slice(compressed),
        "lz4" => fill(FrameDecoder::new(compressed), expected, bytes)?,
        "bz2" => fill(BzDecoder::new(compressed), expected, bytes)?,
        "zstd" => {
            let decoder = StreamingDecoder::new(compressed)
                .map_err(|error| format!("a chunk cannot be decompressed: {error}"))?;
            fill(decoder, expected, bytes)?;
        }
        other => return Err(format!("chunks are compressed with {other}; bz2, lz4 and zstd are read")),
    }
    if bytes.len() as u64 != expected {
        return Err(format!("a chunk has {} bytes where {expected} are announced", bytes.len()));
    }
    Ok(())
}

/// Reads one byte more than expected at most. Memory grows with what there is, not with what is announced.
fn fill(decoder: impl Read, expected: u64, bytes: &mut Vec<u8>) -> Result<(), String> {
    let read = decoder.take(expected + 1).read_to_end(bytes);
    read.map(drop).map_err(|error| format!("a chunk cannot be decompressed: {error}"))
}
