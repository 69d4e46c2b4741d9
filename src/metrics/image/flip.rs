//! FLIP: the difference that an eye sees when it alternates between two images.

use super::{
    Encoding, Image, ImageError, Pair,
    fast_math::{cbrt, pow, srgb_to_linear},
    filter::{BAND, BLOCK, Ring, even, even_of_sum_zero, extend_row, odd},
    hdr_flip::tone_mapped,
};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Pixels per degree of visual angle that scores are given for unless told
/// otherwise: about a 0.7 m wide screen of 3840 pixels seen from 0.7 m.
pub const DEFAULT_PPD: f64 = 67.0;

/// Pixels per degree of a screen `width` metres wide and `pixels` across, seen
/// from `distance` metres.
///
/// ```
/// # use aogauge::metrics::image::pixels_per_degree;
/// assert!((pixels_per_degree(0.7, 3840.0, 0.7) - 67.0206).abs() < 1e-4);
/// ```
pub fn pixels_per_degree(distance: f64, pixels: f64, width: f64) -> f64 {
    distance * pixels / width * PI / 180.0
}

/// The least pixels per degree: below, filters are narrower than a pixel.
const MIN_PPD: f64 = 1.0;
/// The most: its filters reach over 150 pixels to each side.
const MAX_PPD: f64 = 1000.0;

/// White, D65, of CIE XYZ, one over it.
const INV_WHITE: [f32; 3] = [1.052_156_9, 1.0, 0.918_357_7];
/// Exponents and limits of the paper, by its names.
const QC: f32 = 0.7;
const PC: f32 = 0.4;
const PT: f32 = 0.95;

/// How a plane becomes linear light in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Light {
    /// It is, once clamped.
    Linear,
    /// By the sRGB curve.
    Srgb,
    /// Exposed by a factor, tone-mapped, clamped (HDR-FLIP).
    ToneMapped(f32),
}

/// The FLIP error of each pixel, 0 (the same) to 1, row by row.
///
/// Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: FLIP: A
/// Difference Evaluator for Alternating Images, 2020 (with the separable filters
/// of version 1.2 of its tool). Both images are filtered by the eye's contrast
/// sensitivity in an opponent colour space, compared in Hunt-adjusted L*a*b* by
/// the HyAB distance, and the error is raised where edges or points differ:
/// E = Ec^(1 - Ef). Grey images count as RGB with equal channels. Lower is better;
/// the score of an image is its mean.
///
/// `ppd` is [pixels per degree](pixels_per_degree), 1 to 1000. Linear images are
/// clamped to [0, 1]; for HDR images see [`hdr_flip`](super::hdr_flip()).
///
/// # Errors
/// [`ImageError::Range`] for another `ppd`.
pub fn flip(pair: &Pair<'_>, ppd: f64) -> Result<Vec<f32>, ImageError> {
    let light = match pair.reference().encoding() {
        Encoding::Linear => Light::Linear,
        Encoding::Srgb => Light::Srgb,
    };
    flip_of(pair, &Filters::new(ppd)?, light, Arch::new())
}

/// The same by given filters, from planes that become light in a given way.
pub(super) fn flip_of(pair: &Pair<'_>, filters: &Filters, light: Light, arch: Arch) -> Result<Vec<f32>, ImageError> {
    let [width, _] = pair.reference().size();
    let mut map = vec![0.0; pair.reference().pixels()];
    map.par_chunks_mut(width * BAND).enumerate().for_each(|(band, map)| {
        for left in (0..width).step_by(BLOCK) {
            arch.dispatch(Tile { pair, filters, light, left, top: band * BAND, map });
        }
    });
    Ok(map)
}

/// The halves of the filters, from the middle outwards.
pub(super) struct Filters {
    /// Of contrast sensitivity: achromatic, red-green, and the two whose sum is
    /// blue-yellow.
    sensitivity: [Vec<f32>; 4],
    /// A Gaussian, its first and its second derivative.
    features: [Vec<f32>; 3],
    radius: usize,
}

