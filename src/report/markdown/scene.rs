//! The section of a scene.

use super::{
    super::{
        convergence::{self, ConvergenceRow},
        error_maps,
        gallery::Gallery,
        occluders::{self, OccluderCaseRow, OccluderRow},
        plots,
        table::plus_minus,
    },
    anchor,
    grid::{Column, Grid, Picture, Plot},
    overview, show,
};
use crate::{
    counted::counted,
    disk::DiskError,
    gate::CONFIDENCE,
    metrics::{MetricName, artifact::Brighter, judge::Judge, regions::Region},
    record::{
        CaseRecord, Record, SceneRecord, ScreenRecord, Stopped,
        pictures::{self, LOOK, MEASURE, MINUS_CONVERGED, MINUS_Q},
    },
};
use serde::Serialize;
use std::collections::BTreeMap;

/// What is shown of a scene.
#[derive(Serialize)]
pub(super) struct SceneSection {
    name: String,
    anchor: String,
    description: String,
    control: bool,
    verdicts: String,
    triangles: usize,
    radius: f64,
    secondary_radius: f64,
    judge: Option<String>,
    no_judge: Option<String>,
    /// Where screen-space methods are computed, and what is seen from there.
    screen: Option<String>,
    look: Option<Grid>,
    measure: Option<Grid>,
    /// Each method's fewest rays less its converged image.
    noise: Option<Grid>,
    profile: Plot,
    convergence_plot: Plot,
    cases: Vec<CaseRow>,
    /// Cases that a short page leaves out.
    more_cases: usize,
    occluders: Vec<OccluderRow>,
    occluder_cases: Vec<OccluderCaseRow>,
    convergence: Vec<ConvergenceRow>,
    convergence_notes: Vec<String>,
    /// Errors under the occluder and beside it.
    errors_by_region: Vec<ErrorRow>,
    regions: String,
    /// What ended with an error, and why.
    errors: Vec<[String; 2]>,
    /// Why cells hold no number.
    absent: Vec<String>,
}

#[derive(Serialize)]
struct CaseRow {
    /// Estimator, renderer and rays.
    case: String,
    openness: String,
    contrast: String,
    contrast_error: String,
    reading: String,
    removed: String,
    bias: String,
    rmse: String,
    over_darkening: String,
    milliseconds: String,
    replicates: u32,
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
        case: short_id(c),
        region: region.label(),
        cells: names.map(|name| show(c.metric(name, Some(region)))),
    };
    let regions = [Region::Footprint, Region::Left, Region::Right];
    cases.iter().filter(|c| c.error.is_none()).flat_map(|c| regions.map(|r| row(c, r))).collect()
}

/// `estimator/renderer/rays`: a case within its scene.
fn short_id(c: &CaseRecord) -> String {
    format!("{}/{}/{}", c.case.estimator, c.case.renderer, c.case.rays)
}

/// Whether a case is what a short page shows of its estimator: the most rays on the CPU,
/// or where it ran.
fn is_best(cases: &[&CaseRecord], case: &CaseRecord) -> bool {
    let own = cases.iter().filter(|c| c.case.estimator == case.case.estimator && c.error.is_none());
    let best = own.max_by_key(|c| (c.case.renderer == "cpu", c.case.rays));
    best.is_some_and(|best| best.case == case.case)
}

impl SceneSection {
    pub(super) fn new(
        record: &Record,
        scene: &SceneRecord,
        place: usize,
        gallery: &Gallery,
        brief: bool,
    ) -> Result<Self, DiskError> {
        let cases: Vec<&CaseRecord> = record.cases.iter().filter(|c| c.case.scene == scene.name).collect();
        let (convergence, convergence_notes) = convergence::rows(record, scene);
        let failed_judge = scene.judge_error.iter().map(|why| ["judge".to_owned(), why.clone()]);
        let failed = cases.iter().filter_map(|c| Some([c.case.id(), c.error.clone()?]));
        let whole: Vec<&CaseRecord> = cases.iter().copied().filter(|c| c.error.is_none()).collect();
        let listed = whole.iter().filter(|c| !brief || is_best(&cases, c));
        let listed: Vec<CaseRow> = listed.map(|c| case_row(record, c, scene.judge.is_some())).collect();
        let [look, measure, noise] = grids(record, scene, gallery)?;
        let name = &scene.name;
        let by_region = scene.judge.is_some() && !brief;
        let along = plots::along(&scene.profiles);
        Ok(SceneSection {
            anchor: anchor(place),
            description: scene.description.clone(),
            control: scene.control,
            verdicts: overview::verdicts(record, scene),
            triangles: scene.triangles,
            radius: scene.radius,
            secondary_radius: scene.secondary_radius,
            judge: judge_text(scene),
            no_judge: scene.no_judge.clone(),
            screen: scene.screen.as_ref().map(|s| screen_text(scene, s)),
            look,
            measure,
            noise: noise.filter(|_| !brief),
            profile: Plot::new(gallery, &format!("{along} along the transect of {name}"), &pictures::profile(name))?,
            convergence_plot: Plot::new(gallery, &format!("error over rays in {name}"), &pictures::convergence(name))?,
            more_cases: whole.len() - listed.len(),
            cases: listed,
            regions: scene.regions.iter().map(|(r, n)| format!("{} {n}", r.label())).collect::<Vec<_>>().join(", "),
            absent: absent(&cases),
            occluders: occluders::rows(scene),
            occluder_cases: if brief { vec![] } else { occluders::cases(scene, &cases) },
            convergence: if brief { vec![] } else { convergence },
            convergence_notes,
            errors_by_region: if by_region { errors_by_region(&cases) } else { vec![] },
            errors: failed_judge.chain(failed).collect(),
            name: name.clone(),
        })
    }
}

