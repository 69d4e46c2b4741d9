//! A white sheet of SVG, in pixels. All text that reaches it is text, whatever it holds;
//! the bytes depend on what is drawn alone.

use super::style::{Fill, Style};
use crate::untrusted;
use svg::{
    Document, Node,
    node::element::{Circle, Line, Polygon, Polyline, Rectangle, Text, Title},
};

/// Width of every plot: that of GitHub's column of text.
pub(super) const WIDTH: f64 = 832.0;

/// Ink of axes and words.
pub(super) const INK: &str = "#333333";
/// Lines of the grid.
pub(super) const GRID: &str = "#e3e3e3";
/// Guides, and what is beside the matter.
pub(super) const GUIDE: &str = "#767676";

/// Characters of a name at most; the rest is cut.
const LONGEST: usize = 48;

/// A line's look.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke<'a> {
    pub(super) colour: &'a str,
    pub(super) width: f64,
    pub(super) dash: &'a str,
}

impl<'a> Stroke<'a> {
    pub(super) fn new(colour: &'a str, width: f64) -> Self {
        Stroke { colour, width, dash: "" }
    }

    pub(super) fn dashed(self, dash: &'a str) -> Self {
        Stroke { dash, ..self }
    }
}

/// Which end of a text is where it is put.
#[derive(Clone, Copy, Debug)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// What is drawn so far.
pub(super) struct Sheet {
    document: Document,
}

/// Hundredths of a pixel are enough, and the same on every machine.
pub(super) fn round(v: f64) -> f64 {
    // Adding 0 takes the sign from a zero.
    (v * 100.0).round() / 100.0 + 0.0
}

fn places(points: &[[f64; 2]]) -> String {
    points.iter().map(|[x, y]| format!("{},{}", round(*x), round(*y))).collect::<Vec<_>>().join(" ")
}

/// A name as it is shown: on one line, not too long.
pub(super) fn name(text: &str) -> String {
    let line = untrusted::line(text);
    let mut short: String = line.chars().take(LONGEST).collect();
    if short.len() < line.len() {
        short.push('…');
    }
    short
}

/// Width of a text, pixels, rather too large than too small: what fonts there will be
/// is not known.
pub(super) fn width_of(text: &str, size: f64) -> f64 {
    let wide = |c: char| if u32::from(c) < 0x2e80 { 0.6 } else { 1.05 };
    text.chars().map(wide).sum::<f64>() * size
}

impl Sheet {
    /// A sheet with a title at its top, read out where pictures are not seen.
    pub(super) fn new(height: f64, title: &str) -> Self {
        let title = untrusted::line(title);
        let document = Document::new()
            .set("width", round(WIDTH))
            .set("height", round(height))
            .set("viewBox", format!("0 0 {} {}", round(WIDTH), round(height)))
            .set("role", "img")
            .set("font-family", "Arial, Helvetica, Liberation Sans, sans-serif")
            .add(Title::new(title.clone()));
        let mut sheet = Sheet { document };
        sheet.rectangle([0.0, 0.0], [WIDTH, height], "#ffffff", 1.0);
        sheet.text([12.0, 24.0], &title, 16.0, Anchor::Start, "#000000");
        sheet
    }

    fn add(&mut self, node: impl Into<Box<dyn Node>>) {
        self.document.append(node);
    }

    pub(super) fn rectangle(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], colour: &str, opacity: f64) {
        let mut node = Rectangle::new().set("x", round(x)).set("y", round(y)).set("fill", colour);
        node = node.set("width", round(width.max(0.0))).set("height", round(height.max(0.0)));
        if opacity < 1.0 {
            node = node.set("fill-opacity", opacity);
        }
        self.add(node);
    }

    pub(super) fn line(&mut self, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2], stroke: Stroke<'_>) {
        let mut node = Line::new().set("x1", round(x1)).set("y1", round(y1)).set("x2", round(x2)).set("y2", round(y2));
        node = node.set("stroke", stroke.colour).set("stroke-width", stroke.width);
        if !stroke.dash.is_empty() {
            node = node.set("stroke-dasharray", stroke.dash);
        }
        self.add(node);
    }

    /// A curve; the text is shown where a pointer rests on it.
    pub(super) fn curve(&mut self, points: &[[f64; 2]], stroke: Stroke<'_>, tip: &str) {
        let mut node = Polyline::new().set("points", places(points)).set("fill", "none");
        node = node.set("stroke", stroke.colour).set("stroke-width", stroke.width).set("stroke-linejoin", "round");
        if !stroke.dash.is_empty() {
            node = node.set("stroke-dasharray", stroke.dash);
        }
        if !tip.is_empty() {
            node = node.add(Title::new(untrusted::line(tip)));
        }
        self.add(node);
    }

    pub(super) fn area(&mut self, points: &[[f64; 2]], colour: &str, opacity: f64) {
        self.add(Polygon::new().set("points", places(points)).set("fill", colour).set("fill-opacity", opacity));
    }

    /// A marker; the text is shown where a pointer rests on it.
    pub(super) fn marker(&mut self, [x, y]: [f64; 2], style: Style, fill: Fill, tip: &str) {
        let radius = fill.radius();
        let corners = style.shape.corners();
        let (inside, edge) = match fill {
            Fill::Full => (style.colour, 0.0),
            Fill::Hollow | Fill::Dotted => ("#ffffff", 1.8),
        };
        let tip = Title::new(untrusted::line(tip));
        // What is behind a hollow marker shows through.
        let opacity = if fill == Fill::Full { 1.0 } else { 0.0 };
        if corners.is_empty() {
            let node = Circle::new().set("cx", round(x)).set("cy", round(y)).set("r", radius).set("fill", inside);
            let node = node.set("fill-opacity", opacity).set("stroke", style.colour).set("stroke-width", edge);
            self.add(node.add(tip));
        } else {
            let points: Vec<[f64; 2]> = corners.iter().map(|c| [x + radius * c[0], y + radius * c[1]]).collect();
            let node = Polygon::new().set("points", places(&points)).set("fill", inside);
            let node = node.set("fill-opacity", opacity).set("stroke", style.colour).set("stroke-width", edge);
            self.add(node.add(tip));
        }
        if fill == Fill::Dotted {
            self.add(Circle::new().set("cx", round(x)).set("cy", round(y)).set("r", 1.6).set("fill", style.colour));
        }
    }

    pub(super) fn text(&mut self, [x, y]: [f64; 2], text: &str, size: f64, anchor: Anchor, colour: &str) {
        self.add(written(text, size, anchor, colour).set("x", round(x)).set("y", round(y)));
    }

    /// Text that climbs.
    pub(super) fn turned(&mut self, [x, y]: [f64; 2], text: &str, size: f64) {
        let [x, y] = [round(x), round(y)];
        let node = written(text, size, Anchor::Middle, INK).set("x", x).set("y", y);
        self.add(node.set("transform", format!("rotate(-90 {x} {y})")));
    }

    /// The SVG.
    pub(super) fn finish(self) -> String {
        format!("{}\n", self.document)
    }
}

fn written(text: &str, size: f64, anchor: Anchor, colour: &str) -> Text {
    let anchor = match anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    Text::new(untrusted::line(text)).set("font-size", size).set("text-anchor", anchor).set("fill", colour)
}
