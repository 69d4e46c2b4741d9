//! Structural similarity, at one scale and at five.

use super::{
    Image, ImageError, Pair,
    filter::{BAND, BLOCK, LANES, Ring, even},
};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::borrow::Cow;

/// The window reaches this far from its middle: 11 x 11 pixels.
const RADIUS: usize = 5;
/// Standard deviation of the window's Gaussian, pixels.
const DEVIATION: f64 = 1.5;
/// What keeps the ratios finite: (K1 L)^2 and (K2 L)^2 for values of range L = 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Exponents of the five scales, finest first (Wang, Simoncelli and Bovik 2003).
const EXPONENTS: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];

/// The least width and height for [`ssim`], pixels: one window.
pub const SSIM_SIDE: usize = 2 * RADIUS + 1;
/// The least width and height for [`ms_ssim`], pixels: one window at the coarsest
/// scale.
pub const MS_SSIM_SIDE: usize = SSIM_SIDE << (EXPONENTS.len() - 1);

/// SSIM of two images, and of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Ssim {
    /// The weighted mean over the windows that lie within the image, -1 to 1; 1 for
    /// equal images.
    pub mean: f64,
    /// SSIM of the window about each pixel; NaN where it does not fit.
    pub map: Vec<f32>,
    /// The mean of contrast times structure, which MS-SSIM takes of fine scales.
    contrast: f64,
}

/// Structural similarity in its canonical form: luma (the mean of the channels) of
/// range 1, an 11 x 11 Gaussian window of deviation 1.5, K1 = 0.01, K2 = 0.03,
/// biased variances, mean over the windows that fit. It is blind to colour: images of
/// one luma are equal.
///
/// (2 m_r m_t + C1)(2 s_rt + C2) / ((m_r^2 + m_t^2 + C1)(s_r^2 + s_t^2 + C2)).
/// Wang, Bovik, Sheikh, Simoncelli: Image Quality Assessment, 2004. Higher is
/// better. Computed in f64: variances are small differences of large numbers.
///
/// # Errors
/// [`ImageError::Range`] where a side is shorter than [`SSIM_SIDE`], and
/// [`ImageError::Nothing`] where the mask has no weight at any window's middle.
pub fn ssim(pair: &Pair<'_>) -> Result<Ssim, ImageError> {
    check_side(pair, SSIM_SIDE, "11 pixels or more for SSIM")?;
    let sides = [pair.reference(), pair.test()].map(Luma::Image);
    structure(&sides, pair.weights(), true, Arch::new()).ok_or_else(|| nothing(pair))
}

/// Multi-scale structural similarity: contrast and structure at five scales,
/// luminance at the coarsest, each to its exponent, multiplied.
///
/// Wang, Simoncelli, Bovik: Multi-scale Structural Similarity for Image Quality
/// Assessment, 2003. A scale is the mean over 2 x 2 pixels of the one before; an
/// odd last row or column is left out; so are the mask's weights. Negative means
/// count as 0. Range 0 to 1, higher is better. `finest` is the [`ssim`] of the
/// same pair.
///
/// # Errors
/// [`ImageError::Range`] where a side is shorter than [`MS_SSIM_SIDE`], and
/// [`ImageError::Nothing`] where the mask leaves nothing at some scale.
pub fn ms_ssim(pair: &Pair<'_>, finest: &Ssim) -> Result<f64, ImageError> {
    check_side(pair, MS_SSIM_SIDE, "176 pixels or more for MS-SSIM")?;
    let mut product = finest.contrast.max(0.0).powf(EXPONENTS[0]);
    let mut sides = [pair.reference(), pair.test()].map(Luma::Image);
    let mut weights = pair.weights().map(Cow::Borrowed);
    for (scale, exponent) in EXPONENTS.iter().enumerate().skip(1) {
        let size = sides[0].size();
        weights = weights.map(|w| Cow::Owned(halve_weights(&w, size)));
        sides = sides.map(|side| side.halved());
        let at = structure(&sides, weights.as_deref(), false, Arch::new()).ok_or_else(|| nothing(pair))?;
        let factor = if scale + 1 == EXPONENTS.len() { at.mean } else { at.contrast };
        product *= factor.max(0.0).powf(*exponent);
    }
    Ok(product)
}