/// Pictures of the look view; of the measure view with their errors against Q; and of
/// the noise of the fewest rays.
fn grids(record: &Record, scene: &SceneRecord, gallery: &Gallery) -> Result<[Option<Grid>; 3], DiskError> {
    let name = &scene.name;
    let (mut look, mut measure, mut noise) = (Vec::new(), Vec::new(), Vec::new());
    for estimator in &record.suite.estimators {
        let picture =
            |alt: String, folder| Picture::new(gallery, &alt, &pictures::of_estimator(name, folder, estimator));
        let column = |pictures| Column { caption: estimator.clone(), pictures };
        look.push(column(vec![picture(format!("{estimator}, look view"), LOOK)?]));
        measure.push(column(vec![
            picture(format!("{estimator}, measure view"), MEASURE)?,
            picture(format!("{estimator} less Q"), MINUS_Q)?,
        ]));
        if let Some(case) = error_maps::fewest(record, scene, estimator) {
            let n = record.replicates(case);
            let caption = format!("{estimator}, {}, mean of {n}", counted(case.case.rays, "ray", "rays"));
            let pictures = vec![picture(caption.clone(), MINUS_CONVERGED)?];
            noise.push(Column { caption, pictures });
        }
    }
    let traced = Picture::new(gallery, "path-traced, look view", &pictures::path_traced(name))?;
    look.push(Column { caption: "path-traced".to_owned(), pictures: vec![traced] });
    let q = Picture::new(gallery, "Q, measure view", &pictures::q(name))?;
    measure.push(Column { caption: Judge::LABEL.to_owned(), pictures: vec![q] });
    Ok([look, measure, noise].map(Grid::new))
}

fn case_row(record: &Record, case: &CaseRecord, has_judge: bool) -> CaseRow {
    let get = |name, region| show(case.metric(name, region));
    let error_region = if has_judge { Region::Footprint } else { Region::All };
    let error = case.metric(MetricName::ContrastError, None);
    CaseRow {
        case: short_id(case),
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
        milliseconds: record.milliseconds(case).map_or_else(|| "–".to_owned(), |ms| format!("{ms:.1}")),
        replicates: record.replicates(case),
    }
}

pub(in crate::report) fn judge_text(scene: &SceneRecord) -> Option<String> {
    let judge = scene.judge.as_ref()?;
    let Some(contrast) = judge.contrast.estimate() else {
        let why = judge.contrast.note.as_deref().unwrap_or("K(Q) is not known");
        return Some(format!(
            "No contrast error is taken from it: {why}. {} a pixel.",
            counted(judge.paths, "path", "paths")
        ));
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
        "K(Q) = {} against the {flank} flank: {reading}. Q: {}. {} of {} a pixel, until {}; half width of the widest interval of a region mean: {precision}.",
        plus_minus(contrast.value, [lo, hi]),
        q.join(", "),
        counted(judge.replicates, "replicate", "replicates"),
        counted(judge.paths, "path", "paths"),
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

/// Each reason for a missing number once.
fn absent(cases: &[&CaseRecord]) -> Vec<String> {
    let by_occluder = cases.iter().flat_map(|c| &c.occluders).flat_map(|o| &o.metrics);
    let metrics = cases.iter().flat_map(|c| &c.metrics).chain(by_occluder).filter(|m| m.estimate().is_none());
    let mut notes: Vec<String> = metrics.filter_map(|m| m.note.clone()).collect();
    notes.sort();
    notes.dedup();
    notes
}
