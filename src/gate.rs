//! Gates: limits on metrics become verdicts. A pure function.
//!
//! A verdict is taken on the interval, not on the value: inside the limit is a
//! pass, outside is a fail, and an interval that holds the limit is inconclusive.
//! Equivalence is decided by TOST.

use crate::{
    metrics::{Metric, MetricName, regions::Region},
    stats::{Estimate, tost},
    suite::Case,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Confidence of the intervals that verdicts are taken on; equivalence is tested
/// at alpha = 1 - confidence.
pub const CONFIDENCE: f64 = 0.95;

/// Probability with which an effect as small as [`Verdict::detectable`] is decided.
pub const POWER: f64 = 0.8;

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
}

/// A limit on a metric, and where it holds. Empty filters let everything through.
#[derive(Clone, Debug, PartialEq)]
pub struct Gate {
    /// What it makes sure of.
    pub name: String,
    /// The metric.
    pub metric: MetricName,
    /// The region, for metrics that are taken over one.
    pub region: Option<Region>,
    /// The limit.
    pub limit: Limit,
    /// Scenes.
    pub scenes: Vec<String>,
    /// Estimators.
    pub estimators: Vec<String>,
    /// Renderers.
    pub renderers: Vec<String>,
    /// Ray counts.
    pub rays: Vec<u32>,
    /// Why it must fail.
    pub known_failure: Option<String>,
}

/// What came of a gate on one case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The limit is broken, or a known failure did not fail.
    Fail,
    /// The data do not decide.
    Inconclusive,
    /// It failed, as it is known to.
    KnownFailure,
    /// The limit holds.
    Pass,
}

/// A gate's verdict on one case, with the numbers that made it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Verdict {
    /// The gate.
    pub gate: String,
    /// The scene.
    pub scene: String,
    /// The case; null for gates on the judge.
    pub case: Option<Case>,
    /// What was measured.
    pub metric: Metric,
    /// What it must satisfy.
    pub limit: Limit,
    /// The 95 % interval; null where the metric is.
    pub interval: Option<[f64; 2]>,
    /// The smallest detectable effect, in the metric's unit: how far on the right side
    /// of the limit the truth must lie to be decided with a probability of 0.8 (see
    /// [`Gate::verdict`]). A pass says little where that is larger than what matters.
    /// Null where the metric is, and where no replicate differs from another: a
    /// standard error of 0 then says nothing of what could have been found.
    #[serde(default)]
    pub detectable: Option<f64>,
    /// p-value of the equivalence test, for `equals`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub p: Option<f64>,
    /// What came of it.
    pub outcome: Outcome,
    /// Why, in a sentence.
    pub reason: String,
}

impl Gate {
    /// Whether the gate holds for this case.
    pub fn applies_to(&self, case: &Case) -> bool {
        fn passes<T: PartialEq>(filter: &[T], value: &T) -> bool {
            filter.is_empty() || filter.contains(value)
        }
        self.metric != MetricName::JudgeContrast
            && passes(&self.scenes, &case.scene)
            && passes(&self.estimators, &case.estimator)
            && passes(&self.renderers, &case.renderer)
            && passes(&self.rays, &case.rays)
    }

    /// Whether the gate holds for this scene's judge.
    pub fn applies_to_judge(&self, scene: &str) -> bool {
        self.metric == MetricName::JudgeContrast && (self.scenes.is_empty() || self.scenes.iter().any(|s| s == scene))
    }

    /// The smallest distance of the truth from the limit that would be decided with
    /// a probability of [`POWER`]. One-sided limits are held against the two-sided
    /// interval of [`CONFIDENCE`], so by its quantile t(0.975): a truth so far within
    /// the limit passes, one so far outside fails. Equivalence is tested on either
    /// side at 1 - `CONFIDENCE`, by t(0.95): a truth so far within the nearer edge of
    /// the margin passes, where the other edge is further away.
    /// None where the standard error is 0 or unknown.
    fn detectable(&self, estimate: Estimate) -> Option<f64> {
        let alpha = match self.limit {
            Limit::AtLeast(_) | Limit::AtMost(_) => 1.0 - CONFIDENCE,
            Limit::Equals { .. } => 2.0 * (1.0 - CONFIDENCE),
        };
        Some(estimate.detectable(alpha, POWER)).filter(|d| d.is_finite() && *d > 0.0)
    }