impl Filters {
    pub(super) fn new(ppd: f64) -> Result<Self, ImageError> {
        if !(MIN_PPD..=MAX_PPD).contains(&ppd) {
            return Err(ImageError::Range { what: "pixels per degree", value: ppd, range: "1 to 1000" });
        }
        let sensitivity = sensitivity(ppd);
        let features = features(ppd);
        let radius = sensitivity[0].len().max(features[0].len()) - 1;
        Ok(Filters { sensitivity, features, radius })
    }
}

/// Contrast sensitivity as Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b), x in
/// degrees. Blue-yellow is a sum of two; each is split into the same filter over
/// rows and columns, and the sum of both products is 1.
fn sensitivity(ppd: f64) -> [Vec<f32>; 4] {
    let gaussians = [(1.0, 0.0047), (1.0, 0.0053), (34.1, 0.04), (13.5, 0.025)];
    let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * ppd).ceil() as usize;
    let half = |(a, b): (f64, f64)| -> Vec<f64> {
        let height = (a * (PI / b).sqrt()).sqrt();
        (0..=radius).map(|k| height * (-PI * PI * (k as f64 / ppd).powi(2) / b).exp()).collect()
    };
    let sum = |half: &[f64]| half[0] + 2.0 * half[1..].iter().sum::<f64>();
    let halves = gaussians.map(half);
    let sums = [0, 1, 2, 3].map(|i| sum(&halves[i]));
    let both = sums[2].hypot(sums[3]);
    let totals = [sums[0], sums[1], both, both];
    std::array::from_fn(|i| halves[i].iter().map(|v| (v / totals[i]) as f32).collect())
}

/// Detectors of edges and points. Positive and negative weights of a derivative
/// sum to 1 and -1.
fn features(ppd: f64) -> [Vec<f32>; 3] {
    let deviation = 0.5 * 0.082 * ppd;
    let radius = (3.0 * deviation).ceil() as usize;
    let x = || (0..=radius).map(|k| k as f64);
    let gaussian = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let whole: f64 = x().map(|x| gaussian(x) * if x == 0.0 { 1.0 } else { 2.0 }).sum();
    let slope: f64 = x().map(|x| x * gaussian(x)).sum();
    let bend = |x: f64| (x * x / (deviation * deviation) - 1.0) * gaussian(x);
    let part = |sign: f64| -> f64 {
        x().map(|x| (sign * bend(x)).max(0.0) * if x == 0.0 { 1.0 } else { 2.0 }).sum::<f64>().max(f64::MIN_POSITIVE)
    };
    let (up, down) = (part(1.0), part(-1.0));
    [
        x().map(|x| (gaussian(x) / whole) as f32).collect(),
        x().map(|x| (x * gaussian(x) / slope) as f32).collect(),
        x().map(|x| (bend(x) / if bend(x) > 0.0 { up } else { down }) as f32).collect(),
    ]
}

/// Planes of the horizontally filtered image: four of colour, then Gaussian, first
/// and second derivative of the achromatic one.
const PLANES: usize = 7;

/// What one image of the pair needs on the way through a tile.
struct Half {
    /// Rows of red, green, blue, then of the opponent colours, with borders.
    rows: [Vec<f32>; 3],
    rings: [Ring<f32>; PLANES],
    /// A row filtered both ways: four of colour, edges along x and y, points along
    /// x and y.
    filtered: [Row; 8],
}

impl Half {
    fn new(radius: usize) -> Self {
        Half {
            rows: std::array::from_fn(|_| vec![0.0; BLOCK + 2 * radius]),
            rings: std::array::from_fn(|_| Ring::new(2 * radius + 1, BLOCK)),
            filtered: [[0.0; BLOCK]; 8],
        }
    }

