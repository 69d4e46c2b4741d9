//! What a method costs, against how good it is.

use super::{
    frame::{Axis, Frame, is_drawn, is_drawn_log},
    legend::{Legend, Sign},
    renderers,
    sheet::{Anchor, INK, Sheet, Stroke, WIDTH, name, width_of},
    style::{Fill, Style},
};
use crate::{
    counted::counted,
    gate::CONFIDENCE,
    pooled::{Pool, Pooled},
    record::Record,
};

const FRAME: f64 = 300.0;

/// What a panel shows.
struct Quality {
    heading: &'static str,
    label: &'static str,
    of: fn(&Pooled) -> &Pool,
    is_log: bool,
}

const QUALITIES: [Quality; 2] = [
    Quality {
        heading: "against the light (judge)",
        label: "mean |dK| over scenes",
        of: |p| &p.contrast_error_size,
        is_log: false,
    },
    Quality {
        heading: "against its own converged image",
        label: "RMSE under occluders",
        of: |p| &p.rmse,
        is_log: true,
    },
];

struct Point<'a> {
    row: &'a Pooled,
    milliseconds: f64,
    /// How many are in it.
    scenes: usize,
    value: f64,
    interval: [f64; 2],
}

/// Milliseconds of a replicate against mean |dK| and RMSE with their 95 % intervals, over
/// the scenes that are pooled, a point an estimator, renderer and ray count.
///
/// # Errors
/// Why there is nothing to draw.
pub fn cost(record: &Record) -> Result<String, String> {
    let panels: Vec<(&Quality, Vec<Point<'_>>)> =
        QUALITIES.iter().map(|q| (q, points(record, q))).filter(|(_, points)| !points.is_empty()).collect();
    if panels.is_empty() {
        return Err("no scene with an occluder has both an error and a time".to_owned());
    }
    let all = || panels.iter().flat_map(|(_, points)| points);
    let mut entries = Vec::new();
    for (i, estimator) in record.suite.estimators.iter().enumerate() {
        if all().any(|p| p.row.estimator == *estimator) {
            entries.push((Sign::Marker(Style::nth(i), Fill::Full), estimator.clone()));
        }
    }
    entries.extend(renderers(all().map(|p| p.row.renderer.as_str())).into_iter().map(|(sign, renderer, text)| {
        // Over other scenes means do not compare: it is said how many they are.
        let scenes = || all().filter(|p| p.row.renderer == renderer).map(|p| p.scenes);
        let (least, most) = (scenes().min().unwrap_or(0), scenes().max().unwrap_or(0));
        let count = if least == most { most.to_string() } else { format!("{least} to {most}") };
        (sign, format!("{text}, {count} scene{}", if most == 1 { "" } else { "s" }))
    }));
    let legend = Legend::new(entries);
    let top = legend.bottom() + 20.0;
    let mut sheet =
        Sheet::new(top + FRAME + 54.0, "Cost against error, 95 % intervals; numbers at points are rays a pixel");
    legend.draw(&mut sheet);
    let share = WIDTH / panels.len() as f64;
    for (i, (quality, points)) in panels.iter().enumerate() {
        let left = share * i as f64 + 78.0;
        let place = [left, top, share - 78.0 - 22.0, FRAME];
        let ends = || points.iter().flat_map(|p| [p.value, p.interval[0], p.interval[1]]);
        let y = if quality.is_log {
            Axis::log(ends(), None)
        } else {
            Axis::linear(ends().map(|v| v.max(0.0)).chain([0.0]), 0.03, 6.0)
        };
        let frame = Frame { place, x: Axis::log(points.iter().map(|p| p.milliseconds), None), y };
        frame.grid(&mut sheet);
        draw(&mut sheet, &frame, &record.suite.estimators, points);
        frame.axes(&mut sheet, "ms a replicate of the measure view", quality.label);
        sheet.text([left, top - 8.0], quality.heading, 14.0, Anchor::Start, INK);
    }
    Ok(sheet.finish())
}

fn points<'a>(record: &'a Record, quality: &Quality) -> Vec<Point<'a>> {
    let point = |row: &'a Pooled| {
        let pool = (quality.of)(row);
        let e = pool.pooled.estimate()?;
        let milliseconds = milliseconds(record, row, &pool.scenes)?;
        let drawn = if quality.is_log { is_drawn_log(e.value) } else { is_drawn(e.value) };
        let [lo, hi] = e.interval(CONFIDENCE).map(|v| if is_drawn(v) { v } else { e.value });
        let lo = if quality.is_log { lo.max(e.value / 10.0) } else { lo };
        let scenes = pool.scenes.len();
        (drawn && is_drawn_log(milliseconds)).then_some(Point {
            row,
            scenes,
            milliseconds,
            value: e.value,
            interval: [lo, hi],
        })
    };
    record.pooled.iter().filter_map(point).collect()
}

