//! That the numbers of a record that was read are ones that a run may have written. A record is merged, compared and drawn by
//! them, and a slip of an edit would be taken for what was measured.

use super::{CaseRecord, JudgeRecord, OccluderRecord, Record, RegionQ, SceneRecord};
use crate::{
    claim::MAX_SIDE,
    gate::{Limit, PValue, Verdict},
    metrics::{Floor, Metric, MetricName, Quantity, convergence::Convergence, profile::Curve, regions::Region},
    pooled::Pooled,
};
use std::collections::BTreeMap;

type Checked = Result<(), String>;

/// Openness is 0 to 1. Ratios of frames that were handed in, and values that a filter left, may lie beyond, but not so far.
const OPENNESS: [f64; 2] = [-1e8, 1e8];
/// What is divided by a flank, by a contrast error or by light has no such end.
const RATIO: [f64; 2] = [-1e12, 1e12];
/// What cannot be negative.
const SIZE: [f64; 2] = [0.0, 1e12];
/// Metres that are a length.
const LENGTH: [f64; 2] = [1e-9, 1e9];
/// Of p-values and shares.
const SHARE: [f64; 2] = [0.0, 1.0];
/// Confidences that a gate may ask for.
const CONFIDENCE: [f64; 2] = [0.5, 0.999_999];
/// Rays, replicates, paths.
const COUNT: [f64; 2] = [1.0, u32::MAX as f64];

/// Holds all numbers of a record against their ranges.
///
/// # Errors
/// The first that is out of its range, by its field, with its value and the range.
pub(super) fn check(record: &Record) -> Checked {
    let suite = &record.suite;
    within("suite.replicates", suite.replicates, COUNT)?;
    within("suite.converged_rays", suite.converged_rays, COUNT)?;
    known("suite.golden_rays", suite.golden_rays.map(f64::from), COUNT)?;
    each("suite.gates", &suite.gates, |gate| {
        within("confidence", gate.confidence, CONFIDENCE)?;
        gate.warn.iter().chain([&gate.limit]).try_for_each(limit)
    })?;
    if let Some(curve) = record.handed_in.as_ref().and_then(|h| h.curve.as_ref()) {
        within("handed_in.curve.gain", curve.gain, SIZE)?;
        within("handed_in.curve.exponent", curve.exponent, SIZE)?;
    }
    if let Some(until) = &record.until_sure {
        within("until_sure.max_replicates", until.max_replicates, COUNT)?;
        known("until_sure.max_time", until.max_time, SIZE)?;
        each("until_sure.undecided", &until.undecided, |u| within("rays", u.rays, COUNT))?;
    }
    each("verdicts", &record.verdicts, verdict)?;
    each("pooled", &record.pooled, pooled)?;
    each("scenes", &record.scenes, scene)?;
    each("cases", &record.cases, case)?;
    within("timing.seconds", record.timing.seconds, SIZE)?;
    for (name, times) in [("cases", &record.timing.cases), ("judges", &record.timing.judges)] {
        times.iter().try_for_each(|(of, seconds)| within(&format!("timing.{name}.{of}"), *seconds, SIZE))?;
    }
    Ok(())
}

fn within(field: &str, value: impl Into<f64>, [least, most]: [f64; 2]) -> Checked {
    let value = value.into();
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let [value, least, most] = [value, least, most].map(written);
    Err(format!("{field} is {value}: it must be from {least} to {most}"))
}

/// As short as it can be said.
fn written(value: f64) -> String {
    if value != 0.0 && !(1e-4..1e10).contains(&value.abs()) { format!("{value:e}") } else { value.to_string() }
}

fn known(field: &str, value: Option<f64>, range: [f64; 2]) -> Checked {
    value.map_or(Ok(()), |value| within(field, value, range))
}

/// An error in a part stands behind the name of the part.
fn part(name: &str, checked: Checked) -> Checked {
    checked.map_err(|e| format!("{name}.{e}"))
}

fn each<T>(name: &str, all: &[T], check: impl Fn(&T) -> Checked) -> Checked {
    all.iter().enumerate().try_for_each(|(i, one)| part(&format!("{name}[{i}]"), check(one)))
}

