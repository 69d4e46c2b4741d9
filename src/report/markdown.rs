//! The Markdown report.

use super::{
    convergence::{self, ConvergenceRow},
    error_maps::{self, LIMIT_CONVERGED, LIMIT_Q, MINUS_CONVERGED, MINUS_Q},
    occluders::{self, OccluderCaseRow, OccluderRow},
    pooled::{self, PooledRow},
    table::{self, Row, detectable_text, outcome_text, plus_minus, value_text},
};
use crate::{
    gate::CONFIDENCE,
    metrics::{Metric, MetricName, artifact::Brighter, regions::Region},
    record::{CaseRecord, Record, SceneRecord, ScreenRecord, Stopped},
    untrusted::markdown_source,
};
use minijinja::{
    Environment,
    syntax::SyntaxConfig,
    value::{Serde, Value},
};
use serde::Serialize;
use std::collections::BTreeMap;

pub use crate::record::pictures::PICTURES;

/// Everything the template shows.
#[derive(Serialize)]
struct Context<'a> {
    record: &'a Record,
    headline: &'a str,
    rows: Vec<Row>,
    pooled: Vec<PooledRow>,
    pooled_scenes: Vec<String>,
    verdicts: Vec<VerdictRow>,
    scenes: Vec<SceneSection>,
    judge_seconds: f64,
    /// Whether any method is smoothed.
    smoothed: bool,
    pictures: &'a str,
    maps: Maps,
    summary: String,
}

/// Where error maps are, and how far their scales reach.
#[derive(Serialize)]
struct Maps {
    minus_q: &'static str,
    limit_q: f64,
    minus_converged: &'static str,
    limit_converged: f64,
}

/// A method with the fewest rays that it was rendered with.
#[derive(Serialize)]
struct Fewest {
    estimator: String,
    rays: u32,
}

#[derive(Serialize)]
struct VerdictRow {
    outcome: &'static str,
    gate: String,
    subject: String,
    metric: String,
    value: String,
    detectable: String,
    limit: String,
}

#[derive(Serialize)]
struct SceneSection {
    name: String,
    description: String,
    control: bool,
    triangles: usize,
    radius: f64,
    secondary_radius: f64,
    judge: Option<String>,
    no_judge: Option<String>,
    /// Where screen-space methods are computed, and what is seen from there.
    screen: Option<String>,
    estimators: Vec<String>,
    /// Methods that there is a map of against their converged image.
    fewest: Vec<Fewest>,
    cases: Vec<CaseRow>,
    occluders: Vec<OccluderRow>,
    occluder_cases: Vec<OccluderCaseRow>,
    convergence: Vec<ConvergenceRow>,
    convergence_notes: Vec<String>,
    /// Errors under the occluder and beside it.
    errors_by_region: Vec<ErrorRow>,
    regions: String,
    errors: Vec<String>,
    /// Why cells hold no number.
    absent: Vec<String>,
}

#[derive(Serialize)]
struct CaseRow {
    estimator: String,
    renderer: String,
    rays: u32,
    openness: String,
    contrast: String,
    contrast_error: String,
    reading: String,
    removed: String,
    bias: String,
    rmse: String,
    over_darkening: String,
    milliseconds: String,
}

/// A case's errors over one region.
#[derive(Serialize)]
struct ErrorRow {
    case: String,
    region: &'static str,
    /// Openness; bias, MAE, RMSE against the converged image; the same against Q.
    cells: [String; 7],
}

fn errors_by_region(cases: &[&CaseRecord]) -> Vec<ErrorRow> {
    use MetricName::{Bias, JudgeBias, JudgeMae, JudgeRmse, Mae, Openness, Rmse};
    let names = [Openness, Bias, Mae, Rmse, JudgeBias, JudgeMae, JudgeRmse];
    let row = |c: &CaseRecord, region: Region| ErrorRow {
        case: format!("{}/{}/{}", c.case.estimator, c.case.renderer, c.case.rays),
        region: region.label(),
        cells: names.map(|name| show(c.metric(name, Some(region)))),
    };
    let regions = [Region::Footprint, Region::Left, Region::Right];
    cases.iter().filter(|c| c.error.is_none()).flat_map(|c| regions.map(|r| row(c, r))).collect()
}