/// Mean time of a replicate over these scenes.
fn milliseconds(record: &Record, row: &Pooled, scenes: &[String]) -> Option<f64> {
    let of = |scene: &String| {
        let case = record.cases.iter().find(|c| {
            let case = &c.case;
            case.scene == *scene
                && case.estimator == row.estimator
                && case.renderer == row.renderer
                && case.rays == row.rays
        })?;
        record.milliseconds(case)
    };
    let times: Vec<f64> = scenes.iter().filter_map(of).collect();
    (!times.is_empty()).then(|| times.iter().sum::<f64>() / times.len() as f64)
}

/// The points, those of one estimator and renderer joined in the order of their rays.
fn draw(sheet: &mut Sheet, frame: &Frame, estimators: &[String], points: &[Point<'_>]) {
    let mut keys: Vec<(&str, &str)> = Vec::new();
    for p in points {
        let key = (p.row.estimator.as_str(), p.row.renderer.as_str());
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    let mut tags = Vec::new();
    for (estimator, renderer) in keys {
        let own = |p: &&Point<'_>| p.row.estimator == estimator && p.row.renderer == renderer;
        let mut own: Vec<&Point<'_>> = points.iter().filter(own).collect();
        own.sort_by_key(|p| p.row.rays);
        let (style, fill) = (Style::of(estimators, estimator), Fill::of_renderer(renderer));
        let line: Vec<[f64; 2]> = own.iter().map(|p| frame.at(p.milliseconds, p.value)).collect();
        if line.len() > 1 {
            let who = format!("{} on {}", name(estimator), name(renderer));
            sheet.curve(&line, Stroke::new(style.colour, 1.0).dashed(fill.dash()), &who);
        }
        for (p, [x, y]) in own.into_iter().zip(line) {
            frame.interval(sheet, p.milliseconds, p.interval, style.colour);
            let who = format!("{} on {}, {}", name(estimator), name(renderer), counted(p.row.rays, "ray", "rays"));
            let [lo, hi] = p.interval;
            let tip = format!("{who}: {:.3} ms, {:.3e} ({lo:.2e} to {hi:.2e})", p.milliseconds, p.value);
            sheet.marker([x, y], style, fill, &tip);
            tags.push((p.row.rays, [x, y]));
        }
    }
    tag(sheet, &tags);
}

/// Writes ray counts beside their points, where they cover neither another count nor
/// another point; where there is no room, a pointer shows them.
fn tag(sheet: &mut Sheet, tags: &[(u32, [f64; 2])]) {
    const SIZE: f64 = 11.0;
    let mut taken: Vec<[f64; 4]> = tags.iter().map(|(_, [x, y])| [x - 5.0, y - 5.0, x + 5.0, y + 5.0]).collect();
    for (i, (rays, [x, y])) in tags.iter().enumerate() {
        let text = rays.to_string();
        let width = width_of(&text, SIZE);
        let starts = [[x + 7.0, y - 5.0], [x + 7.0, y + 13.0], [x - 7.0 - width, y - 5.0], [x - 7.0 - width, y + 13.0]];
        let room = starts.into_iter().find(|[left, bottom]| {
            let own = [*left, bottom - 9.0, left + width, *bottom];
            let meets =
                |other: &[f64; 4]| own[0] < other[2] && other[0] < own[2] && own[1] < other[3] && other[1] < own[3];
            !taken.iter().enumerate().any(|(j, other)| j != i && meets(other))
        });
        if let Some([left, bottom]) = room {
            taken.push([left, bottom - 9.0, left + width, bottom]);
            sheet.text([left, bottom], &text, SIZE, Anchor::Start, INK);
        }
    }
}
