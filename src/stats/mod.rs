//! Numbers about numbers: estimates with intervals, tests, corrections.
//!
//! Distributions come from statrs; tails use the survival function, never
//! `1 - cdf`, so that small p-values keep their digits.

mod jackknife;
mod spread;
mod tests_of_means;

pub use jackknife::{Group, jackknife};
pub use spread::Spread;
pub(crate) use tests_of_means::welch_of_moments;
pub use tests_of_means::{Welch, sidak_alpha, tost, welch};

use statrs::distribution::{ContinuousCDF, StudentsT};

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

/// Mean and unbiased variance of two values or more; the variance of fewer is NaN.
pub fn mean_variance(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
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
}

/// Student's distribution, or None where `df` is no positive number.
fn student(df: f64) -> Option<StudentsT> {
    StudentsT::new(0.0, 1.0, df).ok()
}

/// Quantile of Student's t; NaN where `df` is no positive number.
pub fn quantile(df: f64, p: f64) -> f64 {
    student(df).map_or(f64::NAN, |d| d.inverse_cdf(p))
}

/// P(T > t) of Student's t; NaN where `df` is no positive number.
pub fn upper_tail(df: f64, t: f64) -> f64 {
    student(df).map_or(f64::NAN, |d| d.sf(t))
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