fn check_side(pair: &Pair<'_>, least: usize, range: &'static str) -> Result<(), ImageError> {
    let [width, height] = pair.reference().size();
    match width.min(height) {
        side if side < least => Err(ImageError::Range { what: "the shorter side", value: side as f64, range }),
        _ => Ok(()),
    }
}

fn nothing(pair: &Pair<'_>) -> ImageError {
    let n = pair.non_finite();
    let non_finite = n.reference + n.test + n.both;
    ImageError::Nothing { masked: pair.reference().pixels() - non_finite, non_finite }
}

/// One channel, made on the way or held.
#[derive(Clone)]
enum Luma<'a> {
    Image(&'a Image),
    Plane { size: [usize; 2], values: Vec<f64> },
}

impl Luma<'_> {
    fn size(&self) -> [usize; 2] {
        match self {
            Luma::Image(image) => image.size(),
            Luma::Plane { size, .. } => *size,
        }
    }

    /// The values of row `y` from column `left` on; what lies beyond is 0.
    #[inline(always)]
    fn row(&self, y: usize, left: usize, out: &mut [f64]) {
        let width = self.size()[0];
        let n = out.len().min(width - left);
        let range = y * width + left..y * width + left + n;
        let (out, beyond) = out.split_at_mut(n);
        beyond.fill(0.0);
        match self {
            Luma::Image(image) => match image.planes() {
                [red, green, blue] => {
                    let (red, green, blue) = (&red[range.clone()], &green[range.clone()], &blue[range]);
                    for (i, out) in out.iter_mut().enumerate() {
                        *out = (f64::from(red[i]) + f64::from(green[i]) + f64::from(blue[i])) * (1.0 / 3.0);
                    }
                }
                planes => out.iter_mut().zip(&planes[0][range]).for_each(|(o, v)| *o = f64::from(*v)),
            },
            Luma::Plane { values, .. } => out.copy_from_slice(&values[range]),
        }
    }

    /// Means over 2 x 2 pixels.
    fn halved(&self) -> Luma<'static> {
        let [width, height] = self.size();
        let size = [width / 2, height / 2];
        let mut values = vec![0.0; size[0] * size[1]];
        values.par_chunks_mut(size[0]).enumerate().for_each(|(y, out)| {
            let mut rows = [vec![0.0; width], vec![0.0; width]];
            rows.iter_mut().enumerate().for_each(|(i, row)| self.row(2 * y + i, 0, row));
            for (x, out) in out.iter_mut().enumerate() {
                *out = 0.25 * (rows[0][2 * x] + rows[0][2 * x + 1] + rows[1][2 * x] + rows[1][2 * x + 1]);
            }
        });
        Luma::Plane { size, values }
    }
}

fn halve_weights(weights: &[f32], [width, height]: [usize; 2]) -> Vec<f32> {
    let at = |x: usize, y: usize| weights[y * width + x];
    (0..height / 2)
        .flat_map(|y| (0..width / 2).map(move |x| (2 * x, 2 * y)))
        .map(|(x, y)| 0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)))
        .collect()
}

/// The Gaussian from its middle outwards, of sum 1.
fn window() -> Vec<f64> {
    let half: Vec<f64> = (0..=RADIUS).map(|k| (-0.5 * (k as f64 / DEVIATION).powi(2)).exp()).collect();
    let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    half.iter().map(|v| v / sum).collect()
}

