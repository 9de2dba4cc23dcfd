//! What can happen to a file.

use std::fs;
use std::io;
use std::path::Path;
use std::process::Command;

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// One kind of damage to a file.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Mutation {
    /// Only this share of the bytes is left, in 64ths.
    Cut(usize),
    /// The last byte is missing.
    LastByte,
    /// Twice in a row.
    Doubled,
    /// Bytes that nobody expects at the end.
    Appended,
    /// A block of 64 bytes, at this 64th of the file, is overwritten by a value.
    Block(usize, u8),
    /// Up to eight random bytes have other values.
    Flips(u32),
    /// The same in a checkpoint whose checksum was made right again.
    Forged(u32),
    /// Lines in another order.
    Reversed,
    /// The first line of data twice.
    LineTwice,
    /// Without its first line.
    NoFirstLine,
    /// The number with this index, counted from the end of the first line of data, is another text.
    Number(usize, &'static str),
    /// Another encoding or line end.
    Encoding(Encoding),
    /// A line of a megabyte.
    LongLine,
    /// The size in the header of a PNG, checksum and all.
    PngSize(u32, u32),
    /// Something else in its place.
    Replaced(Replacement),
}

/// How a text can be stored.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Encoding {
    Mark,
    Utf16,
    Latin1,
    CrLf,
    Cr,
    Nul,
}

/// What can be where a file should be.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Replacement {
    Nothing,
    Folder,
    DeadLink,
    Loop,
    Zeros,
    Pipe,
    /// Five gigabytes without any content.
    Hole,
}

/// Damage that any file can take; `flips` is the number of random ones.
pub(crate) fn of_any_file(flips: u32) -> Vec<Mutation> {
    use Replacement::{DeadLink, Folder, Hole, Loop, Nothing, Pipe, Zeros};
    let replaced = [Nothing, Folder, DeadLink, Loop, Zeros, Pipe, Hole].map(Mutation::Replaced);
    let cuts = [0, 1, 8, 16, 32, 48, 60].map(Mutation::Cut);
    let blocks =
        [(0, 0), (0, 255), (16, 0), (32, 255), (48, 10)].map(|(at, value)| Mutation::Block(at, value));
    let others = [Mutation::LastByte, Mutation::Doubled, Mutation::Appended];
    let random = (0..flips).map(Mutation::Flips);
    replaced.into_iter().chain(cuts).chain(blocks).chain(others).chain(random).collect()
}

/// Damage to texts of numbers.
pub(crate) fn of_text() -> Vec<Mutation> {
    use Encoding::{Cr, CrLf, Latin1, Mark, Nul, Utf16};
    const VALUES: [&str; 9] =
        ["nan", "inf", "-1", "0", "1e300", "1e-300", "99999999999999999999", "\"x\"", ""];
    let numbers = VALUES.iter().flat_map(|value| [0, 1, 3].map(|index| Mutation::Number(index, value)));
    let encodings = [Mark, Utf16, Latin1, CrLf, Cr, Nul].map(Mutation::Encoding);
    let lines = [Mutation::Reversed, Mutation::LineTwice, Mutation::NoFirstLine, Mutation::LongLine];
    numbers.chain(encodings).chain(lines).collect()
}

/// Sizes that a PNG can claim.
pub(crate) fn of_png() -> Vec<Mutation> {
    const SIZES: [(u32, u32); 5] = [(0, 0), (1, 1), (60_000, 60_000), (0x7fff_ffff, 0x7fff_ffff), (161, 120)];
    SIZES.map(|(width, height)| Mutation::PngSize(width, height)).into()
}

impl Mutation {
    /// Applies the damage to the file at `path`, whose good content is `good`.
    pub(crate) fn apply(self, path: &Path, good: &[u8]) -> io::Result<()> {
        if let Self::Replaced(replacement) = self {
            fs::remove_file(path)?;
            return replace(path, replacement);
        }
        fs::write(path, self.damaged(good))
    }

