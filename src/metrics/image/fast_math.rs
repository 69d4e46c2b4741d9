//! Powers and roots in f32 that a compiler turns into SIMD: no branches, no calls.
//!
//! They are built of multiplications and additions that are rounded alike on every
//! instruction set, so that a metric has the same bits with and without AVX2.

/// log2(1 + f) on [sqrt(1/2), sqrt(2)) as a series in s = f / (2 + f):
/// 2 / ln 2 (s + s^3/3 + s^5/5 + ...).
#[inline(always)]
fn log2(x: f32) -> f32 {
    const HALF_ROOT: i32 = 0x3f35_04f3;
    let bits = x.to_bits() as i32;
    let exponent = (bits - HALF_ROOT) >> 23;
    let m = f32::from_bits((bits - (exponent << 23)) as u32);
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let series = 2.885_39 + z * (0.961_796_7 + z * (0.577_078 + z * (0.412_198_6 + z * 0.320_598_9)));
    exponent as f32 + s * series
}

/// 2^x for -126 <= x <= 126.
#[inline(always)]
fn exp2(x: f32) -> f32 {
    // Adding 1.5 * 2^23 rounds to an integer, which then stands in the low bits.
    const ROUND: f32 = 12_582_912.0;
    let rounded = x + ROUND;
    let f = x - (rounded - ROUND);
    let p = 1.0
        + f * (std::f32::consts::LN_2
            + f * (0.240_226_5
                + f * (0.055_504_11
                    + f * (0.009_618_129 + f * (0.001_333_356 + f * (1.540_353e-4 + f * 1.525_273e-5))))));
    f32::from_bits(p.to_bits().wrapping_add(rounded.to_bits() << 23))
}

/// x^p for x of 0 or more and 0 < p <= 4; 0 for 0 and for what is below the
/// smallest normal number. Relative error below 3e-6 where x^p is within 1e-12 to 1e6
/// (tested); it grows with |p log2 x|.
#[inline(always)]
pub(super) fn pow(x: f32, p: f32) -> f32 {
    let e = log2(x) * p;
    let e = if e > 126.0 { 126.0 } else { e };
    let tiny = x < f32::MIN_POSITIVE || e < -126.0;
    let y = exp2(if tiny { 0.0 } else { e });
    if tiny { 0.0 } else { y }
}

/// The cube root of a positive normal number. Relative error below 3e-7 (tested).
#[inline(always)]
pub(super) fn cbrt(x: f32) -> f32 {
    // A third of the exponent, then two of Halley's steps.
    let mut y = f32::from_bits(x.to_bits() / 3 + 0x2a51_2ce3);
    for _ in 0..2 {
        let cube = y * y * y;
        y = y * (cube + x + x) / (cube + cube + x);
    }
    y
}

/// Linear light of an sRGB code in [0, 1], IEC 61966-2-1.
#[inline(always)]
pub(super) fn srgb_to_linear(v: f32) -> f32 {
    let curve = pow((v + 0.055) * (1.0 / 1.055), 2.4);
    if v <= 0.04045 { v * (1.0 / 12.92) } else { curve }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worst(f: impl Fn(f32) -> f32, exact: impl Fn(f64) -> f64, from: f32, to: f32) -> f64 {
        let steps = 200_000;
        (0..=steps)
            .map(|i| (from.ln() + (to.ln() - from.ln()) * i as f32 / steps as f32).exp())
            .map(|x| (f64::from(f(x)) / exact(f64::from(x)) - 1.0).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn powers_are_exact_to_a_few_bits() {
        for p in [0.1f32, 0.5, 0.7, 1.0, 2.4] {
            let (from, to) = (1e-12f32.powf(1.0 / p).max(1e-12), 1e6f32.powf(1.0 / p).min(1e6));
            let error = worst(|x| pow(x, p), |x| x.powf(f64::from(p)), from, to);
            assert!(error < 3e-6, "x^{p}: {error:e}");
        }
        assert_eq!(pow(0.0, 0.7), 0.0);
        assert_eq!(pow(1e-40, 0.7), 0.0);
        assert_eq!(pow(1.0, 0.7), 1.0);
    }

    #[test]
    fn roots_are_exact_to_a_few_bits() {
        let error = worst(cbrt, f64::cbrt, 1e-6, 1e6);
        assert!(error < 3e-7, "{error:e}");
    }

    #[test]
    fn the_srgb_curve_is_that_of_the_standard() {
        for code in 0..=255 {
            let v = f64::from(code) / 255.0;
            let exact = if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
            let error = (f64::from(srgb_to_linear(v as f32)) - exact).abs();
            assert!(error < 1e-6, "{code}: {error:e}");
        }
    }
}
