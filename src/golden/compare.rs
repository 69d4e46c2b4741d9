//! Whether an image may be another sample of its golden.

use super::Sampled;
use crate::{
    layers::pixel_hash,
    stats::{Estimate, sidak_alpha, welch_of_moments},
};
use serde::Serialize;

/// Edge of a tile, pixels. Single pixels have no power (a shift of .48 would
/// pass), the whole image no place; 16 x 16 tiles at 16 replicates see .023.
pub const TILE: u32 = 16;

/// A tile's bias that must be found with probability .8, or a comparison says
/// nothing.
pub const MUST_SEE: f64 = 0.05;

/// Rays that may be decided differently where the random numbers are the same: a
/// share of all. It is what the GPU is allowed against the CPU.
const SAME_RAYS: f64 = 1e-4;

/// A test of one tile, or of the whole image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tile {
    /// Left, top, width and height in pixels.
    pub place: [u32; 4],
    /// Mean of the image less mean of the golden.
    pub bias: f64,
    /// Standard error of the bias.
    pub se: f64,
    /// Two-sided p-value.
    pub p: f64,
}

/// What a comparison found.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Finding {
    /// The same pixels to the last bit.
    Identical,
    /// No test rejects: the image may be another sample of the golden. With the
    /// golden's own seeds: hardly a ray is decided differently.
    Equal,
    /// The random numbers are the golden's, but more rays than rounding can
    /// explain are decided differently.
    Rays {
        /// Their share, at least.
        share: f64,
    },
    /// The tests that reject, the surest first.
    Shifted(Vec<Tile>),
    /// Pixels that hold a number on one side only: geometry moved, or NaN.
    Structure {
        /// How many.
        pixels: usize,
    },
}

/// A comparison with what it could have seen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// What was found.
    pub finding: Finding,
    /// Whether the image used the golden's own random numbers.
    pub same_seeds: bool,
    /// Bias of the whole image.
    pub bias: f64,
    /// The bias of a tile that would be found with probability .8, in the median
    /// tile.
    pub detectable: f64,
    /// Tests made.
    pub tests: usize,
}

impl Comparison {
    /// Whether the image may stand for its golden.
    pub fn passes(&self) -> bool {
        matches!(self.finding, Finding::Identical | Finding::Equal)
    }

    /// Whether it finds nothing because it could see nothing.
    pub fn is_blind(&self) -> bool {
        self.finding == Finding::Equal && !self.same_seeds && self.detectable >= MUST_SEE
    }

    /// One line for people.
    pub fn line(&self) -> String {
        let seeds = if self.same_seeds { "same seeds" } else { "fresh seeds" };
        let sees = format!("would see a bias of {:.4} in a tile", self.detectable);
        match &self.finding {
            Finding::Identical => format!("identical  {seeds}"),
            Finding::Equal if self.is_blind() => format!("BLIND      {seeds}; {sees}, {MUST_SEE} is wanted"),
            Finding::Equal => format!("equal      {seeds}; mean bias {:+.5}; {sees}", self.bias),
            Finding::Rays { share } => {
                format!("DIFFERENT  {seeds}, but {:.3} % of the rays or more are decided differently", share * 100.0)
            }
            Finding::Structure { pixels } => {
                format!("DIFFERENT  {pixels} pixels hold a number in one image only")
            }
            Finding::Shifted(tiles) => {
                let worst = tiles.first().map_or_else(String::new, |t| {
                    let [x, y, w, h] = t.place;
                    format!("; surest at {x},{y} ({w}x{h}): {:+.4}, p = {:.1e}", t.bias, t.p)
                });
                format!("DIFFERENT  {} of {} tests reject{worst}; mean bias {:+.5}", tiles.len(), self.tests, self.bias)
            }
        }
    }
}