/// SSIM of two channels; None where no window has weight. The map stays empty
/// where it is not wanted.
fn structure(sides: &[Luma<'_>; 2], weights: Option<&[f32]>, wanted: bool, arch: Arch) -> Option<Ssim> {
    let [width, height] = sides[0].size();
    let window = window();
    let mut map = if wanted { vec![f32::NAN; width * height] } else { Vec::new() };
    // Rows whose windows fit, in bands.
    let inside = height.checked_sub(2 * RADIUS)?;
    let tops: Vec<usize> = (0..inside).step_by(BAND).collect();
    let band_of = |top: usize, rows: Option<&mut [f32]>| {
        let mut band = Band { top, rows: BAND.min(inside - top), sides, window: &window, weights, map: rows };
        (0..width.saturating_sub(2 * RADIUS)).step_by(BLOCK).fold(Sums::default(), |sums, left| {
            let of_tile = arch.dispatch(Tile { band: &mut band, left });
            sums.and(of_tile)
        })
    };
    let parts: Vec<Sums> = if wanted {
        let rows = map[RADIUS * width..(RADIUS + inside) * width].par_chunks_mut(BAND * width);
        rows.zip(&tops).map(|(rows, &top)| band_of(top, Some(rows))).collect()
    } else {
        tops.par_iter().map(|&top| band_of(top, None)).collect()
    };
    let sums = parts.into_iter().fold(Sums::default(), Sums::and);
    let mean = |sum: f64| sum / sums.weight;
    (sums.weight > 0.0).then(|| Ssim { mean: mean(sums.ssim), contrast: mean(sums.contrast), map })
}

#[derive(Clone, Copy, Default)]
struct Sums {
    weight: f64,
    ssim: f64,
    contrast: f64,
}

impl Sums {
    fn and(self, other: Sums) -> Sums {
        Sums {
            weight: self.weight + other.weight,
            ssim: self.ssim + other.ssim,
            contrast: self.contrast + other.contrast,
        }
    }
}

/// Rows of windows.
struct Band<'a> {
    /// The first row of the first window.
    top: usize,
    rows: usize,
    sides: &'a [Luma<'a>; 2],
    window: &'a [f64],
    weights: Option<&'a [f32]>,
    /// The rows of the map at the windows' middles.
    map: Option<&'a mut [f32]>,
}

/// A block of columns of a band.
struct Tile<'a, 'b> {
    band: &'a mut Band<'b>,
    /// The first column of the first window.
    left: usize,
}

/// r, t, r^2, t^2, r t.
const PLANES: usize = 5;

impl WithSimd for Tile<'_, '_> {
    type Output = Sums;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Sums {
        let Tile { band, left } = self;
        let width = band.sides[0].size()[0];
        let columns = BLOCK.min(width - 2 * RADIUS - left);
        let padded = columns.next_multiple_of(LANES);
        let mut rows: [Vec<f64>; PLANES] = std::array::from_fn(|_| vec![0.0; padded + 2 * RADIUS]);
        let mut rings: [Ring<f64>; PLANES] = std::array::from_fn(|_| Ring::new(2 * RADIUS + 1, padded));
        let mut filtered: [Vec<f64>; PLANES] = std::array::from_fn(|_| vec![0.0; padded]);
        let mut sums = Sums::default();
        for step in 0..band.rows + 2 * RADIUS {
            let [r, t, rr, tt, rt] = &mut rows;
            band.sides[0].row(band.top + step, left, r);
            band.sides[1].row(band.top + step, left, t);
            products(r, t, rr, tt, rt);
            for (ring, row) in rings.iter_mut().zip(&rows) {
                even(band.window, |k| &row[(RADIUS as isize + k) as usize..], ring.row_mut(step));
            }
            let Some(row) = step.checked_sub(2 * RADIUS) else { continue };
            for (ring, out) in rings.iter().zip(&mut filtered) {
                even(band.window, |k| ring.row(((step - RADIUS) as isize + k) as usize), out);
            }
            similarity(&mut filtered);
            let [ssim, contrast, ..] = &filtered;
            let at = row * width + RADIUS + left;
            if let Some(map) = &mut band.map {
                map[at..at + columns].iter_mut().zip(ssim).for_each(|(m, s)| *m = *s as f32);
            }
            let weights = band.weights.map(|w| &w[(band.top + RADIUS) * width + at..]);
            for x in 0..columns {
                let weight = weights.map_or(1.0, |w| f64::from(w[x]));
                sums.weight += weight;
                sums.ssim += weight * ssim[x];
                sums.contrast += weight * contrast[x];
            }
        }
        sums
    }
}

#[inline(always)]
fn products(r: &[f64], t: &[f64], rr: &mut [f64], tt: &mut [f64], rt: &mut [f64]) {
    let n = r.len();
    let (t, rr, tt, rt) = (&t[..n], &mut rr[..n], &mut tt[..n], &mut rt[..n]);
    for i in 0..n {
        (rr[i], tt[i], rt[i]) = (r[i] * r[i], t[i] * t[i], r[i] * t[i]);
    }
}

