//! From linear light back to the bytes that the camera would have stored.

use mba_tracker::photometric::InverseResponse;

/// Forward response of an 8-bit camera: the byte whose linear light is nearest.
#[derive(Clone, Debug, PartialEq)]
pub struct ForwardResponse {
    /// Light half way between the bytes k and k + 1, increasing.
    borders: [f32; 255],
}

impl ForwardResponse {
    /// Inverts the table of a response.
    #[must_use]
    pub fn new(inverse: &InverseResponse) -> Self {
        let mut borders = [0.0; 255];
        for (border, byte) in borders.iter_mut().zip(0..u8::MAX) {
            *border = 0.5 * (inverse.linear_light(byte) + inverse.linear_light(byte + 1));
        }
        Self { borders }
    }

    /// The byte for linear light, where 1 is full scale; light beyond is clipped.
    #[must_use]
    pub fn encode(&self, light: f32) -> u8 {
        // At most 255 borders lie below.
        self.borders.partition_point(|border| *border < light) as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_survives_the_way_to_light_and_back() {
        let measured = InverseResponse::from_table(&std::array::from_fn(|k| (k * k + k) as f32)).unwrap();
        for inverse in [InverseResponse::srgb(), InverseResponse::linear(), measured] {
            let forward = ForwardResponse::new(&inverse);
            assert!((0..=255).all(|byte| forward.encode(inverse.linear_light(byte)) == byte));
            assert_eq!((forward.encode(-1.0), forward.encode(7.0)), (0, 255));
        }
    }

    #[test]
    fn light_between_two_bytes_goes_to_the_nearer_one() {
        let forward = ForwardResponse::new(&InverseResponse::linear());
        assert_eq!((forward.encode(100.4 / 255.0), forward.encode(100.6 / 255.0)), (100, 101));
    }
}