/// Compares an image with its golden, both of the same resolution.
///
/// The exact hash comes first, where the golden's seeds were used; if it differs,
/// no more than 1 ray in 10,000 may. With fresh seeds, Welch's test, with both variances, on every
/// 16 x 16 tile and on the whole image: the variance of a mean over pixels is the
/// sum of the pixels' variances over (pixels^2 x replicates), because pixels have
/// random numbers of their own. Tiles without any noise would reject on one ray,
/// so the variance of a tile's mean is never below (1 / its rays)^2. The level is
/// Sidak's for all tests of `family` cases.
pub fn compare(golden: &Sampled, image: &Sampled, alpha: f64, family: usize) -> Comparison {
    let same_seeds = golden.seed == image.seed && golden.replicates == image.replicates && golden.rays == image.rays;
    let structure = golden.mean.iter().zip(&image.mean).filter(|(a, b)| a.is_finite() != b.is_finite()).count();
    let [width, height] = golden.resolution;
    let whole = [0, 0, width, height];
    let tiles: Vec<[u32; 4]> = (0..height)
        .step_by(TILE as usize)
        .flat_map(|y| (0..width).step_by(TILE as usize).map(move |x| [x, y, TILE.min(width - x), TILE.min(height - y)]))
        .chain([whole])
        .collect();
    let level = sidak_alpha(alpha, tiles.len() * family.max(1));
    let tests: Vec<(Tile, f64)> = tiles.iter().filter_map(|&place| test(golden, image, place)).collect();
    let mut rejected: Vec<Tile> = tests.iter().map(|(t, _)| *t).filter(|t| t.p < level || t.p.is_nan()).collect();
    rejected.sort_by(|a, b| a.p.total_cmp(&b.p));
    let mut detectable: Vec<f64> = tests
        .iter()
        .filter(|(t, _)| t.place != whole)
        .map(|(t, df)| Estimate { value: t.bias, se: t.se, df: *df }.detectable(level, 0.8))
        .collect();
    detectable.sort_by(f64::total_cmp);
    let finding = if same_seeds && pixel_hash(&golden.mean) == pixel_hash(&image.mean) {
        Finding::Identical
    } else if structure > 0 {
        Finding::Structure { pixels: structure }
    } else if same_seeds {
        let share = rays_moved(golden, image);
        if share <= SAME_RAYS { Finding::Equal } else { Finding::Rays { share } }
    } else if rejected.is_empty() {
        Finding::Equal
    } else {
        Finding::Shifted(rejected)
    };
    Comparison {
        finding,
        same_seeds,
        bias: tests.iter().find(|(t, _)| t.place == whole).map_or(0.0, |(t, _)| t.bias),
        detectable: detectable.get(detectable.len() / 2).copied().unwrap_or(0.0),
        tests: tests.len(),
    }
}

/// The least share of rays that explains the difference of the means.
fn rays_moved(golden: &Sampled, image: &Sampled) -> f64 {
    let pairs = || golden.mean.iter().zip(&image.mean).filter(|(a, b)| a.is_finite() && b.is_finite());
    let moved: f64 = pairs().map(|(a, b)| f64::from((a - b).abs())).sum();
    moved / pairs().count() as f64
}

/// Mean, variance of that mean and its degrees of freedom over a rectangle; None
/// where it holds no number.
fn moments(image: &Sampled, [x, y, w, h]: [u32; 4]) -> Option<(f64, f64, f64)> {
    let (mut n, mut sum, mut variance, mut squares) = (0.0, 0.0, 0.0, 0.0);
    for row in y..y + h {
        for column in x..x + w {
            let i = (row * image.resolution[0] + column) as usize;
            if image.mean[i].is_finite() {
                let v = f64::from(image.variance[i]);
                n += 1.0;
                sum += f64::from(image.mean[i]);
                variance += v;
                squares += v * v;
            }
        }
    }
    if n == 0.0 {
        return None;
    }
    let replicates = f64::from(image.replicates);
    let floor = (n * replicates * f64::from(image.rays)).powi(-2);
    // Welch and Satterthwaite over the pixels.
    let df = if squares > 0.0 { variance * variance * (replicates - 1.0) / squares } else { n * (replicates - 1.0) };
    Some((sum / n, (variance / (n * n * replicates)).max(floor), df))
}