pub(super) fn show(metric: Option<&Metric>) -> String {
    match metric {
        None => "–".to_owned(),
        Some(m) => match m.estimate() {
            Some(e) => plus_minus(e.value, e.interval(CONFIDENCE)),
            // Why stands under the table.
            None => "–".to_owned(),
        },
    }
}

fn case_row(record: &Record, case: &CaseRecord, has_judge: bool) -> CaseRow {
    let get = |name, region| show(case.metric(name, region));
    let error_region = if has_judge { Region::Footprint } else { Region::All };
    let error = case.metric(MetricName::ContrastError, None);
    let pixels = record.timing.cases.get(&case.case.id()).copied();
    CaseRow {
        estimator: case.case.estimator.clone(),
        renderer: case.case.renderer.clone(),
        rays: case.case.rays,
        openness: get(MetricName::Openness, Some(Region::All)),
        contrast: get(MetricName::Contrast, None),
        contrast_error: show(error),
        reading: error.filter(|m| m.value.is_some()).and_then(|m| m.note.clone()).unwrap_or_default(),
        removed: case
            .metric(MetricName::Removed, None)
            .filter(|m| m.value.is_some())
            .map_or_else(|| "–".to_owned(), |m| show(Some(m))),
        bias: get(MetricName::Bias, Some(error_region)),
        rmse: get(MetricName::Rmse, Some(error_region)),
        over_darkening: get(MetricName::OverDarkening, None),
        milliseconds: pixels
            .map_or_else(|| "–".to_owned(), |s| format!("{:.1}", s * 1e3 / f64::from(record.replicates(case)))),
    }
}

pub(super) fn judge_text(scene: &SceneRecord) -> Option<String> {
    let judge = scene.judge.as_ref()?;
    let Some(contrast) = judge.contrast.estimate() else {
        let why = judge.contrast.note.as_deref().unwrap_or("K(Q) is not known");
        return Some(format!("No contrast error is taken from it: {why}. {} paths a pixel.", judge.paths));
    };
    let [lo, hi] = contrast.interval(CONFIDENCE);
    let reading = if lo > 0.0 {
        "the highlight is real"
    } else if hi <= 0.0 {
        "there is no highlight"
    } else {
        "the judge cannot tell whether there is a highlight"
    };
    let flank = match scene.brighter.get("Q") {
        Some(Brighter::Left) => "left",
        _ => "right",
    };
    let q: Vec<String> = judge
        .q
        .iter()
        .map(|(region, q)| {
            let text = match (q.value, q.interval) {
                (Some(value), Some(interval)) => plus_minus(value, interval),
                _ => "unknown".to_owned(),
            };
            format!("{} {text}", region.label())
        })
        .collect();
    let precision = judge.precision.map_or_else(|| "unknown".to_owned(), |p| format!("{:.2} %", p * 100.0));
    Some(format!(
        "K(Q) = {} against the {flank} flank: {reading}. Q: {}. {} replicates of {} paths a pixel, until {}; half width of the widest interval of a region mean: {precision}.",
        plus_minus(contrast.value, [lo, hi]),
        q.join(", "),
        judge.replicates,
        judge.paths,
        match judge.stopped {
            Stopped::Precise => "precise enough",
            Stopped::Budget => "the budget was spent",
        },
    ))
}

fn screen_text(scene: &SceneRecord, screen: &ScreenRecord) -> String {
    let [x, y, z] = screen.eye;
    let [width, height] = screen.resolution;
    let shown = [Region::Footprint, Region::Left, Region::Right, Region::All].map(|r| {
        let of = |regions: &BTreeMap<Region, usize>| regions.get(&r).copied().unwrap_or_default();
        format!("{} {} of {}", r.label(), of(&screen.regions), of(&scene.regions))
    });
    format!(
        "Screen-space methods are computed in the {width} x {height} pixels of a camera at ({x:.2}, {y:.2}, {z:.2}) m from \
         the centre of the measure view, and measured, with Q and classic AO beside them, on the measured points that it shows: {}.",
        shown.join(", ")
    )
}

