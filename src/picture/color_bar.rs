//! The bar of colours beside an error map: numbers, unit, and what pixels without a
//! value look like.

use super::{
    lettering::{self, Ink},
    scale::Scale,
};
use image::{Rgb, RgbImage};

/// Lines around things, and ticks.
const LINE: Rgb<u8> = Rgb([70; 3]);
/// Pixels without a value: a checker of two greys that no scale has.
const CHECKER: [[u8; 3]; 2] = [[120; 3], [165; 3]];
/// Narrowest bar with its margins, pixels.
const LEAST_WIDTH: u32 = 240;
/// Widest picture of a bar alone, pixels.
const MOST_WIDTH: u32 = 8192;

/// The colour of a pixel without a value, in a checker of squares of so many pixels.
pub fn no_value([x, y]: [u32; 2], square: u32) -> [u8; 3] {
    CHECKER[((x / square.max(1) + y / square.max(1)) % 2) as usize]
}

/// Height of an x, pixels, beside a map `width` pixels wide.
pub(super) fn lettering_size(width: u32) -> f32 {
    (width as f32 / 72.0).clamp(7.0, 24.0)
}

/// Height of a bar with all that belongs to it, pixels.
pub(super) fn height(size: f32) -> u32 {
    (9.8 * size).ceil() as u32
}

/// The bar by itself, on white, for several maps of one scale.
pub fn color_bar(scale: &Scale, unit: &str, width: u32) -> RgbImage {
    let width = width.clamp(LEAST_WIDTH, MOST_WIDTH);
    let size = lettering_size(width);
    let margin = size.ceil() as u32;
    let mut picture = RgbImage::from_pixel(width, height(size) + 2 * margin, Rgb([255; 3]));
    draw(&mut picture, scale, unit, [margin, margin], width - 2 * margin, size);
    picture
}

/// Writes dark text no wider than the room it has.
pub(super) fn text(picture: &mut RgbImage, text: &str, [left, baseline]: [f32; 2], room: f32, size: f32) {
    let size = size.min(room / lettering::width(text).max(1.0)).max(0.5 * size);
    let columns = 0..((left + room).ceil().max(0.0) as u32).min(picture.width());
    lettering::write(picture, text, [left, baseline], size, columns, &Ink::BLACK);
}

/// Paints a rectangle: left, top, width and height in pixels.
pub(super) fn fill(picture: &mut RgbImage, [left, top, width, height]: [u32; 4], color: impl Fn(u32, u32) -> Rgb<u8>) {
    let [right, foot] =
        [left.saturating_add(width).min(picture.width()), top.saturating_add(height).min(picture.height())];
    for y in top..foot {
        (left..right).for_each(|x| picture.put_pixel(x, y, color(x - left, y - top)));
    }
}

/// A frame of one pixel around a rectangle.
pub(super) fn frame(picture: &mut RgbImage, [left, top, width, height]: [u32; 4]) {
    let [x, y] = [left.saturating_sub(1), top.saturating_sub(1)];
    for edge in
        [[x, y, width + 2, 1], [x, top + height, width + 2, 1], [x, y, 1, height + 2], [left + width, y, 1, height + 2]]
    {
        fill(picture, edge, |_, _| LINE);
    }
}

/// Where things lie, pixels.
struct Layout {
    /// Of the colours between the arrow ends: left, top, width, height.
    bar: [u32; 4],
    /// Length of an arrow end.
    arrow: u32,
    size: f32,
}

/// Draws a bar and its words at `place`, `width` pixels wide and [`height`] high.
pub(super) fn draw(picture: &mut RgbImage, scale: &Scale, unit: &str, [left, top]: [u32; 2], width: u32, size: f32) {
    let thick = (1.8 * size).round() as u32;
    let arrow = (1.4 * size).round() as u32;
    // Numbers under the ends stick out to both sides.
    let inset = arrow + (0.6 * size).round() as u32;
    let bar = [left + inset, top + 1, width.saturating_sub(2 * inset).max(1), thick];
    let layout = Layout { bar, arrow, size };
    fill(picture, bar, |x, _| Rgb(scale.color_at(f64::from(x) / f64::from(bar[2].max(2) - 1))));
    frame(picture, bar);
    arrows(picture, scale, &layout);
    ticks(picture, scale, &layout);
    let (room, foot) = (width as f32, (top + thick) as f32);
    text(picture, &scale.label(unit), [left as f32, foot + 5.1 * size], room, size);
    legend(picture, scale, [left, (foot + 6.3 * size) as u32], room, &layout);
}

