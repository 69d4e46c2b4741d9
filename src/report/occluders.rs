//! Occluders one by one, as rows of a table.

use super::{markdown::show, table::plus_minus};
use crate::{
    metrics::{MetricName, regions::Region},
    record::{CaseRecord, OccluderRecord, RegionQ, SceneRecord},
};
use serde::Serialize;

/// An occluder, whatever the method.
#[derive(Serialize)]
pub(super) struct OccluderRow {
    name: String,
    pixels: String,
    contrast: String,
    q: Vec<String>,
    /// Why values are missing.
    notes: Vec<String>,
}

/// A case under one occluder.
#[derive(Serialize)]
pub(super) struct OccluderCaseRow {
    occluder: String,
    estimator: String,
    renderer: String,
    rays: u32,
    contrast: String,
    contrast_error: String,
    reading: String,
    removed: String,
    /// Openness, bias and RMSE, and bias, MAE and RMSE against Q, by region.
    regions: Vec<[String; 7]>,
}

const REGIONS: [Region; 3] = [Region::Footprint, Region::Left, Region::Right];

/// The occluders of a scene, as it orders them.
pub(super) fn rows(scene: &SceneRecord) -> Vec<OccluderRow> {
    let q = |q: Option<&RegionQ>| match q.and_then(|q| Some((q.value?, q.interval?))) {
        Some((value, interval)) => plus_minus(value, interval),
        None => "–".to_owned(),
    };
    let row = |o: &OccluderRecord| {
        let pixels = REGIONS.map(|r| o.regions.get(&r).copied().unwrap_or_default().to_string());
        let mut notes: Vec<String> = o.q.values().filter_map(|q| q.note.clone()).collect();
        notes.dedup();
        OccluderRow {
            name: o.name.clone(),
            pixels: pixels.join(", "),
            contrast: show(Some(&o.contrast)),
            q: REGIONS.iter().map(|r| q(o.q.get(r))).collect(),
            notes,
        }
    };
    scene.occluders.iter().map(row).collect()
}

/// The cases under each of them.
pub(super) fn cases(scene: &SceneRecord, cases: &[&CaseRecord]) -> Vec<OccluderCaseRow> {
    let mut rows = Vec::new();
    for occluder in &scene.occluders {
        for case in cases {
            let Some(own) = case.occluders.iter().find(|o| o.name == occluder.name) else { continue };
            let get = |name, region| show(own.metric(name, region));
            let error = own.metric(MetricName::ContrastError, None);
            let of = |region: Region| {
                use MetricName::{Bias, JudgeBias, JudgeMae, JudgeRmse, Mae, Openness, Rmse};
                [Openness, Bias, Mae, Rmse, JudgeBias, JudgeMae, JudgeRmse].map(|name| get(name, Some(region)))
            };
            rows.push(OccluderCaseRow {
                occluder: occluder.name.clone(),
                estimator: case.case.estimator.clone(),
                renderer: case.case.renderer.clone(),
                rays: case.case.rays,
                contrast: get(MetricName::Contrast, None),
                contrast_error: show(error),
                reading: error.filter(|m| m.value.is_some()).and_then(|m| m.note.clone()).unwrap_or_default(),
                removed: get(MetricName::Removed, None),
                regions: REGIONS.map(of).to_vec(),
            });
        }
    }
    rows
}
