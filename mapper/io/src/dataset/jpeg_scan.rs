//! Damage inside of the data of a JPEG image, which decoders do not mind: they go on with whatever the bits then mean, and
//! the rest of the picture is displaced, of another colour or grey.
//!
//! Codes have different lengths, so damage nearly always changes how many blocks the bits of a scan are read as. They are
//! read here without being made into pixels, and counted (ITU-T T.81, annexes B and F). Damage that changes values only is
//! not seen, and progressive images are not looked at.

mod bits;

use bits::{BLOCK, Bits, BlockDamage, Codes, Part, next_marker};

const END_OF_IMAGE: u8 = 0xD9;

/// What is wrong with the data of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum ScanDamage {
    /// The data end too early.
    #[error("the JPEG data end in block {block} of {blocks}")]
    Ends { block: usize, blocks: usize },
    /// There are data behind the last block.
    #[error("{bytes} bytes of JPEG data are left after the last of {blocks} blocks")]
    GoesOn { bytes: usize, blocks: usize },
    /// Bits that are no code, or a value that no image has.
    #[error("the JPEG data of block {block} of {blocks} make no sense")]
    Senseless { block: usize, blocks: usize },
}

/// Reads all scans of an image. What is of a kind that is not read here passes, and so does what no decoder takes.
pub(super) fn check_scans(bytes: &[u8]) -> Result<(), ScanDamage> {
    let mut image = Image::default();
    let mut rest = bytes;
    while let Some((marker, after)) = next_marker(rest) {
        rest = after;
        match marker {
            // The start, restarts and padding have no content.
            0xD8 | 0xD0..=0xD7 | 0x01 => continue,
            END_OF_IMAGE => break,
            _ => {}
        }
        let Some((content, after)) = segment(rest) else { break };
        rest = after;
        let is_understood = match marker {
            0xC4 => image.take_codes(content),
            0xDB => image.take_steps(content),
            0xDD => image.take_restarts(content),
            0xC0 | 0xC1 => image.take_frame(content),
            0xDA => match image.scan(content) {
                Some(scan) => {
                    rest = &rest[scan.check(rest)?..];
                    true
                }
                None => false,
            },
            // Frames that are progressive, without loss or coded arithmetically.
            0xC2..=0xCF => false,
            _ => true,
        };
        if !is_understood {
            break;
        }
    }
    Ok(())
}

/// The content of a segment, whose length comes first, and what follows it.
fn segment(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    rest.split_at_checked(usize::from(u16::from_be_bytes(*length)).checked_sub(2)?)
}

/// What the segments before a scan say.
#[derive(Default)]
struct Image {
    /// Columns and rows.
    size: [usize; 2],
    components: Vec<Component>,
    /// Codes of means and of the other values, by their numbers.
    codes: [[Option<Codes>; 4]; 2],
    /// Quantisation step of the means, by the number of its table; 0 where there is none.
    mean_steps: [i32; 4],
    /// Units between two restarts; 0 where there are none.
    restarts: usize,
}

#[derive(Clone, Copy)]
struct Component {
    name: u8,
    /// Blocks of a unit along columns and rows.
    blocks: [usize; 2],
    /// Number of its table of quantisation steps.
    steps: usize,
}

impl Image {
    /// Takes tables of codes; false if they are none.
    fn take_codes(&mut self, mut content: &[u8]) -> bool {
        while let [kind, rest @ ..] = content {
            let Some((lengths, rest)) = rest.split_first_chunk::<16>() else { return false };
            let count = lengths.iter().copied().map(usize::from).sum();
            let Some((symbols, rest)) = rest.split_at_checked(count) else { return false };
            let [class, number] = [kind >> 4, kind & 15].map(usize::from);
            let Some(place) = self.codes.get_mut(class).and_then(|codes| codes.get_mut(number)) else {
                return false;
            };
            *place = Some(Codes::new(lengths, symbols));
            content = rest;
        }
        true
    }

    /// Takes the first step of tables of quantisation steps; false if they are none.
    fn take_steps(&mut self, mut content: &[u8]) -> bool {
        while let [kind, rest @ ..] = content {
            // Steps have one byte or two.
            let width = if kind >> 4 == 0 { 1 } else { 2 };
            let Some((steps, rest)) = rest.split_at_checked(BLOCK * width) else { return false };
            let Some(place) = self.mean_steps.get_mut(usize::from(kind & 15)) else { return false };
            *place = steps[..width].iter().fold(0, |step, byte| step << 8 | i32::from(*byte));
            content = rest;
        }
        true
    }

