//! The pixel-exact metric: how many pixels differ, by how much at most, and where
//! the first of them is. On the numbers as they are stored: no sRGB, no filter, no
//! floats where both images hold integers.

use super::{CompareError, Region};
use crate::{
    metrics::image::{Image, ImageError},
    picture::read::{Samples, Values},
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Rows compared by one thread at a time.
const ROWS: usize = 32;

/// What the pixel-exact metric found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Exact {
    /// Width and height of what was compared, pixels.
    pub size: [usize; 2],
    /// Pixels that were compared: those of weight above 0.
    pub pixels: u64,
    /// Of these, how many have a channel that differs by more than the tolerance.
    /// Lower is better.
    pub differing: u64,
    /// The same as a share of the pixels, 0 to 1.
    pub share: f64,
    /// The largest difference of a channel, of integers as a share of their range.
    /// Null where one image holds NaN or infinity and the other does not. Lower is
    /// better.
    pub largest: Option<f64>,
    /// Column and row, in the whole image, of the first pixel that differs.
    pub first: Option<[usize; 2]>,
    /// The files have the same bytes.
    pub identical_files: bool,
}

impl Exact {
    /// Of two files with the same bytes.
    pub fn of_identical_files(whole: [usize; 2], region: &Region, weights: Option<&[f32]>) -> Self {
        let size = region.size(whole);
        let pixels = match weights {
            Some(w) => region.cut(whole, w).iter().filter(|&&w| w > 0.0).count() as u64,
            None => size[0] as u64 * size[1] as u64,
        };
        Exact { size, pixels, differing: 0, share: 0.0, largest: Some(0.0), first: None, identical_files: true }
    }
}

/// A stored number.
pub(super) trait Sample: Copy + PartialEq + Sync {
    /// How far two of them are apart.
    type Distance: Copy + PartialOrd + Default + Send + Sync;
    fn distance(self, other: Self) -> Self::Distance;
    /// The largest distance within a tolerance.
    fn within(tolerance: f64) -> Self::Distance;
    fn share(distance: Self::Distance) -> f64;
}

macro_rules! integer {
    ($type:ty) => {
        impl Sample for $type {
            type Distance = $type;
            #[inline(always)]
            fn distance(self, other: Self) -> $type {
                self.abs_diff(other)
            }
            fn within(tolerance: f64) -> $type {
                let range = f64::from(<$type>::MAX);
                (within(tolerance, Some(range)) * range).floor() as $type
            }
            fn share(distance: $type) -> f64 {
                f64::from(distance) / f64::from(<$type>::MAX)
            }
        }
    };
}
integer!(u8);
integer!(u16);

impl Sample for f32 {
    type Distance = f64;
    fn distance(self, other: Self) -> f64 {
        if self == other || (self.is_nan() && other.is_nan()) {
            0.0
        } else if self.is_finite() && other.is_finite() {
            (f64::from(self) - f64::from(other)).abs()
        } else {
            f64::INFINITY
        }
    }
    fn within(tolerance: f64) -> f64 {
        within(tolerance, None)
    }
    fn share(distance: f64) -> f64 {
        distance
    }
}

/// Compares two images sample by sample. Alpha is a channel like the others. 8-bit
/// codes are compared with 16-bit ones as shares of their range. Pixels of weight 0
/// do not count; `weights` are those of the whole image. NaN equals NaN.
///
/// # Errors
/// Where size or channels differ, where one image holds integers and the
/// other floats, where the region reaches beyond the image, and where no pixel is left.
pub fn exact(
    reference: &Samples,
    test: &Samples,
    region: &Region,
    weights: Option<&[f32]>,
    tolerance: f64,
) -> Result<Exact, CompareError> {
    if reference.size != test.size {
        return Err(ImageError::Size { reference: reference.size, test: test.size }.into());
    }
    if reference.channels != test.channels {
        return Err(ImageError::Channels { reference: reference.channels, test: test.channels }.into());
    }
    region.check(reference.size)?;
    let view = View { size: reference.size, channels: reference.channels, region, weights };
    let found = match (&reference.values, &test.values) {
        (Values::F32(a), Values::F32(b)) => view.compare(a, b, tolerance),
        (Values::F32(_), _) | (_, Values::F32(_)) => return Err(CompareError::Kinds),
        (Values::U8(a), Values::U8(b)) => view.compare(a, b, tolerance),
        (a, b) => view.compare(&wide(a), &wide(b), tolerance),
    };
    let masked = reference.size[0] * reference.size[1];
    found.ok_or_else(|| ImageError::Nothing { masked, non_finite: 0 }.into())
}

/// Rounding of 8 and 16-bit codes as 32-bit floats from 0 to 1, twice: a tolerance of
/// 1/255 admits one code.
const ROUNDING: f64 = 1.0 / (1u64 << 22) as f64;
/// Of a code, so much is rounding of the tolerance: 2/255 means two codes.
const CODE_ROUNDING: f64 = 1e-6;

