//! What a record says, as the page's rows.

use super::super::{
    handed_in,
    markdown::scene::judge_text,
    plots::{self, Ranges},
    table::{self, detectable_text, value_text},
};
use crate::{
    counted::counted,
    gate::{CONFIDENCE, Outcome, Verdict},
    layers::Layers,
    record::{CaseRecord, End, Record, SceneRecord},
    viewer::{GateRow, Item, Pair, Plot, SceneNote, VerdictRow},
};

/// Outcomes as the page names them, worst first.
const ORDER: [&str; 7] = ["fail", "error", "inconclusive", "warn", "known", "none", "pass"];

/// The place of an outcome, the worst first.
pub(super) fn rank(outcome: &str) -> usize {
    ORDER.iter().position(|o| *o == outcome).unwrap_or(ORDER.len())
}

fn class(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Fail => "fail",
        Outcome::Inconclusive => "inconclusive",
        Outcome::Warn => "warn",
        Outcome::KnownFailure => "known",
        Outcome::Pass => "pass",
    }
}

/// What the whole run came to.
pub(super) fn overall(record: &Record) -> &'static str {
    match record.end() {
        End::Incomplete => "error",
        End::Fail => "fail",
        End::Inconclusive | End::Nothing => "inconclusive",
        End::Pass if record.summary.warnings > 0 => "warn",
        End::Pass => "pass",
    }
}

/// What must be known before anything is read.
pub(super) fn notes(record: &Record) -> Vec<String> {
    let mut notes = Vec::new();
    notes.extend(record.incomplete.iter().map(|why| format!("The run is incomplete: {why}.")));
    notes.extend(handed_in::notes(record));
    notes.extend(record.filter.iter().map(|f| format!("Only cases whose name contains '{f}' were run.")));
    let failed = record.scenes.iter().filter_map(|s| Some((&s.name, s.judge_error.as_ref()?)));
    notes.extend(failed.map(|(scene, why)| format!("The judge of scene '{scene}' failed: {why}.")));
    notes.extend(record.idle_gates.iter().map(|g| format!("Gate not run: {}: {}.", g.gate, g.reason)));
    notes
}

fn worst<'a>(verdicts: impl Iterator<Item = &'a Verdict>) -> &'static str {
    verdicts.map(|v| v.outcome).min().map_or("none", class)
}

fn row(verdict: &Verdict) -> VerdictRow {
    VerdictRow {
        outcome: class(verdict.outcome),
        gate: verdict.gate.clone(),
        metric: verdict.title(),
        value: value_text(verdict.value(), verdict.interval),
        limit: verdict.limit.text(),
        detectable: detectable_text(verdict.detectable),
        reason: verdict.reason.clone(),
    }
}

/// A case.
pub(super) fn item(record: &Record, case: &CaseRecord, pairs: Vec<Pair>) -> Item {
    let of = &case.case;
    let own = || record.verdicts.iter().filter(|v| v.case.as_ref() == Some(of));
    let numbers = case.metrics.iter().map(|m| {
        let value = m.estimate().map(|e| value_text(Some(e.value), Some(e.interval(CONFIDENCE))));
        let value = match (value, &m.note) {
            (Some(value), Some(note)) => format!("{value}: {note}"),
            (Some(value), None) => value,
            (None, Some(why)) => format!("none: {why}"),
            (None, None) => "none".to_owned(),
        };
        [m.title(), value]
    });
    let time = record.milliseconds(case).map(|ms| ["time of a replicate".to_owned(), format!("{ms:.1} ms")]);
    let replicates = ["replicates".to_owned(), record.replicates(case).to_string()];
    Item {
        id: of.id(),
        scene: of.scene.clone(),
        estimator: of.estimator.clone(),
        renderer: of.renderer.clone(),
        origin: match (&case.source, of.is_external()) {
            (Some(_), _) => Some("handed in"),
            (None, true) if record.handed_in.is_none() => Some("external"),
            _ => None,
        },
        rays: of.rays,
        outcome: if case.error.is_some() { "error" } else { worst(own()) },
        words: case.error.as_ref().map_or_else(String::new, |e| format!("The case ended with an error: {e}")),
        verdicts: own().map(row).collect(),
        facts: numbers.chain(time).chain([replicates]).collect(),
        pairs,
        decision: None,
    }
}

