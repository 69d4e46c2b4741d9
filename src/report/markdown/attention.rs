//! What needs a look: verdicts that are neither passed nor known failures, cases without
//! numbers, gates that nothing was held against. A section a gate, the worst first.

use super::{
    super::{
        errors,
        gallery::Gallery,
        table::{detectable_text, digits, outcome_text, value_text},
    },
    anchor,
    grid::{Column, Grid, Picture},
    sign,
};
use crate::{
    disk::DiskError,
    gate::{Outcome, Verdict, words},
    metrics::MetricName,
    record::{Record, pictures},
};
use serde::Serialize;

/// Gates, verdicts of a gate, and pictures of a gate that are shown; the rest stands in
/// the list of every verdict.
const GATES: usize = 20;
const VERDICTS: usize = 12;
const PICTURES: usize = 4;

/// What needs a look.
#[derive(Serialize)]
pub(super) struct Attention {
    /// What there are no numbers of, and why.
    errors: Vec<[String; 2]>,
    /// Gates that nothing was held against, without excuse.
    idle: Vec<[String; 2]>,
    gates: Vec<GateSection>,
    /// Gates that are not shown.
    more: usize,
}

/// A gate's verdicts.
#[derive(Serialize)]
struct GateSection {
    sign: &'static str,
    outcome: &'static str,
    gate: String,
    metric: String,
    verdicts: Vec<Row>,
    /// Which pixels they were measured on, each once.
    places: Vec<String>,
    /// Verdicts that are not shown.
    more: usize,
    /// Of the worst.
    subject: String,
    words: Vec<String>,
    pictures: Option<Grid>,
    /// The scale of the pictures.
    bar: Option<Picture>,
    /// The profile of the worst.
    profile: Option<Picture>,
    /// Images that no page can show.
    images: Vec<String>,
}

#[derive(Serialize)]
struct Row {
    sign: &'static str,
    outcome: &'static str,
    subject: String,
    /// Of the scene's section.
    anchor: Option<String>,
    value: String,
    limit: String,
    margin: String,
    detectable: String,
    reason: String,
}

impl Attention {
    pub(super) fn new(record: &Record, gallery: &Gallery) -> Result<Self, DiskError> {
        let idle = record.idle_gates.iter().filter(|g| !g.excused).map(|g| [g.gate.clone(), g.reason.clone()]);
        let mut gates: Vec<(&str, Vec<&Verdict>)> = Vec::new();
        for v in record.verdicts.iter().filter(|v| needs_a_look(v.outcome)) {
            match gates.iter_mut().find(|(gate, _)| *gate == v.gate) {
                Some((_, verdicts)) => verdicts.push(v),
                None => gates.push((&v.gate, vec![v])),
            }
        }
        for (_, verdicts) in &mut gates {
            verdicts.sort_by(|a, b| {
                (a.outcome, margin(a)).partial_cmp(&(b.outcome, margin(b))).unwrap_or(a.outcome.cmp(&b.outcome))
            });
        }
        gates.sort_by_key(|(_, verdicts)| verdicts.first().map(|v| v.outcome));
        let more = gates.len().saturating_sub(GATES);
        let sections = gates.iter().take(GATES).filter_map(|(_, v)| section(record, gallery, v).transpose());
        Ok(Attention {
            errors: errors(record).map(|(what, why)| [what, why.to_owned()]).collect(),
            idle: idle.collect(),
            gates: sections.collect::<Result<_, _>>()?,
            more,
        })
    }

    /// Whether there is nothing.
    pub(super) fn is_empty(&self) -> bool {
        self.errors.is_empty() && self.idle.is_empty() && self.gates.is_empty()
    }
}

fn needs_a_look(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Fail | Outcome::Inconclusive | Outcome::Warn)
}

fn margin(v: &Verdict) -> f64 {
    v.margin.or_else(|| v.value().map(|value| v.limit.margin(value))).unwrap_or(f64::NEG_INFINITY)
}

