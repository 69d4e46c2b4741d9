//! What a comparison found, as programs read it.

use super::{CompareError, Exact, Limit, Limits, Measure, Settings, Tier, WelchName, WelchReport};
use crate::{
    metrics::image::{ScoreName, Scores},
    stats::Scale,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Version of the format; it changes where a reader of an older one would misread.
pub const VERSION: u32 = 1;

/// By what images are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Every full-reference metric, and the pixel-exact one.
    #[default]
    Metrics,
    /// The pixel-exact metric alone.
    Exact,
}

/// What came of a pair, or of all; the first is the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// It could not be compared.
    Error,
    /// There was no pair at all.
    Nothing,
    /// A limit of the tier `fail` is broken, or an image is missing.
    Fail,
    /// A metric under a limit has no value.
    Inconclusive,
    /// A limit of the tier `warn` is broken.
    Warn,
    /// All limits hold.
    Pass,
    /// There were no limits.
    Measured,
}

impl Outcome {
    /// As it is written in reports.
    pub fn label(self) -> &'static str {
        match self {
            Outcome::Error => "error",
            Outcome::Nothing => "nothing",
            Outcome::Fail => "fail",
            Outcome::Inconclusive => "inconclusive",
            Outcome::Warn => "warn",
            Outcome::Pass => "pass",
            Outcome::Measured => "measured",
        }
    }
}

/// How a limit stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LimitState {
    /// The value is on the good side.
    Holds,
    /// It is not.
    Broken,
    /// There is no value.
    NoValue,
}

/// A limit with the value beside it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LimitReport {
    /// What follows where it is broken.
    pub tier: Tier,
    /// The limit, as it is written: `flip.p99<=0.1`.
    pub limit: String,
    /// The value; null where it is infinite or there is none.
    pub value: Option<f64>,
    /// How it stands.
    pub state: LimitState,
    /// Why there is no value, or no finite one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub note: Option<String>,
}

/// What was found of two images, or of one layer of them.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PairReport {
    /// Path within the folders; of two files, the reference's path.
    pub path: String,
    /// The layer of OpenEXR images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layer: Option<String>,
    /// What came of it.
    pub outcome: Outcome,
    /// Why it could not be compared, or fails though no limit is broken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// What is to be known of it, and changes no outcome.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// Limits with their values.
    pub limits: Vec<LimitReport>,
    /// Pixel by pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exact: Option<Exact>,
    /// Every metric.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scores: Option<Scores>,
    /// Welch's test of the replicates of a record's images, from small to large places.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub welch: Option<WelchReport>,
}

impl PairReport {
    /// Of a pair that could not be compared.
    pub(super) fn failed(path: &str, layer: Option<String>, error: &CompareError) -> Self {
        PairReport {
            path: path.to_owned(),
            layer,
            outcome: Outcome::Error,
            reason: Some(error.to_string()),
            note: None,
            limits: Vec::new(),
            exact: None,
            scores: None,
            welch: None,
        }
    }

    /// Of a pair with its numbers, held against its limits.
    pub(super) fn judged(
        path: &str,
        layer: Option<String>,
        exact: Exact,
        scores: Option<Scores>,
        welch: Option<WelchReport>,
        limits: &Limits,
    ) -> Self {
        let limits = limits.of(path);
        let reports: Vec<LimitReport> = limits
            .iter()
            .map(|(tier, limit)| report(*tier, limit, (&exact, scores.as_ref(), welch.as_ref())))
            .collect();
        // NaN in one image only is a fault that no mean shows.
        let one_sided = scores.as_ref().and_then(|s| s.non_finite.check().err());
        let any = |state: LimitState, tier: Option<Tier>| {
            reports.iter().any(|r| r.state == state && tier.is_none_or(|t| r.tier == t))
        };
        let outcome = if one_sided.is_some() || any(LimitState::Broken, Some(Tier::Fail)) {
            Outcome::Fail
        } else if any(LimitState::NoValue, None) {
            Outcome::Inconclusive
        } else if any(LimitState::Broken, Some(Tier::Warn)) {
            Outcome::Warn
        } else if reports.is_empty() {
            Outcome::Measured
        } else {
            Outcome::Pass
        };
        let reason = one_sided.map(|e| e.to_string());
        let (path, exact) = (path.to_owned(), Some(exact));
        PairReport { path, layer, outcome, reason, note: None, limits: reports, exact, scores, welch }
    }

    /// With what is to be known of it.
    pub(super) fn with_note(self, note: Option<String>) -> Self {
        PairReport { note, ..self }
    }
}

/// What limits are held against.
type Numbers<'a> = (&'a Exact, Option<&'a Scores>, Option<&'a WelchReport>);

