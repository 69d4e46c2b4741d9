//! The contrast error of every method, scene by scene.

use super::{
    best,
    frame::{Axis, Frame, is_drawn},
    legend::{Legend, Sign},
    sheet::{Anchor, GRID, INK, Sheet, Stroke, WIDTH, name, width_of},
    style::{Fill, Style},
};
use crate::{gate::CONFIDENCE, metrics::MetricName, record::Record};

/// Names of scenes take this at most, pixels.
const NAMES: f64 = 230.0;

/// Where many scenes are, rows draw together.
const MANY: usize = 12;

struct Row<'a> {
    scene: &'a str,
    control: bool,
    dots: Vec<Dot>,
}

struct Dot {
    style: Style,
    who: String,
    value: f64,
    interval: [f64; 2],
}

/// dK of every estimator with its 95 % interval, a row a scene, around the line where it
/// is right. Of each estimator the case of the most rays, on the CPU where it ran there;
/// markers of control scenes are hollow.
///
/// # Errors
/// Why there is nothing to draw.
pub fn contrast_error(record: &Record) -> Result<String, String> {
    let rows = rows(record);
    if rows.is_empty() {
        return Err("no case has a contrast error dK: it needs a scene with an occluder and its judge".to_owned());
    }
    let estimators = &record.suite.estimators;
    let dots = || rows.iter().flat_map(|r| &r.dots);
    let mut entries = Vec::new();
    for (i, estimator) in estimators.iter().enumerate() {
        let style = Style::nth(i);
        if dots().any(|d| d.style == style) {
            entries.push((Sign::Interval(style), estimator.clone()));
        }
    }
    if rows.iter().any(|r| r.control) {
        entries.push((Sign::Marker(Style { colour: INK, ..Style::nth(0) }, Fill::Hollow), "control scene".to_owned()));
    }
    let legend = Legend::new(entries);
    let top = legend.bottom() + 6.0;
    let pitch = if rows.len() > MANY { 7.0 } else { 10.0 };
    let most = rows.iter().map(|r| r.dots.len()).max().unwrap_or(1);
    let row = (most as f64 * pitch + 10.0).max(24.0);
    let left = 24.0 + rows.iter().map(|r| width_of(&label(r), 13.0)).fold(0.0, f64::max).min(NAMES);
    let height = row * rows.len() as f64;
    let frame = Frame {
        place: [left, top, WIDTH - left - 20.0, height],
        x: Axis::linear(extent(&rows).into_iter(), 0.04, 9.0),
        y: Axis::linear([0.0, 1.0].into_iter(), 0.0, 1.0),
    };
    let mut sheet = Sheet::new(top + height + 54.0, "Contrast error dK by estimator, 95 % intervals");
    legend.draw(&mut sheet);
    for (i, r) in rows.iter().enumerate() {
        let y = top + row * i as f64;
        if i % 2 == 0 {
            sheet.rectangle([left, y], [frame.place[2], row], "#f7f7f7", 1.0);
        }
        sheet.text([left - 10.0, y + row / 2.0 + 4.5], &label(r), 13.0, Anchor::End, INK);
    }
    ticks(&mut sheet, &frame);
    let zero = frame.across(0.0);
    sheet.line([zero, top], [zero, top + height], Stroke::new(INK, 1.6));
    for (i, r) in rows.iter().enumerate() {
        let first = top + row * i as f64 + (row - pitch * (r.dots.len() - 1) as f64) / 2.0;
        for (j, dot) in r.dots.iter().enumerate() {
            draw(&mut sheet, &frame, r, dot, first + pitch * j as f64);
        }
    }
    sheet.line([left, top + height], [WIDTH - 20.0, top + height], Stroke::new(INK, 1.2));
    let middle = left + frame.place[2] / 2.0;
    let words =
        "← highlight lost, or too dark\u{2003}\u{2003}contrast error dK = K − K(Q)\u{2003}\u{2003}false highlight →";
    sheet.text([middle, top + height + 40.0], words, 14.0, Anchor::Middle, INK);
    Ok(sheet.finish())
}

fn label(row: &Row<'_>) -> String {
    let name = name(row.scene);
    if row.control { format!("{name} (control)") } else { name }
}

fn rows(record: &Record) -> Vec<Row<'_>> {
    let estimators = &record.suite.estimators;
    let dot = |scene: &str, i: usize, estimator: &String| {
        let value = |c: &crate::record::CaseRecord| {
            let e = c.metric(MetricName::ContrastError, None)?.estimate()?;
            is_drawn(e.value).then_some(e)
        };
        let own = record.cases.iter().filter(|c| c.case.scene == scene && c.case.estimator == *estimator);
        let case = best(own.filter(|c| value(c).is_some()))?;
        let e = value(case)?;
        let [lo, hi] = e.interval(CONFIDENCE);
        let style = Style::nth(i);
        let who = format!("{}: dK = {:.4} ({lo:.4} to {hi:.4})", name(&case.case.id()), e.value);
        Some(Dot { style, who, value: e.value, interval: [lo, hi] })
    };
    let row = |s: &'_ crate::record::SceneRecord| -> Vec<Dot> {
        estimators.iter().enumerate().filter_map(|(i, e)| dot(&s.name, i, e)).collect()
    };
    let all = record.scenes.iter().map(|s| Row { scene: &s.name, control: s.control, dots: row(s) });
    all.filter(|r| !r.dots.is_empty()).collect()
}

/// What the axis must hold: 0, all values, and of their intervals as much as does not
/// press the values together.
fn extent(rows: &[Row<'_>]) -> Vec<f64> {
    let dots = || rows.iter().flat_map(|r| &r.dots);
    let (lo, hi) = dots().fold((0.0f64, 0.0f64), |(lo, hi), d| (lo.min(d.value), hi.max(d.value)));
    let more = (hi - lo).max(0.05);
    let ends = dots().flat_map(|d| d.interval).map(|v| v.clamp(lo - more, hi + more));
    ends.chain([lo, hi]).collect()
}

fn ticks(sheet: &mut Sheet, frame: &Frame) {
    let [_, top, _, height] = frame.place;
    for (x, text) in frame.x_ticks() {
        sheet.line([x, top], [x, top + height], Stroke::new(GRID, 1.0));
        sheet.text([x, top + height + 18.0], text, 13.0, Anchor::Middle, INK);
    }
}

fn draw(sheet: &mut Sheet, frame: &Frame, row: &Row<'_>, dot: &Dot, y: f64) {
    let stroke = Stroke::new(dot.style.colour, 1.4);
    let [lo, hi] = dot.interval.map(|v| frame.across(v));
    sheet.line([lo, y], [hi, y], stroke);
    let [from, to] = frame.x.ends();
    for (x, v) in [(lo, dot.interval[0]), (hi, dot.interval[1])] {
        if (from..=to).contains(&v) {
            sheet.line([x, y - 3.0], [x, y + 3.0], stroke);
        }
    }
    let fill = if row.control { Fill::Hollow } else { Fill::Full };
    sheet.marker([frame.across(dot.value), y], dot.style, fill, &dot.who);
}
