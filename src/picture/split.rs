//! Several pictures of one view side by side in one, as in the paper's Fig. 8.

use super::lettering::{self, Ink};
use image::{Rgb, RgbImage};
use std::ops::Range;

/// The columns of part `index` of `count`, of a picture `width` wide.
pub fn columns(index: usize, count: usize, width: u32) -> Range<u32> {
    let at = |i: usize| (u64::from(width) * i as u64 / count.max(1) as u64) as u32;
    at(index)..at(index + 1)
}

/// Which part of `count` a column shows.
pub fn part(column: u32, count: usize, width: u32) -> usize {
    (0..count).find(|&i| columns(i, count, width).contains(&column)).unwrap_or(0)
}

/// Half the width of a divider, pixels, on either side of where parts meet.
pub fn divider(height: u32) -> u32 {
    (height / 500).max(1)
}

/// Height of an x in labels, pixels, of a picture `height` high.
fn lettering_size(height: u32) -> f32 {
    (height as f32 / 36.0).max(6.0)
}

/// Height of the strip at the foot that labels lie in, pixels.
pub fn foot(height: u32) -> u32 {
    (lettering_size(height) * 3.4).ceil() as u32
}

/// Draws a thin white line where parts meet, and each part's name at its foot.
pub fn mark(picture: &mut RgbImage, names: &[String]) {
    let [width, height] = [picture.width(), picture.height()];
    let size = lettering_size(height);
    for (i, name) in names.iter().enumerate() {
        let columns = columns(i, names.len(), width);
        let place = [columns.start as f32 + 1.2 * size, height as f32 - 1.2 * size];
        lettering::write(picture, name, place, size, columns, &Ink::WHITE);
    }
    let half = divider(height);
    for i in 1..names.len() {
        let edge = columns(i, names.len(), width).start;
        for x in edge.saturating_sub(half)..(edge + half).min(width) {
            (0..height).for_each(|y| picture.put_pixel(x, y, Rgb([255; 3])));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_a_picture_without_overlap() {
        for width in [3, 16, 100, 1281] {
            let whole: Vec<u32> = (0..3).flat_map(|i| columns(i, 3, width)).collect();
            assert_eq!(whole, (0..width).collect::<Vec<_>>());
            assert!((0..width).all(|x| columns(part(x, 3, width), 3, width).contains(&x)));
        }
    }

    #[test]
    fn marks_touch_dividers_and_foot_alone() {
        let mut picture = RgbImage::from_pixel(300, 200, Rgb([90; 3]));
        mark(&mut picture, &["no AO", "classic", "extended"].map(String::from));
        for (x, y, pixel) in picture.enumerate_pixels() {
            let at_edge = [100, 200].iter().any(|e| (e - 1..e + 1).contains(&x));
            if at_edge {
                assert_eq!(pixel.0, [255; 3], "{x} {y}");
            } else if y < 200 - foot(200) {
                assert_eq!(pixel.0, [90; 3], "{x} {y}");
            }
        }
        let white = |r: Range<u32>| r.filter(|&x| (170..200).any(|y| picture.get_pixel(x, y).0 == [255; 3])).count();
        assert!([2..98, 102..198, 202..299].into_iter().all(|r| white(r) > 5), "each part has its name");
    }
}