    fn take_restarts(&mut self, content: &[u8]) -> bool {
        let Ok(units) = content.try_into() else { return false };
        self.restarts = usize::from(u16::from_be_bytes(units));
        true
    }

    /// Takes size and components; false if there is anything that is not read here.
    fn take_frame(&mut self, content: &[u8]) -> bool {
        let [8, h1, h0, w1, w0, _, components @ ..] = content else { return false };
        self.size = [[*w1, *w0], [*h1, *h0]].map(|side| usize::from(u16::from_be_bytes(side)));
        let component = |bytes: &[u8; 3]| Component {
            name: bytes[0],
            blocks: [bytes[1] >> 4, bytes[1] & 15].map(usize::from),
            steps: usize::from(bytes[2]),
        };
        self.components = components.as_chunks().0.iter().map(component).collect();
        let is_possible =
            |component: &Component| component.blocks.iter().all(|count| (1..=4).contains(count));
        self.components.iter().all(is_possible)
    }

    /// The scan with that head; none if something is missing that it needs.
    fn scan(&self, head: &[u8]) -> Option<Scan<'_>> {
        let (count, rest) = head.split_first()?;
        let choices = rest.as_chunks::<2>().0.get(..usize::from(*count))?;
        let most = |side: usize| self.components.iter().map(|component| component.blocks[side]).max();
        let most = [most(0)?, most(1)?];
        let mut parts = Vec::new();
        let mut units = [0, 1].map(|side| self.size[side].div_ceil(8 * most[side]));
        for [name, tables] in choices {
            let component = self.components.iter().find(|component| component.name == *name)?;
            let [of_means, of_values] = [tables >> 4, tables & 15].map(usize::from);
            let mut blocks = component.blocks[0] * component.blocks[1];
            if choices.len() == 1 {
                // A component on its own has no blocks beyond its edges.
                units = [0, 1]
                    .map(|side| (self.size[side] * component.blocks[side]).div_ceil(most[side]).div_ceil(8));
                blocks = 1;
            }
            parts.push(Part {
                blocks,
                means: self.codes[0].get(of_means)?.as_ref()?,
                values: self.codes[1].get(of_values)?.as_ref()?,
                mean_step: *self.mean_steps.get(component.steps).filter(|step| **step > 0)?,
            });
        }
        if parts.is_empty() {
            return None;
        }
        Some(Scan { parts, units: units[0] * units[1], restarts: self.restarts })
    }
}

/// What is needed to read the data of a scan.
struct Scan<'a> {
    parts: Vec<Part<'a>>,
    units: usize,
    restarts: usize,
}

impl Scan<'_> {
    /// Reads the data at the beginning of `bytes`, and returns how many bytes they are.
    fn check(&self, bytes: &[u8]) -> Result<usize, ScanDamage> {
        let blocks = self.units * self.parts.iter().map(|part| part.blocks).sum::<usize>();
        let mut bits = Bits::new(bytes);
        let mut means = vec![0; self.parts.len()];
        let mut block = 0;
        for unit in 0..self.units {
            // Between two restarts the data are those of a scan of its own: byte by byte, means from zero.
            if self.restarts > 0 && unit > 0 && unit % self.restarts == 0 {
                check_end(&bits, block)?;
                if !bits.restart() {
                    return Err(ScanDamage::Ends { block, blocks });
                }
                means.fill(0);
            }
            for (part, mean) in self.parts.iter().zip(&mut means) {
                for _ in 0..part.blocks {
                    // Blocks are counted from 1 in messages.
                    block += 1;
                    bits.block(part, mean).map_err(|damage| match damage {
                        BlockDamage::Ends => ScanDamage::Ends { block, blocks },
                        BlockDamage::Senseless => ScanDamage::Senseless { block, blocks },
                    })?;
                }
            }
        }
        check_end(&bits, blocks)?;
        Ok(bits.at)
    }
}

