//! The Markdown report, as GitHub reads it.
//!
//! Names and reasons come from anybody's files. The template therefore escapes whatever
//! it prints ([`untrusted::markdown`]), in the one place [`environment`]; what is Markdown
//! already, or a number that was formatted here, says so by the filter `safe`.

mod attention;
mod grid;
mod overview;
pub(super) mod scene;
mod verdicts;

use super::{
    ReportError,
    definitions::{self, Definition},
    error_maps::{LIMIT_CONVERGED, LIMIT_Q},
    gallery::Gallery,
    handed_in,
    pooled::{self, PooledRow},
    table::{self, Row, outcome_text, plus_minus},
};
use crate::{
    counted::counted,
    disk::DiskError,
    gate::{CONFIDENCE, Outcome},
    metrics::Metric,
    record::{End, Record, pictures},
    untrusted,
};
use attention::Attention;
use grid::{Picture, Plot};
use minijinja::{
    AutoEscape, Environment, UndefinedBehavior,
    syntax::SyntaxConfig,
    value::{Serde, Value},
};
use overview::SceneRow;
use scene::SceneSection;
use serde::Serialize;
use verdicts::Verdicts;

/// GitHub shows larger files as plain text.
const MAX_BYTES: usize = 500_000;

/// With more scenes than these, each is folded away under its heading.
const FOLDED: usize = 8;

/// Everything the template shows.
#[derive(Serialize)]
struct Context<'a> {
    record: &'a Record,
    headline: &'static str,
    sign: &'static str,
    summary: String,
    /// `2 cases of 1 scene`.
    cases: String,
    replicates: String,
    /// What must be known of images that were handed in.
    handed_in: Vec<String>,
    /// Whether tables are cut, so that the page is not too large.
    brief: bool,
    attention: Option<Attention>,
    rows: Vec<SignedRow>,
    verdicts: Verdicts,
    pooled: Vec<PooledRow>,
    pooled_scenes: Vec<String>,
    plots: Plots,
    overview: Vec<SceneRow>,
    folded: bool,
    scenes: Vec<SceneSection>,
    maps: Maps,
    /// Whether any method is smoothed.
    smoothed: bool,
    /// Where documentation lies, with a slash at its end; empty where that is not known.
    docs: String,
    judge_seconds: f64,
    definitions: Vec<Definition>,
}

/// Plots of the whole run.
#[derive(Serialize)]
struct Plots {
    contrast_error: Plot,
    cost: Plot,
    p_values: Plot,
}

/// The bars of error maps, and how far their scales reach.
#[derive(Serialize)]
struct Maps {
    bar_q: Option<Picture>,
    bar_converged: Option<Picture>,
    limit_q: f64,
    limit_converged: f64,
}

/// A gate's row.
#[derive(Serialize)]
struct SignedRow {
    sign: &'static str,
    row: Row,
}

/// Seen before it is read.
fn sign(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Fail => "❌",
        Outcome::Inconclusive => "❔",
        Outcome::Warn => "⚠️",
        Outcome::KnownFailure => "☑️",
        Outcome::Pass => "✅",
    }
}

/// Where the section of a scene begins, by its place in the record.
fn anchor(scene: usize) -> String {
    format!("scene-{}", scene + 1)
}

/// A metric in a table. Why it has no value stands under the table.
pub(super) fn show(metric: Option<&Metric>) -> String {
    let estimate = metric.and_then(Metric::estimate);
    estimate.map_or_else(|| "–".to_owned(), |e| plus_minus(e.value, e.interval(CONFIDENCE)))
}

/// What a run came to, and its sign.
fn headline(record: &Record) -> (&'static str, &'static str) {
    let end = record.end();
    let sign = match end {
        End::Incomplete => "⛔",
        End::Fail => sign(Outcome::Fail),
        End::Inconclusive | End::Nothing => sign(Outcome::Inconclusive),
        End::Pass => sign(Outcome::Pass),
    };
    (end.text(), sign)
}

/// Over how many replicates numbers are taken.
fn replicates(record: &Record) -> String {
    let counts = || record.cases.iter().filter(|c| c.error.is_none()).map(|c| record.replicates(c));
    let seeds = "replicates with seeds of their own";
    let alone = |n: u32| counted(n, "replicate", seeds);
    match (counts().min(), counts().max()) {
        (Some(least), Some(most)) if least < most && record.handed_in.is_some() => {
            format!("{least} to {most} images a case, as they were handed in")
        }
        (Some(least), Some(most)) if least < most => {
            format!("{least} to {most} {seeds}, each case as many as its verdicts took")
        }
        (Some(1), _) if record.handed_in.is_some() => "the tiles of one image a case".to_owned(),
        (Some(least), _) => alone(least),
        _ => alone(record.suite.replicates),
    }
}

