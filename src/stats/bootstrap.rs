//! Intervals of functions of means whose distribution is skew: the BCa bootstrap.

use super::{
    Group, SplitMix64,
    jackknife::{column_means, left_out},
    normal_quantile,
    spread::quantile_of_sorted,
};
use statrs::distribution::{ContinuousCDF, Normal};

/// A bootstrap interval with what corrected it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bca {
    /// The function of the means as measured.
    pub value: f64,
    /// Its interval.
    pub interval: [f64; 2],
    /// Bias correction: 0 where half of the resampled values lie below the value.
    pub z0: f64,
    /// Acceleration: how the standard error changes with the value; 0 where it does
    /// not.
    pub acceleration: f64,
    /// Resamples that gave a number.
    pub resamples: u32,
}

/// Bootstrap interval of `f(means of group 1, means of group 2, ...)` at a confidence
/// in (0, 1), bias corrected and accelerated (Efron, JASA 82, 1987; Efron and
/// Tibshirani, An Introduction to the Bootstrap, 1993, chapter 14).
///
/// Each resample draws as many rows as a group has, with replacement, within each
/// group; rows stay whole. The interval is between two quantiles of the resampled
/// values (type 7, as in [`Spread`](super::Spread)), at the levels of
/// [`bca_levels`]. At 95 % take 2,000 resamples or more. The draws depend on `seed`
/// and resample only ([`SplitMix64`]), so the result is the same everywhere.
///
/// Resampled values that are NaN are left out. Where none is left, or the value is
/// NaN, the interval is the whole line. Where all are equal it is that point. A group
/// of one row has no spread to resample: it counts as known exactly.
///
/// Coverage at 95 %, 2,000 experiments of 500 resamples: .912 of a mean of 16 normal
/// values, .945 of 64; .929 of a ratio of two means of 16 rows. Below 32 rows take
/// [`jackknife`](super::jackknife()) with Student's t.
pub fn bca(groups: &[Group], f: impl Fn(&[Vec<f64>]) -> f64, confidence: f64, resamples: u32, seed: u32) -> Bca {
    let value = f(&groups.iter().map(column_means).collect::<Vec<_>>());
    let mut values: Vec<f64> =
        (0..resamples).map(|i| f(&resampled(groups, draws(seed, i)))).filter(|v| !v.is_nan()).collect();
    values.sort_by(f64::total_cmp);
    let z0 = bias_correction(&values, value);
    let acceleration = acceleration(groups, &f);
    let [low, high] = bca_levels(z0, acceleration, confidence);
    let interval = if values.is_empty() || value.is_nan() || low.is_nan() {
        [f64::NEG_INFINITY, f64::INFINITY]
    } else {
        [quantile_of_sorted(&values, low), quantile_of_sorted(&values, high)]
    };
    Bca { value, interval, z0, acceleration, resamples: values.len() as u32 }
}

/// The draws of one resample.
fn draws(seed: u32, resample: u32) -> SplitMix64 {
    SplitMix64(u64::from(seed) << 32 | u64::from(resample))
}

/// Means of each group over rows drawn with replacement.
fn resampled(groups: &[Group], mut random: SplitMix64) -> Vec<Vec<f64>> {
    let of_group = |rows: &Group| {
        let n = rows.len();
        let mut means = vec![0.0; rows.first().map_or(0, Vec::len)];
        for _ in 0..n {
            let row = random.below(n);
            for (mean, v) in means.iter_mut().zip(&rows[row]) {
                *mean += v;
            }
        }
        for mean in &mut means {
            *mean /= n as f64;
        }
        means
    };
    groups.iter().map(of_group).collect()
}

/// z0 = the normal quantile of the share of `values` below `value`, ties counted
/// half. Shares of 0 and 1 are taken half a value inside; no value gives 0.
fn bias_correction(values: &[f64], value: f64) -> f64 {
    let count = |f: &dyn Fn(&f64) -> bool| values.iter().filter(|v| f(v)).count() as f64;
    let n = values.len() as f64;
    if n == 0.0 {
        return 0.0;
    }
    let share = 0.5 * (count(&|v| *v < value) + count(&|v| *v <= value)) / n;
    normal_quantile(share.clamp(0.5 / n, 1.0 - 0.5 / n))
}

/// a = sum d^3 / (6 (sum d^2)^1.5) over the rows of all groups, d = (n - 1)/n (f_(.) -
/// f_(i)) of the delete-one jackknife within a group of n (Efron and Tibshirani 1993,
/// 14.15; several groups as Davison and Hinkley 1997, 5.3). 0 where nothing varies.
fn acceleration(groups: &[Group], f: &impl Fn(&[Vec<f64>]) -> f64) -> f64 {
    let mut means: Vec<Vec<f64>> = groups.iter().map(column_means).collect();
    let (mut squares, mut cubes) = (0.0, 0.0);
    for (g, rows) in groups.iter().enumerate() {
        let left_out = left_out(rows, g, &mut means, f);
        let n = left_out.len() as f64;
        if n < 2.0 {
            continue;
        }
        let middle = left_out.iter().sum::<f64>() / n;
        for value in left_out {
            let d = (n - 1.0) / n * (middle - value);
            squares += d * d;
            cubes += d * d * d;
        }
    }
    let a = cubes / (6.0 * squares.powf(1.5));
    if a.is_finite() { a } else { 0.0 }
}