/// Ends of a scale that has no end: arrows of the end's colour.
fn arrows(picture: &mut RgbImage, scale: &Scale, layout: &Layout) {
    let [left, top, width, height] = layout.bar;
    let [before, after] = scale.open();
    if before {
        let at = left.saturating_sub(1 + layout.arrow);
        arrow(picture, [at, top, layout.arrow, height], false, Rgb(scale.color_at(0.0)));
    }
    if after {
        arrow(picture, [left + width + 1, top, layout.arrow, height], true, Rgb(scale.color_at(1.0)));
    }
}

/// A triangle that points to the right or left.
fn arrow(picture: &mut RgbImage, [left, top, length, height]: [u32; 4], right: bool, color: Rgb<u8>) {
    let half = height as f32 / 2.0;
    for y in 0..height {
        let off = ((y as f32 + 0.5 - half).abs() / half).min(1.0);
        let long = ((1.0 - off) * length as f32).round() as u32;
        let from = if right { left } else { left + length - long };
        fill(picture, [from, top + y, long, 1], |_, _| color);
        let tip = if right { from + long } else { from.saturating_sub(1) };
        // As wide as the next row's step, so that the outline has no holes.
        let step = (length as f32 / half).ceil() as u32;
        fill(picture, [if right { tip.saturating_sub(step - 1) } else { tip }, top + y, step, 1], |_, _| LINE);
    }
}

/// Ticks with their numbers, and the mark of a level.
fn ticks(picture: &mut RgbImage, scale: &Scale, layout: &Layout) {
    let [left, top, width, height] = layout.bar;
    let size = layout.size;
    let column = |position: f64| left + (position * f64::from(width - 1)).round() as u32;
    let foot = top + height + 1;
    let length = (0.5 * size).round() as u32;
    let small = 0.9 * size;
    for (position, number) in scale.ticks() {
        let x = column(position);
        fill(picture, [x, foot, 1, length], |_, _| LINE);
        let place = [x as f32 + 0.5 - small * lettering::width(&number) / 2.0, foot as f32 + 2.35 * size];
        let columns = 0..picture.width();
        lettering::write(picture, &number, place, small, columns, &Ink::BLACK);
    }
    if let Some(position) = scale.mark() {
        // White beside black is seen on every colour.
        let x = column(position);
        let thick = (size / 4.0).round().max(1.0) as u32;
        let rows = |x: u32, w: u32| [x, top.saturating_sub(1), w, height + 2 + length];
        fill(picture, rows(x.saturating_sub(thick), 3 * thick), |_, _| Rgb([255; 3]));
        fill(picture, rows(x, thick), |_, _| Rgb([0; 3]));
    }
}