    /// Judges one metric.
    pub fn verdict(&self, scene: &str, case: Option<&Case>, metric: &Metric) -> Verdict {
        let estimate = metric.estimate();
        let interval = estimate.map(|e| e.interval(CONFIDENCE));
        let mut p = None;
        let (outcome, reason) = match (estimate, interval) {
            (Some(e), Some([lo, hi])) => {
                let (inside, outside) = match self.limit {
                    Limit::AtLeast(limit) => (lo >= limit, hi < limit),
                    Limit::AtMost(limit) => (hi <= limit, lo > limit),
                    Limit::Equals { target, within } => {
                        let value = tost(&e, target, within);
                        p = value.is_finite().then_some(value);
                        (value < 1.0 - CONFIDENCE, lo > target + within || hi < target - within)
                    }
                };
                if inside {
                    (Outcome::Pass, "the limit holds".to_owned())
                } else if outside {
                    (Outcome::Fail, "the limit is broken".to_owned())
                } else {
                    (Outcome::Inconclusive, "the interval holds the limit: more replicates would decide".to_owned())
                }
            }
            _ => {
                (Outcome::Inconclusive, metric.note.clone().unwrap_or_else(|| "the metric has no interval".to_owned()))
            }
        };
        let (outcome, reason) = match (&self.known_failure, outcome) {
            (Some(why), Outcome::Fail) => (Outcome::KnownFailure, why.clone()),
            (Some(_), Outcome::Pass) => {
                (Outcome::Fail, "marked as a known failure, but it passes: remove the mark".to_owned())
            }
            _ => (outcome, reason),
        };
        Verdict {
            gate: self.name.clone(),
            scene: scene.to_owned(),
            case: case.cloned(),
            metric: metric.clone(),
            limit: self.limit,
            interval: interval.filter(|i| i.iter().all(|v| v.is_finite())),
            detectable: estimate.and_then(|e| self.detectable(e)),
            p,
            outcome,
            reason,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gate(limit: Limit, known_failure: Option<&str>) -> Gate {
        Gate {
            name: "g".into(),
            metric: MetricName::Removed,
            region: None,
            limit,
            scenes: vec!["a".into()],
            estimators: vec![],
            renderers: vec![],
            rays: vec![4],
            known_failure: known_failure.map(str::to_owned),
        }
    }

    fn outcome(limit: Limit, known: Option<&str>, value: f64, se: f64) -> Outcome {
        let metric = Metric::new(MetricName::Removed, None, Ok(Estimate { value, se, df: 15.0 }));
        gate(limit, known).verdict("a", None, &metric).outcome
    }

    #[test]
    fn the_interval_decides() {
        use Outcome::*;
        assert_eq!(outcome(Limit::AtLeast(0.5), None, 0.6, 0.01), Pass);
        assert_eq!(outcome(Limit::AtLeast(0.5), None, 0.51, 0.01), Inconclusive);
        assert_eq!(outcome(Limit::AtLeast(0.5), None, 0.4, 0.01), Fail);
        assert_eq!(outcome(Limit::AtMost(0.5), None, 0.4, 0.01), Pass);
        assert_eq!(outcome(Limit::AtMost(0.5), None, 0.6, 0.01), Fail);
        let equal = Limit::Equals { target: 1.0, within: 0.01 };
        assert_eq!(outcome(equal, None, 1.002, 0.001), Pass);
        assert_eq!(outcome(equal, None, 1.0, 0.02), Inconclusive);
        assert_eq!(outcome(equal, None, 1.05, 0.001), Fail);
        assert_eq!(outcome(equal, None, 1.0, 0.0), Pass);
    }

    /// No replicate differs: nothing is known of what would have been found.
    #[test]
    fn without_scatter_nothing_is_detectable() {
        let sees = |se| {
            let metric = Metric::new(MetricName::Removed, None, Ok(Estimate { value: 0.6, se, df: 15.0 }));
            gate(Limit::AtLeast(0.5), None).verdict("a", None, &metric).detectable
        };
        assert_eq!(sees(0.0), None);
        assert!(sees(0.01).is_some_and(|d| d > 0.0));
    }

    #[test]
    fn a_known_failure_must_fail() {
        assert_eq!(outcome(Limit::AtLeast(0.5), Some("why"), 0.4, 0.01), Outcome::KnownFailure);
        assert_eq!(outcome(Limit::AtLeast(0.5), Some("why"), 0.6, 0.01), Outcome::Fail);
        assert_eq!(outcome(Limit::AtLeast(0.5), Some("why"), 0.5, 0.01), Outcome::Inconclusive);
    }

    #[test]
    fn a_null_metric_is_inconclusive_and_says_why() {
        let metric = Metric::new(MetricName::Removed, None, Err(crate::metrics::Absent("too few pixels".into())));
        let v = gate(Limit::AtLeast(0.5), None).verdict("a", None, &metric);
        assert_eq!((v.outcome, v.reason.as_str()), (Outcome::Inconclusive, "too few pixels"));
    }

    #[test]
    fn filters_select() {
        let case =
            |scene: &str, rays| Case { scene: scene.into(), estimator: "e".into(), renderer: "cpu".into(), rays };
        let g = gate(Limit::AtLeast(0.5), None);
        assert!(g.applies_to(&case("a", 4)));
        assert!(!g.applies_to(&case("a", 32)) && !g.applies_to(&case("b", 4)));
    }
}