/// Refuses data after the last block; a byte is filled up with bits of any kind, and some encoders pad with whole bytes.
fn check_end(bits: &Bits<'_>, blocks: usize) -> Result<(), ScanDamage> {
    let (mut rest, mut left) = (bits.clone(), 0);
    loop {
        rest.fill();
        if rest.count < 8 {
            break;
        }
        let byte = rest.take(rest.count % 8).and_then(|_| rest.take(8)).unwrap_or(0);
        left += usize::from(!matches!(byte, 0 | 0xFF));
    }
    if left > 0 { Err(ScanDamage::GoesOn { bytes: left, blocks }) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use image::codecs::jpeg::JpegEncoder;
    use image::{GrayImage, Luma, Rgb, RgbImage};

    use super::*;

    /// A picture with edges, slopes and some noise.
    fn picture(width: u32, height: u32) -> RgbImage {
        RgbImage::from_fn(width, height, |u, v| {
            let noise = (u.wrapping_mul(2_654_435_761) ^ v.wrapping_mul(40_503)) >> 8 & 15;
            let square = if (u / 13 + v / 9) % 2 == 0 { 90 } else { 0 };
            Rgb([(noise + square + u / 3) as u8, (square + v / 2) as u8, (noise + 40) as u8])
        })
    }

    fn stored(image: &RgbImage, quality: u8) -> Vec<u8> {
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, quality).encode_image(image).expect("memory");
        bytes
    }

    fn decoded(bytes: &[u8]) -> Option<RgbImage> {
        Some(image::load_from_memory(bytes).ok()?.into_rgb8())
    }

    /// Where the data of the only scan begin.
    fn first_byte(bytes: &[u8]) -> usize {
        let head = bytes.windows(2).position(|pair| pair == [0xFF, 0xDA]).expect("a scan");
        head + 2 + usize::from(u16::from_be_bytes([bytes[head + 2], bytes[head + 3]]))
    }

    #[test]
    fn whole_images_pass() {
        for (width, height) in [(64, 48), (61, 47), (8, 8), (1, 1), (320, 5)] {
            for quality in [20, 75, 100] {
                assert_eq!(
                    check_scans(&stored(&picture(width, height), quality)),
                    Ok(()),
                    "{width}x{height}"
                );
            }
            let grey = GrayImage::from_fn(width, height, |u, v| Luma([picture(width, height)[(u, v)][0]]));
            let mut bytes = Vec::new();
            JpegEncoder::new(&mut bytes).encode_image(&grey).expect("memory");
            assert_eq!(check_scans(&bytes), Ok(()), "grey, {width}x{height}");
        }
    }

    #[test]
    fn what_is_cut_or_has_something_inserted_is_named() {
        let bytes = stored(&picture(64, 48), 80);
        let first = first_byte(&bytes);
        let cut = [&bytes[..first + 700], &[0xFF, END_OF_IMAGE][..]].concat();
        assert!(
            matches!(check_scans(&cut), Err(ScanDamage::Ends { blocks: 144, .. })),
            "{:?}",
            check_scans(&cut)
        );
        let longer = [&bytes[..bytes.len() - 2], &[0x35; 40], &[0xFF, END_OF_IMAGE][..]].concat();
        let found = check_scans(&longer);
        assert!(matches!(found, Err(ScanDamage::GoesOn { bytes: 38..=40, blocks: 144 })), "{found:?}");
        // Padding is nothing that is left over.
        let padded = [&bytes[..bytes.len() - 2], &[0; 40], &[0xFF, END_OF_IMAGE][..]].concat();
        assert_eq!(check_scans(&padded), Ok(()));
    }

    /// Damage that changes a fiftieth of the pixels by more than noise is noticed 9 times out of 10.
    #[test]
    fn damage_that_can_be_seen_is_noticed() {
        let whole = picture(160, 120);
        let bytes = stored(&whole, 85);
        let (truth, first) = (decoded(&bytes).expect("an image"), first_byte(&bytes));
        let mut state = 1_u64;
        let mut random = |bound: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % bound
        };
        let (mut visible, mut noticed) = (0, 0);
        for round in 0..300 {
            let mut damaged = bytes.clone();
            let at = first + random(bytes.len() - first - 70);
            match round % 3 {
                0 => damaged[at] ^= 1 << random(8),
                1 => damaged[at..at + 64].fill(0),
                _ => {
                    (0..8).for_each(|_| damaged[first + random(bytes.len() - first - 2)] = random(255) as u8)
                }
            }
            let Some(image) = decoded(&damaged) else { continue };
            let changed = image.as_raw().iter().zip(truth.as_raw()).filter(|(a, b)| a.abs_diff(**b) > 16);
            if changed.count() * 50 > truth.as_raw().len() {
                visible += 1;
                noticed += usize::from(check_scans(&damaged).is_err());
            }
        }
        assert!(visible > 150 && noticed * 10 >= visible * 9, "{noticed} of {visible}");
    }

    #[test]
    fn whatever_the_bytes_are_there_is_an_end() {
        let bytes = stored(&picture(24, 16), 50);
        for at in 0..bytes.len() {
            let _ = check_scans(&bytes[..at]);
            for value in [0, 1, 0x11, 0x7F, 0xFF] {
                let mut changed = bytes.clone();
                changed[at] = value;
                let _ = check_scans(&changed);
            }
        }
    }
}
