//! Errors of an image, a number a pixel, as a picture with its scale and as layers of
//! an OpenEXR file.

use super::{
    color_bar::{self, draw, fill, frame, lettering_size, no_value, text},
    scale::Scale,
};
use crate::layers::Layers;
use image::{Rgb, RgbImage};

/// Narrowest map in a picture: smaller ones are magnified.
const LEAST_WIDTH: u32 = 500;
/// Highest map that magnification may lead to.
const MOST_HEIGHT: u32 = 2000;
/// Narrowest room for the bar and its words.
const LEAST_BAR: u32 = 480;

/// Why there is no such map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MapError {
    /// A number of the scale makes no sense.
    #[error("the scale's {name} is {value}: it must be {allowed}")]
    Limit {
        /// Which.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What may be given.
        allowed: &'static str,
    },
    /// There are not as many values as pixels.
    #[error("an error map of {width} x {height} pixels needs as many values, not {values}, and at least one")]
    Values {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// Values given.
        values: usize,
    },
    /// Two maps of one file differ in size.
    #[error("layer '{layer}' has {width} x {height} pixels and the layers before it have not: all must have as many")]
    Sizes {
        /// The layer.
        layer: String,
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// Two maps of one file have the same name.
    #[error("there are two layers '{layer}': each needs a name of its own")]
    Twice {
        /// The layer.
        layer: String,
    },
}

/// What is written beside a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Caption<'a> {
    /// Above it; none where empty. Example: `extended - Q`.
    pub title: &'a str,
    /// Unit of an absolute or signed error; none where empty. Example: `openness`.
    pub unit: &'a str,
}

/// A number a pixel on a fixed scale.
///
/// ```
/// use aogauge::picture::{error_map::{Caption, ErrorMap}, scale::Scale};
///
/// let scale = Scale::signed(0.5)?;
/// let map = ErrorMap::new([2, 1], vec![0.25, f32::NAN], scale)?;
/// let picture = map.picture(&Caption { title: "extended - Q", unit: "openness" });
/// assert!(picture.width() >= 500);
/// # Ok::<(), aogauge::picture::error_map::MapError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorMap {
    resolution: [u32; 2],
    values: Vec<f32>,
    scale: Scale,
}

impl ErrorMap {
    /// A map of `values`, row by row from the top left, NaN where there is none.
    ///
    /// # Errors
    /// Where there are not as many values as pixels, or no pixels.
    pub fn new([width, height]: [u32; 2], values: Vec<f32>, scale: Scale) -> Result<Self, MapError> {
        if values.is_empty() || values.len() as u64 != u64::from(width) * u64::from(height) {
            return Err(MapError::Values { width, height, values: values.len() });
        }
        Ok(ErrorMap { resolution: [width, height], values, scale })
    }

    /// Signed errors, `test - reference`, from `-limit` to `limit`; a pixel that
    /// either image has no value of has none.
    ///
    /// # Errors
    /// See [`ErrorMap::new`] and [`Scale::signed`].
    pub fn signed(resolution: [u32; 2], test: &[f32], reference: &[f32], limit: f64) -> Result<Self, MapError> {
        Self::new(resolution, differences(test, reference), Scale::signed(limit)?)
    }

    /// Absolute errors, `|test - reference|`, from 0 to `max`.
    ///
    /// # Errors
    /// See [`ErrorMap::new`] and [`Scale::absolute`].
    pub fn absolute(resolution: [u32; 2], test: &[f32], reference: &[f32], max: f64) -> Result<Self, MapError> {
        let errors = differences(test, reference).into_iter().map(f32::abs).collect();
        Self::new(resolution, errors, Scale::absolute(max)?)
    }

    /// p-values of any test, a pixel each, and the level that it rejects below. What
    /// is too small for 32 bits becomes 0, which lies beyond the scale.
    ///
    /// # Errors
    /// See [`ErrorMap::new`] and [`Scale::p_value`].
    pub fn p_values(resolution: [u32; 2], p: &[f64], level: f64) -> Result<Self, MapError> {
        Self::new(resolution, p.iter().map(|&p| p as f32).collect(), Scale::p_value(level)?)
    }

    /// Width and height, pixels.
    pub fn resolution(&self) -> [u32; 2] {
        self.resolution
    }

    /// The numbers.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Their scale.
    pub fn scale(&self) -> &Scale {
        &self.scale
    }

