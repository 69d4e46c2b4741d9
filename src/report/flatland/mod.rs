//! What `aogauge flatland` found, as a table and as plots.

mod map;
mod profiles;

pub use map::map;
pub use profiles::profiles;

use crate::flatland::{Estimator, Map, MapCurve, Measure, Setting, Space, Study};
use plotters::{
    coord::Shift,
    prelude::{DrawingArea, IntoDrawingArea, IntoFont, RGBColor, SVGBackend, WHITE},
    style::{
        FontDesc, TextStyle,
        text_anchor::{HPos, Pos, VPos},
    },
};
use std::fmt::Write as _;

/// How the heading of the profiles begins, by which such a file is known.
pub const PROFILES_BEGIN: &str = "Openness; R = ";
/// The same of the map.
pub const MAP_BEGINS: &str = "Highlight contrast K; R = ";

const GREY: RGBColor = RGBColor(90, 90, 90);

/// The drawing library rounds places to whole units: a pixel has this many, so
/// that curves are smooth.
const UNIT: u32 = 8;
const UNIT_I: i32 = UNIT as i32;

type Drawing<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

/// Draws on a white sheet of so many pixels.
fn sheet([width, height]: [u32; 2], draw: impl Fn(&Drawing<'_>) -> Drawn) -> Result<String, String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (width * UNIT, height * UNIT)).into_drawing_area();
        root.fill(&WHITE).map_err(|e| e.to_string())?;
        draw(&root).map_err(|e| e.to_string())?;
        root.present().map_err(|e| e.to_string())?;
    }
    let drawn = format!("<svg width=\"{}\" height=\"{}\"", width * UNIT, height * UNIT);
    Ok(svg.replacen(&drawn, &format!("<svg width=\"{width}\" height=\"{height}\""), 1))
}

/// A font of so many pixels. The library writes sizes divided by 1.24.
fn font(pixels: u32) -> FontDesc<'static> {
    ("sans-serif", f64::from(pixels * UNIT) * 1.24).into_font()
}

fn text(pixels: u32, horizontal: HPos) -> TextStyle<'static> {
    TextStyle::from(font(pixels)).pos(Pos::new(horizontal, VPos::Center))
}

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
    let mut text = "\nOver the map, w from 0.01 R to R, m up to R:\n".to_owned();
    for curve in &map.curves {
        let bright: Vec<(f64, f64, f64)> = cells(map, &curve.contrast).filter(|c| c.2 > 0.0).collect();
        let Some(most) = bright.iter().max_by(|a, b| a.2.total_cmp(&b.2)) else {
            let _ = writeln!(text, "{:16} K is above 0 nowhere{}", curve.label, removed(map, curve));
            continue;
        };
        let widest = bright.iter().fold(0.0, |a: f64, c| a.max(c.0));
        let (low, high) = bright.iter().fold((1.0, 0.0), |(a, b): (f64, f64), c| (a.min(c.1), b.max(c.1)));
        let _ = writeln!(
            text,
            "{:16} K > 0 for w up to {widest:.2} R and m from {low:.2} R to {high:.2} R; greatest {:+.3} at w = {:.3} R, m = {:.2} R{}",
            curve.label,
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
    format!("; removed {:.0} % on average, {:.0} % at least", 100.0 * mean, 100.0 * least)
}

/// The cells of a map that hold a number: w/R, m/R, value.
fn cells<'a>(map: &'a Map, rows: &'a [Vec<Option<f64>>]) -> impl Iterator<Item = (f64, f64, f64)> + 'a {
    map.gap.iter().zip(rows).flat_map(|(&gap, row)| {
        map.width.iter().zip(row).filter_map(move |(&width, value)| value.map(|value| (width, gap, value)))
    })
}
