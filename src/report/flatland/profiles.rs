//! Profiles in small multiples: a column a width, a row an estimator, a curve a gap.

use super::{Drawing, Drawn, GREY, UNIT, UNIT_I, centimetres, font, heading, sheet, text};
use crate::flatland::{ProfileCurve, Study};
use plotters::{
    prelude::{ChartBuilder, Color, LineSeries, PathElement, RGBColor, Rectangle, ShapeStyle, Text, WHITE},
    style::text_anchor::HPos,
};

/// A panel's width and height, the strip above all panels, and what axis labels
/// take, pixels.
const PANEL: [u32; 2] = [250, 220];
const STRIP: u32 = 92;
const LABELS: [u32; 2] = [62, 48];

/// What the box stands over.
const UNDER: RGBColor = RGBColor(230, 230, 230);

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
    let size = [(columns * PANEL[0] + LABELS[0] + 12).max(600), rows * PANEL[1] + LABELS[1] + STRIP];
    sheet(size, |root| draw(study, root))
}

fn draw(study: &Study, root: &Drawing<'_>) -> Drawn {
    legend(study, root)?;
    let estimators = study.setting.estimators.len();
    for (row, estimator) in study.setting.estimators.iter().enumerate() {
        for (column, &width) in study.setting.widths.iter().enumerate() {
            let edges = [column == 0, row + 1 == estimators];
            let left = if edges[0] { 0 } else { LABELS[0] + column as u32 * PANEL[0] };
            let top = STRIP + row as u32 * PANEL[1];
            let across = PANEL[0] + if edges[0] { LABELS[0] } else { 0 };
            let down = PANEL[1] + if edges[1] { LABELS[1] } else { 0 };
            let at = ((left * UNIT) as i32, (top * UNIT) as i32);
            let area = root.clone().shrink(at, (across * UNIT, down * UNIT));
            panel(study, &area, width, estimator.label(), edges)?;
        }
    }
    Ok(())
}

/// One panel; `edges`: whether it is in the first column, in the last row.
fn panel(study: &Study, area: &Drawing<'_>, width: f64, label: &str, edges: [bool; 2]) -> Drawn {
    let (Some(&from), Some(&to)) = (study.t.first(), study.t.last()) else {
        return Ok(());
    };
    let mut chart = ChartBuilder::on(area)
        .margin(7 * UNIT)
        .x_label_area_size(if edges[1] { LABELS[1] * UNIT } else { 0 })
        .y_label_area_size(if edges[0] { LABELS[0] * UNIT } else { 0 })
        .build_cartesian_2d(from..to, 0.0..1.04)?;
    let edge = width / 2.0 / study.setting.radius;
    chart.draw_series([Rectangle::new([(-edge, 0.0), (edge, 1.04)], UNDER.filled())])?;
    chart
        .configure_mesh()
        .x_desc("t / R")
        .y_desc(label)
        .x_labels(6)
        .y_labels(6)
        .x_label_formatter(&|t| format!("{t:.1}").replace("-0.0", "0.0").replace('-', "−"))
        .y_label_formatter(&|o| format!("{o:.1}"))
        .light_line_style(WHITE.mix(0.0))
        .bold_line_style(RGBColor(218, 218, 218).stroke_width(UNIT))
        .axis_style(GREY.stroke_width(UNIT))
        .set_all_tick_mark_size(4 * UNIT)
        .label_style(font(13))
        .axis_desc_style(font(15))
        .draw()?;
    let gaps = study.setting.gaps.len();
    for (i, &gap) in study.setting.gaps.iter().enumerate() {
        let profile = study.profiles.iter().find(|p| p.width == width && p.gap == gap);
        if let Some(ProfileCurve { openness, .. }) = profile.and_then(|p| p.curves.iter().find(|c| c.label == label)) {
            let points = study.t.iter().copied().zip(openness.iter().copied());
            chart.draw_series(LineSeries::new(points, colour(i, gaps).stroke_width(2 * UNIT)))?;
        }
    }
    Ok(())
}

/// The strip above the panels: what was computed, which colour is which gap, and
/// which column is which width.
fn legend(study: &Study, root: &Drawing<'_>) -> Drawn {
    let at = |x: u32, y: u32| (x as i32 * UNIT_I, y as i32 * UNIT_I);
    let line = |x: u32, i: usize| {
        let color = colour(i, study.setting.gaps.len()).to_rgba();
        let style = ShapeStyle { color, filled: true, stroke_width: 3 * UNIT };
        PathElement::new(vec![at(x, 50), at(x + 24, 50)], style)
    };
    let mut x = LABELS[0];
    let heading = format!("Openness; {}", heading(&study.setting));
    root.draw(&Text::new(heading, at(x, 20), text(16, HPos::Left)))?;
    for (i, &gap) in study.setting.gaps.iter().enumerate() {
        let label = format!("m = {} cm", centimetres(gap));
        root.draw(&line(x, i))?;
        root.draw(&Text::new(label.clone(), at(x + 30, 50), text(14, HPos::Left)))?;
        x += 48 + 8 * label.len() as u32;
    }
    root.draw(&Rectangle::new([at(x, 43), at(x + 24, 57)], UNDER.filled()))?;
    root.draw(&Text::new("under the box", at(x + 30, 50), text(14, HPos::Left)))?;
    for (column, &width) in study.setting.widths.iter().enumerate() {
        let middle = LABELS[0] + column as u32 * PANEL[0] + PANEL[0] / 2;
        root.draw(&Text::new(format!("w = {} cm", centimetres(width)), at(middle, 82), text(15, HPos::Center)))?;
    }
    Ok(())
}
