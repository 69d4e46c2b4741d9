//! Numbers from images: where ([`regions`]), how bright against its surroundings
//! ([`artifact`]), how wrong ([`error`]).

pub mod artifact;
pub mod convergence;
pub mod error;
pub mod image;
pub mod judge;
pub mod profile;
pub mod regions;
pub mod tiles;

use crate::stats::Estimate;
use regions::Region;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is measured. Openness and what derives from it have no unit; all are
/// means over replicates with their interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MetricName {
    /// Mean openness of a region, 0 to 1.
    Openness,
    /// K = mean(footprint) / mean(brighter flank) - 1 (Weber), -1 and up.
    /// Above 0 there is a highlight.
    Contrast,
    /// (footprint - flank) / (footprint + flank), -1 to 1 (Michelson).
    Michelson,
    /// K(Q), the contrast of the judge's occlusion ratio: what K should be.
    JudgeContrast,
    /// dK = K - K(Q), signed. 0 is right; above, the highlight is too strong.
    ContrastError,
    /// 1 - max(0, dK) / dK(classic): 0 leaves the artifact, 1 takes it away.
    Removed,
    /// Mean of O less the converged image of the same estimator. 0 is unbiased.
    Bias,
    /// Mean absolute difference from the converged image. Lower is better.
    Mae,
    /// Root mean square difference from the converged image. Lower is better.
    Rmse,
    /// Mean of O less the region's Q. Reported, never gated: it measures the
    /// direction of light more than AO.
    JudgeBias,
    /// Mean absolute value of O less Q over the region's unmasked pixels.
    /// Reported, never gated.
    JudgeMae,
    /// Root mean square of O less Q over the region's unmasked pixels. Reported,
    /// never gated.
    JudgeRmse,
    /// Mean of O(classic) - O over the whole image. On a control, 0 is right.
    OverDarkening,
    /// Mean of O on this renderer less O on the CPU: same seeds on the GPU, independent ones on
    /// external renderers.
    RendererDifference,
    /// Replicates that are unlike all earlier ones, over all replicates. Below 1 where
    /// nothing is random in the image, or one seed served twice.
    DistinctReplicates,
}

impl MetricName {
    /// As it is written in suites and records.
    pub fn label(self) -> &'static str {
        match self {
            MetricName::Openness => "openness",
            MetricName::Contrast => "contrast",
            MetricName::Michelson => "michelson",
            MetricName::JudgeContrast => "judge-contrast",
            MetricName::ContrastError => "contrast-error",
            MetricName::Removed => "removed",
            MetricName::Bias => "bias",
            MetricName::Mae => "mae",
            MetricName::Rmse => "rmse",
            MetricName::JudgeBias => "judge-bias",
            MetricName::JudgeMae => "judge-mae",
            MetricName::JudgeRmse => "judge-rmse",
            MetricName::OverDarkening => "over-darkening",
            MetricName::RendererDifference => "renderer-difference",
            MetricName::DistinctReplicates => "distinct-replicates",
        }
    }

    /// Whether it is an error against the converged image of the same estimator.
    pub fn is_against_converged(self) -> bool {
        matches!(self, MetricName::Bias | MetricName::Mae | MetricName::Rmse)
    }
}

/// One number of one case, or why there is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Metric {
    /// What.
    pub name: MetricName,
    /// Over which pixels; absent where the metric names its own regions.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub region: Option<Region>,
    /// The value; null where it is not defined.
    pub value: Option<f64>,
    /// Standard error over replicates.
    pub se: Option<f64>,
    /// Degrees of freedom of the standard error.
    pub df: Option<f64>,
    /// The part of the standard error that does not come from the case's own replicates;
    /// absent where all of it does.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub floor: Option<Floor>,
    /// Why the value is null, or how a contrast error reads.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub note: Option<String>,
}

