//! The difference of two images, pixel by pixel: as numbers, and as a picture of which
//! pixels differ.

use super::{Rect, exact::within};
use crate::{
    layers::{Layers, srgb},
    metrics::image::{Encoding, Image},
    picture::{
        channel::Channel,
        read::{Samples, Values},
    },
};
use image::{Rgb, RgbImage};

/// A pixel that differs.
const MARK: Rgb<u8> = Rgb([255, 0, 0]);
/// Of the grey of a pixel that does not differ, so much is left; the rest is white.
const FADE: f32 = 0.25;

/// One of the two images, as its pixels are compared.
#[derive(Clone, Copy)]
pub(super) enum Stored<'a> {
    /// As they are stored, alpha among the channels.
    Samples(&'a Samples),
    /// The same of OpenEXR, channel by channel.
    Channels(&'a [Channel]),
    /// As floats.
    Image(&'a Image),
}

/// Two images of equal shape whose difference can be drawn.
#[derive(Clone, Copy)]
pub struct Difference<'a> {
    pub(super) reference: Stored<'a>,
    pub(super) test: Stored<'a>,
    /// What of both is looked at.
    pub(super) part: Rect,
    /// Weights of all pixels of both; those of weight 0 do not count.
    pub(super) weights: Option<&'a [f32]>,
    /// A pixel differs where a channel does by more than this, of a range of 0 to 1.
    pub(super) tolerance: f64,
}

impl Stored<'_> {
    fn width(&self) -> usize {
        match self {
            Stored::Samples(s) => s.size[0],
            Stored::Channels(c) => c.first().map_or(0, |c| c.size[0]),
            Stored::Image(i) => i.size()[0],
        }
    }

    fn channels(&self) -> usize {
        match self {
            Stored::Samples(s) => s.channels,
            Stored::Channels(c) => c.len(),
            Stored::Image(i) => i.planes().len(),
        }
    }

    /// The names of the channels as OpenEXR has them.
    fn names(&self) -> Vec<&str> {
        match (self, self.channels()) {
            (_, 1) => vec!["Y"],
            (Stored::Channels(c), _) => c.iter().map(|c| c.name.as_str()).collect(),
            (_, 2) => vec!["Y", "A"],
            (_, 3) => vec!["R", "G", "B"],
            _ => vec!["R", "G", "B", "A"],
        }
    }

    /// A number; integers as shares of their range.
    fn value(&self, pixel: usize, channel: usize) -> f64 {
        match self {
            Stored::Samples(s) => {
                let i = pixel * s.channels + channel;
                match &s.values {
                    Values::U8(v) => f64::from(v[i]) / f64::from(u8::MAX),
                    Values::U16(v) => f64::from(v[i]) / f64::from(u16::MAX),
                    Values::F32(v) => v[i].into(),
                }
            }
            Stored::Channels(c) => c[channel].numbers.at(pixel),
            Stored::Image(i) => i.planes()[channel][pixel].into(),
        }
    }

    /// How far numbers may be apart within a tolerance, as [`exact`](super::exact()) has it.
    fn within(&self, other: &Self, tolerance: f64) -> f64 {
        match [self, other].map(|s| if let Stored::Samples(s) = s { Some(&s.values) } else { None }) {
            [Some(Values::U8(_)), Some(Values::U8(_))] => within(tolerance, Some(u8::MAX.into())),
            [Some(Values::U8(_) | Values::U16(_)), _] => within(tolerance, Some(u16::MAX.into())),
            _ => within(tolerance, None),
        }
    }

    /// The channels that are seen: the colours, of OpenEXR those that are called so, else
    /// the first.
    fn colors(&self) -> Vec<usize> {
        let named = |channels: &[Channel], name: &str| channels.iter().position(|c| c.name == name);
        match self {
            Stored::Channels(all) => match ["R", "G", "B"].map(|name| named(all, name)) {
                [Some(r), Some(g), Some(b)] => vec![r, g, b],
                _ => vec![named(all, "Y").or_else(|| named(all, "mean")).unwrap_or(0)],
            },
            _ if self.channels() < 3 => vec![0],
            _ => vec![0, 1, 2],
        }
    }

    /// The mean of the colour channels as a screen shows it, 0 to 1.
    fn grey(&self, pixel: usize, colors: &[usize]) -> f32 {
        let linear = match self {
            Stored::Samples(s) => matches!(s.values, Values::F32(_)),
            Stored::Channels(_) => true,
            Stored::Image(i) => i.encoding() == Encoding::Linear,
        };
        let mean = (colors.iter().map(|&c| self.value(pixel, c)).sum::<f64>() / colors.len() as f64) as f32;
        if linear { f32::from(srgb(mean)) / 255.0 } else { mean.clamp(0.0, 1.0) }
    }
}