fn section(record: &Record, scene: &SceneRecord) -> SceneSection {
    let cases: Vec<&CaseRecord> = record.cases.iter().filter(|c| c.case.scene == scene.name).collect();
    let (convergence, convergence_notes) = convergence::rows(record, scene);
    let failed_judge = scene.judge_error.iter().cloned();
    let failed = cases.iter().filter_map(|c| Some(format!("{}: {}", c.case.id(), c.error.as_ref()?)));
    SceneSection {
        name: scene.name.clone(),
        description: scene.description.clone(),
        control: scene.control,
        triangles: scene.triangles,
        radius: scene.radius,
        secondary_radius: scene.secondary_radius,
        judge: judge_text(scene),
        no_judge: scene.no_judge.clone(),
        screen: scene.screen.as_ref().map(|s| screen_text(scene, s)),
        estimators: record.suite.estimators.clone(),
        fewest: fewest(record, scene),
        cases: cases.iter().filter(|c| c.error.is_none()).map(|c| case_row(record, c, scene.judge.is_some())).collect(),
        regions: scene.regions.iter().map(|(r, n)| format!("{} {n}", r.label())).collect::<Vec<_>>().join(", "),
        absent: absent(&cases),
        occluders: occluders::rows(scene),
        occluder_cases: occluders::cases(scene, &cases),
        convergence,
        convergence_notes,
        errors_by_region: if scene.judge.is_some() { errors_by_region(&cases) } else { vec![] },
        errors: failed_judge.chain(failed).collect(),
    }
}

fn fewest(record: &Record, scene: &SceneRecord) -> Vec<Fewest> {
    let of = |name: &String| {
        let case = error_maps::fewest(record, scene, name).filter(|_| scene.judge.is_some())?;
        Some(Fewest { estimator: name.clone(), rays: case.case.rays })
    };
    record.suite.estimators.iter().filter_map(of).collect()
}

/// Each reason for a missing number once.
fn absent(cases: &[&CaseRecord]) -> Vec<String> {
    let by_occluder = cases.iter().flat_map(|c| &c.occluders).flat_map(|o| &o.metrics);
    let metrics = cases.iter().flat_map(|c| &c.metrics).chain(by_occluder).filter(|m| m.estimate().is_none());
    let mut notes: Vec<String> = metrics.filter_map(|m| m.note.clone()).collect();
    notes.sort();
    notes.dedup();
    notes
}

/// Writes the report's text.
pub fn text(record: &Record) -> Result<String, minijinja::Error> {
    let mut environment = Environment::new();
    environment.set_syntax(SyntaxConfig::builder().trim_blocks(true).lstrip_blocks(true).build()?);
    // All text that a record brings, whether or not the template asks for it.
    environment.set_formatter(|out, state, value| match value.as_str() {
        Some(text) if !value.is_safe() => Ok(out.write_str(&markdown_source(text))?),
        _ => minijinja::escape_formatter(out, state, value),
    });
    environment.add_filter("cell", |s: String| Value::from_safe_string(markdown_source(&s)));
    environment.add_template("report", include_str!("report.md.j2"))?;
    let verdicts: Vec<VerdictRow> = record
        .verdicts
        .iter()
        .map(|v| VerdictRow {
            outcome: outcome_text(v.outcome),
            gate: v.gate.clone(),
            subject: v.subject(),
            metric: v.title(),
            value: value_text(v.value(), v.interval),
            detectable: detectable_text(v.detectable),
            limit: v.limit.text(),
        })
        .collect();
    let rows: Vec<Row> = table::rows(record);
    let headline = record.end().text();
    let scenes: Vec<SceneSection> = record.scenes.iter().map(|s| section(record, s)).collect();
    let judge_seconds: f64 = record.timing.judges.values().sum();
    let (pooled, pooled_scenes) = pooled::rows(record);
    environment.get_template("report")?.render(Serde(Context {
        record,
        headline,
        rows,
        pooled,
        pooled_scenes,
        verdicts,
        scenes,
        judge_seconds,
        smoothed: record.suite.methods.values().any(|m| m.temporal.is_some() || m.denoise.is_some()),
        pictures: PICTURES,
        maps: Maps {
            minus_q: MINUS_Q,
            limit_q: LIMIT_Q,
            minus_converged: MINUS_CONVERGED,
            limit_converged: LIMIT_CONVERGED,
        },
        summary: record.summary_line(),
    }))
}
