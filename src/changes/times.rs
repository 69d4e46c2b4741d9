//! How long cases took.

use super::{Both, coverage::by_id};
use crate::record::Record;
use schemars::JsonSchema;
use serde::Serialize;

/// A case is named where it takes this many times as long, or that part.
const RATIO: f64 = 1.3;

/// And where it differs by more than this, seconds.
const SECONDS: f64 = 0.2;

/// A case that took longer or less.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TimeChange {
    /// The case.
    pub case: String,
    /// Seconds of tracing, all replicates.
    pub seconds: Both<f64>,
    /// New over base, a replicate; above 1 is slower.
    pub ratio: f64,
}

/// Times of the cases that gave an image in both records. Each is a single
/// measurement, and the machines may differ.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Times {
    /// Cases whose time is known in both.
    pub compared: usize,
    /// Seconds of all of them.
    pub seconds: Both<f64>,
    /// Those that took more than 1.3 times as long, or less than a 1.3th, and differ by
    /// more than 0.2 s: the slower first, the most changed first.
    pub changed: Vec<TimeChange>,
}

pub(super) fn times(base: &Record, new: &Record) -> Times {
    let (old, mut found) = (by_id(base), Times { compared: 0, seconds: Both { base: 0.0, new: 0.0 }, changed: vec![] });
    for case in new.cases.iter().filter(|c| c.error.is_none()) {
        let id = case.case.id();
        let (Some(was), Some(is)) = (base.timing.cases.get(&id), new.timing.cases.get(&id)) else { continue };
        let Some(before) = old.get(&id).filter(|c| c.error.is_none()) else { continue };
        // More replicates take longer.
        let scale = f64::from(new.replicates(case).max(1)) / f64::from(base.replicates(before).max(1));
        found.compared += 1;
        found.seconds = Both { base: found.seconds.base + was, new: found.seconds.new + is };
        let expected = was * scale;
        let ratio = is / expected;
        if !(1.0 / RATIO..=RATIO).contains(&ratio) && (is - expected).abs() > SECONDS && ratio.is_finite() {
            found.changed.push(TimeChange { case: id, seconds: Both { base: *was, new: *is }, ratio });
        }
    }
    let order = |t: &TimeChange| if t.ratio > 1.0 { -t.ratio } else { t.ratio };
    found.changed.sort_by(|a, b| (a.ratio < 1.0).cmp(&(b.ratio < 1.0)).then(order(a).total_cmp(&order(b))));
    found
}