impl Difference<'_> {
    /// `test - reference` a channel, in layers `signed.R`, `.G`, `.B` or `signed` of grey,
    /// and `signed.NAME` of every other channel that was compared. Integers are shares of their range. NaN
    /// where either image holds NaN or both the same infinity; pixels that do not count
    /// have their numbers too.
    pub fn layers(&self) -> Layers {
        let mut layers = Layers::new([self.part.width, self.part.height].map(|n| n as u32));
        for (channel, name) in self.reference.names().iter().enumerate() {
            let difference = |i| (self.test.value(i, channel) - self.reference.value(i, channel)) as f32;
            layers = layers.with(&format!("signed.{name}"), self.places().map(difference).collect());
        }
        layers
    }

    /// The reference in faded grey, and pixels that differ by more than the tolerance in
    /// red: as many as [`Exact::differing`](super::Exact::differing) says.
    pub fn marked(&self) -> RgbImage {
        let mut places = self.places();
        let within = self.reference.within(&self.test, self.tolerance);
        let colors = self.reference.colors();
        RgbImage::from_fn(self.part.width as u32, self.part.height as u32, |_, _| match places.next() {
            Some(i) if self.differs(i, within) => MARK,
            Some(i) => Rgb([((1.0 - FADE * (1.0 - self.reference.grey(i, &colors))) * 255.0).round() as u8; 3]),
            None => MARK,
        })
    }

    /// The pixels, row by row.
    fn places(&self) -> impl Iterator<Item = usize> {
        let (Rect { x, y, width, height }, stride) = (self.part, self.reference.width());
        (y..y + height).flat_map(move |row| row * stride + x..row * stride + x + width)
    }

    fn differs(&self, pixel: usize, within: f64) -> bool {
        if self.weights.is_some_and(|w| w[pixel] <= 0.0) {
            return false;
        }
        (0..self.reference.channels()).any(|c| {
            let (a, b) = (self.reference.value(pixel, c), self.test.value(pixel, c));
            let equal = a == b || a.is_nan() && b.is_nan();
            // NaN against a number is no distance, and differs.
            !(equal || (a - b).abs() <= within)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{super::exact, *};
    use crate::compare::Region;

    fn samples(channels: usize, values: Values) -> Samples {
        Samples { size: [4, 3], channels, values }
    }

    /// Of every kind of number, and every tolerance.
    #[test]
    fn as_many_pixels_are_marked_as_are_counted() {
        let a: Vec<u8> = (0..48).map(|i| (i * 37 % 256) as u8).collect();
        let b: Vec<u8> = a.iter().zip(0..).map(|(a, i)| a.wrapping_add(i % 5)).collect();
        let wide = |v: &[u8]| Values::U16(v.iter().map(|&v| u16::from(v) * 257).collect());
        let mut floats: [Vec<f32>; 2] = [&a, &b].map(|v| v.iter().map(|&v| f32::from(v) / 64.0).collect());
        (floats[0][5], floats[1][9], floats[0][13], floats[1][13]) = (f32::NAN, f32::INFINITY, f32::NAN, f32::NAN);
        let [fa, fb] = floats;
        let weights: Vec<f32> = (0..12).map(|i| if i == 6 { 0.0 } else { 1.0 }).collect();
        let mut marked = 0;
        for (reference, test) in [
            (Values::U8(a.clone()), Values::U8(b.clone())),
            (Values::U8(a), wide(&b)),
            (Values::F32(fa), Values::F32(fb)),
        ] {
            let (reference, test) = (samples(4, reference), samples(4, test));
            for tolerance in [0.0, 1.0 / 255.0, 2.0 / 255.0, 3.5 / 255.0, 0.5] {
                let region = Region { crop: Some("1,0,3,3".parse().unwrap()), ..Region::default() };
                let found = exact(&reference, &test, &region, Some(&weights), tolerance).unwrap();
                let difference = Difference {
                    reference: Stored::Samples(&reference),
                    test: Stored::Samples(&test),
                    part: region.crop.unwrap(),
                    weights: Some(&weights),
                    tolerance,
                };
                let picture = difference.marked();
                assert_eq!(picture.dimensions(), (3, 3));
                let red = picture.pixels().filter(|p| **p == MARK).count();
                assert_eq!(red as u64, found.differing, "{tolerance}");
                marked += red;
            }
        }
        assert!(marked > 30, "{marked}");
    }

    #[test]
    fn layers_are_signed_and_named_as_viewers_expect() {
        let reference = samples(2, Values::U8([51, 255].repeat(12)));
        let test = samples(2, Values::U8([0, 204].repeat(12)));
        let part = Rect { x: 0, y: 0, width: 4, height: 3 };
        let [reference, test] = [Stored::Samples(&reference), Stored::Samples(&test)];
        let layers = Difference { reference, test, part, weights: None, tolerance: 0.0 }.layers();
        assert_eq!(layers.layers.keys().collect::<Vec<_>>(), ["signed.A", "signed.Y"]);
        assert!(layers.layers.values().flatten().all(|v| (v + 0.2).abs() < 1e-6));
    }
}
