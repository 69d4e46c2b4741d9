//! Highlight contrast over width and gap, and what of it is removed, as heat maps.

use super::{Drawing, Drawn, GREY, UNIT, UNIT_I, font, heading, sheet, text};
use crate::flatland::{Map, MapCurve, Setting};
use plotters::{
    prelude::{BLACK, ChartBuilder, Color, PathElement, RGBColor, Rectangle, Text},
    style::{FontTransform, TextStyle, text_anchor::HPos},
};

/// A panel's width and height, what axis labels take, and the colour bar's share,
/// pixels.
const PANEL: [u32; 2] = [318, 320];
const STRIP: u32 = 64;
const LABELS: [u32; 2] = [66, 52];
const BAR: u32 = 108;

/// Contrast of the scale's ends.
const END: f64 = 0.4;

/// What a row of panels shows.
struct Scale {
    title: &'static str,
    /// Values of the colour bar's ends.
    ends: [f64; 2],
    colour: fn(f64) -> RGBColor,
    ticks: &'static [(f64, &'static str)],
    /// Label of the colour bar.
    label: &'static str,
    /// Whether a line is drawn where the value is 0.
    line: bool,
}

const CONTRAST: Scale = Scale {
    title: "Highlight contrast K",
    ends: [-END, END],
    colour,
    ticks: &[(-END, "≤ −0.4"), (-0.5 * END, "−0.2"), (0.0, "0"), (0.5 * END, "0.2"), (END, "≥ 0.4")],
    label: "K (black line: K = 0)",
    line: true,
};

const REMOVED: Scale = Scale {
    title: "Share of classic's highlight removed, where that has K of 0.01 or more",
    ends: [-0.25, 1.0],
    colour: share,
    ticks: &[(-0.25, "≤ −0.25"), (0.0, "0"), (0.5, "0.5"), (1.0, "1")],
    label: "removed",
    line: false,
};

/// Mixes two colours.
fn mix(a: [f64; 3], b: [f64; 3], share: f64) -> RGBColor {
    let [r, g, b] = [0, 1, 2].map(|c| (a[c] + (b[c] - a[c]) * share).round() as u8);
    RGBColor(r, g, b)
}

const WHITE: [f64; 3] = [250.0; 3];

/// Blue where the box darkens, white at 0, orange where it brightens; colours that
/// colour-blind people can tell apart.
fn colour(k: f64) -> RGBColor {
    let x = (k / END).clamp(-1.0, 1.0);
    // In steps of END/50.
    let x = (x * 50.0).round() / 50.0;
    let [middle, end] =
        if x < 0.0 { [[140.0, 190.0, 225.0], [5.0, 48.0, 97.0]] } else { [[245.0, 170.0, 90.0], [150.0, 40.0, 0.0]] };
    let a = x.abs();
    if a < 0.5 { mix(WHITE, middle, 2.0 * a) } else { mix(middle, end, 2.0 * a - 1.0) }
}

/// White where nothing is removed, dark green where all is; purple where the
/// highlight grows.
fn share(removed: f64) -> RGBColor {
    let x = (removed.clamp(REMOVED.ends[0], REMOVED.ends[1]) * 50.0).round() / 50.0;
    if x < 0.0 {
        mix(WHITE, [118.0, 42.0, 131.0], x / REMOVED.ends[0])
    } else if x < 0.5 {
        mix(WHITE, [127.0, 191.0, 123.0], 2.0 * x)
    } else {
        mix([127.0, 191.0, 123.0], [0.0, 68.0, 27.0], 2.0 * x - 1.0)
    }
}

