//! Whether two sampled images may have one expectation: Welch's test at three
//! scales, because no scale sees everything. Single pixels have place and no power,
//! the whole image power and no place; tiles lie between.

use super::{Estimate, normal_quantile, sidak_alpha, student::tails};
use schemars::JsonSchema;
use serde::Serialize;

/// Edge of a tile, pixels.
pub const TILE: u32 = 16;

/// Probability with which a detectable bias is found.
pub const POWER: f64 = 0.8;

/// The size of the places that one set of tests compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Every pixel.
    Pixel,
    /// Every tile of [`TILE`] x [`TILE`] pixels, smaller at the right and the bottom.
    Tile,
    /// The whole image.
    Image,
}

impl Scale {
    /// All, from small to large.
    pub const ALL: [Scale; 3] = [Scale::Pixel, Scale::Tile, Scale::Image];
}

/// A sampled image: knows the mean over some of its pixels, and how sure it is.
pub trait ImageSample {
    /// Whether a pixel, counted row by row, holds a number.
    fn is_known(&self, pixel: usize) -> bool;

    /// The mean over pixels that are known, one or more. Its standard error is NaN
    /// where it cannot be told.
    fn mean(&self, pixels: &[usize]) -> Estimate;
}

/// An image whose pixels are independent of each other, by mean and variance over
/// replicates a pixel: renders with random numbers of their own for each pixel, and
/// nothing that mixes pixels.
///
/// The variance of a mean over n pixels is sum v / (n^2 replicates), with Welch and
/// Satterthwaite's degrees of freedom over the pixels: many, so this sees more than
/// [`Replicates`] of the same number. Filtered or denoised images are not
/// independent: there it rejects far too often.
#[derive(Clone, Copy, Debug)]
pub struct IndependentPixels<'a> {
    /// Mean over replicates a pixel; NaN where there is no number.
    pub mean: &'a [f32],
    /// Unbiased variance over replicates a pixel.
    pub variance: &'a [f32],
    /// Independent replicates, 2 or more.
    pub replicates: u32,
    /// How much one ray changes one pixel of one replicate, 1 / rays; 0 where values
    /// are continuous. Places without any noise would reject on one ray, so the
    /// standard error of a mean is never below what one ray changes it by. For N rays
    /// that all agree this is the error sqrt(q (1 - q) / N) = 1/N of Laplace's share of
    /// misses q = 1 / (N + 2), to first order.
    pub quantum: f64,
}

/// An image by its replicates, each a whole image with a seed of its own.
///
/// The mean of a place is taken in each replicate, and its error from how these
/// means scatter: right however the pixels of one replicate depend on each other.
/// Two sides of n replicates have 2 n - 2 degrees of freedom at every scale.
#[derive(Clone, Debug)]
pub struct Replicates<'a> {
    /// The replicates, 2 or more. A pixel is known where all are finite.
    pub images: Vec<&'a [f32]>,
    /// As in [`IndependentPixels`].
    pub quantum: f64,
}

impl ImageSample for IndependentPixels<'_> {
    fn is_known(&self, pixel: usize) -> bool {
        self.mean.get(pixel).is_some_and(|v| v.is_finite()) && pixel < self.variance.len()
    }

    fn mean(&self, pixels: &[usize]) -> Estimate {
        let (mut sum, mut variance, mut squares) = (0.0, 0.0, 0.0);
        for &i in pixels {
            let v = f64::from(self.variance[i]);
            sum += f64::from(self.mean[i]);
            variance += v;
            squares += v * v;
        }
        let (n, replicates) = (pixels.len() as f64, f64::from(self.replicates));
        let shares = if squares > 0.0 { variance * variance / squares } else { n };
        let se = (variance / (n * n * replicates)).sqrt();
        Estimate { value: sum / n, se: at_least(se, self.quantum / (n * replicates)), df: shares * (replicates - 1.0) }
    }
}

