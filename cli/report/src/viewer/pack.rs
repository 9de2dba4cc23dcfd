//! A map in as few bytes as a picture of it needs.
//!
//! A Gaussian has 26 bytes, little-endian: the centre in three floats, metres; the logarithms of the deviations in three bytes;
//! the rotation w x y z in four signed bytes; the opacity in a byte; linear red, green and blue in two bytes each. `unpack.js`
//! is the other side.

use mba_mapper::gaussians::{Gaussian, Gaussians};

/// Natural logarithms of the deviations, in metres, that the least and the greatest byte stand for: 0.1 mm and 10 m.
pub(super) const SCALES: [f32; 2] = [-9.21, 2.303];

/// Linear light that the least and the greatest number stand for. Single colours of a map may be out of what can be shown.
pub(super) const COLOURS: [f32; 2] = [-1.0, 3.0];

/// Opacities from a step of eight bits on are seen.
const FAINTEST: f32 = 1.0 / 255.0;

/// The bytes of all Gaussians that can be seen, in their order.
pub(super) fn pack(map: &Gaussians) -> Vec<u8> {
    let all = (0..map.len()).filter_map(|index| map.get(index));
    all.filter(is_seen).flat_map(|gaussian| packed(&gaussian)).collect()
}

fn is_seen(gaussian: &Gaussian) -> bool {
    gaussian.to_array().iter().all(|value| value.is_finite())
        && gaussian.rotation.iter().any(|q| *q != 0.0)
        && opacity(gaussian) >= FAINTEST
}

fn opacity(gaussian: &Gaussian) -> f32 {
    1.0 / (1.0 + (-gaussian.opacity_logit).exp())
}

fn packed(gaussian: &Gaussian) -> [u8; 26] {
    let mut bytes = [0; 26];
    for (place, value) in bytes.chunks_exact_mut(4).zip(gaussian.mean) {
        place.copy_from_slice(&value.to_le_bytes());
    }
    for (byte, scale) in bytes[12..].iter_mut().zip(gaussian.log_scale) {
        *byte = (255.0 * share(scale, SCALES)).round() as u8;
    }
    let longest = gaussian.rotation.iter().fold(0.0_f32, |longest, q| longest.max(q.abs()));
    for (byte, q) in bytes[15..].iter_mut().zip(gaussian.rotation) {
        *byte = ((127.0 * q / longest).round() as i8).cast_unsigned();
    }
    bytes[19] = (255.0 * opacity(gaussian)).round() as u8;
    for (place, light) in bytes[20..].chunks_exact_mut(2).zip(gaussian.colour) {
        place.copy_from_slice(&((65535.0 * share(light, COLOURS)).round() as u16).to_le_bytes());
    }
    bytes
}

/// Where a value lies between the least and the greatest, 0 to 1.
fn share(value: f32, [least, greatest]: [f32; 2]) -> f32 {
    ((value - least) / (greatest - least)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_seen_is_left_out_and_the_rest_has_its_places() {
        let seen = Gaussian {
            mean: [1.0, -2.0, 3.5],
            log_scale: [-9.21, 2.303, -3.4535],
            rotation: [0.5, -1.0, 0.0, 0.25],
            opacity_logit: 0.0,
            colour: [-1.0, 3.0, 1.0],
        };
        let faint = Gaussian { opacity_logit: -6.0, ..seen };
        let broken = Gaussian { mean: [f32::NAN, 0.0, 0.0], ..seen };
        let bytes = pack(&[faint, seen, broken].into_iter().collect());
        assert_eq!(bytes.len(), 26);
        assert_eq!(bytes[4..8], (-2.0_f32).to_le_bytes());
        // Half of the way is 127.5; the quaternion is as long as its bytes allow.
        assert_eq!(bytes[12..20], [0, 255, 128, 64, 129, 0, 32, 128]);
        assert_eq!(bytes[20..], [0, 0, 255, 255, 0, 128]);
    }
}