/// Ends of an interval, the lower first.
fn interval(field: &str, ends: Option<[f64; 2]>) -> Checked {
    match ends {
        Some([lo, hi]) if lo > hi => Err(format!("{field} is {lo} to {hi}: its lower end must come first")),
        _ => Ok(()),
    }
}

fn error_of(se: Option<f64>, df: Option<f64>) -> Checked {
    known("se", se, SIZE)?;
    known("df", df, [0.0, f64::MAX])
}

fn floor(floor: Option<&Floor>) -> Checked {
    floor.map_or(Ok(()), |f| part("floor", error_of(Some(f.se), Some(f.df))))
}

fn metric(metric: &Metric) -> Checked {
    let range = match metric.name {
        MetricName::DistinctReplicates => SHARE,
        MetricName::Mae | MetricName::Rmse | MetricName::JudgeMae | MetricName::JudgeRmse => [0.0, OPENNESS[1]],
        MetricName::Openness
        | MetricName::Bias
        | MetricName::JudgeBias
        | MetricName::OverDarkening
        | MetricName::RendererDifference => OPENNESS,
        MetricName::Contrast
        | MetricName::Michelson
        | MetricName::JudgeContrast
        | MetricName::ContrastError
        | MetricName::Removed => RATIO,
    };
    known("value", metric.value, range)?;
    error_of(metric.se, metric.df)?;
    floor(metric.floor.as_ref())
}

fn quantity(name: &str, quantity: &Quantity, range: [f64; 2]) -> Checked {
    part(name, known("value", quantity.value, range).and_then(|()| error_of(quantity.se, quantity.df)))
}

fn limit(limit: &Limit) -> Checked {
    let of = match *limit {
        Limit::AtLeast(v) | Limit::AtMost(v) => [v, v],
        Limit::Equals { target, within } => [target, within],
    };
    of.into_iter().try_for_each(|v| within("limit", v, RATIO))
}

fn verdict(verdict: &Verdict) -> Checked {
    part("metric", metric(&verdict.metric))?;
    if let Some(other) = &verdict.against {
        other.metric.iter().try_for_each(|m| part("against.metric", metric(m)))?;
        quantity("against.difference", &other.difference, RATIO)?;
    }
    verdict.warn.iter().chain([&verdict.limit]).try_for_each(limit)?;
    within("confidence", verdict.confidence, CONFIDENCE)?;
    interval("interval", verdict.interval)?;
    known("detectable", verdict.detectable, [0.0, f64::MAX])?;
    floor(verdict.floor.as_ref())?;
    let values =
        [("p_holds", verdict.p_holds), ("p_broken", verdict.p_broken), ("p_warn_broken", verdict.p_warn_broken)];
    for (name, p) in values {
        if let Some(PValue { raw, adjusted }) = p {
            within(&format!("{name}.raw"), raw, SHARE)?;
            within(&format!("{name}.adjusted"), adjusted, SHARE)?;
        }
    }
    within("spent", verdict.spent, SHARE)
}

fn pooled(pooled: &Pooled) -> Checked {
    within("rays", pooled.rays, COUNT)?;
    for (name, pool, range) in [
        ("contrast", &pooled.contrast, RATIO),
        ("contrast_error", &pooled.contrast_error, RATIO),
        ("contrast_error_size", &pooled.contrast_error_size, SIZE),
        ("removed", &pooled.removed, RATIO),
        ("bias", &pooled.bias, OPENNESS),
        ("mae", &pooled.mae, SIZE),
        ("rmse", &pooled.rmse, SIZE),
        ("over_darkening", &pooled.over_darkening, OPENNESS),
    ] {
        quantity(&format!("{name}.pooled"), &pool.pooled, range)?;
    }
    Ok(())
}

