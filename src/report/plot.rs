//! Plots, as SVG.

use crate::{
    metrics::{judge::Judge, profile::Curve},
    record::SceneRecord,
};
use plotters::{
    coord::Shift,
    prelude::{
        BLACK, ChartBuilder, Color, DrawingArea, IntoDrawingArea, IntoFont, LineSeries, PathElement, Polygon, RGBColor,
        SVGBackend, SeriesLabelPosition, ShapeStyle, WHITE,
    },
};

/// Okabe and Ito's colours, which colour-blind people can tell apart.
const PALETTE: [RGBColor; 5] = [
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
];

const SIZE: (u32, u32) = (832, 400);

/// The profiles of a scene along its transect, with pointwise 95 % bands.
pub fn profile(scene: &SceneRecord) -> Result<String, String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        draw(scene, &root).map_err(|e| e.to_string())?;
        root.present().map_err(|e| e.to_string())?;
    }
    Ok(svg)
}

type Drawing<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn draw(scene: &SceneRecord, root: &Drawing<'_>) -> Result<(), Box<dyn std::error::Error>> {
    root.fill(&WHITE)?;
    let (Some(&first), Some(&last)) = (scene.transect.first(), scene.transect.last()) else {
        return Ok(());
    };
    let top = scene.profiles.iter().flat_map(|c| c.hi.iter().flatten()).fold(1.0f64, |a, &b| a.max(b));
    let mut chart = ChartBuilder::on(root)
        .margin(12)
        .x_label_area_size(42)
        .y_label_area_size(54)
        .build_cartesian_2d(first..last, 0.0..(top * 1.04).min(1.6))?;
    chart
        .configure_mesh()
        .x_desc("t / R, along the transect")
        .y_desc("openness; occlusion ratio Q")
        .x_label_formatter(&|t| format!("{:.1}", if t.abs() < 1e-9 { 0.0 } else { *t }))
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .label_style(("sans-serif", 14).into_font())
        .axis_desc_style(("sans-serif", 15).into_font())
        .draw()?;
    let mut colours = PALETTE.iter();
    for curve in &scene.profiles {
        let colour = if curve.label == Judge::LABEL { BLACK } else { colours.next().copied().unwrap_or(BLACK) };
        let width = if curve.label == Judge::LABEL { 3 } else { 2 };
        let style = ShapeStyle { color: colour.to_rgba(), filled: true, stroke_width: width };
        let band = band(&scene.transect, curve);
        if !band.is_empty() {
            chart.draw_series(std::iter::once(Polygon::new(band, colour.mix(0.18).filled())))?;
        }
        let points: Vec<(f64, f64)> =
            scene.transect.iter().zip(&curve.value).filter_map(|(t, v)| Some((*t, (*v)?))).collect();
        chart
            .draw_series(LineSeries::new(points, style))?
            .label(curve.label.clone())
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 22, y)], style));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .label_font(("sans-serif", 14).into_font())
        .draw()?;
    Ok(())
}

/// The outline of a curve's interval.
fn band(transect: &[f64], curve: &Curve) -> Vec<(f64, f64)> {
    let side = |values: &[Option<f64>]| -> Vec<(f64, f64)> {
        transect.iter().zip(values).filter_map(|(t, v)| Some((*t, (*v)?))).collect()
    };
    let mut outline = side(&curve.lo);
    let mut back = side(&curve.hi);
    back.reverse();
    outline.extend(back);
    outline
}
