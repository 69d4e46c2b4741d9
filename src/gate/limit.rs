//! Limits, and the evidence that a value keeps or breaks one.

use super::POWER;
use crate::stats::{Estimate, tost, upper_tail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a value must satisfy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    /// At least this.
    AtLeast(f64),
    /// At most this.
    AtMost(f64),
    /// Equivalent to a target.
    Equals {
        /// The target.
        target: f64,
        /// The margin on either side.
        within: f64,
    },
}

impl Limit {
    /// The limit as people write it.
    pub fn text(&self) -> String {
        match self {
            Limit::AtLeast(v) => format!("at least {v}"),
            Limit::AtMost(v) => format!("at most {v}"),
            Limit::Equals { target, within } => format!("{target} within {within}"),
        }
    }

    /// How far within the limit a value lies, in its unit; negative outside.
    pub fn margin(&self, value: f64) -> f64 {
        match *self {
            Limit::AtLeast(limit) => value - limit,
            Limit::AtMost(limit) => limit - value,
            Limit::Equals { target, within } => within - (value - target).abs(),
        }
    }

    /// Whether whatever keeps this limit keeps the other, and not the other way round.
    pub fn is_stricter_than(&self, other: &Limit) -> bool {
        let ([lo, hi], [least, most]) = (self.range(), other.range());
        lo >= least && hi <= most && (lo, hi) != (least, most)
    }

    fn range(&self) -> [f64; 2] {
        match *self {
            Limit::AtLeast(limit) => [limit, f64::INFINITY],
            Limit::AtMost(limit) => [f64::NEG_INFINITY, limit],
            Limit::Equals { target, within } => [target - within, target + within],
        }
    }

    /// The p-value of "the limit is broken": small where it holds.
    ///
    /// Of one-sided limits 2 P(T > margin / se), at most 1, so that it is below alpha
    /// where the two-sided interval of 1 - alpha lies within the limit: truths on the
    /// limit are passed at half of alpha. Of `equals` two one-sided tests
    /// ([`tost`]). A standard error of 0 leaves no doubt: 0 or 1. NaN where the error
    /// or its degrees of freedom are unknown.
    pub fn p_holds(&self, estimate: &Estimate) -> f64 {
        match *self {
            Limit::Equals { target, within } => tost(estimate, target, within),
            _ => two_tails(estimate, self.margin(estimate.value), |inside| inside >= 0.0),
        }
    }

    /// The p-value of "the limit holds": small where it is broken. 2 P(T > d / se), at
    /// most 1, with d the distance beyond the limit, beyond its nearer edge for
    /// `equals`; there a truth on an edge is failed at alpha or less, whatever the margin.
    /// A standard error of 0 and what is unknown as in [`Limit::p_holds`].
    pub fn p_broken(&self, estimate: &Estimate) -> f64 {
        two_tails(estimate, -self.margin(estimate.value), |beyond| beyond > 0.0)
    }

    /// The smallest distance of the truth from the limit that is decided with a
    /// probability of [`POWER`] where p-values must stay below `alpha`. One-sided
    /// limits take t(1 - alpha/2), equivalence t(1 - alpha): a truth so far within the
    /// nearer edge passes, where the other edge is further away; one so far outside
    /// fails, or nearly. None where the standard error is 0 or unknown.
    pub fn detectable(&self, estimate: &Estimate, alpha: f64) -> Option<f64> {
        let two_sided = match self {
            Limit::AtLeast(_) | Limit::AtMost(_) => alpha,
            Limit::Equals { .. } => 2.0 * alpha,
        };
        Some(estimate.detectable(two_sided, POWER)).filter(|d| d.is_finite() && *d > 0.0)
    }
}