fn report(tier: Tier, limit: &Limit, found: Numbers<'_>) -> LimitReport {
    let limit_text = limit.to_string();
    match value(limit.measure, found) {
        Ok(value) => LimitReport {
            tier,
            limit: limit_text,
            value: Some(value).filter(|v| v.is_finite()),
            state: if limit.holds(value) { LimitState::Holds } else { LimitState::Broken },
            note: (!value.is_finite()).then(|| "infinite".to_owned()),
        },
        Err(why) => LimitReport { tier, limit: limit_text, value: None, state: LimitState::NoValue, note: Some(why) },
    }
}

/// The value that a limit is held against; infinite where PSNR or a difference is.
fn value(measure: Measure, (exact, scores, welch): Numbers<'_>) -> Result<f64, String> {
    let absent = |name: &str| {
        let note = scores.and_then(|s| s.scores.iter().find(|s| s.name.label() == name)).and_then(|s| s.note.clone());
        note.unwrap_or_else(|| format!("{measure} was not computed"))
    };
    match measure {
        Measure::Differing => Ok(exact.share),
        Measure::LargestDifference => Ok(exact.largest.unwrap_or(f64::INFINITY)),
        Measure::Score(name) => {
            let found = scores.and_then(|s| s.value(name));
            let equal = scores.and_then(|s| s.value(ScoreName::Mse)) == Some(0.0);
            let infinite = (name == ScoreName::Psnr && equal).then_some(f64::INFINITY);
            found.or(infinite).ok_or_else(|| absent(name.label()))
        }
        Measure::Welch(name) => welch_value(name, welch),
        Measure::Map(map, statistic) => {
            let summary = scores.and_then(|s| s.maps.get(map.label()));
            summary.map(|s| statistic.of(s)).ok_or_else(|| absent(map.label()))
        }
    }
}

/// A scale at which the test can see nothing has no value: that it rejects nothing there
/// would pass whatever the images are.
fn welch_value(name: WelchName, welch: Option<&WelchReport>) -> Result<f64, String> {
    let welch = welch.ok_or("both images need two replicates or more, and must be compared whole")?;
    let scale = match name {
        WelchName::Bias if welch.bias.is_finite() => return Ok(welch.bias),
        WelchName::Bias => return Err("no pixel has a number in all replicates".to_owned()),
        _ if welch.interval.is_none() => {
            return Err("no replicate differs from another: there is nothing to test with".to_owned());
        }
        WelchName::Rejected => None,
        WelchName::Pixels => Some(Scale::Pixel),
        WelchName::Tiles => Some(Scale::Tile),
        WelchName::Image => Some(Scale::Image),
    };
    let asked = welch.scales.iter().filter(|s| scale.is_none_or(|scale| s.scale == scale));
    let (rejected, sees) = asked
        .fold((0, false), |(n, sees), s| (n + s.rejected.len(), sees || s.sees_something() || !s.rejected.is_empty()));
    if sees { Ok(rejected as f64) } else { Err("what bias the test would have found is not known".to_owned()) }
}

/// All that was found.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Comparison {
    /// Version of this format.
    pub version: u32,
    /// What was compared with.
    pub reference: String,
    /// What was compared.
    pub test: String,
    /// By what.
    pub mode: Mode,
    /// What pixels may differ by without being counted.
    pub tolerance: f64,
    /// The worst of all.
    pub outcome: Outcome,
    /// Each pair, and each layer where all are compared, in the order of their paths.
    pub pairs: Vec<PairReport>,
    /// Images of the reference folder alone.
    pub missing: Vec<String>,
    /// Whether missing images fail.
    pub allow_missing: bool,
    /// Images of the test folder alone.
    pub new: Vec<String>,
    /// Files in both folders that are no images, and links that are not followed.
    pub left_out: usize,
}

impl Comparison {
    pub(super) fn new(reference: &Path, test: &Path, settings: &Settings) -> Self {
        Comparison {
            version: VERSION,
            reference: reference.display().to_string(),
            test: test.display().to_string(),
            mode: settings.mode,
            tolerance: settings.tolerance,
            outcome: Outcome::Nothing,
            pairs: Vec::new(),
            missing: Vec::new(),
            allow_missing: settings.allow_missing,
            new: Vec::new(),
            left_out: 0,
        }
    }

    /// Takes the worst of all for the whole.
    pub(super) fn conclude(&mut self, allow_missing: bool) {
        let missing = (!allow_missing && !self.missing.is_empty()).then_some(Outcome::Fail);
        let pairs = self.pairs.iter().map(|p| p.outcome);
        self.outcome = pairs.chain(missing).min().unwrap_or(Outcome::Nothing);
    }

    /// How many pairs came to this.
    pub fn count(&self, outcome: Outcome) -> usize {
        self.pairs.iter().filter(|p| p.outcome == outcome).count()
    }
}
