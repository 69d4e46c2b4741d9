//! What changed, as tables of words, before they become text or Markdown.

use super::{Both, Changes, ImageState, Kind, MetricChange, Turn, p_text, place};
use crate::{
    counted::counted,
    gate::Outcome,
    report::table::{digits, outcome_text, value_text},
};

/// A cell of a table.
pub(super) enum Cell {
    /// Words.
    Plain(String),
    /// A number, which is not to be broken.
    Number(String),
    /// A name, as it stands in files.
    Code(String),
    /// Words that must not be overlooked.
    Strong(String),
}

use Cell::{Code, Number, Plain, Strong};

/// A table with its title.
pub(super) struct Table {
    pub title: String,
    /// What a reader must know of it.
    pub intro: String,
    /// Whether it is shown at first sight.
    pub is_open: bool,
    pub columns: &'static [&'static str],
    pub rows: Vec<Vec<Cell>>,
}

/// What differs between the runs as a whole.
pub(super) fn runs(changes: &Changes) -> Vec<[String; 3]> {
    let verdicts = |s: &crate::record::Summary| {
        let known = if s.known_failures > 0 { format!(", {} known failures", s.known_failures) } else { String::new() };
        format!("{} passed, {} failed, {} inconclusive{known}", s.pass, s.fail, s.inconclusive)
    };
    let Both { base, new } = &changes.summary;
    let mut rows = vec![["verdicts".to_owned(), verdicts(base), verdicts(new)]];
    if base.cases != new.cases {
        rows.push(["cases".to_owned(), base.cases.to_string(), new.cases.to_string()]);
    }
    rows.extend(changes.settings.iter().map(|s| [s.what.clone(), s.base.clone(), s.new.clone()]));
    rows
}

/// `2 worse, 1 better`: what there is none of is not said.
fn said(counts: &[(usize, &str)]) -> String {
    let said: Vec<String> = counts.iter().filter(|(n, _)| *n > 0).map(|(n, word)| format!("{n} {word}")).collect();
    if said.is_empty() { "none changed".to_owned() } else { said.join(", ") }
}

/// How many metrics went which way.
fn turns(found: &super::Metrics) -> String {
    said(
        &[(Turn::Worse, "worse"), (Turn::Better, "better"), (Turn::Changed, "changed")]
            .map(|(t, w)| (found.turned(t), w)),
    )
}

/// What was compared, in a sentence a line.
pub(super) fn sentences(changes: &Changes) -> Vec<String> {
    let Changes { cases, metrics, images, times, .. } = changes;
    let mut said = vec![format!(
        "{} compared, {} with images that are the same to the last bit.",
        counted(cases.compared, "case", "cases"),
        cases.identical
    )];
    if metrics.tested > 0 {
        let tested = counted(metrics.tested, "metric", "metrics");
        said.push(format!("Of {tested} tested: {} by more than noise.", turns(metrics)));
    }
    if !images.is_empty() {
        let differ = counted(images.len(), "image that differs", "images that differ");
        said.push(format!("Of {differ}: {} moved by more than noise and rounding.", changes.moved()));
    }
    if times.compared > 0 {
        let Both { base, new } = times.seconds;
        said.push(format!("Tracing took {base:.1} s in the base and {new:.1} s now."));
    }
    said
}

/// Every table that has a row, the most important first.
pub(super) fn tables(changes: &Changes) -> Vec<Table> {
    let all = [
        verdicts(changes),
        lost(changes),
        gone(changes),
        gates(changes),
        incomparable(changes),
        metrics(changes),
        values_lost(changes),
        images(changes),
        times(changes),
        new_cases(changes),
    ];
    all.into_iter().filter(|t| !t.rows.is_empty()).collect()
}

fn outcome(o: Outcome) -> String {
    outcome_text(o).to_owned()
}

fn verdicts(changes: &Changes) -> Table {
    let row = |v: &super::VerdictChange| {
        let was = v.base.map_or_else(|| "new".to_owned(), outcome);
        let turned = format!("{was} → {}", outcome_text(v.new));
        // That a limit holds or is broken is what the verdict says.
        let why = if v.reason.starts_with("the limit ") { String::new() } else { format!(" ({})", v.reason) };
        let warn = v.warn.as_ref().map_or_else(String::new, |w| format!(", and warns unless {w}"));
        let edited = match v.edited.as_slice() {
            [] => String::new(),
            edits => format!("; the gate itself changed: {}", edits.join(", ")),
        };
        vec![
            if v.turn == Turn::Worse { Strong(turned) } else { Plain(turned) },
            Plain(v.gate.clone()),
            Code(v.case.clone()),
            Plain(v.base.map_or_else(|| "–".to_owned(), |_| value_text(v.value.base, v.interval.base))),
            Plain(value_text(v.value.new, v.interval.new)),
            Plain(format!("{} {}{warn}{edited}{why}", v.metric, v.limit)),
        ]
    };
    let kinds = [(Turn::Worse, "worse"), (Turn::Better, "better"), (Turn::Changed, "new, warning or excused")];
    Table {
        title: format!("Verdicts: {}", said(&kinds.map(|(turn, word)| (changes.turned(turn), word)))),
        intro: String::new(),
        is_open: true,
        columns: &["", "gate", "case", "base", "new", "must be"],
        rows: changes.verdicts.iter().map(row).collect(),
    }
}