/// A map as SVG: a row of panels for K, a panel an estimator, and below each but
/// the first what it removes.
///
/// # Errors
/// What the drawing library says.
pub fn map(setting: &Setting, map: &Map) -> Result<String, String> {
    let panels = map.curves.len() as u32;
    let row = STRIP + PANEL[1] + LABELS[1];
    let rows = if panels > 1 { 2 } else { 1 };
    let size = [(LABELS[0] + PANEL[0] * panels + BAR).max(600), row * rows];
    sheet(size, |root| {
        let at = |x: u32, y: u32| (x as i32 * UNIT_I, y as i32 * UNIT_I);
        let values = |scale: &Scale, curve: &'_ MapCurve| {
            if scale.line { curve.contrast.clone() } else { curve.removed.clone() }
        };
        for (r, (scale, skipped)) in [(CONTRAST, 0), (REMOVED, 1)].into_iter().take(rows as usize).enumerate() {
            let top = r as u32 * row;
            let begin = LABELS[0] + skipped * PANEL[0];
            let title = if r == 0 { format!("{}; {}", scale.title, heading(setting)) } else { scale.title.to_owned() };
            root.draw(&Text::new(title, at(begin, top + 20), text(16, HPos::Left)))?;
            for (i, curve) in map.curves.iter().enumerate().skip(skipped as usize) {
                let left = LABELS[0] + i as u32 * PANEL[0];
                root.draw(&Text::new(curve.label.clone(), at(left + PANEL[0] / 2, top + 54), text(15, HPos::Center)))?;
                let first = i as u32 == skipped;
                let extra = if first { LABELS[0] } else { 0 };
                let across = (PANEL[0] + extra) * UNIT;
                let area = root.clone().shrink(at(left - extra, top + STRIP), (across, (PANEL[1] + LABELS[1]) * UNIT));
                panel(map, &values(&scale, curve), &scale, first, &area)?;
            }
            bar(root, &scale, LABELS[0] + panels * PANEL[0], top + STRIP)?;
        }
        Ok(())
    })
}

fn panel(map: &Map, values: &[Vec<Option<f64>>], scale: &Scale, first: bool, area: &Drawing<'_>) -> Drawn {
    let mut chart = ChartBuilder::on(area)
        .margin(8 * UNIT)
        .margin_right(16 * UNIT)
        .x_label_area_size(LABELS[1] * UNIT)
        .y_label_area_size(if first { LABELS[0] * UNIT } else { 0 })
        .build_cartesian_2d(Map::NARROWEST.log10()..0.0, 0.0..1.0)?;
    chart.draw_series(tiles(map, values, scale.colour))?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_desc("width w / R")
        .y_desc("gap m / R")
        .x_labels(0)
        .y_labels(6)
        .y_label_formatter(&|y| format!("{y:.1}"))
        .axis_style(GREY.stroke_width(UNIT))
        .set_all_tick_mark_size(4 * UNIT)
        .label_style(font(13))
        .axis_desc_style(font(15))
        .draw()?;
    if scale.line {
        let line = BLACK.stroke_width(2 * UNIT);
        chart.draw_series(zero(map, values).into_iter().map(|ends| PathElement::new(ends.to_vec(), line)))?;
    }
    // The drawing library chooses poor ticks for logarithms.
    let [left, top] = [area.get_pixel_range().0.start, area.get_pixel_range().1.start];
    for (w, label) in [(0.01f64, "0.01"), (0.02, "0.02"), (0.05, "0.05"), (0.1, "0.1"), (0.2, "0.2"), (0.5, "0.5")] {
        let (x, y) = chart.plotting_area().map_coordinate(&(w.log10(), 0.0));
        let (x, y) = (x - left, y - top);
        area.draw(&PathElement::new(vec![(x, y), (x, y + 4 * UNIT_I)], GREY.stroke_width(UNIT)))?;
        area.draw(&Text::new(label, (x, y + 14 * UNIT_I), text(13, HPos::Center)))?;
    }
    Ok(())
}

