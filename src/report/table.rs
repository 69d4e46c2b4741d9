//! Verdicts as rows, for the terminal and for Markdown: a row a gate, with the
//! case that comes closest to its limit.

use crate::{
    gate::{Outcome, Verdict},
    record::Record,
    untrusted::logged,
};
use serde::Serialize;

/// A gate with what came of it on all its cases.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// `PASS`, `FAIL`, `INCONCLUSIVE`, `WARN` or `KNOWN FAILURE`: the worst of its cases.
    pub outcome: &'static str,
    /// The gate.
    pub gate: String,
    /// How many cases were held against it.
    pub cases: usize,
    /// The case nearest to the limit, or furthest beyond it.
    pub nearest: String,
    /// Its value with the interval.
    pub value: String,
    /// The smallest effect that its verdict would have seen.
    pub detectable: String,
    /// The limit.
    pub limit: String,
    /// Why, for what did not pass.
    pub reason: Option<String>,
}

/// How people read an outcome.
pub fn outcome_text(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Pass => "PASS",
        Outcome::Fail => "FAIL",
        Outcome::Inconclusive => "INCONCLUSIVE",
        Outcome::Warn => "WARN",
        Outcome::KnownFailure => "KNOWN FAILURE",
    }
}

/// The digits after the point that an interval of this half width earns.
pub(crate) fn digits(half: f64) -> usize {
    if half > 0.0 { (1.0 - half.log10().floor()).clamp(2.0, 6.0) as usize } else { 4 }
}

/// `value [lo, hi]` with the digits that the interval earns.
pub fn value_text(value: Option<f64>, interval: Option<[f64; 2]>) -> String {
    let Some(value) = value else {
        return "none".to_owned();
    };
    let Some([lo, hi]) = interval else {
        return format!("{value:.4}");
    };
    let d = digits((hi - lo) / 2.0);
    format!("{value:.d$} [{lo:.d$}, {hi:.d$}]")
}

/// `value ± half width` with the digits that the interval earns.
pub fn plus_minus(value: f64, [lo, hi]: [f64; 2]) -> String {
    let half = (hi - lo) / 2.0;
    let d = digits(half);
    // Non-breaking, so that narrow columns keep it on one line.
    format!("{value:.d$}\u{a0}±\u{a0}{half:.d$}")
}

/// A smallest detectable effect with two digits that count.
pub fn detectable_text(detectable: Option<f64>) -> String {
    match detectable {
        None => "–".to_owned(),
        Some(0.0) => "0".to_owned(),
        Some(d) => format!("{d:.0$}", (1.0 - d.log10().floor()).clamp(0.0, 9.0) as usize),
    }
}

/// How far inside its limit a verdict's value lies; negative outside.
pub(super) fn margin(verdict: &Verdict) -> f64 {
    verdict.value().map_or(f64::NEG_INFINITY, |value| verdict.limit.margin(value))
}

/// A row a gate, worst outcome first.
pub fn rows(record: &Record) -> Vec<Row> {
    let mut gates: Vec<&str> = Vec::new();
    for v in &record.verdicts {
        if !gates.contains(&v.gate.as_str()) {
            gates.push(&v.gate);
        }
    }
    gates
        .into_iter()
        .filter_map(|gate| {
            let of_gate = || record.verdicts.iter().filter(move |v| v.gate == gate);
            let worst = of_gate().map(|v| v.outcome).min()?;
            let nearest = of_gate().filter(|v| v.outcome == worst).min_by(|a, b| margin(a).total_cmp(&margin(b)))?;
            Some(Row {
                outcome: outcome_text(worst),
                gate: gate.to_owned(),
                cases: of_gate().count(),
                nearest: nearest.subject(),
                value: value_text(nearest.value(), nearest.interval),
                detectable: detectable_text(nearest.detectable),
                limit: nearest.limit.text(),
                reason: (worst != Outcome::Pass).then(|| nearest.reason.clone()),
            })
        })
        .collect()
}

/// The table as plain text, columns aligned; `sees` is the smallest detectable effect.
pub fn plain(record: &Record) -> String {
    let rows = rows(record);
    let width = |f: fn(&Row) -> &str| rows.iter().map(|r| f(r).chars().count()).max().unwrap_or(0);
    let (a, b, c, d) = (width(|r| r.outcome), width(|r| &r.gate), width(|r| &r.nearest), width(|r| &r.value));
    let e = width(|r| &r.detectable);
    let mut text = String::new();
    for r in &rows {
        let Row { outcome, gate, nearest, value, detectable, limit, cases, .. } = r;
        let (gate, nearest) = (logged(gate), logged(nearest));
        text += &format!(
            "{outcome:<a$}  {gate:<b$}  {cases:>3}x  {nearest:<c$}  {value:<d$}  sees {detectable:<e$}  {limit}\n"
        );
        if let Some(reason) = &r.reason {
            text += &format!("{:a$}  {}\n", "", logged(reason));
        }
    }
    for idle in &record.idle_gates {
        text += &format!("{:<a$}  {}: {}\n", "NOT RUN", logged(&idle.gate), logged(&idle.reason));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_show_the_digits_their_interval_earns() {
        assert_eq!(value_text(Some(0.123_456), Some([0.12, 0.13])), "0.1235 [0.1200, 0.1300]");
        assert_eq!(value_text(Some(-1.0), Some([-1.5, -0.5])), "-1.00 [-1.50, -0.50]");
        assert_eq!(value_text(Some(1.0), Some([1.0, 1.0])), "1.0000 [1.0000, 1.0000]");
        assert_eq!(plus_minus(0.123_456, [0.118_456, 0.128_456]), "0.1235\u{a0}±\u{a0}0.0050");
        assert_eq!(value_text(None, None), "none");
        assert_eq!(detectable_text(Some(0.001_234)), "0.0012");
        assert_eq!((detectable_text(Some(12.3)), detectable_text(None)), ("12".into(), "–".into()));
    }
}
