//! Openness, or light, along the transect of a scene: the paper's Fig. 3, measured.

use super::{
    frame::{Axis, Frame, is_drawn},
    legend::{Legend, Sign},
    sheet::{Sheet, Stroke, WIDTH, name},
    style::{Fill, Style},
};
use crate::{
    layers::Layers,
    metrics::{judge::Judge, profile::Curve, regions::Region},
    record::SceneRecord,
};

const FRAME: f64 = 320.0;
const UNDER: &str = "#dcdcdc";
const BESIDE: &str = "#f1f1f1";
const BLACK: &str = "#000000";

/// Values above this are not drawn: Q over a mirror would flatten all else.
const HIGHEST: f64 = 1.6;

/// Markers along a curve.
const MARKERS: usize = 9;

/// The columns of the measure view that a region has pixels in, from and to, in R along
/// the transect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ranges {
    under: Vec<[f64; 2]>,
    beside: Vec<[f64; 2]>,
}

impl Ranges {
    /// From the masks in the scene's image of regions.
    pub fn new(scene: &SceneRecord, regions: &Layers) -> Self {
        let of = |region: Region| {
            let mask = regions.get(&format!("region-{}", region.label())).unwrap_or_default();
            ranges(&scene.transect, mask)
        };
        let mut beside = of(Region::Left);
        beside.extend(of(Region::Right));
        Ranges { under: of(Region::Footprint), beside }
    }
}

fn ranges(transect: &[f64], mask: &[f32]) -> Vec<[f64; 2]> {
    let width = transect.len();
    let half = match transect {
        [a, b, ..] => (b - a).abs() / 2.0,
        _ => return vec![],
    };
    let is_in = |column: usize| mask.iter().skip(column).step_by(width).any(|v| *v > 0.5);
    let mut found: Vec<[f64; 2]> = Vec::new();
    let mut open = false;
    for (column, t) in transect.iter().enumerate() {
        let inside = is_in(column);
        match found.last_mut() {
            Some(last) if inside && open => last[1] = t + half,
            _ if inside => found.push([t - half, t + half]),
            _ => {}
        }
        open = inside;
    }
    found
}

/// The profiles of a scene along its transect with pointwise 95 % intervals, Q in
/// black, and where the occluder stands.
///
/// # Errors
/// Why there is nothing to draw.
pub fn profile(estimators: &[String], scene: &SceneRecord, ranges: &Ranges) -> Result<String, String> {
    let drawn = |c: &&Curve| c.value.iter().flatten().any(|v| is_drawn(*v));
    let curves: Vec<&Curve> = scene.profiles.iter().filter(drawn).collect();
    if curves.is_empty() || scene.transect.len() < 2 {
        return Err("the record holds no profile of this scene: its cases ended with errors".to_owned());
    }
    let look = |c: &Curve| match c.label == Judge::LABEL {
        true => (Style { colour: BLACK, dash: "", shape: Style::nth(0).shape }, 2.8),
        false => (Style::of(estimators, &c.label), 1.8),
    };
    let mut entries: Vec<(Sign, String)> = Vec::new();
    for curve in &curves {
        let (style, width) = look(curve);
        entries.push(if curve.label == Judge::LABEL {
            (Sign::Line { colour: BLACK, dash: "" }, "Q, what it does to the light".to_owned())
        } else {
            let light = if curve.light { ", light" } else { "" };
            (Sign::Curve(style, width), format!("{}{light}", curve.label))
        });
    }
    for (ranges, colour, text) in [(&ranges.under, UNDER, "under the occluder"), (&ranges.beside, BESIDE, "its flanks")]
    {
        if !ranges.is_empty() {
            entries.push((Sign::Field(colour), text.to_owned()));
        }
    }
    let legend = Legend::new(entries);
    let top = legend.bottom();
    let highest = curves.iter().flat_map(|c| c.value.iter().chain(&c.hi).flatten()).copied().filter(|v| is_drawn(*v));
    let highest = highest.fold(1.0, f64::max).min(HIGHEST) * 1.04;
    let frame = Frame {
        place: [70.0, top, WIDTH - 70.0 - 18.0, FRAME],
        x: Axis::linear(scene.transect.iter().copied(), 0.0, 9.0),
        y: Axis::linear([0.0, highest].into_iter(), 0.0, 7.0),
    };
    let title = format!("{}: {} along the transect, 95 % bands", name(&scene.name), along(&scene.profiles));
    let mut sheet = Sheet::new(top + FRAME + 54.0, &title);
    legend.draw(&mut sheet);
    for (ranges, colour) in [(&ranges.beside, BESIDE), (&ranges.under, UNDER)] {
        for [from, to] in ranges {
            let (left, right) = (frame.across(*from), frame.across(*to));
            sheet.rectangle([left, top], [right - left, FRAME], colour, 1.0);
        }
    }
    frame.grid(&mut sheet);
    for (i, curve) in curves.iter().enumerate() {
        let (style, width) = look(curve);
        draw(&mut sheet, &frame, scene, curve, (style, width, i));
    }
    let what = match shown(&scene.profiles) {
        [_, false] => "openness O",
        [false, true] => "light / flank",
        [true, true] => "O, light / flank",
    };
    let judge = if scene.judge.is_some() { ", occlusion ratio Q" } else { "" };
    frame.axes(&mut sheet, "place t / R along the transect", &format!("{what}{judge}"));
    Ok(sheet.finish())
}