fn lost(changes: &Changes) -> Table {
    let cases = changes.cases.lost.iter().map(|l| vec![Code(l.name.clone()), Plain(l.error.clone())]);
    let judge = |l: &super::LostCase| vec![Code(format!("{} (judge)", l.name)), Plain(l.error.clone())];
    let rows: Vec<Vec<Cell>> = changes.cases.lost_judges.iter().map(judge).chain(cases).collect();
    Table {
        title: format!("{} with an error", counted(rows.len(), "case or judge ended", "cases or judges ended")),
        intro: "They gave an image in the base.".to_owned(),
        is_open: true,
        columns: &["case", "error"],
        rows,
    }
}

fn names(names: &[String]) -> Vec<Vec<Cell>> {
    names.iter().map(|n| vec![Code(n.clone())]).collect()
}

fn gone(changes: &Changes) -> Table {
    Table {
        title: counted(changes.cases.gone.len(), "case is gone", "cases are gone"),
        intro: "They are in the base and not in the new record.".to_owned(),
        is_open: !changes.allow_missing,
        columns: &["case"],
        rows: names(&changes.cases.gone),
    }
}

fn new_cases(changes: &Changes) -> Table {
    Table {
        title: counted(changes.cases.new.len(), "case is new", "cases are new"),
        intro: "There is nothing to compare them with.".to_owned(),
        is_open: false,
        columns: &["case"],
        rows: names(&changes.cases.new),
    }
}

fn gates(changes: &Changes) -> Table {
    let gates = &changes.gates;
    let row = |what: &str, gate: &str, base: String, new: String| {
        vec![Plain(what.to_owned()), Plain(gate.to_owned()), Plain(base), Plain(new)]
    };
    let on = |n, o| format!("{} on {}", outcome(o), counted(n, "case", "cases"));
    let mut rows: Vec<Vec<Cell>> =
        gates.limits.iter().map(|l| row("other limit", &l.gate, l.base.clone(), l.new.clone())).collect();
    rows.extend(
        gates.edits.iter().map(|e| row(&format!("other {}", e.option), &e.gate, e.base.clone(), e.new.clone())),
    );
    rows.extend(gates.gone.iter().map(|g| match &g.idle {
        Some(why) => row("not run", &g.gate, on(g.cases, g.outcome), why.clone()),
        None => row("gone", &g.gate, on(g.cases, g.outcome), "–".to_owned()),
    }));
    rows.extend(gates.new.iter().map(|g| row("new", &g.gate, "–".to_owned(), on(g.cases, g.outcome))));
    rows.extend(
        gates
            .withdrawn
            .iter()
            .map(|w| row("not held any more", &w.gate, outcome(w.outcome), format!("not on {}", w.case))),
    );
    Table {
        title: format!("Gates: {} changed", rows.len()),
        intro: "What the suite demands is not what it was.".to_owned(),
        is_open: true,
        columns: &["", "gate", "base", "new"],
        rows,
    }
}

fn incomparable(changes: &Changes) -> Table {
    let row = |i: &super::Incomparable| {
        let kind = match i.kind {
            Kind::Scene => "scene",
            Kind::Estimator => "estimator",
        };
        vec![Plain(kind.to_owned()), Code(i.name.clone())]
    };
    Table {
        title: format!(
            "{} not compared",
            counted(changes.incomparable.len(), "scene or estimator is", "scenes or estimators are")
        ),
        intro: format!(
            "They are others under the same name, so their metrics and images say nothing about a change. {} left out.",
            counted(changes.metrics.incomparable, "metric is", "metrics are")
        ),
        is_open: true,
        columns: &["", "name"],
        rows: changes.incomparable.iter().map(row).collect(),
    }
}