/// What stands for pixels without a value, and for values beyond the scale.
fn legend(picture: &mut RgbImage, scale: &Scale, [left, top]: [u32; 2], room: f32, layout: &Layout) {
    let size = layout.size;
    let [wide, high] = [(2.4 * size).round() as u32, (1.5 * size).round() as u32];
    let swatch = [left + 1, top, wide, high];
    let square = (size / 3.0).round() as u32;
    fill(picture, swatch, |x, y| Rgb(no_value([x, y], square)));
    frame(picture, swatch);
    let small = 0.9 * size;
    let baseline = (top + high) as f32 - 0.15 * size;
    let mut at = (left + wide) as f32 + size;
    let words = |picture: &mut RgbImage, at: f32, words: &str| {
        text(picture, words, [at, baseline], left as f32 + room - at, small);
        at + small * lettering::width(words) + 2.0 * size
    };
    at = words(picture, at, "no value");
    if scale.open().contains(&true) {
        let place = |at: f32| [at.round().max(0.0) as u32, top, layout.arrow, high];
        let [before, after] = scale.open();
        for (right, open) in [(false, before), (true, after)] {
            if open {
                let color = Rgb(scale.color_at(if right { 1.0 } else { 0.0 }));
                arrow(picture, place(at), right, color);
                at += layout.arrow as f32 + 0.7 * size;
            }
        }
        words(picture, at, "beyond the scale");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::scale::tests::all;

    #[test]
    fn no_scale_has_the_colours_of_pixels_without_a_value() {
        for scale in all() {
            for i in 0..=2550 {
                let color = scale.color_at(f64::from(i) / 2550.0);
                for grey in CHECKER {
                    let far: u32 = (0..3).map(|c| u32::from(color[c].abs_diff(grey[c]))).sum();
                    assert!(far >= 20, "{} at {i}: {color:?}", scale.name());
                }
            }
        }
        assert_ne!(no_value([0, 0], 4), no_value([4, 0], 4));
        assert_eq!(no_value([0, 0], 4), no_value([4, 4], 4));
    }

    /// The numbers on a bar are those of its scale: where a tick is, there is the
    /// number as it is written by itself.
    #[test]
    fn numbers_stand_under_their_ticks() {
        for scale in all() {
            let picture = color_bar(&scale, "", 600);
            let size = lettering_size(600);
            let margin = size.ceil() as u32;
            let mut alone = RgbImage::from_pixel(600, picture.height(), Rgb([255; 3]));
            // Ticks and numbers on an empty sheet, by the same layout.
            let inset = (1.4 * size).round() as u32 + (0.6 * size).round() as u32;
            let bar = [margin + inset, margin + 1, 600 - 2 * margin - 2 * inset, (1.8 * size).round() as u32];
            for (position, number) in scale.ticks() {
                let x = bar[0] as f32 + (position * f64::from(bar[2] - 1)).round() as f32 + 0.5;
                let left = x - 0.9 * size * lettering::width(&number) / 2.0;
                let baseline = (bar[1] + bar[3] + 1) as f32 + 2.35 * size;
                lettering::write(&mut alone, &number, [left, baseline], 0.9 * size, 0..600, &Ink::BLACK);
            }
            let rows = bar[1] + bar[3] + 2 + (0.5 * size).round() as u32 + 2..bar[1] + bar[3] + (2.6 * size) as u32;
            let dark = |p: &RgbImage| {
                rows.clone()
                    .flat_map(|y| (0..600).map(move |x| (x, y)))
                    .filter(|&(x, y)| p.get_pixel(x, y).0[0] < 128)
                    .count()
            };
            assert!(dark(&alone) > 100, "{}", scale.name());
            for y in rows.clone() {
                for x in 0..600 {
                    assert_eq!(picture.get_pixel(x, y), alone.get_pixel(x, y), "{} {x} {y}", scale.name());
                }
            }
        }
    }

    #[test]
    fn a_bar_begins_and_ends_with_the_colours_of_its_ends_and_arrows_where_it_is_open() {
        for scale in all() {
            let picture = color_bar(&scale, "openness", 500);
            let size = lettering_size(500);
            let margin = size.ceil() as u32;
            let inset = (1.4 * size).round() as u32 + (0.6 * size).round() as u32;
            let (left, right, row) = (margin + inset, 500 - margin - inset - 1, margin + 1 + (0.9 * size) as u32);
            let at = |x: u32| picture.get_pixel(x, row).0;
            let [first, last] = [0.0, 1.0].map(|p| scale.color_at(p));
            assert_eq!([at(left), at(right)], [first, last], "{}", scale.name());
            let [before, after] = scale.open();
            assert_eq!(at(left - 4), if before { first } else { [255; 3] }, "{}", scale.name());
            assert_eq!(at(right + 4), if after { last } else { [255; 3] }, "{}", scale.name());
        }
    }

    #[test]
    fn a_bar_of_any_width_can_be_drawn() {
        for width in [0, 1, 239, 5000, u32::MAX] {
            let picture = color_bar(&Scale::flip(), "", width);
            assert!((LEAST_WIDTH..=MOST_WIDTH).contains(&picture.width()));
        }
    }
}
