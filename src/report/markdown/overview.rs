//! The list of scenes: what is in each section, and where it begins.

use super::{anchor, show, sign};
use crate::{
    gate::Outcome,
    record::{Record, SceneRecord},
};
use serde::Serialize;

/// A scene.
#[derive(Serialize)]
pub(super) struct SceneRow {
    name: String,
    anchor: String,
    control: bool,
    /// K(Q).
    contrast: String,
    verdicts: String,
}

pub(super) fn rows(record: &Record) -> Vec<SceneRow> {
    let row = |(i, s): (usize, &SceneRecord)| SceneRow {
        name: s.name.clone(),
        anchor: anchor(i),
        control: s.control,
        contrast: show(s.judge.as_ref().map(|j| &j.contrast)),
        verdicts: verdicts(record, s),
    };
    record.scenes.iter().enumerate().map(row).collect()
}

/// How many verdicts of a scene came to what, the worst first.
pub(super) fn verdicts(record: &Record, scene: &SceneRecord) -> String {
    let of =
        |outcome: Outcome| record.verdicts.iter().filter(|v| v.scene == scene.name && v.outcome == outcome).count();
    let all = [Outcome::Fail, Outcome::Inconclusive, Outcome::Warn, Outcome::KnownFailure, Outcome::Pass];
    let word = |o: Outcome| match o {
        Outcome::Fail => "failed",
        Outcome::Inconclusive => "inconclusive",
        Outcome::Warn => "with a warning",
        Outcome::KnownFailure => "known to fail",
        Outcome::Pass => "passed",
    };
    let errors = record.cases.iter().filter(|c| c.case.scene == scene.name && c.error.is_some()).count()
        + usize::from(scene.judge_error.is_some());
    let errors = (errors > 0).then(|| format!("⛔ {errors} ended with an error"));
    let counts = all.into_iter().filter(|o| of(*o) > 0).map(|o| format!("{} {} {}", sign(o), of(o), word(o)));
    let text = errors.into_iter().chain(counts).collect::<Vec<_>>().join(", ");
    if text.is_empty() { "none".to_owned() } else { text }
}
