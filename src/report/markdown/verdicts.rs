//! Every verdict of a run, as rows of a table.

use super::{
    super::table::{detectable_text, outcome_text, value_text},
    sign,
};
use crate::{
    gate::{Outcome, Verdict},
    record::Record,
};
use serde::Serialize;

/// Verdicts that are listed at most where the page must be short; failures come first.
const BRIEF: usize = 400;

/// The rows.
#[derive(Serialize)]
pub(super) struct Verdicts {
    rows: Vec<VerdictRow>,
    /// How many there are.
    all: usize,
    /// How many are not listed.
    more: usize,
}

#[derive(Serialize)]
struct VerdictRow {
    sign: &'static str,
    outcome: &'static str,
    gate: String,
    /// Why, for what did not pass.
    reason: Option<String>,
    subject: String,
    metric: String,
    value: String,
    detectable: String,
    limit: String,
}

impl Verdicts {
    pub(super) fn new(record: &Record, brief: bool) -> Self {
        let all = record.verdicts.len();
        let listed = if brief { all.min(BRIEF) } else { all };
        let rows = record.verdicts.iter().take(listed).map(row).collect();
        Verdicts { rows, all, more: all - listed }
    }
}

fn row(v: &Verdict) -> VerdictRow {
    VerdictRow {
        sign: sign(v.outcome),
        outcome: outcome_text(v.outcome),
        gate: v.gate.clone(),
        reason: (v.outcome != Outcome::Pass).then(|| v.reason.clone()),
        subject: v.subject(),
        metric: v.title(),
        value: value_text(v.value(), v.interval),
        detectable: detectable_text(v.detectable),
        limit: v.limit.text(),
    }
}
