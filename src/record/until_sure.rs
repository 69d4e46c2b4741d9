//! How a run went on until it was sure.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How replicates were added until verdicts were decided.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UntilSure {
    /// The most replicates of a case.
    pub max_replicates: u32,
    /// After so many seconds none were added; null without end.
    pub max_time: Option<f64>,
    /// What a budget, or that more replicates would not help, ended before all its verdicts and warnings were decided.
    pub undecided: Vec<Undecided>,
}

/// Cases that grow together, and were ended before all was decided.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Undecided {
    /// Their scene.
    pub scene: String,
    /// Primary rays a pixel, of the classic case among them where a method has its own; the fewest
    /// where gates hold cases of several ray counts against each other.
    pub rays: u32,
    /// Replicates that each of them has.
    pub replicates: u32,
    /// What ended them.
    pub by: Budget,
}

/// What ends the search for certainty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Budget {
    /// `--max-time`.
    MaxTime,
    /// `--max-replicates`.
    MaxReplicates,
    /// That no number of replicates would decide: what is left is the noise of the judge, of the
    /// converged image or of a base record.
    Floor,
}
