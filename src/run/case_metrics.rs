//! Every metric of one case.

use crate::metrics::{Absent, Metric, artifact::Method, error, judge::Judge, regions::Region};

/// What a case is compared with, where it is there.
pub(super) struct Others<'a> {
    pub classic: Option<Method<'a>>,
    pub cpu: Option<&'a [Vec<f32>]>,
    pub judge: Result<&'a Judge, Absent>,
    /// Whether the scene has an occluder, so that it should have a judge.
    pub occluder: bool,
}

/// Every metric of one case.
pub(super) fn metrics(method: &Method<'_>, others: &Others<'_>) -> Vec<Metric> {
    let mut metrics = error::openness(method);
    metrics.extend(error::against_converged(method, Region::All));
    if others.occluder {
        let judge = others.judge.clone();
        metrics.extend(method.contrasts());
        metrics.push(method.contrast_error(judge.clone()));
        if let Some(classic) = &others.classic {
            metrics.push(method.removed(classic, judge.clone()));
        }
        for region in Judge::REGIONS {
            metrics.extend(error::against_converged(method, region));
            metrics.extend(error::against_judge(method, judge.clone(), region));
        }
    }
    if let Some(classic) = &others.classic {
        metrics.push(error::over_darkening(method, classic));
    }
    if let Some(cpu) = others.cpu {
        metrics.push(error::renderer_difference(method.replicates, cpu, method.regions));
    }
    metrics
}
