//! What comes of a gate on one case.

use super::{CONFIDENCE, Limit};
use crate::{
    metrics::{Floor, Metric, MetricName, Quantity},
    suite::Case,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What came of a gate on one case, the worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The limit is broken, or a known failure did not fail.
    Fail,
    /// The data do not decide.
    Inconclusive,
    /// The limit holds, the stricter one that warns is broken.
    Warn,
    /// It failed, as it is known to.
    KnownFailure,
    /// The limit holds.
    Pass,
}

/// A p-value alone, and over the family of a run's verdicts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PValue {
    /// Of this test alone, 0 to 1.
    pub raw: f64,
    /// Holm's, over the verdicts of the run, after what a look may spend. Below
    /// 1 - confidence it decides.
    pub adjusted: f64,
}

/// What a metric is held against besides a number: the same metric of another
/// estimator, or of the base record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Other {
    /// The estimator's name, or `base`.
    pub name: String,
    /// Its case; null for judges, and where there is none.
    pub case: Option<Case>,
    /// Its metric; null where there is none.
    pub metric: Option<Metric>,
    /// The metric less this one, Welch's: what is held against the limit. Its error is
    /// too large rather than too small where both share random numbers.
    pub difference: Quantity,
}

/// A gate's verdict on one case, with the numbers that made it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Verdict {
    /// The gate.
    pub gate: String,
    /// The scene.
    pub scene: String,
    /// The case; null for gates on the judge, and where there is no case.
    pub case: Option<Case>,
    /// The estimator that the gate names and no case of which has the metric; absent in all
    /// other verdicts.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub lacking: Option<String>,
    /// What was measured.
    pub metric: Metric,
    /// What it is held against besides a number.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub against: Option<Other>,
    /// What it must satisfy.
    pub limit: Limit,
    /// The stricter limit that warns.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub warn: Option<Limit>,
    /// 1 less the error rate, over all verdicts of the run.
    #[serde(default = "confidence")]
    pub confidence: f64,
    /// The two-sided interval of `confidence` of this value alone; null where the metric is.
    pub interval: Option<[f64; 2]>,
    /// How far within the limit the value lies, in its unit; negative outside. Null
    /// where the value is.
    #[serde(default)]
    pub margin: Option<f64>,
    /// The smallest detectable effect, in the metric's unit: how far on the right side
    /// of the limit the truth must lie to be decided with a probability of 0.8,
    /// whatever becomes of the other verdicts (see [`Limit::detectable`]). A pass says
    /// little where that is larger than what matters. Null where the metric is, and
    /// where no replicate differs from another: a standard error of 0 then says nothing
    /// of what could have been found.
    #[serde(default)]
    pub detectable: Option<f64>,
    /// The part of the standard error of what is held against the limit that more
    /// replicates of the case do not make smaller: that of the judge, of the converged image, of a
    /// base record. Absent where there is none.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub floor: Option<Floor>,
    /// The p-value of "the limit is broken": small where it holds. Null where the
    /// metric is, and in records of version 3 but for `equals`.
    #[serde(default)]
    pub p_holds: Option<PValue>,
    /// The p-value of "the limit holds": small where it is broken. Null likewise.
    #[serde(default)]
    pub p_broken: Option<PValue>,
    /// The same of the limit that warns.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub p_warn_broken: Option<PValue>,
    /// The share of the error rate that this look at a case may spend (see
    /// [`spending`](crate::stats::spending)); 1 where it was looked at once.
    #[serde(default = "one")]
    pub spent: f64,
    /// Which pixels it was measured on.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub place: Option<String>,
    /// A picture that shows it, relative to the record. Of PNG and SVG, one that a report
    /// beside the record draws.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub picture: Option<String>,
    /// What came of it.
    pub outcome: Outcome,
    /// Why, in a sentence.
    pub reason: String,
}

fn confidence() -> f64 {
    CONFIDENCE
}

fn one() -> f64 {
    1.0
}

impl Verdict {
    /// What is held against the limit: the metric, or its difference from the other.
    pub fn value(&self) -> Option<f64> {
        self.against.as_ref().map_or(self.metric.value, |o| o.difference.value)
    }

    /// Its standard error.
    pub fn se(&self) -> Option<f64> {
        self.against.as_ref().map_or(self.metric.se, |o| o.difference.se)
    }

    /// The case, or `scene (judge)`; `scene (no case)` or `estimator (no case)` where the gate
    /// names one that has none.
    pub fn subject(&self) -> String {
        match (&self.case, &self.lacking) {
            (Some(case), _) => case.id(),
            (None, Some(estimator)) => format!("{estimator} (no case)"),
            (None, None) if self.is_on_judge() => format!("{} (judge)", self.scene),
            (None, None) => format!("{} (no case)", self.scene),
        }
    }

    /// Whether the judge was measured, and no case.
    pub fn is_on_judge(&self) -> bool {
        self.metric.name == MetricName::JudgeContrast
    }

    /// What is held against the limit, for people: the metric, and what it is less of.
    pub fn title(&self) -> String {
        match &self.against {
            None => self.metric.title(),
            Some(other) => format!("{} less that of {}", self.metric.title(), other.name),
        }
    }
}