    /// Takes in row `y` of the image, clamped to it, as row `slot` of the rings.
    #[inline(always)]
    fn take(&mut self, tile: &Tile<'_>, image: &Image, y: usize, slot: usize) {
        let (width, radius) = (image.size()[0], tile.filters.radius);
        let planes = image.planes();
        for (channel, row) in self.rows.iter_mut().enumerate() {
            let plane = &planes[channel.min(planes.len() - 1)];
            extend_row(&plane[y * width..(y + 1) * width], tile.left as isize - radius as isize, row);
        }
        let [red, green, blue] = &mut self.rows;
        opponent(red, green, blue, tile.light);
        let colour = &tile.filters.sensitivity;
        for (plane, row, half) in [(0, 0, 0), (1, 1, 1), (2, 2, 2), (3, 2, 3)] {
            let row = &self.rows[row];
            even(&colour[half], |k| &row[(radius as isize + k) as usize..], self.rings[plane].row_mut(slot));
        }
        let y = |k: isize| &self.rows[0][(radius as isize + k) as usize..];
        let [gaussian, slope, bend] = &tile.filters.features;
        even(gaussian, y, self.rings[4].row_mut(slot));
        odd(slope, y, self.rings[5].row_mut(slot));
        even_of_sum_zero(bend, y, self.rings[6].row_mut(slot));
    }

    /// Filters the columns about row `slot` of the rings.
    #[inline(always)]
    fn filter_columns(&mut self, filters: &Filters, slot: usize) {
        let at = |ring: usize| {
            let ring = &self.rings[ring];
            move |k: isize| ring.row((slot as isize + k) as usize)
        };
        let [a, rg, by1, by2, edge_x, edge_y, point_x, point_y] = &mut self.filtered;
        for (half, ring, out) in [(0, 0, a), (1, 1, rg), (2, 2, by1), (3, 3, by2)] {
            even(&filters.sensitivity[half], at(ring), out);
        }
        let [gaussian, slope, bend] = &filters.features;
        even(gaussian, at(5), edge_x);
        odd(slope, at(4), edge_y);
        even(gaussian, at(6), point_x);
        even_of_sum_zero(bend, at(4), point_y);
    }
}

/// A block of columns of a band of rows.
struct Tile<'a> {
    pair: &'a Pair<'a>,
    filters: &'a Filters,
    light: Light,
    left: usize,
    top: usize,
    /// The band's rows of the map.
    map: &'a mut [f32],
}

impl WithSimd for Tile<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let [width, height] = self.pair.reference().size();
        let radius = self.filters.radius;
        let rows = self.map.len() / width;
        let columns = BLOCK.min(width - self.left);
        let (mut reference, mut test) = (Half::new(radius), Half::new(radius));
        let mut errors = [0.0; BLOCK];
        let bounds = Bounds::new();
        for step in 0..rows + 2 * radius {
            // Row `top + step - radius`, clamped to the image.
            let y = (self.top + step).saturating_sub(radius).min(height - 1);
            reference.take(&self, self.pair.reference(), y, step);
            test.take(&self, self.pair.test(), y, step);
            let Some(row) = step.checked_sub(2 * radius) else { continue };
            reference.filter_columns(self.filters, step - radius);
            test.filter_columns(self.filters, step - radius);
            error_row(&reference.filtered, &test.filtered, &bounds, &mut errors);
            self.map[row * width + self.left..][..columns].copy_from_slice(&errors[..columns]);
        }
    }
}

/// Red, green and blue rows become y = Y/Yn, X/Xn - y, y - Z/Zn in place: YCxCz
/// but for factors and an offset, which the filters, being linear and of sum 1,
/// leave alone.
#[inline(always)]
fn opponent(red: &mut [f32], green: &mut [f32], blue: &mut [f32], light: Light) {
    match light {
        Light::Linear => opponent_by(red, green, blue, |v| v),
        Light::Srgb => opponent_by(red, green, blue, |v| srgb_to_linear(unit(v))),
        Light::ToneMapped(factor) => opponent_by(red, green, blue, |v| tone_mapped(v * factor)),
    }
}

#[inline(always)]
fn opponent_by(red: &mut [f32], green: &mut [f32], blue: &mut [f32], linear: impl Fn(f32) -> f32) {
    let n = red.len();
    let (green, blue) = (&mut green[..n], &mut blue[..n]);
    for i in 0..n {
        let (r, g, b) = (unit(linear(red[i])), unit(linear(green[i])), unit(linear(blue[i])));
        let (x, y, z) = normalised_xyz(r, g, b);
        (red[i], green[i], blue[i]) = (y, x - y, y - z);
    }
}