/// A scene's judge, where any gate is held against it or it has an image.
pub(super) fn judge(record: &Record, scene: &SceneRecord, pairs: Vec<Pair>) -> Option<Item> {
    let own = || record.verdicts.iter().filter(|v| v.case.is_none() && v.scene == scene.name);
    if own().next().is_none() && pairs.is_empty() {
        return None;
    }
    Some(Item {
        id: format!("{} (judge)", scene.name),
        scene: scene.name.clone(),
        estimator: "Q".into(),
        renderer: "judge".into(),
        origin: None,
        rays: 0,
        outcome: if scene.judge_error.is_some() { "error" } else { worst(own()) },
        words: String::new(),
        verdicts: own().map(row).collect(),
        facts: Vec::new(),
        pairs,
        decision: None,
    })
}

/// A row a gate, worst first.
pub(super) fn gates(record: &Record) -> Vec<GateRow> {
    let of = |r: table::Row| {
        let worst = record.verdicts.iter().filter(|v| v.gate == r.gate);
        GateRow {
            outcome: self::worst(worst),
            gate: r.gate,
            cases: r.cases,
            nearest: r.nearest,
            value: r.value,
            limit: r.limit,
            reason: r.reason.unwrap_or_default(),
        }
    };
    table::rows(record).into_iter().map(of).collect()
}

/// A plot, where there is something to draw.
fn plot(title: &str, alt: String, svg: Result<String, String>) -> Option<Plot> {
    Some(Plot { title: title.to_owned(), alt, svg: svg.ok()? })
}

/// A scene with its plots.
pub(super) fn scene(record: &Record, scene: &SceneRecord, converged: &Layers) -> SceneNote {
    let mut lines = vec![scene.description.clone()];
    lines.extend(judge_text(scene).map(|text| format!("Judge: {text}")));
    lines.extend(scene.no_judge.iter().map(|why| format!("No judge: {why}.")));
    let curves: Vec<&str> = scene.profiles.iter().map(|c| c.label.as_str()).collect();
    let estimators = &record.suite.estimators;
    let what = plots::along(&scene.profiles);
    let profile = plot(
        &format!("Along the transect: {what}"),
        format!("The {what} over the place along the transect, with 95 % bands, of {}", curves.join(", ")),
        plots::profile(estimators, scene, &Ranges::new(scene, converged)),
    );
    let convergence = plot(
        "Convergence",
        format!("RMSE of one replicate over its rays, both logarithmic, of {}", estimators.join(", ")),
        plots::convergence(estimators, scene),
    );
    SceneNote { name: scene.name.clone(), lines, plots: profile.into_iter().chain(convergence).collect() }
}

/// Plots of the whole run.
pub(super) fn plots(record: &Record) -> Vec<Plot> {
    let all = [
        plot(
            "Contrast error",
            "Contrast error dK of each estimator with its 95 % interval, a row a scene; 0 is right".into(),
            plots::contrast_error(record),
        ),
        plot(
            "Cost against error",
            "Milliseconds of a replicate against mean |dK| and against RMSE, a point an estimator, renderer and ray count".into(),
            plots::cost(record),
        ),
        plot(
            "p-values of the verdicts",
            "Histogram of the p-values of all verdicts".into(),
            plots::p_values(record),
        ),
    ];
    all.into_iter().flatten().collect()
}

/// Where the record comes from.
pub(super) fn facts(record: &Record) -> Vec<[String; 2]> {
    let machine = &record.machine;
    let mut facts = vec![
        ["tool".to_owned(), format!("aogauge {}", record.tool)],
        ["suite".to_owned(), format!("{}, seed {}", record.suite.name, record.seed)],
        ["machine".to_owned(), format!("{}, {} {}", machine.cpu, machine.os, machine.arch)],
        ["GPU".to_owned(), machine.gpu.clone()],
        ["began".to_owned(), record.timing.began.clone()],
        [
            "took".to_owned(),
            format!("{:.1} s on {}", record.timing.seconds, counted(record.timing.threads, "thread", "threads")),
        ],
        ["replicates".to_owned(), record.suite.replicates.to_string()],
    ];
    facts.extend(record.scenes.iter().map(|s| [format!("scene {}", s.name), s.hash.chars().take(16).collect()]));
    facts
}