/// With a sign, and the digits that its interval earns.
fn margin_text(v: &Verdict) -> String {
    let margin = margin(v);
    if !margin.is_finite() {
        return "–".to_owned();
    }
    let digits = v.interval.map_or(4, |[lo, hi]| digits((hi - lo) / 2.0));
    format!("{margin:+.digits$}")
}

fn section(record: &Record, gallery: &Gallery, verdicts: &[&Verdict]) -> Result<Option<GateSection>, DiskError> {
    let Some(worst) = verdicts.first() else { return Ok(None) };
    let family = record.verdicts.iter().filter(|v| v.p_holds.is_some()).count();
    let mut shown: Vec<(&str, Vec<String>)> = Vec::new();
    for v in verdicts {
        let Some(picture) = &v.picture else { continue };
        match shown.iter_mut().find(|(p, _)| p == picture) {
            Some((_, of)) => of.push(v.subject()),
            None => shown.push((picture, vec![v.subject()])),
        }
    }
    let is_image = |p: &str| !p.ends_with(".png") && !p.ends_with(".svg");
    let images = shown.iter().filter(|(p, _)| is_image(p)).take(PICTURES).map(|(p, _)| (*p).to_owned()).collect();
    // Profiles are as wide as the page.
    let small = shown.iter().filter(|(p, _)| p.ends_with(".png")).take(PICTURES);
    let columns = small.map(|(place, of)| {
        let caption = of.first().cloned().unwrap_or_default();
        let caption = if of.len() > 1 { format!("{caption} and {} more", of.len() - 1) } else { caption };
        Ok(Column { pictures: vec![Picture::new(gallery, &caption, place)?], caption })
    });
    let pictures = Grid::new(columns.collect::<Result<_, DiskError>>()?);
    let on_scale = [pictures::MINUS_Q, pictures::MINUS_CONVERGED];
    let scale = on_scale.into_iter().find(|maps| shown.iter().any(|(p, _)| p.contains(&format!("/{maps}/"))));
    let bar = match scale.filter(|_| pictures.is_some()) {
        Some(maps) => Picture::new(gallery, "scale of the pictures above", &pictures::bar(maps))?,
        None => None,
    };
    let profile = match shows_in_profile(worst.metric.name) {
        true => Picture::new(gallery, &format!("profile of {}", worst.scene), &pictures::profile(&worst.scene))?,
        false => None,
    };
    Ok(Some(GateSection {
        sign: sign(worst.outcome),
        outcome: outcome_text(worst.outcome),
        gate: worst.gate.clone(),
        metric: worst.title(),
        verdicts: verdicts.iter().take(VERDICTS).map(|v| row(record, v)).collect(),
        places: places(&verdicts[..verdicts.len().min(VERDICTS)]),
        more: verdicts.len().saturating_sub(VERDICTS),
        subject: worst.subject(),
        words: words::explain(worst, family).into_iter().filter(|text| !text.starts_with("See ")).collect(),
        pictures,
        bar,
        profile,
        images,
    }))
}

fn places(verdicts: &[&Verdict]) -> Vec<String> {
    let mut places: Vec<String> = Vec::new();
    for place in verdicts.iter().filter_map(|v| v.place.as_ref()) {
        if !places.contains(place) {
            places.push(place.clone());
        }
    }
    places
}

fn shows_in_profile(name: MetricName) -> bool {
    use MetricName::{Contrast, ContrastError, JudgeContrast, Michelson, Removed};
    matches!(name, Contrast | ContrastError | JudgeContrast | Michelson | Removed)
}

fn row(record: &Record, v: &Verdict) -> Row {
    Row {
        sign: sign(v.outcome),
        outcome: outcome_text(v.outcome),
        subject: v.subject(),
        anchor: record.scenes.iter().position(|s| s.name == v.scene).map(anchor),
        value: value_text(v.value(), v.interval),
        limit: match v.warn.filter(|_| v.outcome == Outcome::Warn) {
            Some(warn) => format!("{}, warns unless {}", v.limit.text(), warn.text()),
            None => v.limit.text(),
        },
        margin: margin_text(v),
        detectable: detectable_text(v.detectable),
        reason: v.reason.clone(),
    }
}