fn scene(scene: &SceneRecord) -> Checked {
    within("radius", scene.radius, LENGTH)?;
    within("secondary_radius", scene.secondary_radius, [0.0, LENGTH[1]])?;
    sides(scene.resolution)?;
    let [width, height] = scene.resolution.map(|side| side as usize);
    regions("regions", &scene.regions, width * height)?;
    column("transect", scene.transect.len(), width)?;
    scene.transect.iter().try_for_each(|place| within("transect", *place, RATIO))?;
    if let Some(judge) = &scene.judge {
        part("judge", of_judge(judge))?;
    }
    if let Some(screen) = &scene.screen {
        part("screen", sides(screen.resolution))?;
        screen.eye.iter().try_for_each(|at| within("screen.eye", *at, RATIO))?;
        regions("screen.regions", &screen.regions, width * height)?;
    }
    each("occluders", &scene.occluders, |o| occluder(o, width * height))?;
    each("convergence", &scene.convergence, convergence)?;
    each("profiles", &scene.profiles, |curve| profile(curve, width))
}

fn sides(resolution: [u32; 2]) -> Checked {
    resolution.iter().try_for_each(|side| within("resolution", *side, [1.0, f64::from(MAX_SIDE)]))
}

fn regions(name: &str, all: &BTreeMap<Region, usize>, pixels: usize) -> Checked {
    match all.iter().find(|(_, count)| **count > pixels) {
        Some((region, count)) => Err(format!(
            "{name}.{} is {count}: it must be from 0 to {pixels}, the pixels of the measure view",
            region.label()
        )),
        None => Ok(()),
    }
}

/// Lists have a value a column of the measure view.
fn column(name: &str, values: usize, width: usize) -> Checked {
    if values == width {
        return Ok(());
    }
    Err(format!("{name} has {values} values: it must have {width}, one a column of the measure view"))
}

fn of_judge(judge: &JudgeRecord) -> Checked {
    part("contrast", metric(&judge.contrast))?;
    of_regions(&judge.q)?;
    within("paths", judge.paths, COUNT)?;
    within("replicates", judge.replicates, COUNT)?;
    known("precision", judge.precision, SIZE)?;
    within("wanted", judge.wanted, SIZE)
}

fn of_regions(all: &BTreeMap<Region, RegionQ>) -> Checked {
    all.iter().try_for_each(|(region, q)| {
        let checked = known("value", q.value, SIZE).and_then(|()| interval("interval", q.interval));
        part(&format!("q.{}", region.label()), checked)
    })
}

fn occluder(occluder: &OccluderRecord, pixels: usize) -> Checked {
    regions("regions", &occluder.regions, pixels)?;
    occluder.shown.iter().try_for_each(|shown| regions("shown", shown, pixels))?;
    part("contrast", metric(&occluder.contrast))?;
    of_regions(&occluder.q)
}

fn convergence(of: &Convergence) -> Checked {
    each("points", &of.points, |point| {
        within("rays", point.rays, COUNT)?;
        quantity("rmse", &point.rmse, SIZE)?;
        quantity("bias_squared", &point.bias_squared, RATIO)?;
        quantity("variance", &point.variance, RATIO)
    })?;
    for (name, value) in [("slope", &of.slope), ("limit", &of.limit), ("per_ray", &of.per_ray)] {
        quantity(name, value, RATIO)?;
    }
    of.target.iter().try_for_each(|target| {
        within("target.rmse", target.rmse, SIZE)?;
        quantity("target.rays", &target.rays, SIZE)
    })
}

fn profile(curve: &Curve, width: usize) -> Checked {
    for (name, list) in [("value", &curve.value), ("lo", &curve.lo), ("hi", &curve.hi)] {
        column(name, list.len(), width)?;
        // An interval of two replicates may be wide.
        list.iter().try_for_each(|v| known(name, *v, if name == "value" { RATIO } else { [f64::MIN, f64::MAX] }))?;
    }
    Ok(())
}

fn case(case: &CaseRecord) -> Checked {
    within("case.rays", case.case.rays, COUNT)?;
    known("looks", case.looks.map(f64::from), COUNT)?;
    each("metrics", &case.metrics, metric)?;
    each("occluders", &case.occluders, |o| each("metrics", &o.metrics, metric))
}
