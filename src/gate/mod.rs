//! Gates: limits on metrics become verdicts. A pure function of what a record holds.
//!
//! Each verdict is a test, and a run makes hundreds. [`judge`] therefore takes all
//! verdicts of a run as one family: with Holm's correction the chance of any false red
//! in a run is at most alpha = 1 - confidence, and so is that of any false green. What
//! neither can be said of is inconclusive. docs/gates.md tells it at length.

mod against;
mod family;
mod floor;
mod limit;
mod place;
#[cfg(test)]
mod tests;
mod verdict;
pub mod words;

pub use family::{Evidence, family_at_most, judge};
pub(crate) use floor::Standing;
pub use limit::Limit;
pub use verdict::{Other, Outcome, PValue, Verdict};

use crate::{
    metrics::{MetricName, regions::Region},
    suite::Case,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The confidence of a gate that names none, and of the intervals of reports.
pub const CONFIDENCE: f64 = 0.95;

/// Probability with which an effect as small as [`Verdict::detectable`] is decided.
pub const POWER: f64 = 0.8;

/// What a gate is `against` to be held against the record of another run.
pub const BASE: &str = "base";

/// A limit on a metric, and where it holds. Empty filters let everything through.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gate {
    /// What it makes sure of. Unique in its suite.
    pub name: String,
    /// The metric.
    pub metric: MetricName,
    /// The region, for metrics that are taken over one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub region: Option<Region>,
    /// What fails.
    pub limit: Limit,
    /// What warns: a stricter limit.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub warn: Option<Limit>,
    /// What the metric is taken less of before it is held against the limit: another
    /// estimator by name, or [`BASE`]. Absent, the limit is on the metric itself.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub against: Option<String>,
    /// 1 less the error rate of its verdicts, over all verdicts of a run.
    pub confidence: f64,
    /// Scenes.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub scenes: Vec<String>,
    /// Estimators.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub estimators: Vec<String>,
    /// Renderers.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub renderers: Vec<String>,
    /// Ray counts.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub rays: Vec<u32>,
    /// Why it must fail.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub known_failure: Option<String>,
}

impl Gate {
    /// Whether the gate holds for this case.
    pub fn applies_to(&self, case: &Case) -> bool {
        fn passes<T: PartialEq>(filter: &[T], value: &T) -> bool {
            filter.is_empty() || filter.contains(value)
        }
        self.metric != MetricName::JudgeContrast
            && self.against.as_ref() != Some(&case.estimator)
            && passes(&self.scenes, &case.scene)
            && passes(&self.estimators, &case.estimator)
            && passes(&self.renderers, &case.renderer)
            && passes(&self.rays, &case.rays)
    }

    /// Whether the gate holds for this scene's judge.
    pub fn applies_to_judge(&self, scene: &str) -> bool {
        self.metric == MetricName::JudgeContrast && (self.scenes.is_empty() || self.scenes.iter().any(|s| s == scene))
    }

    /// Whether its metric is taken under an occluder, so that it says nothing of scenes without.
    pub fn needs_occluder(&self) -> bool {
        use MetricName::{Bias, Contrast, ContrastError, JudgeContrast, Mae, Michelson, Openness, Removed, Rmse};
        match self.metric {
            Contrast | Michelson | ContrastError | Removed | JudgeContrast => true,
            Openness | Bias | Mae | Rmse => {
                matches!(self.region, Some(Region::Footprint | Region::Left | Region::Right))
            }
            _ => false,
        }
    }

    /// Whether it needs the record of another run.
    pub fn is_against_base(&self) -> bool {
        self.against.as_deref() == Some(BASE)
    }

    /// The rate of false reds, and of false greens, that it grants to a run.
    pub fn alpha(&self) -> f64 {
        1.0 - self.confidence
    }
}