#[inline(always)]
fn unit(v: f32) -> f32 {
    let v = if v < 0.0 { 0.0 } else { v };
    if v > 1.0 { 1.0 } else { v }
}

/// X/Xn, Y/Yn, Z/Zn of linear sRGB, by the exact fractions of its primaries.
#[inline(always)]
fn normalised_xyz(r: f32, g: f32, b: f32) -> (f32, f32, f32) {
    const X: [f32; 3] = [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0];
    const Y: [f32; 3] = [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0];
    const Z: [f32; 3] = [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0];
    let x = (X[0] * r + X[1] * g + X[2] * b) * INV_WHITE[0];
    let y = Y[0] * r + Y[1] * g + Y[2] * b;
    let z = (Z[0] * r + Z[1] * g + Z[2] * b) * INV_WHITE[2];
    (x, y, z)
}

/// Linear sRGB of normalised XYZ, clamped to [0, 1].
#[inline(always)]
fn clamped_rgb(x: f32, y: f32, z: f32) -> (f32, f32, f32) {
    let (x, z) = (x * (1.0 / INV_WHITE[0]), z * (1.0 / INV_WHITE[2]));
    let r = unit(3.241_003_3 * x - 1.537_399 * y - 0.498_615_86 * z);
    let g = unit(-0.969_224_34 * x + 1.875_930_1 * y + 0.041_554_224 * z);
    let b = unit(0.055_639_423 * x - 0.204_011_2 * y + 1.057_149 * z);
    (r, g, b)
}

/// The nonlinearity of L*a*b*.
#[inline(always)]
fn lab_curve(t: f32) -> f32 {
    const DELTA: f32 = 6.0 / 29.0;
    let small = t <= DELTA * DELTA * DELTA;
    let root = cbrt(if small { 1.0 } else { t });
    if small { t * (1.0 / (3.0 * DELTA * DELTA)) + 4.0 / 29.0 } else { root }
}

/// L*, and a* and b* after Hunt's adjustment: chroma counts by lightness.
#[inline(always)]
fn hunt_lab(r: f32, g: f32, b: f32) -> (f32, f32, f32) {
    let (x, y, z) = normalised_xyz(r, g, b);
    let (fx, fy, fz) = (lab_curve(x), lab_curve(y), lab_curve(z));
    let l = 116.0 * fy - 16.0;
    (l, 0.01 * l * (500.0 * (fx - fy)), 0.01 * l * (200.0 * (fy - fz)))
}

/// HyAB: city block in lightness, Euclid in chroma.
#[inline(always)]
fn hyab(a: (f32, f32, f32), b: (f32, f32, f32)) -> f32 {
    let (dl, da, db) = (a.0 - b.0, a.1 - b.1, a.2 - b.2);
    dl.abs() + (da * da + db * db).sqrt()
}

/// Where colour errors are bent: the largest distance of two colours, that of
/// green and blue, to the power of the paper's qc, and pc of it.
struct Bounds {
    most: f32,
    knee: f32,
}

impl Bounds {
    #[inline(always)]
    fn new() -> Self {
        let most = pow(hyab(hunt_lab(0.0, 1.0, 0.0), hunt_lab(0.0, 0.0, 1.0)), QC);
        Bounds { most, knee: PC * most }
    }

    /// Maps an error below the knee to [0, 0.95], above it to the rest.
    #[inline(always)]
    fn redistribute(&self, error: f32) -> f32 {
        let below = error * (PT / self.knee);
        let above = PT + (error - self.knee) / (self.most - self.knee) * (1.0 - PT);
        if error < self.knee { below } else { above }
    }
}

/// A row of a block.
type Row = [f32; BLOCK];

