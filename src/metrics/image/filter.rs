//! Separable filters over rows, written so that compilers make SIMD of them.

use std::ops::{Add, Mul, Sub};

/// Columns computed together: four AVX registers of sums, which hide the latency
/// of addition. The width of a block is a multiple of it.
pub(super) const LANES: usize = 32;

/// Columns of a block. The rows that a vertical filter of 21 taps needs, of all
/// planes of two images, are then 300 KiB and fit into a second-level cache.
pub(super) const BLOCK: usize = 256;

/// Rows of a band, the unit of parallel work. Rows above and below that only its
/// filters need are computed again by the next band.
pub(super) const BAND: usize = 144;

/// What filters compute in.
pub(super) trait Real: Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {}
impl Real for f32 {}
impl Real for f64 {}

/// A filter that is even about its middle: out = h0 a(0) + sum h_k (a(-k) + a(k)).
///
/// `at(k)` is the row, or the same row shifted by k columns, for k from -radius to
/// radius; each holds at least as many values as `out`, whose length is a multiple
/// of [`LANES`].
#[inline(always)]
pub(super) fn even<'a, T: Real + 'a>(half: &[T], at: impl Fn(isize) -> &'a [T], out: &mut [T]) {
    for (chunk, out) in out.chunks_exact_mut(LANES).enumerate() {
        let lanes = |k: isize| at(k).get(chunk * LANES..).and_then(<[T]>::first_chunk::<LANES>);
        let Some(middle) = lanes(0) else { return };
        let mut sum = [T::default(); LANES];
        for i in 0..LANES {
            sum[i] = half[0] * middle[i];
        }
        for (k, &h) in half.iter().enumerate().skip(1) {
            let (Some(before), Some(after)) = (lanes(-(k as isize)), lanes(k as isize)) else { return };
            for i in 0..LANES {
                sum[i] = sum[i] + h * (before[i] + after[i]);
            }
        }
        out.copy_from_slice(&sum);
    }
}

/// An even filter whose taps sum to zero: out = sum h_k ((a(-k) - a(0)) + (a(k) - a(0))).
/// Where the image is flat it is exactly 0, not a rounding error; `half[0]` is not
/// used.
#[inline(always)]
pub(super) fn even_of_sum_zero<'a, T: Real + 'a>(half: &[T], at: impl Fn(isize) -> &'a [T], out: &mut [T]) {
    for (chunk, out) in out.chunks_exact_mut(LANES).enumerate() {
        let lanes = |k: isize| at(k).get(chunk * LANES..).and_then(<[T]>::first_chunk::<LANES>);
        let Some(middle) = lanes(0) else { return };
        let mut sum = [T::default(); LANES];
        for (k, &h) in half.iter().enumerate().skip(1) {
            let (Some(before), Some(after)) = (lanes(-(k as isize)), lanes(k as isize)) else { return };
            for i in 0..LANES {
                sum[i] = sum[i] + h * ((before[i] - middle[i]) + (after[i] - middle[i]));
            }
        }
        out.copy_from_slice(&sum);
    }
}

/// A filter that is odd about its middle: out = sum h_k (a(k) - a(-k)); `half[0]`
/// is not used.
#[inline(always)]
pub(super) fn odd<'a, T: Real + 'a>(half: &[T], at: impl Fn(isize) -> &'a [T], out: &mut [T]) {
    for (chunk, out) in out.chunks_exact_mut(LANES).enumerate() {
        let lanes = |k: isize| at(k).get(chunk * LANES..).and_then(<[T]>::first_chunk::<LANES>);
        let mut sum = [T::default(); LANES];
        for (k, &h) in half.iter().enumerate().skip(1) {
            let (Some(before), Some(after)) = (lanes(-(k as isize)), lanes(k as isize)) else { return };
            for i in 0..LANES {
                sum[i] = sum[i] + h * (after[i] - before[i]);
            }
        }
        out.copy_from_slice(&sum);
    }
}

/// The latest rows of a block, as many as a vertical filter needs.
pub(super) struct Ring<T> {
    rows: usize,
    width: usize,
    values: Vec<T>,
}

impl<T: Real> Ring<T> {
    /// Room for `rows` rows of `width` values.
    pub(super) fn new(rows: usize, width: usize) -> Self {
        Ring { rows, width, values: vec![T::default(); rows * width] }
    }

    /// The place of row `y`.
    #[inline(always)]
    pub(super) fn row_mut(&mut self, y: usize) -> &mut [T] {
        let at = y % self.rows * self.width;
        &mut self.values[at..at + self.width]
    }

    /// Row `y`, where it is one of the latest.
    #[inline(always)]
    pub(super) fn row(&self, y: usize) -> &[T] {
        let at = y % self.rows * self.width;
        &self.values[at..at + self.width]
    }
}

/// Copies `out.len()` values of a row from column `from` on; beyond its ends the
/// row goes on with its first and last value.
#[inline(always)]
pub(super) fn extend_row(row: &[f32], from: isize, out: &mut [f32]) {
    let last = row.len() as isize - 1;
    let inside = usize::try_from(from).ok().and_then(|f| row.get(f..f + out.len()));
    if let Some(inside) = inside {
        out.copy_from_slice(inside);
    } else {
        for (i, out) in out.iter_mut().enumerate() {
            *out = row[(from + i as isize).clamp(0, last) as usize];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_are_sums() {
        let row: Vec<f64> = (0..40).map(|i| f64::from(i * i)).collect();
        let at = |k: isize| &row[(2 + k) as usize..];
        let mut out = [0.0; 32];
        even(&[0.5, 0.25, 0.125], at, &mut out);
        let by_hand = |i: usize| 0.5 * row[i + 2] + 0.25 * (row[i + 1] + row[i + 3]) + 0.125 * (row[i] + row[i + 4]);
        assert!((0..32).all(|i| out[i] == by_hand(i)));
        let mut same = [0.0; 32];
        even_of_sum_zero(&[-1.5, 0.5, 0.25], at, &mut out);
        even(&[-1.5, 0.5, 0.25], at, &mut same);
        assert_eq!(out, same);
        odd(&[9.0, 0.5, 0.25], at, &mut out);
        let by_hand = |i: usize| 0.5 * (row[i + 3] - row[i + 1]) + 0.25 * (row[i + 4] - row[i]);
        assert!((0..32).all(|i| out[i] == by_hand(i)));
    }

    #[test]
    fn rows_go_on_with_their_ends() {
        let mut out = [0.0; 5];
        extend_row(&[1.0, 2.0], -2, &mut out);
        assert_eq!(out, [1.0, 1.0, 1.0, 2.0, 2.0]);
        extend_row(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 1, &mut out);
        assert_eq!(out, [2.0, 3.0, 4.0, 5.0, 6.0]);
    }
}
