//! How methods converge, as rows of a table: from a record, and from its times.

use super::table::plus_minus;
use crate::{
    gate::CONFIDENCE,
    metrics::{Quantity, convergence::Convergence},
    record::{Record, SceneRecord},
};
use serde::Serialize;

/// A method on one renderer over one region.
#[derive(Serialize)]
pub(super) struct ConvergenceRow {
    estimator: String,
    renderer: String,
    region: &'static str,
    /// RMSE by ray count.
    rmse: Vec<String>,
    /// b² at the most rays.
    bias_squared: String,
    variance: String,
    slope: String,
    limit: String,
    /// v of the model.
    per_ray: String,
    /// 1 / (variance x time) at the most rays.
    efficiency: String,
    /// Rays and time to the target.
    target: String,
}

/// The rows of a scene, and why cells are empty.
pub(super) fn rows(record: &Record, scene: &SceneRecord) -> (Vec<ConvergenceRow>, Vec<String>) {
    let mut notes: Vec<String> = Vec::new();
    let mut rows = Vec::new();
    for c in &scene.convergence {
        let quantities = c.points.iter().flat_map(|p| [&p.rmse, &p.bias_squared, &p.variance]);
        notes.extend(quantities.chain([&c.slope, &c.limit]).filter_map(|q| q.note.clone()));
        rows.push(row(record, scene, c));
    }
    notes.sort();
    notes.dedup();
    (rows, notes)
}

fn row(record: &Record, scene: &SceneRecord, c: &Convergence) -> ConvergenceRow {
    let rmse = c.points.iter().map(|p| format!("{}: {}", p.rays, show(&p.rmse)));
    let last = c.points.last();
    let seconds = last.and_then(|p| seconds(record, scene, c, p.rays));
    ConvergenceRow {
        estimator: c.estimator.clone(),
        renderer: c.renderer.clone(),
        region: c.region.label(),
        rmse: rmse.collect(),
        bias_squared: last.map_or_else(String::new, |p| show(&p.bias_squared)),
        variance: last.map_or_else(String::new, |p| show(&p.variance)),
        slope: show(&c.slope),
        limit: show(&c.limit),
        per_ray: show(&c.per_ray),
        efficiency: last.zip(seconds).map_or_else(|| "–".to_owned(), |(p, s)| efficiency(&p.variance, s)),
        target: target(record, scene, c),
    }
}

/// 1 / (variance x time) with the ends of the variance's interval, time taken as
/// exact. An interval of variances that reaches 0 leaves it without an upper end.
fn efficiency(variance: &Quantity, seconds: f64) -> String {
    let of = |v: f64| if v > 0.0 { 1.0 / (v * seconds) } else { f64::INFINITY };
    match variance.value.map(of) {
        Some(value) if value.is_finite() && seconds > 0.0 => {
            match variance.estimate().map(|e| e.interval(CONFIDENCE)) {
                Some([lo, hi]) if of(lo).is_finite() => format!("{value:.3e} ({:.2e} to {:.2e})", of(hi), of(lo)),
                Some([_, hi]) => format!("{value:.3e} ({:.2e} or more)", of(hi)),
                None => format!("{value:.3e}"),
            }
        }
        _ => "–".to_owned(),
    }
}

/// Rays and time of one replicate with the target's error.
fn target(record: &Record, scene: &SceneRecord, c: &Convergence) -> String {
    let Some(target) = &c.target else { return "–".to_owned() };
    let Some(rays) = target.rays.value else {
        let why = target.rays.note.as_ref().filter(|_| c.slope.value.is_some());
        return why.map_or_else(|| "–".to_owned(), |why| format!("{}: {why}", target.rmse));
    };
    let text = match target.rays.estimate().map(|e| e.interval(CONFIDENCE)) {
        Some([lo, hi]) => format!("{}: {rays:.1}\u{a0}±\u{a0}{:.1} rays", target.rmse, (hi - lo) / 2.0),
        None => format!("{}: {rays:.1} rays", target.rmse),
    };
    let times: Option<Vec<(f64, f64)>> =
        c.points.iter().map(|p| Some((f64::from(p.rays), seconds(record, scene, c, p.rays)?))).collect();
    match times.and_then(|times| time_of(rays, &times)) {
        Some(seconds) => format!("{text}, {:.2} ms", seconds * 1e3),
        None => text,
    }
}

/// The time of some rays, by a power law through times of two ray counts or more.
fn time_of(rays: f64, times: &[(f64, f64)]) -> Option<f64> {
    let n = times.len() as f64;
    let (x, y) = (times.iter().map(|t| t.0.ln()).sum::<f64>() / n, times.iter().map(|t| t.1.ln()).sum::<f64>() / n);
    let across: f64 = times.iter().map(|t| (t.0.ln() - x) * (t.1.ln() - y)).sum();
    let along: f64 = times.iter().map(|t| (t.0.ln() - x).powi(2)).sum();
    Some((y + across / along * (rays.ln() - x)).exp()).filter(|t| t.is_finite())
}

/// Time of one replicate.
fn seconds(record: &Record, scene: &SceneRecord, c: &Convergence, rays: u32) -> Option<f64> {
    let found = record.cases.iter().find(|r| {
        let case = &r.case;
        case.scene == scene.name && case.estimator == c.estimator && case.renderer == c.renderer && case.rays == rays
    })?;
    Some(record.timing.cases.get(&found.case.id())? / f64::from(record.replicates(found).max(1)))
}

/// `value ± half width`, or a dash. Small numbers keep two digits that count.
fn show(q: &Quantity) -> String {
    let Some(e) = q.estimate() else { return "–".to_owned() };
    let [lo, hi] = e.interval(CONFIDENCE);
    let half = (hi - lo) / 2.0;
    if half > 0.0 && half < 1e-4 {
        return format!("{:.2e}\u{a0}±\u{a0}{half:.0e}", e.value);
    }
    plus_minus(e.value, [lo, hi])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn efficiency_has_the_interval_of_its_variance() {
        let of = |value, se| Quantity { value: Some(value), se: Some(se), df: Some(1e9), note: None };
        // 1.96 standard errors of .01 beside .04: .0204 to .0596, over half a second.
        assert_eq!(efficiency(&of(0.04, 0.01), 0.5), "5.000e1 (3.36e1 to 9.80e1)");
        assert_eq!(efficiency(&of(0.04, 0.03), 0.5), "5.000e1 (2.02e1 or more)");
        assert_eq!((efficiency(&of(0.0, 0.0), 0.5), efficiency(&of(0.04, 0.0), 0.0)), ("–".into(), "–".into()));
    }

    #[test]
    fn times_follow_a_power_law() {
        let t = time_of(16.0, &[(4.0, 0.02), (64.0, 0.08)]).unwrap();
        assert!((t - 0.04).abs() < 1e-12);
        assert_eq!(time_of(16.0, &[(4.0, 0.0), (64.0, 0.08)]), None);
    }
}
