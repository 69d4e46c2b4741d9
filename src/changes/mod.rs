//! What changed between two records: verdicts, cases, metrics, images and times, as
//! data, text and a comment for a pull request.
//!
//! The one is the *base*, what was there before; the other is *new*. Nothing here
//! renders. What cannot be compared, because a scene or a method is another one, is
//! said and not compared.

mod coverage;
mod edits;
mod grounds;
mod images;
mod markdown;
mod metrics;
mod tables;
mod text;
mod times;
mod verdicts;

pub use coverage::{Coverage, LostCase};
pub use edits::GateEdit;
pub use grounds::{Incomparable, Kind};
pub use images::{ImageChange, ImageState, images};
pub use markdown::{MAX_BYTES, markdown, marker};
pub use metrics::{MetricChange, Metrics, ValueLost};
pub use text::text;
pub use times::{TimeChange, Times};
pub use verdicts::{Gates, GoneGate, LimitChange, NewGate, VerdictChange, Withdrawn};

use crate::{
    counted::counted,
    record::{Record, Summary},
};
use grounds::Grounds;
use schemars::JsonSchema;
use serde::Serialize;

/// Version of what `compare --format json` prints of two records.
pub const VERSION: u32 = 1;

/// The chance of naming any metric, and of naming any image, where nothing changed.
pub const ALPHA: f64 = 0.01;

/// One thing as it was and as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Both<T> {
    /// In the base.
    pub base: T,
    /// In the new record.
    pub new: T,
}

/// Which way something went.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Turn {
    /// For the worse.
    Worse,
    /// Neither: it has no better side, or both sides are as far from it. Of verdicts, a
    /// pass that became a warning or a known failure, or a verdict without one before.
    Changed,
    /// For the better.
    Better,
}

/// What two records come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The new record lacks cases or judges of the base, or its run ended early.
    Lost,
    /// A verdict got worse.
    Worse,
    /// The records have no case in common that gave an image in the new one.
    Nothing,
    /// No verdict got worse, and nothing was lost.
    Pass,
}

/// A setting or a machine that is not the same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Setting {
    /// Which.
    pub what: String,
    /// In the base.
    pub base: String,
    /// In the new record.
    pub new: String,
}

/// Everything that changed between two records.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Changes {
    /// Version of this format.
    pub version: u32,
    /// The suite of the new record.
    pub suite: String,
    /// What it comes to.
    pub outcome: Outcome,
    /// Whether cases that the new record does not have are no loss.
    pub allow_missing: bool,
    /// Why the new run ended early; null where it did not.
    pub incomplete: Option<String>,
    /// Counts of verdicts and cases.
    pub summary: Both<Summary>,
    /// Suite, tool, seed, replicates and machine, where they differ.
    pub settings: Vec<Setting>,
    /// Scenes and methods that are others under the same name: their metrics and images
    /// are not compared.
    pub incomparable: Vec<Incomparable>,
    /// New, gone and lost cases.
    pub cases: Coverage,
    /// Verdicts that changed and those without one before that do not pass, the worst
    /// first.
    pub verdicts: Vec<VerdictChange>,
    /// New and gone gates and limits.
    pub gates: Gates,
    /// Metrics.
    pub metrics: Metrics,
    /// Images that are not the same to the last bit, the surest change first.
    pub images: Vec<ImageChange>,
    /// Times.
    pub times: Times,
}

/// Finds what changed. `images` is what [`images()`] found, or nothing;
/// `allow_missing` takes cases that the new record does not have for no loss.
pub fn changes(base: &Record, new: &Record, images: Vec<ImageChange>, allow_missing: bool) -> Changes {
    let grounds = Grounds::of(base, new);
    let cases = coverage::coverage(base, new);
    let verdicts = verdicts::changed(base, new);
    let lost = new.incomplete.is_some() || !cases.lost.is_empty() || !cases.lost_judges.is_empty();
    let gone = !allow_missing && !cases.gone.is_empty();
    let outcome = if lost || gone {
        Outcome::Lost
    } else if verdicts.iter().any(|v| v.turn == Turn::Worse) {
        Outcome::Worse
    } else if cases.compared + cases.recovered == 0 {
        Outcome::Nothing
    } else {
        Outcome::Pass
    };
    Changes {
        version: VERSION,
        suite: new.suite.name.clone(),
        outcome,
        allow_missing,
        incomplete: new.incomplete.clone(),
        summary: Both { base: base.summary.clone(), new: new.summary.clone() },
        settings: coverage::settings(base, new),
        metrics: metrics::metrics(base, new, &grounds),
        incomparable: grounds.into_list(),
        cases,
        verdicts,
        gates: verdicts::gates(base, new),
        images,
        times: times::times(base, new),
    }
}

impl Changes {
    /// How many verdicts went this way.
    pub fn turned(&self, turn: Turn) -> usize {
        self.verdicts.iter().filter(|v| v.turn == turn).count()
    }

    /// Verdicts that warn and did not.
    pub fn warns(&self) -> usize {
        let did = Some(crate::gate::Outcome::Warn);
        self.verdicts.iter().filter(|v| Some(v.new) == did && v.base != did).count()
    }

    /// Images that moved, or were lost.
    pub fn moved(&self) -> usize {
        self.images.iter().filter(|i| i.state <= ImageState::Moved).count()
    }

    /// What it comes to, in a few words.
    pub fn headline(&self) -> String {
        let lost = self.cases.lost.len() + self.cases.lost_judges.len();
        let gone = if self.allow_missing { 0 } else { self.cases.gone.len() };
        let worse = self.turned(Turn::Worse);
        let mut says: Vec<String> =
            self.incomplete.iter().map(|why| format!("the new run ended early ({why})")).collect();
        for (n, one, many) in [
            (lost, "case or judge ended with an error", "cases or judges ended with an error"),
            (gone, "case is gone", "cases are gone"),
            (worse, "verdict got worse", "verdicts got worse"),
        ] {
            if n > 0 {
                says.push(counted(n, one, many));
            }
        }
        if self.outcome == Outcome::Nothing {
            says.push(match self.cases.still_failing {
                0 => "the records have no case in common".to_owned(),
                n => format!("{} in both records", counted(n, "case ended with an error", "cases ended with an error")),
            });
        }
        if says.is_empty() {
            says.push("no verdict got worse".to_owned());
        }
        let warns = self.warns();
        if warns > 0 {
            says.push(counted(warns, "warns that did not", "warn that did not"));
        }
        if self.cases.recovered > 0 {
            let n = counted(self.cases.recovered, "case", "cases");
            says.push(format!("{n} ended with an error in the base: nothing to compare with"));
        }
        // What is not worse than before may still be bad.
        let (fail, open) = (self.summary.new.fail, self.summary.new.inconclusive);
        if worse == 0 && fail > 0 {
            says.push(counted(fail, "fails", "fail"));
        }
        if worse == 0 && open > 0 {
            says.push(format!("{open} inconclusive"));
        }
        says.join(", ")
    }
}

/// A p-value with the digits that count.
fn p_text(p: f64) -> String {
    match p {
        p if p < 1e-12 => "< 1e-12".to_owned(),
        p if p < 1e-3 => format!("{p:.0e}"),
        p => format!("{p:.4}"),
    }
}

/// A case, and the occluder in it.
fn place(case: &str, occluder: Option<&str>) -> String {
    occluder.map_or_else(|| case.to_owned(), |o| format!("{case}, {o}"))
}
