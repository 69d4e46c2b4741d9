//! Where a verdict's number comes from: which pixels, and a picture of them.

use crate::{
    counted::counted,
    metrics::{Metric, MetricName, artifact::Brighter, regions::Region},
    record::{CaseRecord, SceneRecord, pictures},
};

/// Which pixels a metric is taken over, with their number.
pub(super) fn place(metric: &Metric, scene: &SceneRecord, case: Option<&CaseRecord>, on_screen: bool) -> String {
    let shown = scene.screen.as_ref().filter(|_| on_screen);
    let regions = shown.map_or(&scene.regions, |s| &s.regions);
    let sized = |r: Region| match regions.get(&r) {
        Some(n) => format!("{} ({})", r.label(), counted(*n, "pixel", "pixels")),
        None => r.label().to_owned(),
    };
    let mut text = match (metric.name, metric.region) {
        (_, Some(region)) => sized(region),
        (MetricName::OverDarkening | MetricName::RendererDifference, None) => sized(Region::All),
        (MetricName::DistinctReplicates, None) => "all pixels of each replicate".to_owned(),
        (_, None) => {
            let method = case.map_or("Q", |c| c.case.estimator.as_str());
            let flank = match scene.brighter.get(method) {
                Some(Brighter::Left) => sized(Region::Left),
                Some(Brighter::Right) => sized(Region::Right),
                None => "not known".to_owned(),
            };
            format!("{} against the brighter flank, {flank}", sized(Region::Footprint))
        }
    };
    if shown.is_some() {
        text += ", of those that the camera of screen-space methods shows";
    }
    text
}

/// A picture that shows what a metric measures, relative to the record.
pub(super) fn picture(metric: &Metric, scene: &SceneRecord, case: Option<&CaseRecord>) -> Option<String> {
    let judged = scene.judge.is_some();
    let Some(CaseRecord { case, image, .. }) = case else {
        return judged.then(|| pictures::q(&scene.name));
    };
    let of = |folder| Some(pictures::of_estimator(&scene.name, folder, &case.estimator));
    match metric.name {
        MetricName::Contrast | MetricName::Michelson => Some(pictures::profile(&scene.name)),
        MetricName::ContrastError | MetricName::Removed if judged => of(pictures::MINUS_Q),
        name if judged && name.is_against_converged() => of(pictures::MINUS_CONVERGED),
        // No picture of a report shows what is below one grey level.
        MetricName::RendererDifference | MetricName::DistinctReplicates => image.clone(),
        _ => of(pictures::MEASURE),
    }
}