/// The cells of a map, neighbours of one colour in a row as one. Each reaches a
/// little under the next, which is drawn over it, so that no seams shine through.
fn tiles(map: &Map, values: &[Vec<Option<f64>>], colour: fn(f64) -> RGBColor) -> Vec<Rectangle<(f64, f64)>> {
    const UNDER_NEXT: f64 = 0.2;
    let (columns, rows) = (map.width.len() as f64, map.gap.len() as f64);
    let from = Map::NARROWEST.log10();
    let mut tiles = vec![];
    for (y, row) in values.iter().enumerate() {
        let colours: Vec<Option<RGBColor>> = row.iter().map(|k| k.map(colour)).collect();
        let mut x = 0;
        for run in colours.chunk_by(|a, b| a == b) {
            let edge = |x: f64| from * (1.0 - x / columns).max(0.0);
            let (start, end) = (x as f64, (x + run.len()) as f64);
            x += run.len();
            let Some(Some(colour)) = run.first() else { continue };
            let top = ((y as f64 + 1.0 + UNDER_NEXT) / rows).min(1.0);
            tiles
                .push(Rectangle::new([(edge(start), y as f64 / rows), (edge(end + UNDER_NEXT), top)], colour.filled()));
        }
    }
    tiles
}

/// Where contrast is 0, a line at a time: each square of four cells is cut into
/// two triangles, and each triangle crossed by at most one line.
fn zero(map: &Map, rows: &[Vec<Option<f64>>]) -> Vec<[(f64, f64); 2]> {
    let mut lines = vec![];
    for (y, pair) in rows.windows(2).enumerate() {
        for x in 1..map.width.len() {
            let corner =
                |dx: usize, dy: usize| Some((map.width[x - 1 + dx].log10(), map.gap[y + dy], pair[dy][x - 1 + dx]?));
            let (Some(a), Some(b), Some(c), Some(d)) = (corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)) else {
                continue;
            };
            lines.extend([[a, b, d], [a, c, d]].into_iter().filter_map(crossing));
        }
    }
    lines
}

fn crossing(triangle: [(f64, f64, f64); 3]) -> Option<[(f64, f64); 2]> {
    let [a, b, c] = triangle;
    let mut ends = [(a, b), (b, c), (c, a)].into_iter().filter(|(p, q)| (p.2 > 0.0) != (q.2 > 0.0)).map(|(p, q)| {
        let f = p.2 / (p.2 - q.2);
        (p.0 + f * (q.0 - p.0), p.1 + f * (q.1 - p.1))
    });
    Some([ends.next()?, ends.next()?])
}

/// The colour bar beside a row of panels.
fn bar(root: &Drawing<'_>, scale: &Scale, x: u32, y: u32) -> Drawn {
    const STEPS: u32 = 96;
    let [left, top, bottom] = [x + 16, y + 8, y + PANEL[1] - 8].map(|v| v as i32 * UNIT_I);
    let width = 18 * UNIT_I;
    let [low, high] = scale.ends;
    let y = |v: f64| bottom - (f64::from(bottom - top) * (v - low) / (high - low)).round() as i32;
    for i in 0..STEPS {
        let value = |i: u32| low + (high - low) * f64::from(i) / f64::from(STEPS);
        // Up to the end, each drawn over the one before, so that no seams shine through.
        let step = [(left, top), (left + width, y(value(i)))];
        root.draw(&Rectangle::new(step, (scale.colour)((value(i) + value(i + 1)) / 2.0).filled()))?;
    }
    root.draw(&Rectangle::new([(left, top), (left + width, bottom)], GREY.stroke_width(UNIT)))?;
    let right = left + width;
    for &(tick, label) in scale.ticks {
        let y = y(tick);
        root.draw(&PathElement::new(vec![(right, y), (right + 4 * UNIT_I, y)], GREY.stroke_width(UNIT)))?;
        root.draw(&Text::new(label, (right + 8 * UNIT_I, y), text(13, HPos::Left)))?;
    }
    let turned = TextStyle::from(font(15).transform(FontTransform::Rotate270)).pos(text(15, HPos::Center).pos);
    root.draw(&Text::new(scale.label, (right + 62 * UNIT_I, (top + bottom) / 2), turned))?;
    Ok(())
}