/// Window means of the five planes become SSIM and contrast times structure, in
/// the first two.
#[inline(always)]
fn similarity([r, t, rr, tt, rt]: &mut [Vec<f64>; PLANES]) {
    let n = r.len();
    let (r, t, rr, tt, rt) = (&mut r[..n], &mut t[..n], &rr[..n], &tt[..n], &rt[..n]);
    for i in 0..n {
        let (mr, mt) = (r[i], t[i]);
        let luminance = (2.0 * mr * mt + C1) / (mr * mr + mt * mt + C1);
        let contrast = (2.0 * (rt[i] - mr * mt) + C2) / (rr[i] - mr * mr + (tt[i] - mt * mt) + C2);
        (r[i], t[i]) = (luminance * contrast, contrast);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::image::Encoding;

    fn noise(seed: u32, size: [usize; 2]) -> Image {
        let mut x = seed;
        let mut next = || {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (x >> 8) as f32 / 16_777_216.0
        };
        Image::new(size, vec![(0..size[0] * size[1]).map(|_| next()).collect()], Encoding::Linear).unwrap()
    }

    #[test]
    fn equal_images_are_one_and_a_window_is_by_hand() {
        let a = noise(1, [200, 180]);
        let pair = Pair::new(&a, &a, None).unwrap();
        let s = ssim(&pair).unwrap();
        assert_eq!((s.mean, ms_ssim(&pair, &s).unwrap()), (1.0, 1.0));
        assert_eq!(s.map.iter().filter(|v| v.is_nan()).count(), 200 * 180 - 190 * 170);

        // One window of two constants: contrast is 1, luminance is left.
        let flat = |v: f32| Image::new([11, 11], vec![vec![v; 121]], Encoding::Linear).unwrap();
        let (a, b) = (flat(0.5), flat(0.25));
        let s = ssim(&Pair::new(&a, &b, None).unwrap()).unwrap();
        assert!((s.mean - (0.25 + C1) / (0.25 + 0.0625 + C1)).abs() < 1e-12);
        let small = flat(0.5);
        assert!(ms_ssim(&Pair::new(&small, &b, None).unwrap(), &s).unwrap_err().to_string().contains("176"));
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits_and_blocks_leave_no_seam() {
        let (a, b) = (noise(1, [300, 160]), noise(2, [300, 160]));
        let sides = [Luma::Image(&a), Luma::Image(&b)];
        let fast = structure(&sides, None, true, Arch::new()).unwrap();
        let portable = structure(&sides, None, true, Arch::Scalar).unwrap();
        assert_eq!(fast.mean.to_bits(), portable.mean.to_bits());
        // A window that spans two blocks, from an image that has but one.
        let part = |image: &Image| {
            let rows = (100..130).flat_map(|y| image.planes()[0][y * 300 + 240..y * 300 + 280].to_vec());
            Image::new([40, 30], vec![rows.collect()], Encoding::Linear).unwrap()
        };
        let (a, b) = (part(&a), part(&b));
        let alone = structure(&[Luma::Image(&a), Luma::Image(&b)], None, true, Arch::new()).unwrap();
        let apart = (5..25).flat_map(|y| (5..35).map(move |x| (x, y)));
        for (x, y) in apart {
            assert_eq!(alone.map[y * 40 + x], fast.map[(100 + y) * 300 + 240 + x], "{x}, {y}");
        }
    }

    #[test]
    fn masks_weigh_windows_at_their_middle() {
        let (a, b) = (noise(1, [40, 30]), noise(2, [40, 30]));
        let whole = ssim(&Pair::new(&a, &b, None).unwrap()).unwrap();
        let mut mask = vec![0.0; 1200];
        (mask[10 * 40 + 12], mask[20 * 40 + 30], mask[0]) = (1.0, 0.5, 1.0);
        let masked = ssim(&Pair::new(&a, &b, Some(&mask)).unwrap()).unwrap();
        let by_hand = (f64::from(whole.map[10 * 40 + 12]) + 0.5 * f64::from(whole.map[20 * 40 + 30])) / 1.5;
        assert!((masked.mean - by_hand).abs() < 1e-6);
        let mut border = vec![0.0; 1200];
        border[0] = 1.0;
        assert!(ssim(&Pair::new(&a, &b, Some(&border)).unwrap()).is_err());
    }
}
