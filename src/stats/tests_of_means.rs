//! Tests of means: Welch, equivalence (TOST), and Sidak's correction.

use super::{Estimate, mean_variance, upper_tail};

/// Welch's test of two means with variances of their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Welch {
    /// Mean of the first less mean of the second, with its standard error and
    /// Welch-Satterthwaite degrees of freedom.
    pub difference: Estimate,
    /// The statistic.
    pub t: f64,
    /// Two-sided p-value.
    pub p_two: f64,
    /// p-value of "the first is greater".
    pub p_greater: f64,
}

/// Welch's t-test (Biometrika 34, 1947). Needs two values a side.
pub fn welch(a: &[f64], b: &[f64]) -> Welch {
    let ((ma, va), (mb, vb)) = (mean_variance(a), mean_variance(b));
    welch_of_moments((ma, va / a.len() as f64, a.len() as f64 - 1.0), (mb, vb / b.len() as f64, b.len() as f64 - 1.0))
}

/// The same from mean, variance of that mean and degrees of freedom of each side.
pub(crate) fn welch_of_moments(a: (f64, f64, f64), b: (f64, f64, f64)) -> Welch {
    let variance = a.1 + b.1;
    let df = variance * variance / (a.1 * a.1 / a.2 + b.1 * b.1 / b.2);
    let difference = Estimate { value: a.0 - b.0, se: variance.sqrt(), df };
    let t = difference.value / difference.se;
    Welch { difference, t, p_two: (2.0 * upper_tail(df, t.abs())).min(1.0), p_greater: upper_tail(df, t) }
}

/// Two one-sided tests (Schuirmann 1987): the p-value of "the value lies outside
/// `target +- margin`". Below alpha, the value is equivalent to the target.
pub fn tost(estimate: &Estimate, target: f64, margin: f64) -> f64 {
    let off = estimate.value - target;
    if estimate.se == 0.0 {
        return if off.abs() < margin { 0.0 } else { 1.0 };
    }
    let lower = upper_tail(estimate.df, (off + margin) / estimate.se);
    let upper = upper_tail(estimate.df, (margin - off) / estimate.se);
    lower.max(upper)
}

/// The level of each of `n` independent tests for a family error of `alpha`:
/// 1 - (1 - alpha)^(1/n), without losing digits for large n.
pub fn sidak_alpha(alpha: f64, n: usize) -> f64 {
    -((-alpha).ln_1p() / n.max(1) as f64).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    fn reference() -> Value {
        serde_json::from_str(include_str!("../../tests/reference/statistics.json")).unwrap()
    }

    fn numbers(v: &Value) -> Vec<f64> {
        v.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
    }

    fn close(a: f64, b: &Value, what: &str) {
        let b = b.as_f64().unwrap();
        assert!((a - b).abs() <= 1e-9 * b.abs().max(1e-3), "{what}: {a} against {b}");
    }

    #[test]
    fn welch_and_tost_match_the_reference() {
        let all = reference();
        let r = &all["welch"];
        let w = welch(&numbers(&r["a"]), &numbers(&r["b"]));
        close(w.t, &r["t"], "t");
        close(w.difference.df, &r["df"], "df");
        close(w.p_two, &r["p_two"], "p_two");
        close(w.p_greater, &r["p_greater"], "p_greater");
        let [lo, hi] = w.difference.interval(0.95);
        close(lo, &r["ci95"][0], "lo");
        close(hi, &r["ci95"][1], "hi");
        for margin in [0.05, 0.15] {
            close(tost(&w.difference, 0.0, margin), &all[format!("tost_margin_{margin}")]["p"], "tost");
        }
    }

    #[test]
    fn sidak_matches_the_reference() {
        let all = reference();
        for n in [2usize, 100, 4096, 65_536] {
            close(sidak_alpha(0.01, n), &all["multiple"]["sidak_alpha"][n.to_string()], "sidak");
        }
    }
}