    /// The map alone, each pixel a square of `factor` pixels; 0 is taken as 1.
    pub fn plain(&self, factor: u32) -> RgbImage {
        let [width, height] = self.resolution;
        let factor = factor.max(1);
        let mut picture = RgbImage::new(width * factor, height * factor);
        self.paint(&mut picture, [0, 0], factor);
        picture
    }

    /// The map, magnified where it is small, with title, bar, numbers and legend, on
    /// white.
    pub fn picture(&self, caption: &Caption<'_>) -> RgbImage {
        let [width, height] = self.resolution;
        let factor = self.factor();
        let shown = [width * factor, height * factor];
        let bar = shown[0].max(LEAST_BAR);
        let (size, margin, head) = self.layout();
        let head = if caption.title.is_empty() { 0 } else { head };
        let gap = (1.2 * size).ceil() as u32;
        let tall = margin + head + shown[1] + gap + color_bar::height(size) + margin;
        let mut picture = RgbImage::from_pixel(bar + 2 * margin, tall, Rgb([255; 3]));
        let place = [margin as f32, margin as f32 + 1.5 * size];
        text(&mut picture, caption.title, place, bar as f32, 1.1 * size);
        let corner = [margin, margin + head];
        self.paint(&mut picture, corner, factor);
        frame(&mut picture, [corner[0], corner[1], shown[0], shown[1]]);
        draw(&mut picture, &self.scale, caption.unit, [margin, corner[1] + shown[1] + gap], bar, size);
        picture
    }

    /// Height of an x, the margin on all sides, and the room a title takes, pixels.
    pub(super) fn layout(&self) -> (f32, u32, u32) {
        let size = lettering_size((self.resolution[0] * self.factor()).max(LEAST_BAR));
        (size, (1.2 * size).ceil() as u32, (2.8 * size).ceil() as u32)
    }

    /// How much a map is magnified in its picture.
    pub(super) fn factor(&self) -> u32 {
        let [width, height] = self.resolution;
        LEAST_WIDTH.div_ceil(width).min(MOST_HEIGHT / height).max(1)
    }

    fn paint(&self, picture: &mut RgbImage, [left, top]: [u32; 2], factor: u32) {
        let [width, _] = self.resolution;
        let square = (factor / 2).clamp(1, 8);
        for (i, value) in self.values.iter().enumerate() {
            let [x, y] = [i as u32 % width * factor, i as u32 / width * factor];
            let color = self.scale.color(f64::from(*value));
            fill(picture, [left + x, top + y, factor, factor], |dx, dy| {
                Rgb(color.unwrap_or_else(|| no_value([x + dx, y + dy], square)))
            });
        }
    }
}

fn differences(test: &[f32], reference: &[f32]) -> Vec<f32> {
    if test.len() != reference.len() {
        // As many values as there are pixels in neither: refused by `new`.
        return Vec::new();
    }
    test.iter().zip(reference).map(|(t, r)| t - r).collect()
}

