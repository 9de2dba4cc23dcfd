//! Reading the bytes of messages, as ROS 1 writes them and as CDR has them.

/// How messages are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Packed, little-endian.
    Ros1,
    /// Values aligned to their size, after four bytes that tell the order of bytes.
    Cdr,
}

/// Reads one message from its beginning. Every read is none where the message ends too early.
pub(super) struct Wire<'a> {
    /// Without the four bytes of CDR, from which alignment counts.
    bytes: &'a [u8],
    at: usize,
    pub(super) encoding: Encoding,
    is_big_endian: bool,
}

macro_rules! number {
    ($name:ident, $type:ty) => {
        pub(super) fn $name(&mut self) -> Option<$type> {
            const BYTES: usize = size_of::<$type>();
            if self.encoding == Encoding::Cdr {
                self.at = self.at.next_multiple_of(BYTES);
            }
            let bytes = self.take(BYTES)?.try_into().ok()?;
            Some(if self.is_big_endian {
                <$type>::from_be_bytes(bytes)
            } else {
                <$type>::from_le_bytes(bytes)
            })
        }
    };
}

impl<'a> Wire<'a> {
    pub(super) fn new(message: &'a [u8], encoding: Encoding) -> Option<Self> {
        if encoding == Encoding::Ros1 {
            return Some(Self { bytes: message, at: 0, encoding, is_big_endian: false });
        }
        let (header, bytes) = message.split_at_checked(4)?;
        // Big- and little-endian without a list of parameters; others are not those of ROS.
        let is_big_endian = match header {
            [0, 0, ..] => true,
            [0, 1, ..] => false,
            _ => return None,
        };
        Some(Self { bytes, at: 0, encoding, is_big_endian })
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(count)?;
        let taken = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(taken)
    }

    number!(u8, u8);
    number!(u32, u32);
    number!(i32, i32);
    number!(f32, f32);
    number!(f64, f64);

    pub(super) fn f64s<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Some(values)
    }

    /// A sequence of at most `most` numbers.
    pub(super) fn f64_list(&mut self, most: usize) -> Option<Vec<f64>> {
        let count = self.u32()? as usize;
        if count > most {
            return None;
        }
        (0..count).map(|_| self.f64()).collect()
    }

    /// A sequence of bytes.
    pub(super) fn bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()?;
        self.take(count as usize)
    }

    /// A text; CDR ends it with a zero.
    pub(super) fn text(&mut self) -> Option<&'a str> {
        let bytes = self.bytes()?;
        let bytes = match (self.encoding, bytes) {
            (Encoding::Cdr, [text @ .., 0]) => text,
            _ => bytes,
        };
        std::str::from_utf8(bytes).ok()
    }
}