impl Metric {
    /// A measured metric.
    pub fn new(name: MetricName, region: Option<Region>, estimate: Result<Estimate, Absent>) -> Self {
        match estimate {
            Ok(e) if e.value.is_finite() => {
                let finite = |v: f64| v.is_finite().then_some(v);
                Metric {
                    name,
                    region,
                    value: Some(e.value),
                    se: finite(e.se),
                    df: finite(e.df),
                    floor: None,
                    note: None,
                }
            }
            Ok(_) => Self::absent(
                name,
                region,
                "the value is not a finite number: an image holds NaN, or a denominator is zero",
            ),
            Err(Absent(why)) => Self::absent(name, region, &why),
        }
    }

    fn absent(name: MetricName, region: Option<Region>, why: &str) -> Self {
        Metric { name, region, value: None, se: None, df: None, floor: None, note: Some(why.to_owned()) }
    }

    /// The same, where a part of the standard error is that of something else than the
    /// case's replicates.
    #[must_use]
    pub fn with_floor(self, part: Option<Estimate>) -> Self {
        Metric { floor: part.filter(|_| self.value.is_some()).and_then(Floor::of), ..self }
    }

    /// Value and standard error, where both are known.
    pub fn estimate(&self) -> Option<Estimate> {
        Some(Estimate { value: self.value?, se: self.se?, df: self.df.unwrap_or(1.0) })
    }

    /// The regions that it is taken over.
    pub fn regions(&self) -> &[Region] {
        match (self.name, &self.region) {
            (_, Some(region)) => std::slice::from_ref(region),
            (MetricName::OverDarkening | MetricName::RendererDifference | MetricName::DistinctReplicates, None) => {
                &[Region::All]
            }
            _ => &[Region::Footprint, Region::Left, Region::Right],
        }
    }

    /// `name` or `name over region`, for people.
    pub fn title(&self) -> String {
        match self.region {
            Some(region) => format!("{} over {}", self.name.label(), region.label()),
            None => self.name.label().to_owned(),
        }
    }
}

/// The part of a standard error that does not come from a case's own replicates, but from
/// the judge, the converged image or a base record: however many replicates the case has,
/// its standard error does not fall below this.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Floor {
    /// The standard error of that part, above 0.
    pub se: f64,
    /// Its degrees of freedom, above 0.
    pub df: f64,
}

impl Floor {
    /// That of an estimate; None where it has no error, or an unknown one.
    pub fn of(part: Estimate) -> Option<Self> {
        let is_known = part.se > 0.0 && part.se.is_finite() && part.df > 0.0 && part.df.is_finite();
        is_known.then_some(Floor { se: part.se, df: part.df })
    }
}

/// A number with its uncertainty, of which the place in a record says what it is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Quantity {
    /// The value; null where it is not defined.
    pub value: Option<f64>,
    /// Its standard error; null where it is not known.
    pub se: Option<f64>,
    /// Degrees of freedom of the standard error.
    pub df: Option<f64>,
    /// Why the value is null.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub note: Option<String>,
}

impl Quantity {
    /// A measured quantity, or why there is none.
    pub fn new(estimate: Result<Estimate, Absent>) -> Self {
        let finite = |v: f64| v.is_finite().then_some(v);
        match estimate {
            Ok(e) if e.value.is_finite() => {
                Quantity { value: Some(e.value), se: finite(e.se), df: finite(e.df), note: None }
            }
            Ok(_) => Self::new(Err(Absent("the value is not a finite number".into()))),
            Err(Absent(why)) => Quantity { value: None, se: None, df: None, note: Some(why) },
        }
    }

    /// Value and standard error, where both are known.
    pub fn estimate(&self) -> Option<Estimate> {
        Some(Estimate { value: self.value?, se: self.se?, df: self.df.unwrap_or(1.0) })
    }
}

/// Why a metric has no value.
#[derive(Clone, Debug, PartialEq)]
pub struct Absent(pub String);