/// Maps as named layers of 32-bit floats. The numbers are not clamped; attributes
/// `NAME.kind`, `NAME.from` and `NAME.to` say the scale of each. A map's own name
/// ([`Scale::name`]) is the one to take where there is one of its kind.
///
/// # Errors
/// Where two maps differ in size or are called the same.
pub fn layers<'a>(maps: impl IntoIterator<Item = (&'a str, &'a ErrorMap)>) -> Result<Layers, MapError> {
    let mut layers = Layers::default();
    for (name, map) in maps {
        let [width, height] = map.resolution;
        if layers.layers.is_empty() {
            layers.resolution = map.resolution;
        } else if layers.resolution != map.resolution {
            return Err(MapError::Sizes { layer: name.to_owned(), width, height });
        }
        if layers.layers.insert(name.to_owned(), map.values.clone()).is_some() {
            return Err(MapError::Twice { layer: name.to_owned() });
        }
        let [from, to] = map.scale.ends();
        for (what, text) in [("kind", map.scale.name().to_owned()), ("from", from.to_string()), ("to", to.to_string())]
        {
            layers.attributes.insert(format!("{name}.{what}"), text);
        }
    }
    Ok(layers)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signed(resolution: [u32; 2], values: Vec<f32>) -> ErrorMap {
        ErrorMap::new(resolution, values, Scale::signed(0.5).unwrap()).unwrap()
    }

    #[test]
    fn each_pixel_is_a_square_of_its_colour() {
        let map = signed([2, 2], vec![-0.5, 0.0, f32::NAN, 9.0]);
        let picture = map.plain(4);
        assert_eq!(picture.dimensions(), (8, 8));
        for (x, y, pixel) in picture.enumerate_pixels() {
            let expected = match (x / 4, y / 4) {
                (0, 0) => [0x05, 0x30, 0x61],
                (1, 0) => [247; 3],
                (0, 1) => no_value([x, y], 2),
                _ => [0x67, 0x00, 0x1f],
            };
            assert_eq!(pixel.0, expected, "{x} {y}");
        }
        assert_eq!(map.plain(0), map.plain(1));
    }

    /// Small, wide, tall and square maps of every scale.
    #[test]
    fn maps_of_every_shape_have_a_picture() {
        let title = "extended \u{2212} Q";
        for scale in
            [Scale::absolute(0.0), Scale::signed(0.0), Ok(Scale::flip()), Scale::p_value(0.05), Scale::similarity(0.5)]
        {
            for [w, h] in [[1, 1], [2000, 3], [3, 2000], [40, 30]] {
                let map = ErrorMap::new([w, h], vec![0.0; (w * h) as usize], scale.clone().unwrap()).unwrap();
                let picture = map.picture(&Caption { title, unit: "openness" });
                let shown = picture.width();
                assert!(
                    (LEAST_BAR..=2100).contains(&shown) && picture.height() < 2200,
                    "{w} x {h}: {:?}",
                    picture.dimensions()
                );
                if w >= 40 || h == 1 {
                    assert!(shown >= LEAST_WIDTH);
                }
                let own = map.scale().color(0.0).unwrap();
                let found = picture.pixels().filter(|p| p.0 == own).count() as u32;
                assert!(found >= w * h * map.factor().pow(2), "{w} x {h} {}", map.scale().name());
            }
        }
    }

    /// Equal images: no error anywhere, the scale goes to 1.
    #[test]
    fn equal_images_have_a_map_of_zeros() {
        let image = [0.25, 0.5, f32::NAN, 1.0];
        let map = ErrorMap::absolute([2, 2], &image, &image, 0.0).unwrap();
        assert_eq!(map.scale().ends(), [0.0, 1.0]);
        assert_eq!(map.values()[3], 0.0);
        assert!(map.values()[2].is_nan());
        let map = ErrorMap::signed([2, 2], &image, &[0.5, 0.0, 0.0, 1.0], 1.0).unwrap();
        assert_eq!(map.values()[..2], [-0.25, 0.5]);
    }

    #[test]
    fn p_values_need_nothing_else() {
        let map = ErrorMap::p_values([4, 1], &[1.0, 1e-300, f64::NAN, 0.02], 0.01).unwrap();
        let picture = map.plain(1);
        assert_eq!(picture.get_pixel(0, 0).0, [250; 3]);
        assert_eq!(picture.get_pixel(1, 0).0, [0x80, 0x00, 0x26]);
        assert_eq!(picture.get_pixel(2, 0).0, no_value([2, 0], 1));
    }

    #[test]
    fn maps_are_layers_with_their_scales() {
        let error = signed([2, 1], vec![0.75, f32::NAN]);
        let p = ErrorMap::p_values([2, 1], &[0.5, 1e-9], 0.01).unwrap();
        let written = layers([("signed", &error), ("p-value", &p)]).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("maps.exr");
        written.write(&path).unwrap();
        let read = Layers::read(&path).unwrap();
        assert_eq!(read.get("signed").map(|v| (v[0], v[1].is_nan())), Some((0.75, true)));
        assert_eq!(read.get("p-value"), Some([0.5f32, 1e-9].as_slice()));
        for (name, value) in
            [("signed.kind", "signed"), ("signed.from", "-0.5"), ("p-value.from", "1"), ("p-value.to", "0.000001")]
        {
            assert_eq!(read.attributes.get(name).map(String::as_str), Some(value), "{name}");
        }
        let other = signed([1, 1], vec![0.0]);
        assert!(matches!(layers([("a", &error), ("b", &other)]), Err(MapError::Sizes { .. })));
        assert!(matches!(layers([("a", &error), ("a", &error)]), Err(MapError::Twice { .. })));
    }

    #[test]
    fn numbers_must_fit_the_pixels() {
        let scale = Scale::flip();
        for (resolution, n) in [([2, 2], 3), ([0, 0], 0), ([0, 5], 0), ([u32::MAX, u32::MAX], 1)] {
            assert!(matches!(ErrorMap::new(resolution, vec![0.0; n], scale), Err(MapError::Values { .. })));
        }
        assert!(ErrorMap::signed([2, 1], &[0.0; 2], &[0.0; 3], 1.0).is_err());
    }
}
