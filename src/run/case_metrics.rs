//! Every metric of one case.

use super::occluders::JudgedOccluder;
use crate::{
    metrics::{
        Absent, Metric,
        artifact::Method,
        error::{self, Pairing},
        judge::{Judge, JudgedRegions, QImage},
        regions::Region,
    },
    stats::Estimate,
};

/// What a case is compared with, where it is there.
pub(super) struct Others<'a> {
    pub classic: Option<Method<'a>>,
    pub cpu: Option<(&'a [Vec<f32>], Pairing)>,
    pub judge: Result<&'a JudgedRegions, Absent>,
    pub image: Result<&'a QImage, Absent>,
    /// Whether the scene has an occluder, so that it should have a judge.
    pub occluder: bool,
}

/// Every metric of one case.
pub(super) fn metrics(method: &Method<'_>, others: &Others<'_>) -> Vec<Metric> {
    let mut metrics = error::openness(method, &Region::ALL);
    metrics.extend(error::against_converged(method, Region::All));
    if others.occluder {
        let q = |region| others.judge.clone().and_then(|j| j.q_of(region).ok_or_else(no_such_region));
        metrics.extend(artifact(method, others.classic.as_ref(), others.judge.clone()));
        metrics.extend(errors(method, q, &others.image));
    }
    if let Some(classic) = &others.classic {
        metrics.push(error::over_darkening(method, classic));
    }
    if let Some((cpu, pairing)) = others.cpu {
        metrics.push(error::renderer_difference(method.replicates, cpu, method.regions, pairing));
    }
    metrics.push(error::distinct_replicates(method.replicates));
    metrics
}

/// The metrics of one case under one occluder of several; the regions of `method` and
/// `classic` are the occluder's.
pub(super) fn of_occluder(
    method: &Method<'_>,
    classic: Option<&Method<'_>>,
    judged: &Result<&JudgedOccluder, Absent>,
    image: &Result<&QImage, Absent>,
) -> Vec<Metric> {
    let means = judged.clone().and_then(|j| j.means.as_ref().map_err(Clone::clone));
    let q = |region| {
        let judged = judged.clone()?;
        let index = Judge::REGIONS.iter().position(|&r| r == region).ok_or_else(no_such_region)?;
        judged.q[index].clone()
    };
    let mut metrics = error::openness(method, &Judge::REGIONS);
    metrics.extend(artifact(method, classic, means));
    metrics.extend(errors(method, q, image));
    metrics
}

fn no_such_region() -> Absent {
    Absent("the judge has no such region".into())
}

/// Contrast, its error, and what is removed.
fn artifact(method: &Method<'_>, classic: Option<&Method<'_>>, judge: Result<&JudgedRegions, Absent>) -> Vec<Metric> {
    let mut metrics = method.contrasts().to_vec();
    metrics.push(method.contrast_error(judge.clone()));
    metrics.extend(classic.map(|classic| method.removed(classic, judge)));
    metrics
}

/// Errors under an occluder and beside it, against the converged image and Q.
fn errors(
    method: &Method<'_>,
    q: impl Fn(Region) -> Result<Estimate, Absent>,
    image: &Result<&QImage, Absent>,
) -> Vec<Metric> {
    let of = |region| {
        let against_judge = error::against_judge(method, q(region), image, region);
        error::against_converged(method, region).into_iter().chain(against_judge)
    };
    Judge::REGIONS.into_iter().flat_map(of).collect()
}
