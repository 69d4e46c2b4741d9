//! Letters drawn as strokes: names on pictures, numbers and titles beside them.

mod glyph;

use glam::Vec2;
use glyph::{Glyph, glyph, unknown};
use image::{Rgb, RgbImage};
use std::ops::Range;

/// Room between letters.
const GAP: f32 = 0.34;
/// How far letters reach above and below the baseline, in heights of an x.
const ABOVE: f32 = 1.65;
const BELOW: f32 = 0.5;

/// What letters are written with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ink {
    /// Grey of the strokes.
    pub grey: u8,
    /// Half the width of a stroke, in heights of an x.
    pub pen: f32,
    /// Width of a dark rim, in heights of an x.
    pub rim: f32,
}

impl Ink {
    /// White with a dark rim that makes it readable on white: for labels that lie on
    /// a picture.
    pub const WHITE: Ink = Ink { grey: 255, pen: 0.1, rim: 0.16 };
    /// Near black without a rim: for text on white.
    pub const BLACK: Ink = Ink { grey: 26, pen: 0.075, rim: 0.0 };
}

/// The letters of a text, each with its place; what there is no shape of is a box.
fn set(text: &str) -> (Vec<(f32, Glyph)>, f32) {
    let mut at = 0.0;
    let mut placed = Vec::new();
    for c in text.chars() {
        let glyph = glyph(c).unwrap_or_else(unknown);
        let width = glyph.width;
        placed.push((at, glyph));
        at += width + GAP;
    }
    (placed, (at - GAP).max(0.0))
}

/// The width of a text, in heights of an x.
pub fn width(text: &str) -> f32 {
    set(text).1
}

fn distance(p: Vec2, a: Vec2, b: Vec2) -> f32 {
    let ab = b - a;
    let t = ((p - a).dot(ab) / ab.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    p.distance(a + ab * t)
}

/// The pixels of `length` that lie between two places.
fn span(from: f32, to: f32, length: u32) -> Range<u32> {
    from.floor().max(0.0) as u32..(to.ceil().max(0.0) as u32).min(length)
}

/// Writes a text. `left` and `baseline` are pixels; `size` is the height of an x in
/// pixels; nothing is written outside the columns `within`, nor outside the picture.
pub fn write(picture: &mut RgbImage, text: &str, [left, baseline]: [f32; 2], size: f32, within: Range<u32>, ink: &Ink) {
    let (letters, width) = set(text);
    let margin = size * (ink.pen + ink.rim) + 1.0;
    let columns = span(left - margin, left + width * size + margin, within.end.min(picture.width()));
    let columns = columns.start.max(within.start)..columns.end;
    let rows = span(baseline - ABOVE * size - margin, baseline + BELOW * size + margin, picture.height());
    if columns.is_empty() || rows.is_empty() {
        return;
    }
    // How far each pixel is from the nearest stroke: a rim must not cover the
    // letter beside it.
    let across = columns.len();
    let mut distances = vec![f32::INFINITY; across * rows.len()];
    for (at, glyph) in letters {
        let from = left + at * size;
        let reach = span(from - 0.3 * size - margin, from + (glyph.width + 0.3) * size + margin, columns.end);
        for y in rows.clone() {
            for x in reach.start.max(columns.start)..reach.end {
                let p = Vec2::new(x as f32 + 0.5 - from, baseline - y as f32 - 0.5) / size;
                let ends = glyph.strokes.iter().flat_map(|s| s.windows(2));
                let d = &mut distances[(y - rows.start) as usize * across + (x - columns.start) as usize];
                *d = ends.fold(*d, |d, ends| d.min(distance(p, ends[0], ends[1])));
            }
        }
    }
    for (i, d) in distances.into_iter().enumerate() {
        // A pixel's worth of soft edge.
        let covered = |radius: f32| ((radius - d) * size + 0.5).clamp(0.0, 1.0);
        let rim = if ink.rim > 0.0 { covered(ink.pen + ink.rim) * 0.6 } else { 0.0 };
        let stroke = covered(ink.pen);
        let pixel = picture.get_pixel_mut(columns.start + (i % across) as u32, rows.start + (i / across) as u32);
        let shade = |c: u8| (f32::from(c) * (1.0 - rim)) * (1.0 - stroke) + f32::from(ink.grey) * stroke;
        *pixel = Rgb(pixel.0.map(|c| shade(c).round() as u8));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_white_and_stay_within_their_columns() {
        let mut picture = RgbImage::from_pixel(60, 30, Rgb([128; 3]));
        write(&mut picture, "lol", [5.0, 25.0], 10.0, 0..20, &Ink::WHITE);
        assert_eq!(picture.get_pixel(5, 15).0, [255; 3], "on the stroke of the first l");
        assert_eq!(picture.get_pixel(13, 20).0, [128; 3], "inside the o");
        assert!((20..60).all(|x| (0..30).all(|y| picture.get_pixel(x, y).0 == [128; 3])));
    }

    #[test]
    fn dark_letters_have_no_rim() {
        let mut picture = RgbImage::from_pixel(40, 30, Rgb([255; 3]));
        write(&mut picture, "l", [20.0, 25.0], 10.0, 0..40, &Ink::BLACK);
        assert!(picture.get_pixel(19, 15).0[0] < 100);
        assert!((0..30).all(|y| (0..17).chain(23..40).all(|x| picture.get_pixel(x, y).0 == [255; 3])));
    }

    #[test]
    fn a_text_outside_the_picture_is_no_harm() {
        let mut picture = RgbImage::from_pixel(8, 4, Rgb([255; 3]));
        for place in [[-100.0, 2.0], [100.0, 2.0], [2.0, -100.0], [2.0, 100.0], [f32::NAN, 0.0]] {
            write(&mut picture, "AO", place, 8.0, 0..8, &Ink::BLACK);
        }
        assert!(picture.pixels().all(|p| p.0 == [255; 3]));
        write(&mut picture, "", [2.0, 2.0], 8.0, 0..8, &Ink::BLACK);
        write(&mut picture, "\u{1f642}", [2.0, 3.0], 2.0, 0..8, &Ink::BLACK);
        assert!(picture.pixels().any(|p| p.0 != [255; 3]), "a box");
        assert_eq!(width(""), 0.0);
    }
}