/// The largest difference that a tolerance admits, of codes 0 to `range` as shares of it,
/// or of floats.
pub(super) fn within(tolerance: f64, range: Option<f64>) -> f64 {
    match range {
        Some(range) => tolerance + CODE_ROUNDING / range,
        // Floats that are no codes may differ by far less: of a tolerance never more than a 64th is rounding.
        None => tolerance + ROUNDING.min(tolerance / 64.0),
    }
}

/// The same of two images as floats, of equal shape, cut out of the whole image at
/// `corner`; `weights` are those of the part.
///
/// # Errors
/// Where size or channels differ, and where no pixel is left.
pub fn exact_images(
    reference: &Image,
    test: &Image,
    corner: [usize; 2],
    weights: Option<&[f32]>,
    tolerance: f64,
) -> Result<Exact, CompareError> {
    if reference.size() != test.size() {
        return Err(ImageError::Size { reference: reference.size(), test: test.size() }.into());
    }
    let planes: Vec<(&[f32], &[f32])> =
        reference.planes().iter().zip(test.planes()).map(|(r, t)| (r.as_slice(), t.as_slice())).collect();
    if reference.planes().len() != test.planes().len() {
        let [reference, test] = [reference.planes().len(), test.planes().len()];
        return Err(ImageError::Channels { reference, test }.into());
    }
    let within = within(tolerance, None);
    let width = reference.size()[0];
    let rows: Vec<Count<f64>> = (0..reference.size()[1])
        .into_par_iter()
        .map(|y| {
            let row = y * width..(y + 1) * width;
            let mut count = Count::<f64>::default();
            for i in row {
                if weights.is_some_and(|w| w[i] <= 0.0) {
                    continue;
                }
                count.add(planes.iter().map(|(r, t)| r[i].distance(t[i])).fold(0.0, f64::max), within, i);
            }
            count
        })
        .collect();
    let all = rows.into_iter().fold(Count::default(), and);
    let found = all.found(reference.size(), |i| [i % width + corner[0], i / width + corner[1]]);
    found.ok_or_else(|| ImageError::Nothing { masked: reference.pixels(), non_finite: 0 }.into())
}

/// Codes of 16 bits: 255 becomes 65,535.
fn wide(values: &Values) -> Cow<'_, [u16]> {
    match values {
        Values::U8(v) => v.iter().map(|&v| u16::from(v) * 257).collect::<Vec<_>>().into(),
        Values::U16(v) => v.into(),
        Values::F32(_) => Cow::Borrowed(&[]),
    }
}

/// What of both images is looked at.
struct View<'a> {
    size: [usize; 2],
    channels: usize,
    region: &'a Region,
    weights: Option<&'a [f32]>,
}

/// Of some rows.
#[derive(Clone, Copy, Default)]
pub(super) struct Count<D> {
    pixels: u64,
    differing: u64,
    largest: D,
    /// Place of the first, row by row in the whole image.
    first: Option<usize>,
}

impl View<'_> {
    fn compare<T: Sample>(&self, a: &[T], b: &[T], tolerance: f64) -> Option<Exact> {
        let width = self.size[0];
        let part = self.region.crop.unwrap_or(super::Rect::whole(self.size));
        let within = T::within(tolerance);
        let rows: Vec<usize> = (part.y..part.y + part.height).step_by(ROWS).collect();
        let counts: Vec<Count<T::Distance>> = rows
            .into_par_iter()
            .map(|from| {
                let rows = from..(from + ROWS).min(part.y + part.height);
                rows.fold(Count::default(), |count, row| {
                    let at = row * width + part.x;
                    and(count, self.row(a, b, at, part.width, within))
                })
            })
            .collect();
        let all = counts.into_iter().fold(Count::default(), and);
        let all =
            Count { pixels: all.pixels, differing: all.differing, largest: T::share(all.largest), first: all.first };
        all.found([part.width, part.height], |at| [at % width, at / width])
    }

    /// Pixels `at` and following of one row.
    fn row<T: Sample>(&self, a: &[T], b: &[T], at: usize, width: usize, within: T::Distance) -> Count<T::Distance> {
        let n = self.channels;
        let (a, b) = (&a[at * n..(at + width) * n], &b[at * n..(at + width) * n]);
        let weights = self.weights.map(|w| &w[at..at + width]);
        let pixels = weights.map_or(width, |w| w.iter().filter(|&&w| w > 0.0).count()) as u64;
        let mut count = Count { pixels, ..Count::default() };
        if a == b {
            return count;
        }
        for (i, (p, q)) in a.chunks_exact(n).zip(b.chunks_exact(n)).enumerate() {
            if p == q || weights.is_some_and(|w| w[i] <= 0.0) {
                continue;
            }
            let mut distance = T::Distance::default();
            for (p, q) in p.iter().zip(q) {
                let d = p.distance(*q);
                distance = if d > distance { d } else { distance };
            }
            count.largest = if distance > count.largest { distance } else { count.largest };
            if distance > within {
                count.differing += 1;
                count.first = count.first.or(Some(at + i));
            }
        }
        count
    }
}

