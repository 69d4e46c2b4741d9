//! Numbers about numbers: estimates with intervals, tests, corrections.
//!
//! Distributions come from statrs; tails use the survival function, never
//! `1 - cdf`, so that small p-values keep their digits.

mod bootstrap;
mod chi_square;
mod directions;
mod equivalence;
mod jackknife;
mod moments;
mod multiplicity;
mod noise;
mod random;
mod regression;
mod scales;
mod sequential;
mod share;
mod spread;
mod student;
mod uniformity;
mod welch;

pub use bootstrap::{Bca, bca, bca_levels};
pub use chi_square::{ChiSquare, ChiSquareError, LEAST_EXPECTED, chi_square};
pub use directions::DirectionHistogram;
pub use equivalence::{Better, non_inferior, tost};
pub(crate) use jackknife::column_means;
pub use jackknife::{Group, jackknife, jackknife_of};
pub use moments::Moments;
pub use multiplicity::{benjamini_hochberg, holm, sidak, sidak_alpha};
pub use noise::{Noise, noise_of_pixels, noise_of_replicates, unexplained};
pub use random::SplitMix64;
pub use regression::{Line, RegressionError, log_log_slope, regress};
pub use scales::{
    Difference, ImageSample, IndependentPixels, POWER, Replicates, Scale, ScaleTest, TILE, pixel_p_values, three_scales,
};
pub use sequential::{decided, spending};
pub use share::{clopper_pearson, wilson};
pub use spread::Spread;
pub use student::{Student, student, student_pooled};
pub use uniformity::{Uniformity, uniformity};
pub use welch::{Welch, welch, welch_of_estimates};

use statrs::distribution::{Continuous, ContinuousCDF, Normal, StudentsT};

/// A value with its standard error and the degrees of freedom of that error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard error, 0 or more.
    pub se: f64,
    /// Degrees of freedom of `se`, above 0.
    pub df: f64,
}

/// The mean, measured from the first value: of equal values it is that value, which their sum over their
/// number need not be. Two renderers without noise would differ by the rounding, and surely so.
pub(crate) fn mean(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let origin = values.clone().next().filter(|v| v.is_finite()).unwrap_or(0.0);
    let (n, sum) = values.fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + (v - origin)));
    origin + sum / n
}

/// Mean and unbiased variance of two values or more; the variance of fewer is NaN, of equal values 0.
pub fn mean_variance(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = mean(values.iter().copied());
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (mean, if n < 2.0 { f64::NAN } else { squares / (n - 1.0) })
}

impl Estimate {
    /// The mean of independent replicates.
    pub fn of_mean(values: &[f64]) -> Self {
        let (value, variance) = mean_variance(values);
        let n = values.len() as f64;
        Estimate { value, se: (variance / n).sqrt(), df: n - 1.0 }
    }

    /// This less an independent other, with Welch and Satterthwaite's degrees of
    /// freedom.
    #[must_use]
    pub fn less(&self, other: &Estimate) -> Estimate {
        let variance = self.se * self.se + other.se * other.se;
        let welch = self.se.powi(4) / self.df + other.se.powi(4) / other.df;
        let df = if welch > 0.0 { variance * variance / welch } else { 1.0 };
        Estimate { value: self.value - other.value, se: variance.sqrt(), df }
    }

