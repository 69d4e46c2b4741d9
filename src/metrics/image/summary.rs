//! What a map of errors comes to: mean, maximum, percentiles.

use super::Pair;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Values summed together before sums are added up, whatever the number of
/// threads, so that results do not depend on it.
const CHUNK: usize = 1 << 16;

/// An error map in a few numbers, over the pixels that have weight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapSummary {
    /// Weighted mean.
    pub mean: f64,
    /// The smallest value.
    pub min: f64,
    /// Column and row of the first pixel that has it.
    pub min_at: [usize; 2],
    /// The largest value.
    pub max: f64,
    /// Column and row of the first pixel that has it.
    pub max_at: [usize; 2],
    /// The smallest value that 1 % of the weight does not exceed.
    pub p1: f64,
    /// The same for 5 %.
    pub p5: f64,
    /// The same for half of the weight.
    pub median: f64,
    /// The same for 95 %.
    pub p95: f64,
    /// The same for 99 %.
    pub p99: f64,
}

/// Summarises a map of the pair's pixels. NaN in the map (a border that a filter
/// cannot reach) has no weight; None where nothing has.
///
/// Percentiles are of the inverse distribution function (type 1 of Hyndman and Fan
/// 1996, NumPy's `inverted_cdf`), the one that weights leave well defined.
pub fn summary(pair: &Pair<'_>, map: &[f32]) -> Option<MapSummary> {
    let width = pair.reference().size()[0];
    let totals = map.par_chunks(CHUNK).enumerate().map(|(chunk, values)| {
        let mut total = Total::default();
        for (i, &v) in values.iter().enumerate() {
            total.add(v, pair.weight(chunk * CHUNK + i), chunk * CHUNK + i);
        }
        total
    });
    let totals: Vec<Total> = totals.collect();
    let total = totals.iter().fold(Total::default(), |a, b| a.and(b));
    if total.weight <= 0.0 {
        return None;
    }
    let [p1, p5, median, p95, p99] = percentiles(pair, map, [0.01, 0.05, 0.5, 0.95, 0.99], total.weight);
    let place = |pixel: usize| [pixel % width, pixel / width];
    Some(MapSummary {
        mean: total.sum / total.weight,
        min: f64::from(total.min),
        min_at: place(total.min_at),
        max: f64::from(total.max),
        max_at: place(total.max_at),
        p1,
        p5,
        median,
        p95,
        p99,
    })
}

#[derive(Clone, Copy)]
struct Total {
    weight: f64,
    sum: f64,
    min: f32,
    min_at: usize,
    max: f32,
    max_at: usize,
}

impl Default for Total {
    fn default() -> Self {
        Total { weight: 0.0, sum: 0.0, min: f32::INFINITY, min_at: 0, max: f32::NEG_INFINITY, max_at: 0 }
    }
}

impl Total {
    fn add(&mut self, value: f32, weight: f64, at: usize) {
        if weight > 0.0 && !value.is_nan() {
            self.weight += weight;
            self.sum += weight * f64::from(value);
            if value < self.min {
                (self.min, self.min_at) = (value, at);
            }
            if value > self.max {
                (self.max, self.max_at) = (value, at);
            }
        }
    }

    fn and(&self, later: &Total) -> Total {
        let max = if later.max > self.max { later } else { self };
        let min = if later.min < self.min { later } else { self };
        Total {
            weight: self.weight + later.weight,
            sum: self.sum + later.sum,
            min: min.min,
            min_at: min.min_at,
            max: max.max,
            max_at: max.max_at,
        }
    }
}

/// The order of f32 as the order of u32.
fn key(v: f32) -> u32 {
    let bits = v.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

fn value(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 { key & !(1 << 31) } else { !key })
}

/// Bins of a histogram over half a key.
const BINS: usize = 1 << 16;