    fn damaged(self, good: &[u8]) -> Vec<u8> {
        let text = || String::from_utf8_lossy(good).into_owned();
        match self {
            Self::Cut(share) => good[..good.len() * share / 64].to_vec(),
            Self::LastByte => good[..good.len().saturating_sub(1)].to_vec(),
            Self::Doubled => good.repeat(2),
            Self::Appended => [good, &[0, 255, b'x', b'\n', 7]].concat(),
            Self::Block(at, value) => {
                let mut bytes = good.to_vec();
                let start = bytes.len() * at / 64;
                bytes.iter_mut().skip(start).take(64).for_each(|byte| *byte = value);
                bytes
            }
            Self::Flips(seed) => flipped(good, seed),
            Self::Forged(seed) => forged(good, seed),
            Self::Reversed => text().lines().rev().map(|line| format!("{line}\n")).collect::<String>().into(),
            Self::LineTwice => {
                let at = first_line_of_data(&text());
                let twice =
                    |(index, line): (usize, &str)| format!("{line}\n").repeat(1 + usize::from(index == at));
                text().lines().enumerate().map(twice).collect::<String>().into()
            }
            Self::NoFirstLine => {
                text().lines().skip(1).map(|line| format!("{line}\n")).collect::<String>().into()
            }
            Self::Number(index, value) => with_number(&text(), index, value).into(),
            Self::Encoding(encoding) => encoded(&text(), encoding),
            Self::LongLine => [good, &b"1 ".repeat(1 << 19)].concat(),
            Self::PngSize(width, height) => png_of_size(good, width, height),
            Self::Replaced(_) => Vec::new(),
        }
    }
}

fn flipped(good: &[u8], seed: u32) -> Vec<u8> {
    let mut bytes = good.to_vec();
    let mut random = Pcg32::seed_from_u64(u64::from(seed));
    let mut below = |limit: usize| random.next_u32() as usize % limit;
    if bytes.is_empty() {
        return bytes;
    }
    // Half of all damage near the beginning, where the headers are.
    let reach = if seed.is_multiple_of(2) { bytes.len().min(256) } else { bytes.len() };
    for _ in 0..=below(8) {
        let at = below(reach);
        bytes[at] ^= 1 << below(8);
    }
    bytes
}

/// A checkpoint with other content and the checksum of that: its header has 64 bytes, of which the last twelve are the
/// length of what follows and the checksum.
fn forged(good: &[u8], seed: u32) -> Vec<u8> {
    let (header, content) = good.split_at(64.min(good.len()));
    let mut bytes = [header, &flipped(content, seed)].concat();
    if bytes.len() > 64 {
        let checksum = crc32fast::hash(&[&bytes[12..60], &bytes[64..]].concat());
        bytes[60..64].copy_from_slice(&checksum.to_le_bytes());
    }
    bytes
}

/// Index of the first line with a number that is no comment.
fn first_line_of_data(text: &str) -> usize {
    let is_data = |line: &str| !line.starts_with('#') && line.contains(|c: char| c.is_ascii_digit());
    text.lines().position(is_data).unwrap_or(0)
}

fn with_number(text: &str, index: usize, value: &str) -> String {
    let at = first_line_of_data(text) + index;
    let replaced = |line: &str| {
        let is_number = |word: &&str| word.parse::<f64>().is_ok();
        let separators = [' ', ',', '\t'];
        match line.split(separators).filter(is_number).nth(index) {
            Some(number) => line.replacen(number, value, 1),
            None => value.to_owned(),
        }
    };
    let line = |(k, line): (usize, &str)| if k == at { replaced(line) + "\n" } else { format!("{line}\n") };
    text.lines().enumerate().map(line).collect()
}

fn encoded(text: &str, encoding: Encoding) -> Vec<u8> {
    match encoding {
        Encoding::Mark => [&[0xEF, 0xBB, 0xBF], text.as_bytes()].concat(),
        Encoding::Utf16 => {
            [0xFEFF].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect()
        }
        Encoding::Latin1 => [&b"# caf\xE9\n"[..], text.as_bytes()].concat(),
        Encoding::CrLf => text.replace('\n', "\r\n").into(),
        Encoding::Cr => text.replace('\n', "\r").into(),
        Encoding::Nul => text.replacen(' ', "\0", 3).into(),
    }
}

/// A PNG whose header claims another size, with the checksum of that header.
fn png_of_size(good: &[u8], width: u32, height: u32) -> Vec<u8> {
    // Signature and length are 12 bytes, then IHDR with width and height, 17 bytes in all, then the checksum.
    let mut bytes = good.to_vec();
    if bytes.len() < 33 {
        return bytes;
    }
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    let checksum = crc32fast::hash(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
    bytes
}

fn replace(path: &Path, replacement: Replacement) -> io::Result<()> {
    let link = |target: &Path| std::os::unix::fs::symlink(target, path);
    match replacement {
        Replacement::Nothing => Ok(()),
        Replacement::Folder => fs::create_dir(path),
        Replacement::DeadLink => link(Path::new("nowhere")),
        Replacement::Loop => link(path),
        Replacement::Zeros => link(Path::new("/dev/zero")),
        Replacement::Pipe => Command::new("mkfifo").arg(path).status().map(|_| ()),
        Replacement::Hole => fs::File::create(path)?.set_len(5 << 30),
    }
}