    /// Student's interval, `value +- t se`, at a confidence in (0, 1). A standard
    /// error of zero gives the point; an unknown one gives the whole line.
    pub fn interval(&self, confidence: f64) -> [f64; 2] {
        if self.se == 0.0 {
            return [self.value; 2];
        }
        let half = self.se * quantile(self.df, 0.5 + confidence / 2.0);
        if half.is_nan() {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        [self.value - half, self.value + half]
    }

    /// The smallest detectable effect: how far from zero the truth must lie for a
    /// two-sided test at level `alpha` to reject with probability `power`, both in
    /// (0, 1). In the unit of the value; smaller is better.
    ///
    /// se (t(1 - alpha/2, df) + t(power, df)), the minimum detectable effect of
    /// Bloom, "Minimum Detectable Effects", Evaluation Review 19(5), 1995. It takes
    /// t shifted for noncentral t: below 4 degrees of freedom it is a guide.
    ///
    /// A standard error of zero gives 0: what is known exactly hides nothing. Where it is
    /// zero because no replicate happened to differ, nothing is known: leave it unsaid. One that is unknown (NaN, or no
    /// degrees of freedom), or levels outside (0, 1), sees nothing: infinity.
    ///
    /// ```
    /// # use aogauge::stats::Estimate;
    /// let bias = Estimate { value: 0.01, se: 0.004, df: 30.0 };
    /// // t(.975, 30) = 2.0423, t(.8, 30) = 0.8538.
    /// assert!((bias.detectable(0.05, 0.8) - 0.004 * (2.0423 + 0.8538)).abs() < 1e-6);
    /// ```
    pub fn detectable(self, alpha: f64, power: f64) -> f64 {
        if self.se == 0.0 {
            return 0.0;
        }
        // The lower tail keeps its digits where alpha is tiny.
        let effect = self.se * (quantile(self.df, power) - quantile(self.df, alpha / 2.0));
        if effect.is_nan() { f64::INFINITY } else { effect.max(0.0) }
    }
}

/// Student's distribution, or None where `df` is no positive number.
fn students_t(df: f64) -> Option<StudentsT> {
    StudentsT::new(0.0, 1.0, df).ok()
}

/// From so many degrees of freedom on Student's t is the normal distribution with its
/// first correction, to 1e-9; statrs' incomplete beta function loses its digits there.
const NEARLY_NORMAL: f64 = 1e7;

/// Quantile of Student's t; NaN where `df` is no positive number or `p` lies
/// outside [0, 1].
pub fn quantile(df: f64, p: f64) -> f64 {
    if !(0.0..=1.0).contains(&p) {
        return f64::NAN;
    }
    if df >= NEARLY_NORMAL {
        // Peiser 1943.
        let z = normal_quantile(p);
        return if z.is_finite() { z + (z * z * z + z) / (4.0 * df) } else { z };
    }
    let t = |d| where_tail_is(&d, p.min(1.0 - p)).copysign(p - 0.5);
    students_t(df).map_or(f64::NAN, t)
}

/// The t of 0 or more that a share `tail` of at most 1/2 lies above.
///
/// statrs' inverse is not used: it is off by 1e-3 at a million degrees of freedom, by
/// orders of magnitude for tails of 1e-12, and does not end at 1e9. Its tails are
/// right, so from the normal quantile Newton's steps on ln P(T > t) over ln t lead
/// there, and halving where they leave what is known to hold the quantile.
fn where_tail_is(d: &StudentsT, tail: f64) -> f64 {
    if tail <= 0.0 || tail >= 0.5 {
        return if tail <= 0.0 { f64::INFINITY } else { 0.0 };
    }
    let (mut low, mut high) = (0.0, f64::INFINITY);
    let guess = -normal_quantile(tail);
    let mut t = if guess > 0.0 && guess.is_finite() { guess } else { 1.0 };
    for _ in 0..100 {
        let above = d.sf(t);
        if above > tail {
            low = t;
        } else {
            high = t;
        }
        let step = t * ((above / tail).ln() * above / (d.pdf(t) * t)).exp();
        let next = match (step > low && step < high, high.is_finite()) {
            (true, _) => step,
            (false, true) => 0.5 * (low + high),
            (false, false) => 2.0 * low,
        };
        let moved = (next - t).abs();
        t = next;
        if moved <= 1e-15 * t {
            break;
        }
    }
    t
}

/// Quantile of the standard normal distribution; NaN where `p` lies outside [0, 1].
fn normal_quantile(p: f64) -> f64 {
    if (0.0..=1.0).contains(&p) { Normal::standard().inverse_cdf(p) } else { f64::NAN }
}

/// P(T > t) of Student's t; NaN where `df` is no positive number or `t` is NaN.
pub fn upper_tail(df: f64, t: f64) -> f64 {
    if t.is_nan() {
        return f64::NAN;
    }
    if df >= NEARLY_NORMAL {
        return Normal::standard().sf(t / (1.0 + (t * t + 1.0) / (4.0 * df)));
    }
    students_t(df).map_or(f64::NAN, |d| d.sf(t))
}

/// The oracle values of the tests of this room.
#[cfg(test)]
mod reference {
    use serde_json::Value;