/// Documentation of the version that makes the report, where the package says where it
/// is kept.
fn docs() -> String {
    let repository = env!("CARGO_PKG_REPOSITORY").trim_end_matches('/').trim_end_matches(".git");
    match repository {
        "" => String::new(),
        at => format!("{at}/blob/v{}/docs/", env!("CARGO_PKG_VERSION")),
    }
}

fn context<'a>(record: &'a Record, gallery: &Gallery, brief: bool) -> Result<Context<'a>, DiskError> {
    let (headline, sign) = headline(record);
    let (pooled, pooled_scenes) = pooled::rows(record);
    let scenes = record.scenes.iter().enumerate();
    let scenes = scenes.map(|(i, s)| SceneSection::new(record, s, i, gallery, brief));
    let smoothed = record.suite.methods.values().any(|m| m.temporal.is_some() || m.denoise.is_some());
    let plot = |alt: &str, place: String| Plot::new(gallery, alt, &place);
    let bar = |alt: &str, maps: &str| Picture::new(gallery, alt, &pictures::bar(maps));
    Ok(Context {
        record,
        headline,
        sign,
        summary: record.summary_line(),
        cases: format!(
            "{} of {}",
            counted(record.summary.cases, "case", "cases"),
            counted(record.scenes.len(), "scene", "scenes")
        ),
        replicates: replicates(record),
        handed_in: handed_in::notes(record),
        brief,
        attention: Some(Attention::new(record, gallery)?).filter(|a| !a.is_empty()),
        rows: table::rows(record).into_iter().map(SignedRow::new).collect(),
        verdicts: Verdicts::new(record, brief),
        pooled,
        pooled_scenes,
        plots: Plots {
            contrast_error: plot("contrast error by estimator and scene", pictures::contrast_error())?,
            cost: plot("cost against error", pictures::cost())?,
            p_values: plot("p-values of the verdicts", pictures::p_values())?,
        },
        overview: overview::rows(record),
        folded: record.scenes.len() > FOLDED,
        scenes: scenes.collect::<Result<_, _>>()?,
        maps: Maps {
            bar_q: bar(&format!("O - Q, from -{LIMIT_Q} to {LIMIT_Q}"), pictures::MINUS_Q)?,
            bar_converged: bar(
                &format!("mean - converged, from -{LIMIT_CONVERGED} to {LIMIT_CONVERGED}"),
                pictures::MINUS_CONVERGED,
            )?,
            limit_q: LIMIT_Q,
            limit_converged: LIMIT_CONVERGED,
        },
        smoothed,
        docs: docs(),
        judge_seconds: record.timing.judges.values().sum(),
        definitions: definitions::of(record),
    })
}

impl SignedRow {
    fn new(row: Row) -> Self {
        let outcomes = [Outcome::Fail, Outcome::Inconclusive, Outcome::Warn, Outcome::KnownFailure, Outcome::Pass];
        let outcome = outcomes.into_iter().find(|o| outcome_text(*o) == row.outcome);
        SignedRow { sign: outcome.map_or("", sign), row }
    }
}

/// The templates, and what makes all that they print harmless.
fn environment() -> Result<Environment<'static>, minijinja::Error> {
    let mut environment = Environment::new();
    environment.set_syntax(SyntaxConfig::builder().trim_blocks(true).lstrip_blocks(true).build()?);
    // What macros return is then Markdown, not a text to be escaped again.
    environment.set_auto_escape_callback(|_| AutoEscape::Custom("markdown".into()));
    environment.set_undefined_behavior(UndefinedBehavior::SemiStrict);
    environment.set_formatter(|out, _, value| {
        if value.is_none() {
            return Ok(());
        }
        let text = value.to_string();
        if value.is_safe() {
            out.write_str(&text)?;
        } else {
            out.write_str(&untrusted::markdown(&text))?;
        }
        Ok(())
    });
    // A value and its interval on one line, or the one over the other. Numbers keep their
    // brackets: they are no links.
    let number = |value: &str| untrusted::markdown(value).replace("&#91;", "[").replace("&#93;", "]");
    environment.add_filter("line", move |value: String| Value::from_safe_string(number(&value).replace(' ', "\u{a0}")));
    environment.add_filter("interval", move |value: String| {
        Value::from_safe_string(number(&value).replace(", ", ",\u{a0}").replace(" [", "<br>["))
    });
    environment.add_template("attention", include_str!("attention.md.j2"))?;
    environment.add_template("scene", include_str!("scene.md.j2"))?;
    environment.add_template("reading", include_str!("reading.md.j2"))?;
    environment.add_template("pictures", include_str!("pictures.md.j2"))?;
    environment.add_template("report", include_str!("report.md.j2"))?;
    Ok(environment)
}

