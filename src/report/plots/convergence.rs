//! How the error of each method falls with its rays.

use super::{
    frame::{Axis, Frame, is_drawn_log},
    legend::{Legend, Sign},
    renderers,
    sheet::{Anchor, GUIDE, INK, Sheet, Stroke, WIDTH, name},
    style::{Fill, Style},
};
use crate::{
    counted::counted,
    gate::CONFIDENCE,
    metrics::{convergence::Convergence, regions::Region},
    record::SceneRecord,
};
use std::collections::BTreeSet;

const FRAME: f64 = 300.0;

/// RMSE over rays of every estimator and renderer, both logarithmic, with 95 %
/// intervals and a guide of slope -1/2: over all pixels, and over the footprint.
///
/// # Errors
/// Why there is nothing to draw.
pub fn convergence(estimators: &[String], scene: &SceneRecord) -> Result<String, String> {
    let regions = [Region::All, Region::Footprint];
    let of = |region: Region| -> Vec<&Convergence> {
        scene.convergence.iter().filter(|c| c.region == region && points(c).next().is_some()).collect()
    };
    let panels: Vec<(Region, Vec<&Convergence>)> =
        regions.map(|r| (r, of(r))).into_iter().filter(|(_, found)| !found.is_empty()).collect();
    let all: Vec<&Convergence> = panels.iter().flat_map(|(_, found)| found.iter().copied()).collect();
    if all.is_empty() {
        return Err("no RMSE above 0 is known of any method here: it takes three replicates or more".to_owned());
    }
    let rays: BTreeSet<u32> = all.iter().flat_map(|c| points(c).map(|p| p.rays)).collect();
    let rays: Vec<u32> = rays.into_iter().collect();

    let mut entries: Vec<(Sign, String)> = Vec::new();
    let mut named: Vec<&str> = Vec::new();
    for c in &all {
        if !named.contains(&c.estimator.as_str()) {
            named.push(&c.estimator);
            entries.push((Sign::Marker(Style::of(estimators, &c.estimator), Fill::Full), c.estimator.clone()));
        }
    }
    let renderers = renderers(all.iter().map(|c| c.renderer.as_str()));
    entries.extend(renderers.into_iter().map(|(sign, _, text)| (sign, text)));
    entries.push((Sign::Line { colour: GUIDE, dash: "7 5" }, "slope −1/2: independent rays".to_owned()));
    let legend = Legend::new(entries);
    let top = legend.bottom() + 20.0;
    let title = format!("{}: error over rays, 95 % intervals", name(&scene.name));
    let mut sheet = Sheet::new(top + FRAME + 54.0, &title);
    legend.draw(&mut sheet);
    let share = WIDTH / panels.len() as f64;
    for (i, (region, found)) in panels.iter().enumerate() {
        let left = share * i as f64 + 78.0;
        let values = found.iter().flat_map(|c| points(c).flat_map(|p| [p.rmse, p.interval[0], p.interval[1]]));
        let frame = Frame {
            place: [left, top, share - 78.0 - 18.0, FRAME],
            x: Axis::log(rays.iter().map(|r| f64::from(*r)), Some(&rays)),
            y: Axis::log(values.filter(|v| is_drawn_log(*v)), None),
        };
        frame.grid(&mut sheet);
        guide(&mut sheet, &frame, found);
        for c in found {
            series(&mut sheet, &frame, Style::of(estimators, &c.estimator), c);
        }
        frame.axes(&mut sheet, "rays a pixel", "RMSE of openness");
        let heading = if *region == Region::All { "all pixels" } else { "under the occluder (footprint)" };
        sheet.text([left, top - 8.0], heading, 14.0, Anchor::Start, INK);
    }
    Ok(sheet.finish())
}

struct Place {
    rays: u32,
    rmse: f64,
    interval: [f64; 2],
}

/// What can be drawn of a method.
fn points(c: &Convergence) -> impl Iterator<Item = Place> + '_ {
    c.points.iter().filter(|p| p.rays > 0).filter_map(|p| {
        let rmse = p.rmse.value.filter(|v| is_drawn_log(*v))?;
        let interval = p.rmse.estimate().map_or([rmse; 2], |e| e.interval(CONFIDENCE));
        let [lo, hi] = interval.map(|v| if v.is_finite() { v } else { rmse });
        // An interval that reaches 0 has no end here: a decade of it is shown.
        Some(Place { rays: p.rays, rmse, interval: [lo.max(rmse / 10.0), hi] })
    })
}

/// Through the first point that is highest.
fn guide(sheet: &mut Sheet, frame: &Frame, found: &[&Convergence]) {
    let first = found.iter().flat_map(|c| points(c)).map(|p| p.rays).min();
    let starts = found.iter().flat_map(|c| points(c)).filter(|p| Some(p.rays) == first);
    let Some(start) = starts.max_by(|a, b| a.rmse.total_cmp(&b.rmse)) else { return };
    let [from, to] = frame.x.ends();
    let [least, most] = frame.y.ends();
    let at = |rays: f64| start.rmse * (rays / f64::from(start.rays)).powf(-0.5);
    // From where it enters the frame to where it leaves it.
    let rays_of = |rmse: f64| f64::from(start.rays) * (rmse / start.rmse).powi(-2);
    let (from, to) = (from.max(rays_of(most)), to.min(rays_of(least)));
    if from < to {
        sheet.line(frame.at(from, at(from)), frame.at(to, at(to)), Stroke::new(GUIDE, 1.4).dashed("7 5"));
    }
}

fn series(sheet: &mut Sheet, frame: &Frame, style: Style, c: &Convergence) {
    let fill = Fill::of_renderer(&c.renderer);
    let all: Vec<Place> = points(c).collect();
    let who = format!("{} on {}", name(&c.estimator), name(&c.renderer));
    let line: Vec<[f64; 2]> = all.iter().map(|p| frame.at(f64::from(p.rays), p.rmse)).collect();
    if line.len() > 1 {
        sheet.curve(&line, Stroke::new(style.colour, 1.6).dashed(fill.dash()), &who);
    }
    for (p, at) in all.iter().zip(line) {
        frame.interval(sheet, f64::from(p.rays), p.interval, style.colour);
        let tip = format!(
            "{who}, {}: {:.3e} ({:.2e} to {:.2e})",
            counted(p.rays, "ray", "rays"),
            p.rmse,
            p.interval[0],
            p.interval[1]
        );
        sheet.marker(at, style, fill, &tip);
    }
}
