//! `[[gate]]`: a limit on a metric, and where it holds.

use super::{Method, Rays};
use crate::{
    gate::{BASE, CONFIDENCE, Gate, Limit},
    metrics::{MetricName, regions::Region},
};
use schemars::JsonSchema;
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error, IntoDeserializer, value},
};
use std::fmt::Display;

/// The confidences a gate may ask for.
const CONFIDENCES: std::ops::RangeInclusive<f64> = 0.5..=0.999_999;

/// A finite limit.
fn finite<'de, D: Deserializer<'de>>(d: D) -> Result<Option<f64>, D::Error> {
    let value = f64::deserialize(d)?;
    if value.is_finite() {
        Ok(Some(value))
    } else {
        Err(D::Error::custom(format!("{value} is no limit: give a finite number")))
    }
}

fn confidence<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    let value = f64::deserialize(d)?;
    if CONFIDENCES.contains(&value) {
        Ok(value)
    } else {
        Err(D::Error::custom(format!("confidence is {value}: it must be 0.5 to 0.999999")))
    }
}

fn usual() -> f64 {
    CONFIDENCE
}

/// The metrics that may be gated.
const GATED: [MetricName; 12] = [
    MetricName::Openness,
    MetricName::Contrast,
    MetricName::Michelson,
    MetricName::JudgeContrast,
    MetricName::ContrastError,
    MetricName::Removed,
    MetricName::Bias,
    MetricName::Mae,
    MetricName::Rmse,
    MetricName::OverDarkening,
    MetricName::RendererDifference,
    MetricName::DistinctReplicates,
];

/// Reads a metric's name. Those that are never gated are known, and refused by what they are.
fn gated<'de, D: Deserializer<'de>>(d: D) -> Result<MetricName, D::Error> {
    let name = String::deserialize(d)?;
    let read = MetricName::deserialize(name.as_str().into_deserializer());
    read.map_err(|_: value::Error| {
        let known = GATED.map(|m| format!("`{}`", m.label())).join(", ");
        D::Error::custom(format!("unknown metric `{name}`, expected one of {known}"))
    })
}

/// `[[gate]]`: a limit on a metric. Filters that are absent or empty let
/// everything through.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GateFile {
    /// What it makes sure of, in a sentence.
    pub name: String,
    /// The metric.
    #[serde(deserialize_with = "gated")]
    pub metric: MetricName,
    /// The region, for metrics that are taken over one.
    pub region: Option<Region>,
    /// Scenes it holds for.
    #[serde(default)]
    pub scenes: Vec<String>,
    /// Estimators it holds for.
    #[serde(default)]
    pub estimators: Vec<String>,
    /// Renderers it holds for.
    #[serde(default)]
    pub renderers: Vec<String>,
    /// Ray counts it holds for.
    #[serde(default)]
    pub rays: Vec<Rays>,
    /// The value is at least this.
    #[serde(default, deserialize_with = "finite")]
    pub min: Option<f64>,
    /// The value is at most this.
    #[serde(default, deserialize_with = "finite")]
    pub max: Option<f64>,
    /// The value equals this, give or take `within`: equivalence, by two one-sided
    /// tests.
    #[serde(default, deserialize_with = "finite")]
    pub equals: Option<f64>,
    /// The margin of `equals`.
    #[serde(default, deserialize_with = "finite")]
    pub within: Option<f64>,
    /// A stricter limit, whose breach is told and passes.
    pub warn: Option<LimitFile>,
    /// The limits are on the metric less that of another estimator, by name, in the same
    /// scene with the same renderer and rays; or, with `base`, less that of the same
    /// case in the record that `run --base` names, without which the gate is idle.
    pub against: Option<String>,
    /// 1 less the chance of any false red in a run, and of any false green: 0.5 to
    /// 0.999999.
    #[serde(default = "usual", deserialize_with = "confidence")]
    #[schemars(extend("minimum" = 0.5, "maximum" = 0.999_999))]
    pub confidence: f64,
    /// Why this gate must fail. It is then shown as a known failure, and passing
    /// is what fails.
    pub known_failure: Option<String>,
}

/// A limit: `min`, `max`, or `equals` together with `within`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LimitFile {
    /// The value is at least this.
    #[serde(default, deserialize_with = "finite")]
    pub min: Option<f64>,
    /// The value is at most this.
    #[serde(default, deserialize_with = "finite")]
    pub max: Option<f64>,
    /// The value equals this, give or take `within`.
    #[serde(default, deserialize_with = "finite")]
    pub equals: Option<f64>,
    /// The margin of `equals`.
    #[serde(default, deserialize_with = "finite")]
    pub within: Option<f64>,
}

impl LimitFile {
    fn build(self) -> Result<Limit, String> {
        match (self.min, self.max, self.equals, self.within) {
            (Some(v), None, None, None) => Ok(Limit::AtLeast(v)),
            (None, Some(v), None, None) => Ok(Limit::AtMost(v)),
            (None, None, Some(target), Some(within)) if within > 0.0 => Ok(Limit::Equals { target, within }),
            (None, None, Some(_), Some(within)) => Err(format!("within is {within}: it must be above 0")),
            _ => Err(format!("give exactly one limit: min, max, or equals together with within; {}", self.given())),
        }
    }