/// Twice the tail beyond a distance, at most 1; without noise, whether it is sure.
fn two_tails(estimate: &Estimate, distance: f64, sure: impl Fn(f64) -> bool) -> f64 {
    if estimate.se == 0.0 && !distance.is_nan() {
        return if sure(distance) { 0.0 } else { 1.0 };
    }
    let p = 2.0 * upper_tail(estimate.df, distance / estimate.se);
    // `min` would take 1 for NaN.
    if p > 1.0 { 1.0 } else { p }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::SplitMix64;

    const LIMITS: [Limit; 4] = [
        Limit::AtLeast(0.5),
        Limit::AtMost(0.5),
        Limit::Equals { target: 0.5, within: 0.1 },
        Limit::Equals { target: 0.5, within: 1e-6 },
    ];

    fn at(value: f64, se: f64) -> Estimate {
        Estimate { value, se, df: 15.0 }
    }

    /// What a p-value says, the interval says: two-sided for one-sided limits and for
    /// what is broken, of 1 - 2 alpha for equivalence.
    #[test]
    fn the_tests_and_the_intervals_agree() {
        let mut random = SplitMix64(4);
        for _ in 0..2000 {
            let e = at(0.2 + 0.6 * random.uniform(), 0.05 * random.uniform());
            let [lo, hi] = e.interval(0.95);
            let [low, high] = e.interval(0.9);
            for limit in LIMITS {
                let (inside, outside) = match limit {
                    Limit::AtLeast(l) => (lo > l, hi < l),
                    Limit::AtMost(l) => (hi < l, lo > l),
                    Limit::Equals { target, within } => {
                        (low > target - within && high < target + within, lo > target + within || hi < target - within)
                    }
                };
                assert_eq!(limit.p_holds(&e) < 0.05, inside, "{limit:?} {e:?}");
                assert_eq!(limit.p_broken(&e) < 0.05, outside, "{limit:?} {e:?}");
                assert!(limit.p_holds(&e) >= 0.5 || limit.p_broken(&e) >= 0.5);
            }
        }
    }

    #[test]
    fn without_noise_there_is_no_doubt_and_with_unknown_noise_only_doubt() {
        for (limit, value, holds, broken) in [
            (Limit::AtLeast(0.5), 0.5, 0.0, 1.0),
            (Limit::AtLeast(0.5), 0.4, 1.0, 0.0),
            (Limit::AtMost(0.5), 0.5, 0.0, 1.0),
            (Limit::AtMost(0.5), 0.6, 1.0, 0.0),
            (Limit::Equals { target: 1.0, within: 0.25 }, 1.1, 0.0, 1.0),
            // On the edge it is neither.
            (Limit::Equals { target: 1.0, within: 0.25 }, 1.25, 1.0, 1.0),
            (Limit::Equals { target: 1.0, within: 0.25 }, 0.5, 1.0, 0.0),
        ] {
            assert_eq!(limit.p_holds(&at(value, 0.0)), holds, "{limit:?}");
            assert_eq!(limit.p_broken(&at(value, 0.0)), broken, "{limit:?}");
            for unknown in [at(value, f64::NAN), Estimate { df: f64::NAN, ..at(value, 0.1) }, at(f64::NAN, 0.1)] {
                assert!(limit.p_holds(&unknown).is_nan() && limit.p_broken(&unknown).is_nan());
                assert_eq!(
                    limit.detectable(&Estimate { value: 0.5, ..unknown }, 0.05).is_some(),
                    unknown.se.is_finite() && unknown.df.is_finite()
                );
            }
            assert_eq!(limit.detectable(&at(value, 0.0), 0.05), None, "where nothing scatters, nothing is known");
        }
    }

    /// 20,000 means of 16 normal values, the truth on the limit: at most 5 % are
    /// called held, at most 5 % broken. Four standard errors of a share are .006.
    #[test]
    fn a_truth_on_the_limit_is_rarely_decided() {
        let mut random = SplitMix64(7);
        let (mut held, mut broken) = ([0.0; 4], [0.0; 4]);
        const RUNS: usize = 20_000;
        for _ in 0..RUNS {
            let noise = Estimate::of_mean(&std::array::from_fn::<f64, 16, _>(|_| normal(&mut random)));
            for (i, limit) in LIMITS.iter().enumerate() {
                let edge = limit.range().into_iter().find(|e| e.is_finite()).unwrap();
                let e = Estimate { value: edge + 1e-4 * noise.value, se: 1e-4 * noise.se, ..noise };
                held[i] += f64::from(limit.p_holds(&e) < 0.05) / RUNS as f64;
                broken[i] += f64::from(limit.p_broken(&e) < 0.05) / RUNS as f64;
            }
        }
        // One-sided limits at half of alpha; equivalence at alpha where the margin is
        // wide, at nearly none where it is far below the noise.
        for (share, expected) in held.iter().zip([0.025, 0.025, 0.05, 0.0]) {
            assert!((share - expected).abs() < 0.006, "{held:?}");
        }
        for (share, expected) in broken.iter().zip([0.025, 0.025, 0.025, 0.05]) {
            assert!((share - expected).abs() < 0.006, "{broken:?}");
        }
    }

    fn normal(random: &mut SplitMix64) -> f64 {
        // Box and Muller 1958.
        (-2.0 * random.uniform().ln()).sqrt() * (std::f64::consts::TAU * random.uniform()).cos()
    }

    #[test]
    fn stricter_is_within() {
        let stricter = |a: Limit, b: Limit| a.is_stricter_than(&b);
        assert!(stricter(Limit::AtMost(0.4), Limit::AtMost(0.5)) && !stricter(Limit::AtMost(0.6), Limit::AtMost(0.5)));
        assert!(
            stricter(Limit::AtLeast(0.6), Limit::AtLeast(0.5)) && !stricter(Limit::AtLeast(0.5), Limit::AtLeast(0.5))
        );
        let equals = |target, within| Limit::Equals { target, within };
        assert!(stricter(equals(0.0, 0.5), equals(0.0, 1.0)) && !stricter(equals(0.75, 0.5), equals(0.0, 1.0)));
        assert!(stricter(equals(0.0, 0.5), Limit::AtMost(0.5)) && !stricter(Limit::AtMost(0.5), equals(0.0, 1.0)));
        assert!(!stricter(Limit::AtLeast(0.9), Limit::AtMost(1.0)));
    }

    #[test]
    fn the_margin_is_positive_inside() {
        assert_eq!(Limit::AtLeast(0.5).margin(0.75), 0.25);
        assert_eq!(Limit::AtMost(0.5).margin(0.75), -0.25);
        assert_eq!(Limit::Equals { target: 1.0, within: 0.25 }.margin(0.875), 0.125);
        assert_eq!(Limit::Equals { target: 1.0, within: 0.25 }.margin(1.5), -0.25);
    }
}
