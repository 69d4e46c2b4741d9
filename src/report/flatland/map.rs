//! Highlight contrast over width and gap, as heat maps.

use crate::flatland::{Map, MapCurve};
use plotters::{
    coord::Shift,
    prelude::{
        BLACK, ChartBuilder, Color, DrawingArea, IntoDrawingArea, IntoFont, PathElement, RGBColor, Rectangle,
        SVGBackend, ShapeStyle, Text, WHITE,
    },
    style::{
        FontTransform, TextStyle,
        text_anchor::{HPos, Pos, VPos},
    },
};

type Drawing<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

/// A panel's width and height, what axis labels take, and the colour bar's share,
/// pixels.
const PANEL: [u32; 2] = [310, 340];
const LABELS: u32 = 54;
const BAR: u32 = 100;

/// Contrast of the scale's ends.
const END: f64 = 0.4;

/// Blue where the box darkens, white at 0, orange where it brightens; colours that
/// colour-blind people can tell apart.
fn colour(k: f64) -> RGBColor {
    let x = (k / END).clamp(-1.0, 1.0);
    let [middle, end] =
        if x < 0.0 { [[140.0, 190.0, 225.0], [5.0, 48.0, 97.0]] } else { [[245.0, 170.0, 90.0], [150.0, 40.0, 0.0]] };
    let a = x.abs();
    let [r, g, b] = [0, 1, 2].map(|c| {
        let value = if a < 0.5 {
            250.0 + (middle[c] - 250.0) * 2.0 * a
        } else {
            middle[c] + (end[c] - middle[c]) * (2.0 * a - 1.0)
        };
        value.round() as u8
    });
    RGBColor(r, g, b)
}

/// A map, a panel an estimator, as SVG.
///
/// # Errors
/// What the drawing library says.
pub fn map(map: &Map) -> Result<String, String> {
    let size = (LABELS + PANEL[0] * map.curves.len() as u32 + BAR, PANEL[1] + LABELS);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(map, &root).map_err(|e| e.to_string())?;
        root.present().map_err(|e| e.to_string())?;
    }
    Ok(svg)
}

fn draw(map: &Map, root: &Drawing<'_>) -> Drawn {
    root.fill(&WHITE)?;
    for (i, curve) in map.curves.iter().enumerate() {
        let left = if i == 0 { 0 } else { LABELS + i as u32 * PANEL[0] };
        let width = PANEL[0] + if i == 0 { LABELS } else { 0 };
        let area = root.clone().shrink((left as i32, 0), (width, PANEL[1] + LABELS));
        panel(map, curve, i == 0, &area)?;
    }
    bar(root, (LABELS + map.curves.len() as u32 * PANEL[0]) as i32)
}

fn panel(map: &Map, curve: &MapCurve, first: bool, area: &Drawing<'_>) -> Drawn {
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .caption(format!("K, {}", curve.label), ("sans-serif", 16).into_font())
        .x_label_area_size(LABELS - 8)
        .y_label_area_size(if first { LABELS } else { 0 })
        .build_cartesian_2d(0.0..1.0, 0.0..1.0)?;
    let half = 0.5 / map.width.len().max(1) as f64;
    chart.draw_series(
        super::cells(map, &curve.contrast)
            .map(|(w, m, k)| Rectangle::new([(w - half, m - half), (w + half, m + half)], colour(k).filled())),
    )?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_desc("width w / R")
        .y_desc("gap m / R")
        .x_labels(6)
        .y_labels(6)
        .x_label_formatter(&|x| format!("{x:.1}"))
        .y_label_formatter(&|y| format!("{y:.1}"))
        .label_style(("sans-serif", 13).into_font())
        .axis_desc_style(("sans-serif", 15).into_font())
        .draw()?;
    let style = ShapeStyle { color: BLACK.to_rgba(), filled: false, stroke_width: 2 };
    chart.draw_series(zero(map, &curve.contrast).into_iter().map(|line| PathElement::new(line.to_vec(), style)))?;
    Ok(())
}

/// Where contrast is 0, a line at a time: each square of four cells is cut into
/// two triangles, and each triangle crossed by at most one line.
fn zero(map: &Map, rows: &[Vec<Option<f64>>]) -> Vec<[(f64, f64); 2]> {
    let mut lines = vec![];
    for (y, pair) in rows.windows(2).enumerate() {
        for x in 1..map.width.len() {
            let corner = |dx: usize, dy: usize| Some((map.width[x - 1 + dx], map.gap[y + dy], pair[dy][x - 1 + dx]?));
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

/// The colour bar, at x.
fn bar(root: &Drawing<'_>, x: i32) -> Drawn {
    let (left, top, bottom) = (x + 14, 34, PANEL[1] as i32);
    let y = |k: f64| bottom + ((top - bottom) as f64 * (k + END) / (2.0 * END)).round() as i32;
    const STEPS: i32 = 96;
    for i in 0..STEPS {
        let k = |i: i32| END * (2.0 * f64::from(i) / f64::from(STEPS) - 1.0);
        let box_ = [(left, y(k(i + 1))), (left + 18, y(k(i)))];
        root.draw(&Rectangle::new(box_, colour((k(i) + k(i + 1)) / 2.0).filled()))?;
    }
    root.draw(&Rectangle::new([(left, top), (left + 18, bottom)], BLACK.stroke_width(1)))?;
    let text = |size: i32| TextStyle::from(("sans-serif", size).into_font()).pos(Pos::new(HPos::Left, VPos::Center));
    for i in -2..=2 {
        let k = END * f64::from(i) / 2.0;
        let end = if i == -2 {
            "≤ "
        } else if i == 2 {
            "≥ "
        } else {
            ""
        };
        root.draw(&PathElement::new(vec![(left + 18, y(k)), (left + 22, y(k))], BLACK.stroke_width(1)))?;
        let sign = if i < 0 { "−" } else { "" };
        root.draw(&Text::new(format!("{end}{sign}{:.1}", k.abs()), (left + 26, y(k)), text(13)))?;
    }
    let turned = TextStyle::from(("sans-serif", 14).into_font().transform(FontTransform::Rotate270))
        .pos(Pos::new(HPos::Center, VPos::Center));
    root.draw(&Text::new("highlight contrast K", (left + 76, (top + bottom) / 2), turned))?;
    Ok(())
}
