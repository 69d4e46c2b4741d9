//! Where the middle of some values lies, and how far they spread: for times, which
//! have outliers on one side only.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Median and quartiles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// The smallest value.
    pub least: f64,
    /// A quarter of the values lies below.
    pub lower: f64,
    /// Half of them.
    pub median: f64,
    /// Three quarters.
    pub upper: f64,
}

impl Spread {
    /// Of at least one value, none of them NaN; None of none. Between values it is
    /// linear (type 7 of Hyndman and Fan 1996, as in R and NumPy).
    ///
    /// ```
    /// # use aogauge::stats::Spread;
    /// let s = Spread::of(&[4.0, 1.0, 3.0, 2.0]).unwrap();
    /// assert_eq!((s.least, s.lower, s.median, s.upper), (1.0, 1.75, 2.5, 3.25));
    /// ```
    pub fn of(values: &[f64]) -> Option<Spread> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let least = *sorted.first()?;
        let [lower, median, upper] = [0.25, 0.5, 0.75].map(|share| quantile_of_sorted(&sorted, share));
        Some(Spread { least, lower, median, upper })
    }

    /// Each value by a factor above 0.
    #[must_use]
    pub fn times(self, factor: f64) -> Spread {
        let Spread { least, lower, median, upper } = self;
        Spread { least: least * factor, lower: lower * factor, median: median * factor, upper: upper * factor }
    }
}

/// Quantile (type 7 of Hyndman and Fan 1996) of values in order, at a share in [0,
/// 1]; NaN of none.
pub(super) fn quantile_of_sorted(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share * last as f64;
    let (below, part) = ((place.floor() as usize).min(last), place.fract());
    let [low, high] = [sorted[below], sorted[(below + 1).min(last)]];
    // Infinite neighbours must not make NaN where the value is one of them.
    if part == 0.0 { low } else { low * (1.0 - part) + high * part }
}
