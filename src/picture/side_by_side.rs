//! Pictures of one view beside the map of their difference.

use super::{
    color_bar::{fill, frame, text},
    error_map::{Caption, ErrorMap},
};
use image::{Rgb, RgbImage};

/// Two pictures, each under its name, and the map with its bar at their right; all of
/// the map's size, and magnified like it. What a smaller picture does not cover is white.
pub fn side_by_side(pictures: [(&str, &RgbImage); 2], title: &str, map: &ErrorMap) -> RgbImage {
    let factor = map.factor();
    let [width, height] = map.resolution().map(|n| n * factor);
    let right = map.picture(&Caption { title, unit: "" });
    let (size, margin, head) = map.layout();
    let column = width + margin;
    let mut whole = RgbImage::from_pixel(2 * column + right.width(), right.height(), Rgb([255; 3]));
    // First, as its white margin reaches over the frame at its left.
    image::imageops::replace(&mut whole, &right, i64::from(2 * column), 0);
    for (i, (name, picture)) in pictures.into_iter().enumerate() {
        let left = margin + i as u32 * column;
        let top = margin + head;
        text(&mut whole, name, [left as f32, margin as f32 + 1.5 * size], width as f32, 1.1 * size);
        let part = [left, top, width.min(picture.width() * factor), height.min(picture.height() * factor)];
        fill(&mut whole, part, |x, y| *picture.get_pixel(x / factor, y / factor));
        frame(&mut whole, part);
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::scale::Scale;

    #[test]
    fn three_columns_show_their_pixels() {
        let map = ErrorMap::new([2, 1], vec![0.0, 1.0], Scale::flip()).unwrap();
        let picture = |c: u8| RgbImage::from_fn(2, 1, |x, _| Rgb([c, x as u8, 3]));
        let whole = side_by_side([("reference", &picture(10)), ("test", &picture(20))], "FLIP", &map);
        let count = |rgb: [u8; 3]| whole.pixels().filter(|p| p.0 == rgb).count() as u32;
        let square = map.factor() * map.factor();
        for rgb in [[10, 0, 3], [10, 1, 3], [20, 0, 3], [20, 1, 3]] {
            assert_eq!(count(rgb), square, "{rgb:?}");
        }
        assert!(count(map.scale().color(1.0).unwrap()) >= square);
        assert_eq!(whole.get_pixel(0, 0).0, [255; 3]);
    }
}