/// What the curves of methods are, in a word or two.
pub fn along(curves: &[Curve]) -> &'static str {
    match shown(curves) {
        [_, false] => "openness",
        [false, true] => "light",
        [true, true] => "openness and light",
    }
}

/// Whether any curve of a method is openness, and whether any is light.
fn shown(curves: &[Curve]) -> [bool; 2] {
    [false, true].map(|light| curves.iter().any(|c| c.label != Judge::LABEL && c.light == light))
}

/// Band, curve and markers, a piece between holes at a time.
fn draw(
    sheet: &mut Sheet,
    frame: &Frame,
    scene: &SceneRecord,
    curve: &Curve,
    (style, width, nth): (Style, f64, usize),
) {
    let at = |list: &[Option<f64>], i: usize| list.get(i).copied().flatten().filter(|v| is_drawn(*v));
    let columns: Vec<usize> = (0..scene.transect.len()).collect();
    let known = |i: &usize| at(&curve.value, *i).is_some();
    for piece in columns.chunk_by(|a, b| known(a) == known(b)).filter(|piece| known(&piece[0])) {
        let side = |list: &[Option<f64>]| -> Vec<[f64; 2]> {
            piece.iter().filter_map(|&i| Some(frame.at(scene.transect[i], at(list, i)?))).collect()
        };
        let (mut band, back) = (side(&curve.lo), side(&curve.hi));
        band.extend(back.into_iter().rev());
        if band.len() > 2 {
            sheet.area(&band, style.colour, 0.18);
        }
        let stroke = Stroke::new(style.colour, width).dashed(style.dash);
        sheet.curve(&side(&curve.value), stroke, &name(&curve.label));
    }
    if curve.label == Judge::LABEL {
        return;
    }
    // Curves that lie on each other show their markers at different places.
    let every = (scene.transect.len() / MARKERS).max(1);
    for i in columns.into_iter().skip(every / 2 + nth * every / 7 % every).step_by(every) {
        if let Some(v) = at(&curve.value, i) {
            let tip = format!("{}: {v:.4} at t = {:.2} R", name(&curve.label), scene.transect[i]);
            sheet.marker(frame.at(scene.transect[i], v), style, Fill::Full, &tip);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_whole_columns() {
        let transect = [-1.0, -0.5, 0.0, 0.5, 1.0];
        let mask = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        assert_eq!(ranges(&transect, &mask), [[-1.25, -0.25], [0.75, 1.25]]);
        assert_eq!((ranges(&transect, &[]), ranges(&[], &mask)), (vec![], vec![]));
    }
}
