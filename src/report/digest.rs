//! What came of a run, for scripts: small, versioned, without what a record holds for
//! other programs of this kind.

use super::errors;
use crate::{
    gate::{Limit, Outcome, Verdict},
    metrics::{MetricName, regions::Region},
    record::{End, IdleGate, Record, Summary},
};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::PathBuf;

/// Version of [`Digest`].
pub const VERSION: u32 = 1;

/// What `report --format json` prints. Fields may be added; what is there keeps its
/// meaning as long as the version stays.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Digest {
    /// Version of this format.
    pub version: u32,
    /// Version of the tool that made the record.
    pub tool: String,
    /// The suite's name.
    pub suite: String,
    /// Seed of all randomness.
    pub seed: u32,
    /// What the run comes to.
    pub outcome: End,
    /// The exit code of `run`, and of `report --gate`.
    pub exit_code: u8,
    /// Counts of verdicts and cases.
    pub summary: Summary,
    /// Why the run ended early; null where it did not.
    pub incomplete: Option<String>,
    /// What ended with an error.
    pub errors: Vec<Error>,
    /// Verdicts that failed or that the data do not decide, failures first.
    pub failures: Vec<Failure>,
    /// Gates that nothing was held against, with the reason.
    pub idle_gates: Vec<IdleGate>,
    /// The files written, without pictures.
    pub files: Vec<String>,
}

/// What ended with an error.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Error {
    /// The case's id, or `scene (judge)`.
    pub subject: String,
    /// Why.
    pub message: String,
}

/// A verdict that does not let the run pass.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Failure {
    /// `fail` or `inconclusive`.
    pub outcome: Outcome,
    /// The gate.
    pub gate: String,
    /// The case's id, `scene/estimator/renderer/rays`, or `scene (judge)`.
    pub subject: String,
    /// What was measured.
    pub metric: MetricName,
    /// Where.
    pub region: Option<Region>,
    /// What the metric was taken less of, where the limit is on the difference.
    pub against: Option<String>,
    /// What was held against the limit.
    pub value: Option<f64>,
    /// Its two-sided interval.
    pub interval: Option<[f64; 2]>,
    /// What it must satisfy.
    pub limit: Limit,
    /// Why it came out so, in a sentence.
    pub reason: String,
    /// A picture that shows it, relative to the record.
    pub picture: Option<String>,
}

impl Failure {
    fn of(verdict: &Verdict) -> Self {
        Failure {
            outcome: verdict.outcome,
            gate: verdict.gate.clone(),
            subject: verdict.subject(),
            metric: verdict.metric.name,
            region: verdict.metric.region,
            against: verdict.against.as_ref().map(|o| o.name.clone()),
            value: verdict.value(),
            interval: verdict.interval,
            limit: verdict.limit,
            reason: verdict.reason.clone(),
            picture: verdict.picture.clone(),
        }
    }
}

impl Digest {
    /// What came of a run that exits with this code, and the files that were written.
    pub fn new(record: &Record, exit_code: u8, files: &[PathBuf]) -> Self {
        let stops = |v: &&Verdict| matches!(v.outcome, Outcome::Fail | Outcome::Inconclusive);
        let mut failures: Vec<Failure> = record.verdicts.iter().filter(stops).map(Failure::of).collect();
        failures.sort_by_key(|f| f.outcome);
        Digest {
            version: VERSION,
            tool: record.tool.clone(),
            suite: record.suite.name.clone(),
            seed: record.seed,
            outcome: record.end(),
            exit_code,
            summary: Summary::new(&record.verdicts, &record.idle_gates, &record.scenes, &record.cases),
            incomplete: record.incomplete.clone(),
            errors: errors(record).map(|(subject, why)| Error { subject, message: why.to_owned() }).collect(),
            failures,
            idle_gates: record.idle_gates.clone(),
            files: files.iter().map(|f| f.display().to_string()).collect(),
        }
    }
}
