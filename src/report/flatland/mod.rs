//! What `aogauge flatland` found, as a table and as plots.

mod map;
mod profiles;

pub use map::map;
pub use profiles::profiles;

use crate::flatland::{Estimator, Map, MapCurve, Measure, Setting, Space, Study};
use plotters::style::RGBColor;
use std::fmt::Write as _;

const GREY: RGBColor = RGBColor(90, 90, 90);

/// A length in metres, in centimetres with the digits it has.
fn centimetres(metres: f64) -> String {
    let text = format!("{:.4}", metres * 100.0);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// One line: what was computed.
fn heading(setting: &Setting) -> String {
    let space = match setting.space {
        Space::Flat => "flatland",
        Space::Extruded => "extruded",
    };
    let measure = match setting.measure {
        Measure::Uniform => "uniform",
        Measure::Cosine => "cosine",
    };
    let own = setting.estimators.iter().find_map(|e| match e {
        Estimator::Classic => None,
        Estimator::Extended { secondary_radius, .. } => Some(format!(", R' = {} cm", centimetres(*secondary_radius))),
        Estimator::Obscurance { sigma, limited } => {
            Some(format!(", sigma = {sigma} /m, rays {}", if *limited { "of length R" } else { "without end" }))
        }
    });
    let [radius, height] = [setting.radius, setting.height].map(centimetres);
    format!("R = {radius} cm, h = {height} cm, {space}, {measure}{}", own.unwrap_or_default())
}

/// The table for the terminal: a row a box and estimator, then what the map says.
pub fn table(study: &Study) -> String {
    let mut text = format!(
        "{}\n{:>8} {:>8}  {:16} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}\n",
        heading(&study.setting),
        "w, cm",
        "m, cm",
        "estimator",
        "K",
        "centre",
        "apex",
        "at t/R",
        "trough",
        "at t/R",
        "height"
    );
    for profile in &study.profiles {
        for curve in &profile.curves {
            let a = &curve.apex;
            let k = a.contrast.map_or_else(|| "none".to_owned(), |k| format!("{k:+.3}"));
            let _ = writeln!(
                text,
                "{:>8} {:>8}  {:16} {k:>8} {:>8.3} {:>8.3} {:>8.3} {:>8.3} {:>8.3} {:>+8.3}",
                centimetres(profile.width),
                centimetres(profile.gap),
                curve.label,
                a.centre,
                a.apex,
                a.apex_at,
                a.trough,
                a.trough_at,
                a.height
            );
        }
    }
    text + "K: mean under the box / mean of the flank - 1. height: centre - trough.\n"
        + &study.map.as_ref().map_or_else(String::new, summary)
}

/// What a map says, a line an estimator.
fn summary(map: &Map) -> String {
    let mut text = "\nOver all boxes with w and m up to R:\n".to_owned();
    for curve in &map.curves {
        let cells: Vec<(f64, f64, f64)> = cells(map, &curve.contrast).collect();
        let bright = cells.iter().filter(|c| c.2 > 0.0).count() as f64 / cells.len().max(1) as f64;
        let [mut least, mut most] = [(0.0, 0.0, f64::INFINITY), (0.0, 0.0, f64::NEG_INFINITY)];
        for &cell in &cells {
            least = if cell.2 < least.2 { cell } else { least };
            most = if cell.2 > most.2 { cell } else { most };
        }
        let _ = writeln!(
            text,
            "{:16} K > 0 for {:.0} % of them; K from {:+.3} (w = {:.2} R, m = {:.2} R) to {:+.3} (w = {:.2} R, m = {:.2} R){}",
            curve.label,
            100.0 * bright,
            least.2,
            least.0,
            least.1,
            most.2,
            most.0,
            most.1,
            removed(map, curve)
        );
    }
    text
}

fn removed(map: &Map, curve: &MapCurve) -> String {
    if map.curves.first() == Some(curve) {
        return String::new();
    }
    let shares: Vec<f64> = cells(map, &curve.removed).map(|c| c.2).collect();
    if shares.is_empty() {
        return String::new();
    }
    let least = shares.iter().fold(1.0, |a: f64, &b| a.min(b));
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    format!("; removed {:.0} % (least {:.0} %)", 100.0 * mean, 100.0 * least)
}

/// The cells of a map that hold a number: w/R, m/R, value.
fn cells<'a>(map: &'a Map, rows: &'a [Vec<Option<f64>>]) -> impl Iterator<Item = (f64, f64, f64)> + 'a {
    map.gap.iter().zip(rows).flat_map(|(&gap, row)| {
        map.width.iter().zip(row).filter_map(move |(&width, value)| value.map(|value| (width, gap, value)))
    })
}