    pub fn reference() -> Value {
        serde_json::from_str(include_str!("../../tests/reference/statistics.json")).unwrap()
    }

    pub fn numbers(v: &Value) -> Vec<f64> {
        v.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
    }

    pub fn close(a: f64, b: &Value, what: &str) {
        let b = b.as_f64().unwrap();
        assert!((a - b).abs() <= 1e-9 * b.abs().max(1e-3), "{what}: {a} against {b}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Replicates of a renderer without noise: no error, no difference between so many and others.
    #[test]
    fn equal_values_are_exact() {
        let mut random = SplitMix64(3);
        for _ in 0..2000 {
            let value = random.uniform();
            for n in 2..20 {
                let values = vec![value; n];
                assert_eq!(mean_variance(&values), (value, 0.0));
                let group: Group = values.iter().map(|v| vec![*v, 2.0 * v]).collect();
                let e = jackknife(&[group], |m| m[0][0] / m[0][1]);
                assert_eq!((e.value, e.se), (0.5, 0.0));
            }
            assert_eq!(welch(&[value; 16], &[value; 8]).p_two, 1.0);
        }
        assert!(mean_variance(&[f64::INFINITY, 1.0]).0.is_infinite() && mean_variance(&[]).0.is_nan());
    }

    /// Student's quantiles end in the normal's, at any degrees of freedom.
    #[test]
    fn quantiles_of_many_degrees_of_freedom_are_normal() {
        for df in [1e6, 9.9e6, 1e7, 1e9, 1e15, f64::INFINITY] {
            // z + (z^3 + z) / (4 df), Peiser 1943.
            let z = 1.959_963_984_540_054;
            let expected = z + (z * z * z + z) / (4.0 * df);
            assert!((quantile(df, 0.975) - expected).abs() < 1e-7, "{df:e}: {}", quantile(df, 0.975));
            assert!((upper_tail(df, expected) - 0.025).abs() < 1e-8, "{df:e}: {}", upper_tail(df, expected));
        }
    }

    #[test]
    fn the_interval_of_a_mean_is_students() {
        // t(0.975, 3) = 3.182446; mean 2.5, s^2 = 5/3, se = 0.6454972.
        let e = Estimate::of_mean(&[1.0, 2.0, 3.0, 4.0]);
        let [lo, hi] = e.interval(0.95);
        assert!((lo - (2.5 - 3.182_446_305 * 0.645_497_224)).abs() < 1e-6);
        assert!((hi - (2.5 + 3.182_446_305 * 0.645_497_224)).abs() < 1e-6);
        assert_eq!(Estimate::of_mean(&[0.5; 4]).interval(0.95), [0.5, 0.5]);
        assert_eq!(Estimate::of_mean(&[0.5]).interval(0.95), [f64::NEG_INFINITY, f64::INFINITY]);
    }

    #[test]
    fn the_smallest_detectable_effect_has_its_edges() {
        let known = Estimate { value: 0.3, se: 0.1, df: 10.0 };
        // t(.995, 10) = 3.169273, t(.9, 10) = 1.372184.
        assert!((known.detectable(0.01, 0.9) - 0.454_145_7).abs() < 1e-6);
        assert_eq!(Estimate { se: 0.0, ..known }.detectable(0.01, 0.9), 0.0);
        for unknown in
            [Estimate { se: f64::NAN, ..known }, Estimate { df: f64::NAN, ..known }, Estimate { df: 0.0, ..known }]
        {
            assert_eq!(unknown.detectable(0.01, 0.9), f64::INFINITY);
        }
        for (alpha, power) in [(0.0, 0.8), (f64::NAN, 0.8), (0.01, 1.0), (0.01, 1.5)] {
            assert_eq!(known.detectable(alpha, power), f64::INFINITY, "{alpha}, {power}");
        }
    }
}
