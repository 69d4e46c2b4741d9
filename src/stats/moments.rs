//! Mean and variance of values that come one by one, or in parts.

use super::Estimate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Count, mean, variance and extremes of the finite values pushed so far.
///
/// Welford's updates (Technometrics 4, 1962) and the merge of Chan, Golub and LeVeque
/// (The American Statistician 37, 1983), both on values less the first one: so
/// rounding is relative to how far the values spread, not to how far they lie from
/// zero. Merging is exact but for rounding: the variance agrees with two passes over
/// all values to 1e-12 relative, the mean to 1e-12 of itself or the standard deviation,
/// for 10,000 values in any order, at an offset of 1e9 times their spread too; rounding
/// grows slower than the count. The same parts merged in the same order give the same bits; another
/// order, or other parts, may change the last ones.
///
/// NaN and infinite values are counted apart and enter nothing else. Finite values
/// should stay below 1e150 in size, whose squares are finite.
///
/// ```
/// # use aogauge::stats::Moments;
/// let mut left: Moments = [1.0, 2.0].into_iter().collect();
/// let right: Moments = [3.0, 4.0, f64::NAN].into_iter().collect();
/// left.merge(&right);
/// assert_eq!((left.count(), left.mean(), left.not_finite()), (4, 2.5, 1));
/// assert!((left.variance() - 5.0 / 3.0).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Moments {
    /// Finite values.
    count: u64,
    /// Values that are NaN or infinite.
    not_finite: u64,
    /// The first value, which the others are measured from; 0 of none.
    origin: f64,
    /// Mean less the origin.
    shift: f64,
    /// Sum of squared distances from the mean.
    squares: f64,
    /// The smallest value; null of none.
    least: Option<f64>,
    /// The greatest value; null of none.
    greatest: Option<f64>,
}

impl Moments {
    /// Adds a value.
    pub fn push(&mut self, value: f64) {
        if !value.is_finite() {
            self.not_finite = self.not_finite.saturating_add(1);
            return;
        }
        if self.count == 0 {
            self.origin = value;
        }
        self.count = self.count.saturating_add(1);
        let off = value - self.origin;
        let from_old = off - self.shift;
        self.shift += from_old / self.count as f64;
        self.squares += from_old * (off - self.shift);
        self.least = Some(self.least.map_or(value, |v| v.min(value)));
        self.greatest = Some(self.greatest.map_or(value, |v| v.max(value)));
    }

    /// Adds the values of another.
    pub fn merge(&mut self, other: &Moments) {
        let not_finite = self.not_finite.saturating_add(other.not_finite);
        if other.count == 0 || self.count == 0 {
            *self = Moments { not_finite, ..if self.count == 0 { *other } else { *self } };
            return;
        }
        let count = self.count.saturating_add(other.count);
        let (n, m) = (self.count as f64, other.count as f64);
        let apart = (other.origin - self.origin) + other.shift - self.shift;
        let extreme =
            |a: Option<f64>, b: Option<f64>, f: fn(f64, f64) -> f64| a.zip(b).map_or(a.or(b), |(a, b)| Some(f(a, b)));
        *self = Moments {
            count,
            not_finite,
            origin: self.origin,
            shift: self.shift + apart * (m / (n + m)),
            squares: self.squares + other.squares + apart * apart * (n * m / (n + m)),
            least: extreme(self.least, other.least, f64::min),
            greatest: extreme(self.greatest, other.greatest, f64::max),
        };
    }

    /// How many finite values.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// How many values were NaN or infinite.
    pub fn not_finite(&self) -> u64 {
        self.not_finite
    }

    /// Their mean; NaN of none.
    pub fn mean(&self) -> f64 {
        if self.count == 0 { f64::NAN } else { self.origin + self.shift }
    }

    /// Unbiased variance, 0 or more; NaN of fewer than two.
    pub fn variance(&self) -> f64 {
        if self.count < 2 { f64::NAN } else { (self.squares / (self.count - 1) as f64).max(0.0) }
    }

    /// The smallest value; None of none.
    pub fn least(&self) -> Option<f64> {
        self.least
    }

    /// The greatest value; None of none.
    pub fn greatest(&self) -> Option<f64> {
        self.greatest
    }

    /// The mean with its standard error, of independent values.
    pub fn estimate(&self) -> Estimate {
        let n = self.count as f64;
        Estimate { value: self.mean(), se: (self.variance() / n).sqrt(), df: n - 1.0 }
    }
}