/// The levels between which a BCa interval lies: Phi(z0 + (z0 + z) / (1 - a (z0 +
/// z))) for z the normal quantiles of (1 -+ confidence)/2. No correction gives the
/// percentile interval. NaN for a confidence outside (0, 1).
pub fn bca_levels(z0: f64, acceleration: f64, confidence: f64) -> [f64; 2] {
    if !(confidence > 0.0 && confidence < 1.0) {
        return [f64::NAN; 2];
    }
    let z = normal_quantile((1.0 + confidence) / 2.0);
    [-z, z].map(|z| {
        let off = z0 + z;
        let scale = 1.0 - acceleration * off;
        // Past its pole the correction runs to the end it was heading for.
        let to = if scale > 0.0 { z0 + off / scale } else { off * f64::INFINITY };
        Normal::standard().cdf(to)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::reference::{close, numbers, reference};

    fn group(values: &[f64]) -> Group {
        values.iter().map(|&v| vec![v]).collect()
    }

    #[test]
    fn the_corrections_match_the_reference() {
        let all = reference();
        let r = &all["bca"];
        let a = acceleration(&[group(&numbers(&r["data"]))], &|m: &[Vec<f64>]| m[0][0]);
        close(a, &r["accel"], "acceleration");
        // 52 of 100 lie below.
        let values: Vec<f64> = (0..100).map(|i| f64::from(i) - 51.5).collect();
        close(bias_correction(&values, 0.0), &r["z0"], "z0");
        // 51 below and 2 ties are 52 below.
        let tied: Vec<f64> = (0..100)
            .map(|i| {
                if i < 51 {
                    -1.0
                } else if i < 53 {
                    0.0
                } else {
                    1.0
                }
            })
            .collect();
        close(bias_correction(&tied, 0.0), &r["z0"], "z0 of ties");
        let [lo, hi] = bca_levels(r["z0"].as_f64().unwrap(), a, 0.95);
        close(lo, &r["adj_alpha_lo"], "low level");
        close(hi, &r["adj_alpha_hi"], "high level");
    }

    #[test]
    fn levels_without_correction_are_percentiles_and_never_leave_0_to_1() {
        let [lo, hi] = bca_levels(0.0, 0.0, 0.9);
        assert!((lo - 0.05).abs() < 1e-9 && (hi - 0.95).abs() < 1e-9);
        assert_eq!(bca_levels(1.0, 0.5, 0.95)[1], 1.0);
        assert_eq!(bca_levels(-1.0, -0.5, 0.95)[0], 0.0);
        assert!(bca_levels(0.0, 0.0, 1.0)[0].is_nan());
    }

    #[test]
    fn the_interval_of_a_skew_sample_leans_and_repeats() {
        let data = group(&[0.62, 0.9, 0.91, 0.93, 0.95, 0.96, 0.97, 0.98]);
        let mean = |m: &[Vec<f64>]| m[0][0];
        let e = bca(std::slice::from_ref(&data), mean, 0.95, 20_000, 7);
        let [lo, hi] = e.interval;
        // By scipy.stats.bootstrap with 1,000,000 resamples: .77375 to .95125.
        assert!((lo - 0.77375).abs() < 0.006 && (hi - 0.95125).abs() < 0.002, "{e:?}");
        assert_eq!(e, bca(&[data], mean, 0.95, 20_000, 7));
    }

    #[test]
    fn degenerate_groups_have_a_stated_interval() {
        let mean = |m: &[Vec<f64>]| m[0][0];
        let e = bca(&[group(&[0.5; 6])], mean, 0.95, 100, 1);
        assert_eq!((e.value, e.interval, e.z0, e.acceleration), (0.5, [0.5; 2], 0.0, 0.0));
        assert_eq!(bca(&[group(&[0.5])], mean, 0.95, 100, 1).interval, [0.5; 2]);
        let line = [f64::NEG_INFINITY, f64::INFINITY];
        let unknown = bca(&[group(&[0.5, f64::NAN])], mean, 0.95, 100, 1);
        assert_eq!(unknown.interval, line);
        assert_eq!(bca(&[group(&[0.5, 0.6])], mean, 0.95, 0, 1).interval, line);
        assert_eq!(bca(&[group(&[0.5, 0.6])], mean, 2.0, 10, 1).interval, line);
        assert_eq!(bca(&[vec![]], |m| m[0].first().copied().unwrap_or(f64::NAN), 0.95, 10, 1).interval, line);
    }
}
