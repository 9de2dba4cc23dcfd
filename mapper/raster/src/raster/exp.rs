//! Exponentials of vectors. The backward pass repeats the forward pass with the same function, bit for bit.
//!
//! Range reduction to half a power of two on either side, a relative minimax polynomial of degree 5, and the
//! exponent added in integer bits. Rounding adds and subtracts 1.5 2^23: SSE2 has no rounding instruction, and the
//! integer falls out of the bits.

use core::f32::consts::LOG2_E;

use fearless_simd::{f32x8, prelude::*};

const ROUNDING: f32 = 12_582_912.0;

/// Minimax polynomial of `exp` on `[-ln 2/2, ln 2/2]`, constant term first; relative error 1.1e-7.
const MINIMAX: [f64; 6] =
    [1.000_000_07, 0.999_999_692, 0.499_988_948, 0.166_675_747, 0.041_915_382_6, 0.008_297_655_11];

const EXP: [f32; 6] = scaled(1.0);

/// The same polynomial in `-x/ln 2`.
const EXP2_OF_MINUS: [f32; 6] = scaled(-core::f64::consts::LN_2);

/// Coefficients of the polynomial in `x/unit`.
const fn scaled(unit: f64) -> [f32; 6] {
    let mut coefficients = [0.0; 6];
    let (mut power, mut k) = (1.0, 0);
    while k < 6 {
        coefficients[k] = (MINIMAX[k] * power) as f32;
        power *= unit;
        k += 1;
    }
    coefficients
}

/// Arguments of [`exp2_of_minus`] above this count as this: `2^-24` is far below any visible alpha.
const FAINTEST: f32 = 24.0;

/// Arguments of [`exp`] beyond this count as this; the result is a normal number.
const LARGEST: f32 = 87.0;

/// `ln 2` in two parts; products of the first with small integers are exact.
const LN_2: [f32; 2] = [355.0 / 512.0, -2.121_944_4e-4];

/// `2^-x` within 3e-7 relatively for `0 <= x <= 24`; larger arguments count as 24, small negative ones are allowed.
#[inline(always)]
pub(super) fn exp2_of_minus<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, x: V) -> V {
    let x = x.min(FAINTEST);
    let shifted = V::splat(simd, ROUNDING) - x;
    let fraction = x + (shifted - ROUNDING);
    scale_by_power(polynomial(simd, fraction, &EXP2_OF_MINUS), shifted)
}

/// `exp(x)` within 3e-7 relatively for `|x| <= 87`; arguments beyond count as 87 or -87. The result for NaN is
/// not specified.
#[inline(always)]
pub fn exp<S: Simd>(x: f32x8<S>) -> f32x8<S> {
    let x = x.max(-LARGEST).min(LARGEST);
    let shifted = x * LOG2_E + ROUNDING;
    let power = shifted - ROUNDING;
    let rest = x - power * LN_2[0];
    scale_by_power(polynomial(x.token(), rest - power * LN_2[1], &EXP), shifted)
}

#[inline(always)]
fn polynomial<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, x: V, coefficients: &[f32; 6]) -> V {
    let [c0, c1, c2, c3, c4, c5] = *coefficients;
    let high = x.mul_add(c5, V::splat(simd, c4));
    x.mul_add(x.mul_add(x.mul_add(x.mul_add(high, c3), c2), c1), c0)
}

/// `value 2^n`, where the lowest bits of `shifted` hold the integer n.
#[inline(always)]
fn scale_by_power<S: Simd, V: SimdFloat<S, Element = f32>>(value: V, shifted: V) -> V {
    V::from_bits(value.to_bits() + (shifted.to_bits() << 23))
}