/// The report's text. Where it would be larger than GitHub renders, tables are cut, and
/// it says so.
pub(super) fn text(record: &Record, gallery: &Gallery) -> Result<String, ReportError> {
    let environment = environment()?;
    let template = environment.get_template("report")?;
    let text = template.render(Serde(context(record, gallery, false)?))?;
    if text.len() <= MAX_BYTES || gallery.embeds() {
        return Ok(text);
    }
    Ok(template.render(Serde(context(record, gallery, true)?))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        gate::Verdict,
        pooled::Pooled,
        record::{CaseRecord, SceneRecord},
        suite::Case,
    };

    /// All that a template prints is escaped, unless it says that it is Markdown.
    #[test]
    fn what_is_printed_is_escaped() {
        let mut environment = environment().unwrap();
        environment.add_template("t", "{{ a }} {{ b }} {{ a|safe }} {{ c }}").unwrap();
        let context = minijinja::context! { a => "<b>|", b => -0.5, c => () };
        let text = environment.get_template("t").unwrap().render(context).unwrap();
        assert_eq!(text, "&lt;b&gt;&#124; -0.5 <b>| ");
    }

    #[test]
    fn replicates_are_those_of_the_cases() {
        let mut record: Record = serde_json::from_str(include_str!("../../../tests/records/v4/record.json")).unwrap();
        assert_eq!(replicates(&record), "4 replicates with seeds of their own");
        record.cases[0].replicates = Some(16);
        assert!(replicates(&record).starts_with("4 to 16 replicates"), "{}", replicates(&record));
        record.cases[1].replicates = Some(16);
        assert!(replicates(&record).starts_with("16 replicates"), "{}", replicates(&record));
        record.cases[1].error = Some("lost".into());
        record.cases[1].replicates = None;
        assert!(replicates(&record).starts_with("16 replicates"), "{}", replicates(&record));
    }

    /// GitHub renders half a megabyte: 50 scenes of 10 estimators, on two renderers with
    /// two ray counts, must fit, and what is cut must be said.
    #[test]
    fn a_page_of_many_scenes_is_cut_and_says_so() {
        let mut record: Record = serde_json::from_str(include_str!("../../../tests/records/v4/record.json")).unwrap();
        let (scene, cases) = (record.scenes[0].clone(), record.cases.clone());
        let (verdicts, pooled) = (record.verdicts.clone(), record.pooled.clone());
        let names: Vec<String> = (0..10).map(|i| format!("estimator-number-{i}")).collect();
        let scenes: Vec<String> = (0..50).map(|i| format!("curtain-of-place-{i}")).collect();
        record.suite.estimators.clone_from(&names);
        (record.scenes, record.cases, record.verdicts, record.pooled) = (vec![], vec![], vec![], vec![]);
        let keys: Vec<(&String, &str, u32)> = names
            .iter()
            .flat_map(|n| [("cpu", 4), ("cpu", 32), ("gpu", 4), ("gpu", 32)].map(|(r, k)| (n, r, k)))
            .collect();
        for name in &scenes {
            record.scenes.push(SceneRecord { name: name.clone(), ..scene.clone() });
            for (estimator, renderer, rays) in &keys {
                let case = Case {
                    scene: name.clone(),
                    estimator: (*estimator).clone(),
                    renderer: (*renderer).to_owned(),
                    rays: *rays,
                };
                record.cases.push(CaseRecord { case: case.clone(), ..cases[0].clone() });
                record.verdicts.push(Verdict { scene: name.clone(), case: Some(case), ..verdicts[1].clone() });
            }
        }
        for (estimator, renderer, rays) in &keys {
            let key = Pooled {
                estimator: (*estimator).clone(),
                renderer: (*renderer).to_owned(),
                rays: *rays,
                ..pooled[0].clone()
            };
            record.pooled.push(key);
        }
        let mut gallery = Gallery::new("pictures".into(), false);
        for name in &scenes {
            for folder in [pictures::LOOK, pictures::MEASURE, pictures::MINUS_Q, pictures::MINUS_CONVERGED] {
                for estimator in &names {
                    gallery.place(&pictures::of_estimator(name, folder, estimator));
                }
            }
            gallery.place(&pictures::profile(name));
        }
        let page = text(&record, &gallery).unwrap();
        assert!(page.len() < MAX_BYTES, "{}", page.len());
        assert!(
            page.contains("This page is cut") && page.contains("1600 more are in") && page.contains("30 more cases")
        );
        for name in &scenes {
            assert_eq!(page.matches(&format!("\n### {name}\n")).count(), 1);
            assert!(page.contains(&format!("<details><summary>Pictures, profile and numbers of {name}</summary>")));
        }
        assert_eq!(page.matches("<details>").count(), page.matches("</details>").count());
        record.scenes.truncate(1);
        record.verdicts.truncate(40);
        assert!(!text(&record, &gallery).unwrap().contains("This page is cut"));
    }
}