fn title(name: crate::metrics::MetricName, region: Option<crate::metrics::regions::Region>) -> String {
    region.map_or_else(|| name.label().to_owned(), |r| format!("{} over {}", name.label(), r.label()))
}

fn metrics(changes: &Changes) -> Table {
    let found = &changes.metrics;
    let row = |m: &MetricChange| {
        let half = m.interval.map_or(0.0, |[lo, hi]| (hi - lo) / 2.0);
        let d = digits(if half > 0.0 { half } else { m.difference.abs() });
        let turn = match m.turn {
            Turn::Worse => Strong("worse".to_owned()),
            Turn::Better => Plain("better".to_owned()),
            Turn::Changed => Plain("changed".to_owned()),
        };
        let Both { base, new } = m.value;
        vec![
            turn,
            Code(place(&m.case, m.occluder.as_deref())),
            Plain(title(m.metric, m.region)),
            Plain(format!("{base:.d$}")),
            Plain(format!("{new:.d$}")),
            Number(if half > 0.0 {
                format!("{:+.d$} ± {half:.d$}", m.difference)
            } else {
                format!("{:+.d$}", m.difference)
            }),
            Number(p_text(m.adjusted_p)),
        ]
    };
    let seeds = if found.same_seed {
        " Both runs have the same seed: they share noise that the tests take for independent, so they find less than there is."
    } else {
        ""
    };
    let identical = match found.identical {
        0 => String::new(),
        n => format!(" {} equal, of images that are the same to the last bit.", counted(n, "more is", "more are")),
    };
    Table {
        title: format!("Metrics: {} by more than noise, of {} tested", turns(found), found.tested),
        intro: format!(
            "Welch's tests over replicates, p adjusted by Holm over all of them: where nothing changed, one or more would \
             be named with a chance of {} at most. Differences with their 95 % interval.{seeds}{identical}",
            found.alpha
        ),
        is_open: false,
        columns: &["", "case", "metric", "base", "new", "difference", "p"],
        rows: found.changed.iter().map(row).collect(),
    }
}

fn values_lost(changes: &Changes) -> Table {
    let row = |l: &super::ValueLost| {
        vec![
            Code(place(&l.case, l.occluder.as_deref())),
            Plain(title(l.metric, l.region)),
            Plain(l.why.clone().unwrap_or_default()),
        ]
    };
    Table {
        title: counted(changes.metrics.lost.len(), "metric lost its value", "metrics lost their values"),
        intro: String::new(),
        is_open: false,
        columns: &["case", "metric", "why"],
        rows: changes.metrics.lost.iter().map(row).collect(),
    }
}

fn images(changes: &Changes) -> Table {
    let row = |i: &super::ImageChange| {
        let number = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.5}"));
        let state = match i.state {
            ImageState::Moved => Strong("moved".to_owned()),
            ImageState::Unreadable => Plain("not read".to_owned()),
            ImageState::Blind => Plain("undecided".to_owned()),
            ImageState::Alike => Plain("alike".to_owned()),
        };
        let bias = i.bias.map_or_else(|| "–".to_owned(), |b| format!("{b:+.5}"));
        vec![state, Code(i.case.clone()), Plain(bias), Plain(number(i.rmse)), Plain(i.what.clone())]
    };
    Table {
        title: format!("Images: {} moved, of {} that differ", changes.moved(), changes.images.len()),
        intro: format!(
            "Held against the base as against a golden; the chance that any is said to have moved by noise alone is {}. \
             Bias and RMSE are those of the means over replicates.",
            crate::golden::ALPHA
        ),
        is_open: false,
        columns: &["", "case", "bias", "RMSE", "what"],
        rows: changes.images.iter().map(row).collect(),
    }
}

fn times(changes: &Changes) -> Table {
    let found = &changes.times.changed;
    let row = |t: &super::TimeChange| {
        let factor = if t.ratio > 1.0 { t.ratio } else { 1.0 / t.ratio };
        let word = if t.ratio > 1.0 { "slower" } else { "faster" };
        vec![
            Plain(format!("{factor:.1} x {word}")),
            Code(t.case.clone()),
            Plain(format!("{:.2} s", t.seconds.base)),
            Plain(format!("{:.2} s", t.seconds.new)),
        ]
    };
    Table {
        title: format!("Times: {} slower or faster, of {}", found.len(), changes.times.compared),
        intro:
            "Single measurements, perhaps on other machines or beside other work: only more than 1.3 times and more \
                than 0.2 s is named, and none of it is a verdict. `aogauge bench` measures."
                .to_owned(),
        is_open: false,
        columns: &["", "case", "base", "new"],
        rows: found.iter().map(row).collect(),
    }
}
