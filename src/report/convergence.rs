//! How methods converge, as rows of a table: from a record, and from its times.

use super::table::plus_minus;
use crate::{
    gate::CONFIDENCE,
    metrics::{
        Absent, Quantity,
        convergence::{Convergence, TARGET},
    },
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
    rmse: String,
    /// b² at the most rays.
    bias_squared: String,
    variance: String,
    slope: String,
    limit: String,
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
    let variance = last.and_then(|p| p.variance.value);
    let seconds = last.and_then(|p| seconds(record, scene, c, p.rays));
    let efficiency = match variance.zip(seconds) {
        Some((v, s)) if v * s > 0.0 => format!("{:.3e}", 1.0 / (v * s)),
        _ => "–".to_owned(),
    };
    ConvergenceRow {
        estimator: c.estimator.clone(),
        renderer: c.renderer.clone(),
        region: c.region.label(),
        rmse: rmse.collect::<Vec<_>>().join("<br>"),
        bias_squared: last.map_or_else(String::new, |p| show(&p.bias_squared)),
        variance: last.map_or_else(String::new, |p| show(&p.variance)),
        slope: show(&c.slope),
        limit: show(&c.limit),
        efficiency,
        target: target(record, scene, c),
    }
}

/// Rays and time of one replicate with the target's error.
fn target(record: &Record, scene: &SceneRecord, c: &Convergence) -> String {
    let rays = match c.rays_for(TARGET) {
        Ok(rays) => rays,
        Err(Absent(why)) => return if c.slope.value.is_some() { why } else { "–".to_owned() },
    };
    let times: Option<Vec<(f64, f64)>> =
        c.points.iter().map(|p| Some((f64::from(p.rays), seconds(record, scene, c, p.rays)?))).collect();
    match times.and_then(|times| time_of(rays, &times)) {
        Some(seconds) => format!("{rays:.1} rays, {:.2} ms", seconds * 1e3),
        None => format!("{rays:.1} rays"),
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
    let case = record.cases.iter().map(|r| &r.case).find(|case| {
        case.scene == scene.name && case.estimator == c.estimator && case.renderer == c.renderer && case.rays == rays
    })?;
    Some(record.timing.cases.get(&case.id())? / f64::from(record.suite.replicates))
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
    fn times_follow_a_power_law() {
        let t = time_of(16.0, &[(4.0, 0.02), (64.0, 0.08)]).unwrap();
        assert!((t - 0.04).abs() < 1e-12);
        assert_eq!(time_of(16.0, &[(4.0, 0.0), (64.0, 0.08)]), None);
    }
}