impl ImageSample for Replicates<'_> {
    fn is_known(&self, pixel: usize) -> bool {
        !self.images.is_empty() && self.images.iter().all(|image| image.get(pixel).is_some_and(|v| v.is_finite()))
    }

    fn mean(&self, pixels: &[usize]) -> Estimate {
        let (n, replicates) = (pixels.len() as f64, self.images.len() as f64);
        let of = |image: &&[f32]| pixels.iter().map(|&i| f64::from(image[i])).sum::<f64>() / n;
        let mean = Estimate::of_mean(&self.images.iter().map(of).collect::<Vec<_>>());
        Estimate { se: at_least(mean.se, self.quantum / (n * replicates)), ..mean }
    }
}

/// The greater, but NaN where the standard error is.
fn at_least(se: f64, floor: f64) -> f64 {
    if se < floor { floor } else { se }
}

/// A test of one place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Difference {
    /// Left, top, width and height in pixels.
    pub place: [u32; 4],
    /// Mean of the first image less mean of the second, over pixels known in both.
    pub bias: f64,
    /// Standard error of the bias.
    #[schemars(with = "Option<f64>")]
    pub se: f64,
    /// Two-sided p-value; NaN where a standard error is: nothing vouches for such a
    /// place, so it counts as rejected.
    #[schemars(with = "Option<f64>")]
    pub p: f64,
}

/// All tests of one scale.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ScaleTest {
    /// The scale.
    pub scale: Scale,
    /// Places that hold a number in both images.
    pub tests: usize,
    /// Level of each test.
    pub level: f64,
    /// The tests that reject, the surest first.
    pub rejected: Vec<Difference>,
    /// The smallest bias of a place that would be found with probability [`POWER`],
    /// in the place whose standard error is the median; 0 without places, infinite
    /// where that error is unknown.
    #[schemars(with = "Option<f64>")]
    pub detectable: f64,
}

impl ScaleTest {
    /// Whether a bias that openness can have would be found: one between 0 and 1.
    pub fn sees_something(&self) -> bool {
        self.detectable > 0.0 && self.detectable < 1.0
    }
}

/// Welch's test of every pixel, every tile and the whole image, from small to large.
/// Images of one resolution, width and height in pixels; pixels without a number in
/// either are left out of every place.
///
/// The family error, the chance of any rejection where both have one expectation, is
/// `alpha` over `cases` such comparisons: Sidak's level for 3 x cases, and within a
/// scale again for its places. So the many pixels do not cost tiles and image their
/// power: each scale has a third of the error. Scales of one image depend on each
/// other positively, which makes the family error smaller, not larger.
///
/// Measured, openness of 16 replicates x 32 rays, share of open rays .05 to .95:
///
/// | | nominal | measured |
/// |---|---|---|
/// | a tile, independent pixels | .01 | within [.0085, .0115], 40,000 tests |
/// | a tile, replicates | .01 | within [.0085, .0115], 40,000 tests |
/// | the image, replicates | .01 | within [.0085, .0115], 40,000 tests |
/// | a pixel | .01 | within [.0085, .0125], 40,000 tests |
/// | the image and a tile of 32 x 32, either sample | .01 | within [.007, .013], 10,000 tests each |
/// | the family, 32 x 32 pixels | .05 | below .062, 3,000 comparisons |
///
/// A pixel of 4 rays against 32, 16 replicates a side: below .01 at .01 for shares of
/// .97 and .999, but .02 to .03 for .9, where few samples show too little scatter by
/// chance. Without the quantum .97 rejects in a tenth or more. Compare images of as
/// many rays, or read tiles and image.
///
/// A bias of .02 over one tile of 256 x 256 pixels is found in all of 100 such
/// comparisons at a family error of .01.
pub fn three_scales(
    [width, height]: [u32; 2],
    image: &impl ImageSample,
    against: &impl ImageSample,
    alpha: f64,
    cases: usize,
) -> [ScaleTest; 3] {
    let share = sidak_alpha(alpha, Scale::ALL.len().saturating_mul(cases.max(1)));
    Scale::ALL.map(|scale| {
        let [w, h] = match scale {
            Scale::Pixel => [1, 1],
            Scale::Tile => [TILE, TILE],
            Scale::Image => [width.max(1), height.max(1)],
        };
        let places = (0..height).step_by(h as usize).flat_map(|y| {
            let left = (0..width).step_by(w as usize);
            left.map(move |x| [x, y, w.min(width - x), h.min(height - y)])
        });
        let tests: Vec<([u32; 4], Estimate)> =
            places.filter_map(|place| Some((place, bias(image, against, width, place)?))).collect();
        of_scale(scale, &tests, sidak_alpha(share, tests.len()))
    })
}