    /// Which of its options are there.
    fn given(&self) -> String {
        let options = [("min", self.min), ("max", self.max), ("equals", self.equals), ("within", self.within)];
        let given: Vec<&str> = options.iter().filter(|(_, value)| value.is_some()).map(|(name, _)| *name).collect();
        match given.as_slice() {
            [] => "none of them is given".to_owned(),
            [one] => format!("{one} alone is given"),
            [most @ .., last] => format!("{} and {last} are given", most.join(", ")),
        }
    }
}

/// Refuses a list that names something twice.
pub(super) fn once<T: PartialEq + Display>(field: &str, list: &[T]) -> Result<(), String> {
    match (1..list.len()).find(|&i| list[..i].contains(&list[i])) {
        Some(i) => Err(format!("{field} names {} twice", list[i])),
        None => Ok(()),
    }
}

impl GateFile {
    /// The gate of a suite that has these methods, `classic` among them.
    pub(super) fn build(&self, methods: &[Method]) -> Result<Gate, String> {
        if self.name.trim().is_empty() {
            return Err("name is empty: it must say what the gate makes sure of".into());
        }
        self.check_filters()?;
        let GateFile { min, max, equals, within, .. } = *self;
        let limit = LimitFile { min, max, equals, within }.build()?;
        let warn = self.warn.map(LimitFile::build).transpose().map_err(|e| format!("warn: {e}"))?;
        if let Some(warn) = warn.filter(|w| !w.is_stricter_than(&limit)) {
            return Err(format!(
                "warn is {}, which is not stricter than what fails, {}: it would warn of nothing",
                warn.text(),
                limit.text()
            ));
        }
        match &self.known_failure {
            Some(why) if why.trim().is_empty() => return Err("known_failure must say why it fails".into()),
            Some(_) if warn.is_some() => return Err("known_failure and warn exclude each other".into()),
            _ => {}
        }
        self.check_metric()?;
        self.check_against(methods)?;
        Ok(Gate {
            name: self.name.clone(),
            metric: self.metric,
            region: self.region,
            limit,
            warn,
            against: self.against.clone(),
            confidence: self.confidence,
            scenes: self.scenes.clone(),
            estimators: self.estimators.clone(),
            renderers: self.renderers.clone(),
            rays: self.rays.iter().map(|r| r.get()).collect(),
            known_failure: self.known_failure.clone(),
        })
    }

    /// What stands in a filter twice is a slip: perhaps another was meant.
    fn check_filters(&self) -> Result<(), String> {
        for (filter, list) in
            [("scenes", &self.scenes), ("estimators", &self.estimators), ("renderers", &self.renderers)]
        {
            once(filter, list)?;
        }
        once("rays", &self.rays.iter().map(|r| r.get()).collect::<Vec<_>>())
    }

    fn check_metric(&self) -> Result<(), String> {
        if !GATED.contains(&self.metric) {
            return Err(format!(
                "{} is reported but never gated: it measures the direction of light more than AO; gate contrast-error",
                self.metric.label()
            ));
        }
        let needs = matches!(self.metric, MetricName::Openness | MetricName::Bias | MetricName::Mae | MetricName::Rmse);
        match (needs, self.region) {
            (true, None) => return Err(format!("{} needs a region", self.metric.label())),
            (false, Some(_)) => return Err(format!("{} takes no region: it has its own", self.metric.label())),
            _ => {}
        }
        if self.metric == MetricName::JudgeContrast
            && !(self.estimators.is_empty() && self.renderers.is_empty() && self.rays.is_empty())
        {
            return Err("judge-contrast belongs to a scene: filter by scenes only".into());
        }
        Ok(())
    }

    fn check_against(&self, methods: &[Method]) -> Result<(), String> {
        let Some(other) = &self.against else { return Ok(()) };
        let method = methods.iter().find(|m| m.name == *other);
        if other == BASE {
            return match method {
                Some(_) => Err(
                    "against = 'base' means the record of --base, but an estimator is called 'base': rename the estimator"
                        .into(),
                ),
                None => Ok(()),
            };
        }
        let Some(method) = method else {
            let known: Vec<&str> = methods.iter().map(|m| m.name.as_str()).collect();
            return Err(format!(
                "against names '{other}', which the suite does not have; it has {}, and base is the record of --base",
                known.join(", ")
            ));
        };
        if self.metric == MetricName::JudgeContrast {
            return Err("judge-contrast belongs to a scene, not to an estimator: it may be against base only".into());
        }
        if self.estimators.contains(other) {
            return Err(format!("estimators names '{other}', which the gate is against: that is always equal"));
        }
        if method.is_classic() && matches!(self.metric, MetricName::Removed | MetricName::OverDarkening) {
            return Err(format!("{} is taken against classic already: leave against out", self.metric.label()));
        }
        Ok(())
    }
}