impl Extend<f64> for Moments {
    fn extend<I: IntoIterator<Item = f64>>(&mut self, values: I) {
        for value in values {
            self.push(value);
        }
    }
}

impl FromIterator<f64> for Moments {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let mut moments = Moments::default();
        moments.extend(values);
        moments
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{SplitMix64, mean_variance};

    fn noise(n: u32) -> impl Iterator<Item = f64> + Clone {
        let mut random = SplitMix64(3);
        (0..n).map(move |_| random.uniform())
    }

    fn relative(a: f64, b: f64) -> f64 {
        (a - b).abs() / b.abs()
    }

    /// Two passes on the values less a constant near them, which is exact here.
    fn two_passes(values: &[f64]) -> (f64, f64) {
        let shifted: Vec<f64> = values.iter().map(|v| v - values[0]).collect();
        let (mean, variance) = mean_variance(&shifted);
        (values[0] + mean, variance)
    }

    #[test]
    fn pushed_and_merged_agree_with_two_passes_on_hostile_data() {
        let hostile: Vec<(&str, Vec<f64>)> = vec![
            ("offset", noise(100_000).map(|v| 1e9 + v).collect()),
            ("far offset", noise(100_000).map(|v| 1e15 + (v * 64.0).floor()).collect()),
            ("first is apart", std::iter::once(-1e9).chain(noise(10_000)).collect()),
            ("tiny", noise(1000).map(|v| v * 1e-140).collect()),
            ("huge", noise(1000).map(|v| v * 1e140).collect()),
            ("sorted", (0..10_000).map(|i| 1e6 + f64::from(i) * 1e-3).collect()),
            ("steps", (0..100_000).map(|i| if i < 50_000 { 0.0 } else { 1e8 + f64::from(i % 7) }).collect()),
        ];
        for (what, values) in hostile {
            let (mean, variance) = two_passes(&values);
            let pushed: Moments = values.iter().copied().collect();
            let mut merged = Moments::default();
            for part in values.chunks(317) {
                merged.merge(&part.iter().copied().collect());
            }
            for (how, m) in [("pushed", pushed), ("merged", merged)] {
                assert!(
                    (m.mean() - mean).abs() < 1e-12 * mean.abs().max(variance.sqrt()),
                    "{what}, {how}: {} and {mean}",
                    m.mean()
                );
                assert!(relative(m.variance(), variance) < 1e-12, "{what}, {how}: {} and {variance}", m.variance());
                assert_eq!(m.count() as usize, values.len());
                assert_eq!(m.least(), values.iter().copied().reduce(f64::min));
                assert_eq!(m.greatest(), values.iter().copied().reduce(f64::max));
            }
        }
    }

    #[test]
    fn the_same_merges_give_the_same_bits() {
        let parts: Vec<Moments> = (1..50).map(|i| noise(i * 13).map(|v| 1e5 + v).collect()).collect();
        let merged = || {
            parts.iter().fold(Moments::default(), |mut all, part| {
                all.merge(part);
                all
            })
        };
        assert_eq!(merged(), merged());
        assert_eq!(merged().variance().to_bits(), merged().variance().to_bits());
        let mut into_empty = Moments::default();
        into_empty.merge(&parts[3]);
        assert_eq!(into_empty, parts[3]);
        into_empty.merge(&Moments::default());
        assert_eq!(into_empty, parts[3]);
    }

    #[test]
    fn what_is_no_number_is_counted_and_kept_out() {
        let m: Moments = [f64::NAN, 1.0, f64::INFINITY, 3.0, f64::NEG_INFINITY].into_iter().collect();
        assert_eq!((m.count(), m.not_finite(), m.mean(), m.variance()), (2, 3, 2.0, 2.0));
        assert_eq!(m.estimate(), Estimate { value: 2.0, se: 1.0, df: 1.0 });
        let none: Moments = [f64::NAN].into_iter().collect();
        assert!(none.mean().is_nan() && none.variance().is_nan() && none.least().is_none());
        let mut both = none;
        both.merge(&m);
        assert_eq!((both.count(), both.not_finite()), (2, 4));
    }

    #[test]
    fn moments_survive_json_and_refuse_what_they_do_not_know() {
        let m: Moments = noise(10).collect();
        let text = serde_json::to_string(&m).unwrap();
        assert_eq!(serde_json::from_str::<Moments>(&text).unwrap(), m);
        assert!(serde_json::from_str::<Moments>(&text.replace("shift", "drift")).is_err());
    }
}