impl Count<f64> {
    /// Counts a pixel that is so far apart.
    pub(super) fn add(&mut self, distance: f64, within: f64, at: usize) {
        self.pixels += 1;
        self.largest = self.largest.max(distance);
        if distance > within {
            self.differing += 1;
            self.first = self.first.or(Some(at));
        }
    }

    /// What it comes to; None where there is no pixel.
    pub(super) fn found(self, size: [usize; 2], place: impl Fn(usize) -> [usize; 2]) -> Option<Exact> {
        (self.pixels > 0).then(|| Exact {
            size,
            pixels: self.pixels,
            differing: self.differing,
            share: self.differing as f64 / self.pixels as f64,
            largest: Some(self.largest).filter(|l| l.is_finite()),
            first: self.first.map(place),
            identical_files: false,
        })
    }
}

pub(super) fn and<D: PartialOrd>(a: Count<D>, b: Count<D>) -> Count<D> {
    Count {
        pixels: a.pixels + b.pixels,
        differing: a.differing + b.differing,
        largest: if b.largest > a.largest { b.largest } else { a.largest },
        first: a.first.or(b.first),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(size: [usize; 2], channels: usize, values: Values) -> Samples {
        Samples { size, channels, values }
    }

    #[test]
    fn integers_are_compared_without_floats() {
        let a = samples([2, 2], 3, Values::U8((0..12).collect()));
        let mut codes: Vec<u8> = (0..12).collect();
        (codes[4], codes[11]) = (6, 111);
        let b = samples([2, 2], 3, Values::U8(codes));
        let found = |tolerance| exact(&a, &b, &Region::default(), None, tolerance).unwrap();
        let all = found(0.0);
        assert_eq!((all.pixels, all.differing, all.share, all.first), (4, 2, 0.5, Some([1, 0])));
        assert_eq!(all.largest, Some(100.0 / 255.0));
        assert_eq!((found(2.0 / 255.0).differing, found(2.0 / 255.0).first), (1, Some([1, 1])));
        assert_eq!((found(100.0 / 255.0).differing, found(99.0 / 255.0).differing), (0, 1));
    }

    #[test]
    fn depths_meet_and_kinds_do_not() {
        let a = samples([2, 1], 1, Values::U8(vec![0, 255]));
        let b = samples([2, 1], 1, Values::U16(vec![0, 65_535]));
        assert_eq!(exact(&a, &b, &Region::default(), None, 0.0).unwrap().differing, 0);
        let c = samples([2, 1], 1, Values::F32(vec![0.0, 1.0]));
        assert!(matches!(exact(&a, &c, &Region::default(), None, 0.0), Err(CompareError::Kinds)));
    }

    #[test]
    fn floats_know_nan() {
        let a = samples([4, 1], 1, Values::F32(vec![f32::NAN, 1.0, f32::INFINITY, 0.5]));
        let b = samples([4, 1], 1, Values::F32(vec![f32::NAN, f32::NAN, f32::INFINITY, 0.25]));
        let all = exact(&a, &b, &Region::default(), None, 0.0).unwrap();
        assert_eq!((all.differing, all.largest, all.first), (2, None, Some([1, 0])));
        let masked = exact(&a, &b, &Region::default(), Some(&[1.0, 0.0, 1.0, 1.0]), 0.0).unwrap();
        assert_eq!((masked.pixels, masked.differing, masked.largest), (3, 1, Some(0.25)));
        let none = exact(&a, &b, &Region::default(), Some(&[0.0; 4]), 0.0);
        assert!(none.unwrap_err().to_string().contains("no pixel is left"));
    }

    /// Against a loop a reader can check, on images of odd sizes with a crop and weights.
    #[test]
    fn rows_and_threads_change_nothing() {
        let size = [37, 101];
        let mut x = 1u32;
        let mut next = || {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            x >> 24
        };
        let a: Vec<u8> = (0..37 * 101 * 4).map(|_| next() as u8).collect();
        let b: Vec<u8> = a.iter().map(|&v| if next() < 3 { v ^ 9 } else { v }).collect();
        let weights: Vec<f32> = (0..37 * 101).map(|_| if next() < 50 { 0.0 } else { 1.0 }).collect();
        let region = Region { crop: Some("3,40,30,50".parse().unwrap()), ..Region::default() };
        let (mut differing, mut pixels, mut first) = (0, 0, None);
        for y in 40..90 {
            for x in 3..33 {
                let at = y * 37 + x;
                if weights[at] > 0.0 {
                    pixels += 1;
                    if a[at * 4..at * 4 + 4] != b[at * 4..at * 4 + 4] {
                        differing += 1;
                        first = first.or(Some([x, y]));
                    }
                }
            }
        }
        let (a, b) = (samples(size, 4, Values::U8(a)), samples(size, 4, Values::U8(b)));
        let found = exact(&a, &b, &region, Some(&weights), 0.0).unwrap();
        assert_eq!((found.size, found.pixels, found.differing, found.first), ([30, 50], pixels, differing, first));
    }
}