fn test(golden: &Sampled, image: &Sampled, place: [u32; 4]) -> Option<(Tile, f64)> {
    let welch = welch_of_moments(moments(image, place)?, moments(golden, place)?);
    let d = welch.difference;
    Some((Tile { place, bias: d.value, se: d.se, p: welch.p_two }, d.df))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::sampler::Sampler;

    /// Binary openness of probability `p`, plus a bias in one tile.
    fn sample(seed: u32, bias: f64) -> Sampled {
        let (resolution, replicates, rays) = ([64u32, 32u32], 16u32, 32u32);
        let n = (resolution[0] * resolution[1]) as usize;
        let (mut mean, mut variance) = (vec![], vec![]);
        for pixel in 0..n as u32 {
            let (x, y) = (pixel % 64, pixel / 64);
            let p = 0.55 + 0.4 * f64::from(x) / 64.0 + if x < 16 && y < 16 { bias } else { 0.0 };
            let values: Vec<f64> = (0..replicates)
                .map(|r| {
                    // One dimension a ray, so that rays are independent.
                    let sampler = Sampler::new(seed, pixel, r);
                    let open = (0..rays).filter(|&i| f64::from(sampler.pair(0, i)[0]) < p).count();
                    open as f64 / f64::from(rays)
                })
                .collect();
            let (m, v) = crate::stats::mean_variance(&values);
            mean.push(m as f32);
            variance.push(v as f32);
        }
        Sampled { resolution, mean, variance, replicates, rays, seed }
    }

    /// At alpha .01, 300 comparisons of fresh seeds reject 3 on average; the
    /// binomial 99.9 % band is 0 to 9. Seeds are fixed.
    #[test]
    fn fresh_seeds_pass_at_the_stated_rate() {
        let golden = sample(1, 0.0);
        let rejected = (2..302).filter(|&seed| !compare(&golden, &sample(seed, 0.0), 0.01, 1).passes()).count();
        assert!(rejected <= 9, "{rejected} of 300");
    }

    #[test]
    fn a_shift_of_one_tile_is_found_and_placed() {
        let golden = sample(1, 0.0);
        let c = compare(&golden, &sample(2, 0.04), 0.01, 20);
        let Finding::Shifted(tiles) = &c.finding else { panic!("{c:?}") };
        assert_eq!(tiles[0].place, [0, 0, 16, 16]);
        assert!((tiles[0].bias - 0.04).abs() < 0.01);
        assert!(c.detectable > 0.0 && c.detectable < 0.04, "{}", c.detectable);
    }

    #[test]
    fn the_same_pixels_are_identical_and_holes_are_structure() {
        let golden = sample(1, 0.0);
        assert_eq!(compare(&golden, &golden, 0.01, 1).finding, Finding::Identical);
        let mut holed = sample(2, 0.0);
        holed.mean[5] = f32::NAN;
        assert_eq!(compare(&golden, &holed, 0.01, 1).finding, Finding::Structure { pixels: 1 });
    }

    #[test]
    fn with_the_same_seeds_a_shift_is_no_noise() {
        let golden = sample(1, 0.0);
        let mut image = golden.clone();
        for v in &mut image.mean {
            *v += 0.001;
        }
        assert!(matches!(compare(&golden, &image, 0.01, 1).finding, Finding::Rays { .. }));
        image = golden.clone();
        image.mean[7] -= 2.0 / (16.0 * 32.0);
        assert_eq!(compare(&golden, &image, 0.01, 1).finding, Finding::Equal);
    }

    #[test]
    fn without_noise_one_ray_is_not_enough_to_reject() {
        let mut golden = sample(1, 0.0);
        golden.mean.fill(1.0);
        golden.variance.fill(0.0);
        let mut image = Sampled { seed: 2, ..golden.clone() };
        // One ray of one replicate in one pixel.
        image.mean[100] = 1.0 - 1.0 / (16.0 * 32.0);
        assert_eq!(compare(&golden, &image, 0.01, 1).finding, Finding::Equal);
        for v in &mut image.mean[100..110] {
            *v = 1.0 - 2.0 / 16.0;
        }
        assert!(!compare(&golden, &image, 0.01, 1).passes());
    }
}
