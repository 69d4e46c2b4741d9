//! Tests whose alternative is "close enough": equivalence and non-inferiority.
//! Here a small p-value is good news.

use super::{Estimate, upper_tail};

/// Which way a value is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// Greater is better.
    Higher,
    /// Smaller is better.
    Lower,
}

/// Two one-sided tests (Schuirmann 1987): the p-value of "the value lies outside
/// `target +- margin`". Below alpha, the value is equivalent to the target. NaN
/// where the standard error or its degrees of freedom are unknown.
///
/// Measured with the truth on the margin and the margin many standard errors wide:
/// 40,000 tests at level .05 of 16 normal values call a share within [.0467, .0533]
/// equivalent; narrower margins call fewer.
pub fn tost(estimate: &Estimate, target: f64, margin: f64) -> f64 {
    let off = estimate.value - target;
    if estimate.se == 0.0 {
        return if off.abs() < margin { 0.0 } else { 1.0 };
    }
    let lower = upper_tail(estimate.df, (off + margin) / estimate.se);
    let upper = upper_tail(estimate.df, (margin - off) / estimate.se);
    lower.max(upper)
}

/// Non-inferiority (Blackwelder 1982): the p-value of "the value is worse than the
/// target by the margin or more". Below alpha, it is not.
///
/// One t test of the value against target - margin where higher is better, against
/// target + margin where lower is. NaN where the standard error or its degrees of freedom
/// are unknown. A standard error of zero decides: 0 or 1.
///
/// Measured with the truth on the margin: 40,000 tests at level .05 of 16 normal
/// values call a share within [.0467, .0533] not inferior.
///
/// ```
/// # use aogauge::stats::{Better, Estimate, non_inferior};
/// let error = Estimate { value: 0.021, se: 0.001, df: 15.0 };
/// // Lower is better: surely less than .005 above .02.
/// assert!(non_inferior(&error, 0.02, 0.005, Better::Lower) < 0.01);
/// assert!(non_inferior(&error, 0.02, 0.001, Better::Lower) > 0.4);
/// ```
pub fn non_inferior(estimate: &Estimate, target: f64, margin: f64, better: Better) -> f64 {
    let ahead = match better {
        Better::Higher => estimate.value - (target - margin),
        Better::Lower => target + margin - estimate.value,
    };
    if estimate.se == 0.0 && !ahead.is_nan() {
        return if ahead > 0.0 { 0.0 } else { 1.0 };
    }
    upper_tail(estimate.df, ahead / estimate.se)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{
        reference::{close, numbers, reference},
        welch,
    };

    #[test]
    fn tost_and_its_halves_match_the_reference() {
        let all = reference();
        let r = &all["welch"];
        let difference = welch(&numbers(&r["a"]), &numbers(&r["b"])).difference;
        for margin in [0.05, 0.15] {
            let r = &all[format!("tost_margin_{margin}")];
            close(tost(&difference, 0.0, margin), &r["p"], "tost");
            close(non_inferior(&difference, 0.0, margin, Better::Higher), &r["p_lower"], "not lower");
            close(non_inferior(&difference, 0.0, margin, Better::Lower), &r["p_upper"], "not higher");
        }
    }

    #[test]
    fn degenerate_estimates_have_a_stated_result() {
        let sure = Estimate { value: 0.5, se: 0.0, df: 3.0 };
        assert_eq!(non_inferior(&sure, 0.6, 0.2, Better::Higher), 0.0);
        assert_eq!(non_inferior(&sure, 0.75, 0.25, Better::Higher), 1.0, "worse by the margin is worse");
        assert_eq!(non_inferior(&sure, 0.25, 0.25, Better::Lower), 1.0);
        for unknown in [Estimate { se: f64::NAN, ..sure }, Estimate { se: 0.1, df: f64::NAN, ..sure }] {
            assert!(non_inferior(&unknown, 0.6, 0.2, Better::Higher).is_nan());
            assert!(tost(&unknown, 0.6, 0.2).is_nan());
        }
    }
}
