//! Student's test: one mean against a value, or two means of one variance.

use super::{Estimate, mean_variance, upper_tail};

/// Student's test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Student {
    /// What is tested less what it is tested against, with its standard error and
    /// degrees of freedom.
    pub difference: Estimate,
    /// The statistic.
    pub t: f64,
    /// Two-sided p-value.
    pub p_two: f64,
    /// p-value of "it is greater".
    pub p_greater: f64,
}

/// One sample against a value (Student, Biometrika 6, 1908): t = (mean - value) /
/// (s / sqrt n), n - 1 degrees of freedom.
///
/// Two samples whose values come in pairs are one sample of their differences,
/// against 0. Needs two values; with fewer, or NaN, every p-value is NaN. Where
/// the values do not vary, p is 1 at the value and 0 elsewhere.
///
/// Measured: 40,000 tests at level .05 of 16 normal values reject a share within
/// [.0467, .0533].
///
/// ```
/// # use aogauge::stats::student;
/// let (before, after) = ([0.61, 0.72, 0.55, 0.80], [0.60, 0.70, 0.54, 0.77]);
/// let change: Vec<f64> = before.iter().zip(after).map(|(b, a)| a - b).collect();
/// let test = student(&change, 0.0);
/// assert!(test.t < 0.0 && test.difference.df == 3.0);
/// ```
pub fn student(values: &[f64], against: f64) -> Student {
    of(&Estimate::of_mean(values), against)
}

/// Two independent samples of one variance: s^2 pooled over both, se^2 = s^2 (1/na
/// plus 1/nb), with na + nb - 2 degrees of freedom. Where the variances may differ,
/// take [`welch`](super::welch()): it costs next to nothing.
///
/// Needs one value a side and three in all; with fewer, or NaN, every p-value is
/// NaN. Measured: 40,000 tests at level .05 of 16 against 8 normal values reject a
/// share within [.0467, .0533].
pub fn student_pooled(a: &[f64], b: &[f64]) -> Student {
    let squares = |values: &[f64], variance: f64| match values.len() {
        0 => f64::NAN,
        // One value does not vary about its mean; NaN stays NaN.
        1 => 0.0 * values[0],
        n => variance * (n - 1) as f64,
    };
    let ((ma, va), (mb, vb)) = (mean_variance(a), mean_variance(b));
    let (na, nb) = (a.len() as f64, b.len() as f64);
    let df = na + nb - 2.0;
    let variance = (squares(a, va) + squares(b, vb)) / df;
    let se = if df > 0.0 { (variance * (1.0 / na + 1.0 / nb)).sqrt() } else { f64::NAN };
    of(&Estimate { value: ma - mb, se, df }, 0.0)
}

fn of(estimate: &Estimate, against: f64) -> Student {
    let [t, p_two, p_greater] = tails(estimate, against);
    Student { difference: Estimate { value: estimate.value - against, ..*estimate }, t, p_two, p_greater }
}

/// t, two-sided p and p of "greater" of an estimate against a value. A standard
/// error of zero leaves no doubt: p is 0 or 1.
pub(super) fn tails(estimate: &Estimate, against: f64) -> [f64; 3] {
    let off = estimate.value - against;
    if estimate.se == 0.0 && !off.is_nan() {
        let sure = |yes: bool| if yes { 0.0 } else { 1.0 };
        let t = if off == 0.0 { 0.0 } else { off * f64::INFINITY };
        return [t, sure(off != 0.0), sure(off > 0.0)];
    }
    let t = off / estimate.se;
    // `min` would take 1 for NaN.
    let p_two = 2.0 * upper_tail(estimate.df, t.abs());
    [t, if p_two > 1.0 { 1.0 } else { p_two }, upper_tail(estimate.df, t)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sample_is_what_the_formula_says() {
        // Mean 2.5, se .6454972; t = 1.5/.6454972 = 2.3237900, df 3, p by scipy.
        let s = student(&[1.0, 2.0, 3.0, 4.0], 1.0);
        assert!((s.t - 2.323_790_008).abs() < 1e-9 && s.difference.df == 3.0 && s.difference.value == 1.5);
        assert!((s.p_two - P_ONE).abs() < 1e-9, "{}", s.p_two);
        assert!((s.p_greater - P_ONE / 2.0).abs() < 1e-9);
    }

    #[test]
    fn two_samples_share_a_variance() {
        let s = student_pooled(&[1.0, 2.0, 3.0, 4.0], &[2.0, 4.0, 9.0]);
        assert!((s.t - T_TWO).abs() < 1e-9 && s.difference.df == 5.0, "{}", s.t);
        assert!((s.p_two - P_TWO).abs() < 1e-9, "{}", s.p_two);
        // With one value on a side, only the other has a spread.
        let s = student_pooled(&[1.0], &[2.0, 4.0, 9.0]);
        assert!(s.difference.df == 2.0 && s.p_two.is_finite());
    }

    #[test]
    fn degenerate_samples_have_a_stated_result() {
        assert_eq!(student(&[0.5; 3], 0.5).p_two, 1.0);
        assert_eq!(student(&[0.5; 3], 0.4).p_two, 0.0);
        assert_eq!(student(&[0.5; 3], 0.6).p_greater, 1.0);
        for s in [
            student(&[0.5], 0.5),
            student(&[], 0.5),
            student(&[0.5, f64::NAN], 0.5),
            student(&[0.5; 3], f64::NAN),
            student_pooled(&[0.5], &[0.4]),
            student_pooled(&[], &[0.4, 0.5, 0.6]),
            student_pooled(&[f64::NAN], &[0.4, 0.5, 0.6]),
        ] {
            assert!(s.p_two.is_nan() && s.p_greater.is_nan(), "{s:?}");
        }
    }

    const P_ONE: f64 = 0.102_728_078_858_399;
    const T_TWO: f64 = -1.314_576_205_124_047_3;
    const P_TWO: f64 = 0.245_719_762_702_992_8;
}