/// The two-sided p-value of every pixel, row by row; NaN where either image has no
/// number or no standard error.
pub fn pixel_p_values([width, height]: [u32; 2], image: &impl ImageSample, against: &impl ImageSample) -> Vec<f64> {
    let places = (0..height).flat_map(|y| (0..width).map(move |x| [x, y, 1, 1]));
    places.map(|place| bias(image, against, width, place).map_or(f64::NAN, |b| tails(&b, 0.0)[1])).collect()
}

/// Welch's difference over a place; None where no pixel is known in both.
fn bias(image: &impl ImageSample, against: &impl ImageSample, width: u32, [x, y, w, h]: [u32; 4]) -> Option<Estimate> {
    let pixels: Vec<usize> = (y..y + h)
        .flat_map(|row| (x..x + w).map(move |column| row as usize * width as usize + column as usize))
        .filter(|&i| image.is_known(i) && against.is_known(i))
        .collect();
    (!pixels.is_empty()).then(|| image.mean(&pixels).less(&against.mean(&pixels)))
}

fn of_scale(scale: Scale, tests: &[([u32; 4], Estimate)], level: f64) -> ScaleTest {
    // Student's tails are heavier than the normal's: a bias within the normal's bound
    // cannot reject, which spares most places the work.
    let bound = -normal_quantile(level / 2.0);
    let mut rejected: Vec<Difference> = tests
        .iter()
        .filter(|(_, bias)| bias.value.abs() >= bound * bias.se || bias.value.is_nan() || bias.se.is_nan())
        .map(|(place, bias)| Difference { place: *place, bias: bias.value, se: bias.se, p: tails(bias, 0.0)[1] })
        .filter(|d| d.p < level || d.p.is_nan())
        .collect();
    rejected.sort_by(|a, b| {
        let size = |d: &Difference| (d.bias / d.se).abs();
        a.p.total_cmp(&b.p).then(size(b).total_cmp(&size(a)))
    });
    // A quantile of Student's t for every place would cost more than all the tests.
    let mut by_error: Vec<&Estimate> = tests.iter().map(|(_, bias)| bias).collect();
    let middle = by_error.len() / 2;
    let detectable = match by_error.is_empty() {
        true => 0.0,
        false => by_error.select_nth_unstable_by(middle, |a, b| a.se.total_cmp(&b.se)).1.detectable(level, POWER),
    };
    ScaleTest { scale, tests: tests.len(), level, rejected, detectable }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four pixels of equal variance.
    fn flat(mean: &[f32]) -> IndependentPixels<'_> {
        IndependentPixels { mean, variance: &[0.25; 4], replicates: 4, quantum: 0.0 }
    }

    #[test]
    fn means_and_errors_are_what_the_formulas_say() {
        let mean = [0.1, 0.2, 0.3, 0.6];
        let a = flat(&mean);
        let e = a.mean(&[0, 1, 2, 3]);
        // Sum of v / (n^2 replicates) = 1 / (16 x 4); four equal shares of 3.
        assert!((e.value - 0.3).abs() < 1e-7 && e.se == 0.125 && e.df == 12.0, "{e:?}");
        let images = [[0.0f32, 1.0, f32::NAN], [0.5, 0.5, 0.5], [1.0, 0.6, 0.1]];
        let b = Replicates { images: images.iter().map(|i| &i[..]).collect(), quantum: 0.0 };
        assert!(b.is_known(1) && !b.is_known(2) && !b.is_known(3));
        let e = b.mean(&[0, 1]);
        let direct = Estimate::of_mean(&[0.5, 0.5, 0.8]);
        assert!((e.value - direct.value).abs() < 1e-7 && (e.se - direct.se).abs() < 1e-7 && e.df == 2.0);
    }

    #[test]
    fn without_noise_a_ray_is_not_enough_but_many_are() {
        let (zero, ones) = ([0.0f32; 1024], [1.0f32; 1024]);
        let golden = IndependentPixels { mean: &ones, variance: &zero, replicates: 16, quantum: 1.0 / 32.0 };
        let mut mean = ones;
        mean[5] -= 1.0 / 512.0;
        let rejected = |mean: &[f32]| {
            let scales = three_scales([32, 32], &IndependentPixels { mean, ..golden }, &golden, 0.01, 1);
            scales.map(|s| s.rejected.len())
        };
        assert_eq!(rejected(&mean), [0, 0, 0]);
        for v in &mut mean[0..10] {
            *v = 1.0 - 16.0 / 512.0;
        }
        assert_eq!(rejected(&mean), [10, 1, 1]);
    }

    #[test]
    fn pixels_without_numbers_are_left_out_on_both_sides() {
        let (hole, whole) = ([f32::NAN, 0.2, 0.3, 0.6], [0.9f32, 0.2, 0.3, 0.6]);
        let (a, b) = (flat(&hole), flat(&whole));
        let [pixel, tile, image] = three_scales([2, 2], &a, &b, 0.05, 1);
        assert_eq!((pixel.tests, tile.tests, image.tests), (3, 1, 1));
        assert!(pixel.rejected.is_empty() && image.rejected.is_empty());
        let p = pixel_p_values([2, 2], &a, &b);
        assert!(p[0].is_nan() && p[1..].iter().all(|p| *p == 1.0), "{p:?}");
        let nothing = [f32::NAN; 4];
        let none = three_scales([2, 2], &flat(&nothing), &b, 0.05, 1);
        assert!(none.iter().all(|s| s.tests == 0 && s.rejected.is_empty() && s.detectable == 0.0));
        assert!(three_scales([0, 0], &a, &b, 0.05, 1).iter().all(|s| s.tests == 0));
    }

    #[test]
    fn an_unknown_error_vouches_for_nothing() {
        let mean = [0.1f32, 0.2, 0.3, 0.6];
        let known = flat(&mean);
        let unknown = IndependentPixels { variance: &[f32::NAN, 0.1, 0.1, 0.1], ..known };
        let [pixel, tile, _] = three_scales([2, 2], &unknown, &known, 0.05, 1);
        assert_eq!((pixel.rejected.len(), tile.rejected.len()), (1, 1));
        assert!(pixel.rejected[0].p.is_nan() && tile.detectable == f64::INFINITY);
    }

    #[test]
    fn a_shift_is_placed_and_its_levels_are_sidaks() {
        let n = 40 * 20;
        let mean = vec![0.5f32; n];
        let mut shifted = mean.clone();
        for y in 0..16 {
            shifted[y * 40 + 16..y * 40 + 32].fill(0.6);
        }
        let variance = vec![0.01f32; n];
        let a = IndependentPixels { mean: &shifted, variance: &variance, replicates: 16, quantum: 1.0 / 32.0 };
        let [pixel, tile, image] = three_scales([40, 20], &a, &IndependentPixels { mean: &mean, ..a }, 0.01, 5);
        assert_eq!((pixel.tests, tile.tests, image.tests), (800, 6, 1));
        let share = sidak_alpha(0.01, 15);
        assert_eq!([pixel.level, tile.level, image.level], [sidak_alpha(share, 800), sidak_alpha(share, 6), share]);
        assert_eq!(tile.rejected.len(), 1);
        assert_eq!(tile.rejected[0].place, [16, 0, 16, 16]);
        assert!((tile.rejected[0].bias - 0.1).abs() < 1e-6);
        assert!(pixel.detectable > tile.detectable && tile.detectable > image.detectable);
    }
}
