//! The legend: rows between the title and the frame, so that it never lies over curves.

use super::{
    sheet::{Anchor, INK, Sheet, Stroke, WIDTH, name, width_of},
    style::{Fill, Style},
};

const SIZE: f64 = 13.0;
const ROW: f64 = 21.0;
const LEFT: f64 = 14.0;
/// Where the first row is.
const TOP: f64 = 46.0;
/// What stands before an entry's text.
const SIGN: f64 = 34.0;
const GAP: f64 = 18.0;

/// What stands before a text.
pub(super) enum Sign {
    /// A piece of a curve with a marker.
    Curve(Style, f64),
    /// A marker.
    Marker(Style, Fill),
    /// A marker with its interval, lying or standing.
    Interval(Style),
    /// A line.
    Line { colour: &'static str, dash: &'static str },
    /// A field.
    Field(&'static str),
}

/// What is explained, in rows.
pub(super) struct Legend {
    entries: Vec<(Sign, String, [f64; 2])>,
    height: f64,
}

impl Legend {
    /// Lays out the entries from left to right, in as many rows as it takes.
    pub(super) fn new(entries: Vec<(Sign, String)>) -> Self {
        let (mut x, mut y) = (LEFT, TOP);
        let mut placed = Vec::new();
        for (sign, text) in entries {
            let text = name(&text);
            let width = SIGN + width_of(&text, SIZE) * 0.93 + GAP;
            if x > LEFT && x + width - GAP > WIDTH - LEFT {
                (x, y) = (LEFT, y + ROW);
            }
            placed.push((sign, text, [x, y]));
            x += width;
        }
        let height = if placed.is_empty() { TOP - ROW } else { y };
        Legend { entries: placed, height }
    }

    /// Where a frame may begin.
    pub(super) fn bottom(&self) -> f64 {
        self.height + 16.0
    }

    pub(super) fn draw(&self, sheet: &mut Sheet) {
        for (sign, text, [x, y]) in &self.entries {
            let middle = [x + 13.0, *y];
            let (from, to) = ([*x, *y], [x + 26.0, *y]);
            match sign {
                Sign::Curve(style, width) => {
                    sheet.line(from, to, Stroke::new(style.colour, *width).dashed(style.dash));
                    sheet.marker(middle, *style, Fill::Full, text);
                }
                Sign::Marker(style, fill) => sheet.marker(middle, *style, *fill, text),
                Sign::Interval(style) => {
                    sheet.line([x + 2.0, *y], [x + 24.0, *y], Stroke::new(style.colour, 1.4));
                    for end in [x + 2.0, x + 24.0] {
                        sheet.line([end, y - 3.0], [end, y + 3.0], Stroke::new(style.colour, 1.4));
                    }
                    sheet.marker(middle, *style, Fill::Full, text);
                }
                Sign::Line { colour, dash } => sheet.line(from, to, Stroke::new(colour, 1.8).dashed(dash)),
                Sign::Field(colour) => {
                    sheet.rectangle([*x, y - 7.0], [26.0, 14.0], colour, 1.0);
                    // Light fields need an edge on white.
                    let edge = [[*x, y - 7.0], [x + 26.0, y - 7.0], [x + 26.0, y + 7.0], [*x, y + 7.0], [*x, y - 7.0]];
                    sheet.curve(&edge, Stroke::new("#bbbbbb", 0.8), "");
                }
            }
            sheet.text([x + SIGN, y + 4.5], text, SIZE, Anchor::Start, INK);
        }
    }
}