/// The errors of a row from both images, filtered.
///
/// Loops over whole rows of known length, of scalars alone: compilers make SIMD of
/// them. One loop over all, with arrays of channels, stayed scalar and took FLIP
/// from 0.43 to 1.85 s at 4K.
#[inline(always)]
fn error_row(reference: &[Row; 8], test: &[Row; 8], bounds: &Bounds, out: &mut Row) {
    let (mut colour, mut feature) = ([0.0; BLOCK], [0.0; BLOCK]);
    for (x, colour) in colour.iter_mut().enumerate() {
        *colour = hyab(lab_at(reference, x), lab_at(test, x));
    }
    for (x, feature) in feature.iter_mut().enumerate() {
        let edge = (strength_at(reference, 4, x) - strength_at(test, 4, x)).abs();
        let point = (strength_at(reference, 6, x) - strength_at(test, 6, x)).abs();
        *feature = (std::f32::consts::FRAC_1_SQRT_2 * if edge > point { edge } else { point }).sqrt();
    }
    for x in 0..BLOCK {
        out[x] = pow(bounds.redistribute(pow(colour[x], QC)), 1.0 - feature[x]);
    }
}

#[inline(always)]
fn lab_at(filtered: &[Row; 8], x: usize) -> (f32, f32, f32) {
    let (y, cx, cz) = (filtered[0][x], filtered[1][x], filtered[2][x] + filtered[3][x]);
    let (r, g, b) = clamped_rgb(y + cx, y, y - cz);
    hunt_lab(r, g, b)
}

/// The length of a feature's vector, whose x and y stand in rows `i` and `i + 1`.
#[inline(always)]
fn strength_at(filtered: &[Row; 8], i: usize, x: usize) -> f32 {
    (filtered[i][x] * filtered[i][x] + filtered[i + 1][x] * filtered[i + 1][x]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u32, size: [usize; 2], planes: usize) -> Image {
        let mut x = seed;
        let mut next = || {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (x >> 8) as f32 / 16_777_216.0
        };
        let planes = (0..planes).map(|_| (0..size[0] * size[1]).map(|_| next()).collect()).collect();
        Image::new(size, planes, Encoding::Srgb).unwrap()
    }

    #[test]
    fn filters_sum_to_one() {
        for ppd in [1.0, 20.0, DEFAULT_PPD, 130.0] {
            let f = Filters::new(ppd).unwrap();
            let sum = |half: &[f32]| half[0] + 2.0 * half[1..].iter().sum::<f32>();
            let [a, rg, by1, by2] = f.sensitivity.each_ref().map(|h| sum(h));
            assert!((a - 1.0).abs() < 1e-6 && (rg - 1.0).abs() < 1e-6 && (by1 * by1 + by2 * by2 - 1.0).abs() < 1e-6);
            assert!((sum(&f.features[0]) - 1.0).abs() < 1e-6 && sum(&f.features[2]).abs() < 1e-6);
        }
        assert_eq!(Filters::new(DEFAULT_PPD).unwrap().radius, 10);
        assert!(Filters::new(0.0).is_err() && Filters::new(f64::NAN).is_err());
    }

    /// With AVX2, without, and across the borders of blocks and bands.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let (a, b) = (noise(1, [300, 160], 3), noise(2, [300, 160], 3));
        let pair = Pair::new(&a, &b, None).unwrap();
        let filters = Filters::new(DEFAULT_PPD).unwrap();
        let fast = flip_of(&pair, &filters, Light::Srgb, Arch::new()).unwrap();
        let portable = flip_of(&pair, &filters, Light::Srgb, Arch::Scalar).unwrap();
        assert!(fast.iter().zip(&portable).all(|(a, b)| a.to_bits() == b.to_bits()));
        assert!(fast.iter().all(|e| (0.0..=1.0).contains(e)));
    }

    #[test]
    fn equal_images_have_no_error_and_opposites_the_most() {
        let a = noise(1, [40, 30], 1);
        assert!(flip(&Pair::new(&a, &a, None).unwrap(), DEFAULT_PPD).unwrap().iter().all(|&e| e == 0.0));
        let flat = |v: f32| Image::new([20, 20], vec![vec![v; 400]], Encoding::Linear).unwrap();
        let (black, white) = (flat(0.0), flat(1.0));
        let errors = flip(&Pair::new(&black, &white, None).unwrap(), DEFAULT_PPD).unwrap();
        // HyAB 100 of at most 203.3: 0.95 + 0.05 (100^0.7 - 0.4 m) / (0.6 m), m = 203.3^0.7.
        assert!(errors.iter().all(|e| (e - 0.96739).abs() < 1e-4), "{}", errors[0]);
    }
}
