//! Profiles in small multiples: a column a width, a row an estimator, a curve a gap.

use super::{GREY, centimetres, heading};
use crate::flatland::{ProfileCurve, Study};
use plotters::{
    coord::Shift,
    prelude::{
        ChartBuilder, Color, DrawingArea, IntoDrawingArea, IntoFont, LineSeries, PathElement, RGBColor, Rectangle,
        SVGBackend, ShapeStyle, Text, WHITE,
    },
    style::{
        TextStyle,
        text_anchor::{HPos, Pos, VPos},
    },
};

type Drawing<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

/// A panel's width and height, the strip above all panels, and what axis labels
/// take, pixels.
const PANEL: [u32; 2] = [250, 220];
const STRIP: u32 = 66;
const LABELS: [u32; 2] = [58, 44];

/// From small to large gaps: dark to light (after viridis), never too light for
/// white paper.
const RAMP: [[f64; 3]; 4] = [[68.0, 1.0, 84.0], [49.0, 104.0, 142.0], [33.0, 158.0, 120.0], [202.0, 190.0, 20.0]];

fn colour(i: usize, n: usize) -> RGBColor {
    let at = if n > 1 { i as f64 / (n - 1) as f64 * (RAMP.len() - 1) as f64 } else { 1.0 };
    let low = (at.floor() as usize).min(RAMP.len() - 2);
    let f = at - low as f64;
    let [r, g, b] = [0, 1, 2].map(|c| (RAMP[low][c] * (1.0 - f) + RAMP[low + 1][c] * f).round() as u8);
    RGBColor(r, g, b)
}

/// The profiles of a study, as SVG.
///
/// # Errors
/// What the drawing library says.
pub fn profiles(study: &Study) -> Result<String, String> {
    let (columns, rows) = (study.setting.widths.len() as u32, study.setting.estimators.len() as u32);
    let size = [(columns * PANEL[0] + LABELS[0] + 16).max(560), rows * PANEL[1] + LABELS[1] + STRIP + 8];
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (size[0], size[1])).into_drawing_area();
        draw(study, &root).map_err(|e| e.to_string())?;
        root.present().map_err(|e| e.to_string())?;
    }
    Ok(svg)
}

fn draw(study: &Study, root: &Drawing<'_>) -> Drawn {
    root.fill(&WHITE)?;
    legend(study, root)?;
    let estimators = study.setting.estimators.len();
    for (row, estimator) in study.setting.estimators.iter().enumerate() {
        for column in 0..study.setting.widths.len() {
            let (first, last) = (column == 0, row + 1 == estimators);
            let left = if first { 0 } else { LABELS[0] + column as u32 * PANEL[0] };
            let top = STRIP + row as u32 * PANEL[1];
            let width = PANEL[0] + if first { LABELS[0] } else { 0 };
            let height = PANEL[1] + if last { LABELS[1] } else { 0 };
            let area = root.clone().shrink((left as i32, top as i32), (width, height));
            panel(study, &area, column, estimator.label(), [first, row == 0, last])?;
        }
    }
    Ok(())
}

/// One panel; `edges`: whether it is the first column, the first row, the last row.
fn panel(study: &Study, area: &Drawing<'_>, column: usize, label: &str, edges: [bool; 3]) -> Drawn {
    let (Some(&from), Some(&to)) = (study.t.first(), study.t.last()) else {
        return Ok(());
    };
    let width = study.setting.widths.get(column).copied().unwrap_or_default();
    let [first_column, first_row, last_row] = edges;
    let mut builder = ChartBuilder::on(area);
    builder.margin(7).margin_top(if first_row { 4 } else { 7 });
    if first_row {
        builder.caption(format!("w = {} cm", centimetres(width)), ("sans-serif", 15).into_font());
    }
    let mut chart = builder
        .x_label_area_size(if last_row { LABELS[1] } else { 0 })
        .y_label_area_size(if first_column { LABELS[0] } else { 0 })
        .build_cartesian_2d(from..to, 0.0..1.04)?;
    let edge = width / 2.0 / study.setting.radius;
    chart.draw_series([Rectangle::new([(-edge, 0.0), (edge, 1.04)], RGBColor(228, 228, 228).filled())])?;
    chart
        .configure_mesh()
        .x_desc("t / R")
        .y_desc(format!("openness, {label}"))
        .x_labels(5)
        .y_labels(5)
        .x_label_formatter(&|t| format!("{:.1}", if t.abs() < 1e-9 { 0.0 } else { *t }))
        .y_label_formatter(&|o| format!("{o:.1}"))
        .light_line_style(WHITE.mix(0.0))
        .bold_line_style(RGBColor(215, 215, 215))
        .label_style(("sans-serif", 13).into_font())
        .axis_desc_style(("sans-serif", 14).into_font())
        .draw()?;
    let gaps = study.setting.gaps.len();
    for (i, &gap) in study.setting.gaps.iter().enumerate() {
        let profile = study.profiles.iter().find(|p| p.width == width && p.gap == gap);
        if let Some(ProfileCurve { openness, .. }) = profile.and_then(|p| p.curves.iter().find(|c| c.label == label)) {
            let points = study.t.iter().copied().zip(openness.iter().copied());
            chart.draw_series(LineSeries::new(points, colour(i, gaps).stroke_width(2)))?;
        }
    }
    Ok(())
}

/// The strip above the panels: what was computed, and which colour is which gap.
fn legend(study: &Study, root: &Drawing<'_>) -> Drawn {
    let middle = Pos::new(HPos::Left, VPos::Center);
    let style = |size: i32| TextStyle::from(("sans-serif", size).into_font()).pos(middle);
    let left = LABELS[0] as i32;
    root.draw(&Text::new(heading(&study.setting), (left, 18), style(15)))?;
    let gaps = study.setting.gaps.len();
    let mut x = left;
    for (i, &gap) in study.setting.gaps.iter().enumerate() {
        let line = ShapeStyle { color: colour(i, gaps).to_rgba(), filled: true, stroke_width: 3 };
        let text = format!("m = {} cm", centimetres(gap));
        root.draw(&PathElement::new(vec![(x, 46), (x + 24, 46)], line))?;
        root.draw(&Text::new(text.clone(), (x + 30, 46), style(14)))?;
        x += 48 + 8 * text.len() as i32;
    }
    root.draw(&Rectangle::new([(x, 39), (x + 24, 53)], RGBColor(228, 228, 228).filled()))?;
    root.draw(&Text::new("under the box", (x + 30, 46), style(14).color(&GREY)))?;
    Ok(())
}
