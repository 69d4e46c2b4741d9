//! Letters drawn as strokes, for the names of methods on pictures.

use glam::Vec2;
use image::{Rgb, RgbImage};

/// Half the width of a stroke, in heights of an x.
const PEN: f32 = 0.1;
/// The dark rim that makes white letters readable on white.
const RIM: f32 = 0.16;
/// Room between letters.
const GAP: f32 = 0.34;

/// A letter: its width and its strokes, each a line through points; the baseline
/// at 0 and an x of height 1.
struct Letter {
    width: f32,
    strokes: Vec<Vec<Vec2>>,
}

fn line(points: &[[f32; 2]]) -> Vec<Vec2> {
    points.iter().map(|&p| Vec2::from(p)).collect()
}

/// Part of an ellipse, degrees counter-clockwise from the right.
fn arc(center: [f32; 2], [rx, ry]: [f32; 2], from: f32, to: f32) -> Vec<Vec2> {
    let at = |i: u8| (from + (to - from) * f32::from(i) / 32.0).to_radians();
    (0..=32).map(|i| Vec2::from(center) + Vec2::new(rx * at(i).cos(), ry * at(i).sin())).collect()
}

/// The letters that names of methods are made of.
fn letter(c: char) -> Option<Letter> {
    let bowl = || arc([0.5, 0.5], [0.5; 2], 0.0, 360.0);
    let (width, strokes) = match c {
        ' ' => (0.3, vec![]),
        '-' => (0.5, vec![line(&[[0.0, 0.5], [0.5, 0.5]])]),
        'A' => (1.2, vec![line(&[[0.0, 0.0], [0.6, 1.5], [1.2, 0.0]]), line(&[[0.2, 0.5], [1.0, 0.5]])]),
        'O' => (1.4, vec![arc([0.7, 0.75], [0.7, 0.75], 0.0, 360.0)]),
        'a' => (1.0, vec![bowl(), line(&[[1.0, 1.0], [1.0, 0.0]])]),
        'b' => (1.0, vec![bowl(), line(&[[0.0, 1.5], [0.0, 0.0]])]),
        'c' => (0.86, vec![arc([0.5, 0.5], [0.5; 2], 45.0, 315.0)]),
        'd' => (1.0, vec![bowl(), line(&[[1.0, 1.5], [1.0, 0.0]])]),
        'e' => (1.0, vec![line(&[[0.0, 0.5], [1.0, 0.5]]), arc([0.5, 0.5], [0.5; 2], 0.0, 315.0)]),
        'i' => (0.0, vec![line(&[[0.0, 1.0], [0.0, 0.0]]), line(&[[0.0, 1.42], [0.0, 1.42]])]),
        'l' => (0.0, vec![line(&[[0.0, 1.5], [0.0, 0.0]])]),
        'n' => (
            0.8,
            vec![
                line(&[[0.0, 1.0], [0.0, 0.0]]),
                arc([0.4, 0.6], [0.4; 2], 180.0, 0.0),
                line(&[[0.8, 0.6], [0.8, 0.0]]),
            ],
        ),
        'o' => (1.0, vec![bowl()]),
        'r' => (0.6, vec![line(&[[0.0, 1.0], [0.0, 0.0]]), arc([0.4, 0.6], [0.4; 2], 180.0, 60.0)]),
        's' => (0.6, vec![arc([0.3, 0.75], [0.3, 0.25], 35.0, 270.0), arc([0.3, 0.25], [0.3, 0.25], 90.0, -145.0)]),
        't' => (0.56, vec![line(&[[0.25, 1.4], [0.25, 0.0]]), line(&[[0.0, 1.0], [0.56, 1.0]])]),
        'u' => (
            0.8,
            vec![
                line(&[[0.0, 1.0], [0.0, 0.4]]),
                arc([0.4, 0.4], [0.4; 2], 180.0, 360.0),
                line(&[[0.8, 1.0], [0.8, 0.0]]),
            ],
        ),
        'x' => (0.8, vec![line(&[[0.0, 0.0], [0.8, 1.0]]), line(&[[0.0, 1.0], [0.8, 0.0]])]),
        _ => return None,
    };
    Some(Letter { width, strokes })
}

/// The strokes of a text and its width, in heights of an x. Letters that there
/// are not are left out.
fn strokes(text: &str) -> (Vec<Vec<Vec2>>, f32) {
    let (mut all, mut at) = (Vec::new(), 0.0);
    for letter in text.chars().filter_map(letter) {
        all.extend(letter.strokes.into_iter().map(|s| s.into_iter().map(|p| p + Vec2::X * at).collect::<Vec<_>>()));
        at += letter.width + GAP;
    }
    (all, (at - GAP).max(0.0))
}

fn distance(p: Vec2, a: Vec2, b: Vec2) -> f32 {
    let ab = b - a;
    let t = ((p - a).dot(ab) / ab.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    p.distance(a + ab * t)
}

/// Writes white letters with a dark rim. `left` and `baseline` are pixels; `size`
/// is the height of an x; nothing is written outside the columns `within`.
pub fn write(picture: &mut RgbImage, text: &str, [left, baseline]: [f32; 2], size: f32, within: std::ops::Range<u32>) {
    let (strokes, width) = strokes(text);
    let margin = size * (PEN + RIM) + 1.0;
    let columns = (left - margin).max(within.start as f32) as u32
        ..((left + width * size + margin).ceil() as u32).min(within.end).min(picture.width());
    let rows = (baseline - 1.6 * size - margin).max(0.0) as u32
        ..((baseline + margin).ceil().max(0.0) as u32).min(picture.height());
    for y in rows {
        for x in columns.clone() {
            let p = Vec2::new(x as f32 + 0.5 - left, baseline - y as f32 - 0.5) / size;
            let d = strokes
                .iter()
                .flat_map(|s| s.windows(2))
                .fold(f32::INFINITY, |d, ends| d.min(distance(p, ends[0], ends[1])));
            // A pixel's worth of soft edge.
            let covered = |radius: f32| ((radius - d) * size + 0.5).clamp(0.0, 1.0);
            let (ink, rim) = (covered(PEN), covered(PEN + RIM) * 0.6);
            let pixel = picture.get_pixel_mut(x, y);
            *pixel = Rgb(pixel.0.map(|c| ((f32::from(c) * (1.0 - rim)) * (1.0 - ink) + 255.0 * ink).round() as u8));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_can_be_written() {
        for name in ["no AO", "classic", "obscurance", "extended", "extended-obscurance"] {
            assert!(name.chars().all(|c| letter(c).is_some()), "{name}");
        }
    }

    #[test]
    fn letters_are_white_and_stay_within_their_columns() {
        let mut picture = RgbImage::from_pixel(60, 30, Rgb([128; 3]));
        write(&mut picture, "lol", [5.0, 25.0], 10.0, 0..20);
        assert_eq!(picture.get_pixel(5, 15).0, [255; 3], "on the stroke of the first l");
        assert_eq!(picture.get_pixel(13, 20).0, [128; 3], "inside the o");
        assert!((20..60).all(|x| (0..30).all(|y| picture.get_pixel(x, y).0 == [128; 3])));
    }
}