/// Exact weighted percentiles without sorting or copying: a histogram of the upper
/// halves of the keys, then one of the lower halves in each bin that is asked for.
fn percentiles<const N: usize>(pair: &Pair<'_>, map: &[f32], shares: [f64; N], total: f64) -> [f64; N] {
    let upper = histogram(pair, map, BINS, |key| Some((key >> 16) as usize));
    let reached = shares.map(|share| reach(&upper, share * total));
    let slot = |high: usize| reached.iter().position(|&(h, _)| h == high);
    let lower =
        histogram(pair, map, N * BINS, |key| Some(slot((key >> 16) as usize)? * BINS + (key & 0xffff) as usize));
    std::array::from_fn(|i| {
        let (high, before) = reached[i];
        let at = slot(high).unwrap_or(i) * BINS;
        let (low, _) = reach(&lower[at..at + BINS], shares[i] * total - before);
        f64::from(value((high as u32) << 16 | low as u32))
    })
}

/// The weight in each bin; `bin` tells which one a key is in.
fn histogram(pair: &Pair<'_>, map: &[f32], bins: usize, bin: impl Fn(u32) -> Option<usize> + Sync) -> Vec<f64> {
    // A few large parts, as many on every machine: a histogram is half a megabyte
    // and more.
    let part = map.len().div_ceil(4).max(CHUNK);
    let parts = map.par_chunks(part).enumerate().map(|(index, values)| {
        let mut weights = vec![0.0; bins];
        for (i, &v) in values.iter().enumerate().filter(|(_, v)| !v.is_nan()) {
            if let Some(bin) = bin(key(v)) {
                weights[bin] += pair.weight(index * part + i);
            }
        }
        weights
    });
    let mut parts = parts.collect::<Vec<Vec<f64>>>().into_iter();
    let mut sum = parts.next().unwrap_or_else(|| vec![0.0; bins]);
    for other in parts {
        sum.iter_mut().zip(other).for_each(|(a, b)| *a += b);
    }
    sum
}

/// The first bin at which the running sum reaches `wanted` (the last that holds
/// anything, should rounding keep it below), and the sum before it.
fn reach(bins: &[f64], wanted: f64) -> (usize, f64) {
    let (mut sum, mut last) = (0.0, (0, 0.0));
    for (bin, &weight) in bins.iter().enumerate().filter(|(_, w)| **w > 0.0) {
        last = (bin, sum);
        sum += weight;
        if sum >= wanted * (1.0 - 1e-12) {
            break;
        }
    }
    last
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::image::{Encoding, Image};

    #[test]
    fn weights_and_nan_are_heeded() {
        let image = Image::new([4, 2], vec![vec![0.0; 8]], Encoding::Linear).unwrap();
        let mask = [1.0, 1.0, 0.5, 0.0, 1.0, 1.0, 1.0, 1.0];
        let pair = Pair::new(&image, &image, Some(&mask)).unwrap();
        let map = [0.1, 0.2, 0.9, 7.0, f32::NAN, -0.3, 0.0, 0.2];
        let s = summary(&pair, &map).unwrap();
        assert!((s.mean - (0.1 + 0.2 + 0.45 - 0.3 + 0.2) / 5.5).abs() < 1e-7);
        assert_eq!((s.min as f32, s.min_at, s.max as f32, s.max_at), (-0.3, [1, 1], 0.9, [2, 0]));
        assert_eq!((s.p1 as f32, s.median as f32, s.p95 as f32), (-0.3, 0.1, 0.9));
        assert!(summary(&pair, &[f32::NAN; 8]).is_none());
    }

    #[test]
    fn percentiles_are_those_of_the_sorted_values() {
        let n = 100_000;
        let mut x = 7u32;
        let mut map: Vec<f32> = (0..n)
            .map(|_| {
                x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (x >> 8) as f32 / 16_777_216.0 - 0.4
            })
            .collect();
        let image = Image::new([n, 1], vec![vec![0.0; n]], Encoding::Linear).unwrap();
        let s = summary(&Pair::new(&image, &image, None).unwrap(), &map).unwrap();
        map.sort_by(f32::total_cmp);
        let at = |share: f64| f64::from(map[(share * n as f64).ceil() as usize - 1]);
        assert_eq!([s.p1, s.p5, s.median, s.p95, s.p99], [0.01, 0.05, 0.5, 0.95, 0.99].map(at));
        assert_eq!([s.min, s.max], [f64::from(map[0]), f64::from(map[n - 1])]);
    }
}
