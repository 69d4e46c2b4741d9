//! Whether an image may stand for its golden, and what moved where it may not.

use super::{Limits, Measured, Sampled, rays};
use crate::{
    layers::pixel_hash,
    metrics::image::{Encoding, Image, ImageError, Pair},
    metrics::regions::Region,
    stats::{
        Difference, Estimate, ImageSample, Noise, Scale, ScaleTest, noise_of_pixels, noise_of_replicates, sidak_alpha,
        three_scales, unexplained, upper_tail,
    },
};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// A tile's bias that must be found with probability .8, or a comparison says
/// nothing.
pub const MUST_SEE: f64 = 0.05;

/// Rejections that a comparison names; the rest are counted.
const NAMED: usize = 64;

/// Kinds of tests that share the family error: pixels, tiles, image, noise, pattern.
const KINDS: usize = 5;

/// How an image was held against its golden.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The same pixels to the last bit.
    Identical,
    /// By the rays decided differently: the random numbers are the golden's.
    SameSeeds,
    /// By Welch's tests of independent pixels.
    Pixels,
    /// By Welch's tests of replicates: pixels depend on each other.
    Replicates,
    /// By perceptual limits: there is no noise.
    Limits,
}

/// One thing that moved.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case", tag = "what")]
pub enum Moved {
    /// The image holds NaN or infinity where the golden holds a number.
    NotANumber {
        /// How many pixels.
        pixels: usize,
        /// Column and row of the first.
        first: [u32; 2],
    },
    /// The image holds numbers where the golden has none: geometry moved.
    Structure {
        /// How many pixels.
        pixels: usize,
        /// Column and row of the first.
        first: [u32; 2],
    },
    /// The random numbers are the golden's, but more rays than rounding can explain
    /// are decided differently.
    Rays {
        /// Where they are too many: in the whole image, in a tile, in a pixel.
        scale: Scale,
        /// Their share of the rays of the worst such place, at least.
        share: f64,
        /// The share that rounding may move there.
        limit: f64,
        /// The worst place: left, top, width and height.
        worst: [u32; 4],
        /// Pixels whose means differ.
        pixels: usize,
        /// The least rectangle that holds them: left, top, width and height.
        place: [u32; 4],
    },
    /// The mean of a tile or of the whole image moved.
    Shift {
        /// The tests that reject, the surest first, 64 at most.
        places: Vec<Difference>,
        /// How many reject.
        rejected: usize,
        /// Every region's own shift, the surest first.
        regions: Vec<RegionShift>,
    },
    /// Pixels moved that the means of tiles do not show: fine structure.
    Pattern {
        /// The pixels that reject, the surest first, 64 at most; none where only all
        /// of them together are beyond doubt.
        places: Vec<Difference>,
        /// How many reject.
        rejected: usize,
        /// The chance that noise explains all differences of pixels together; null
        /// where pixels depend on each other.
        p: Option<f64>,
    },
    /// The image is noisier than its golden, or less noisy.
    Noise(Noise),
    /// A perceptual limit is passed.
    Beyond(Measured),
}

/// How much the mean of a region moved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RegionShift {
    /// The region.
    pub region: Region,
    /// Its pixels that hold a number in both images.
    pub pixels: usize,
    /// Its mean in the image less that in the golden.
    pub bias: f64,
    /// Two-sided p-value, of this region alone; null where pixels depend on each
    /// other.
    pub p: Option<f64>,
}

/// A comparison with what it could have seen.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Comparison {
    /// How it was made.
    pub method: Method,
    /// Whether the image used the golden's own random numbers.
    pub same_seeds: bool,
    /// What moved; nothing where the golden holds.
    pub moved: Vec<Moved>,
    /// Bias of the whole image.
    pub bias: f64,
    /// Root mean square of the difference of the means.
    pub distance: f64,
    /// The bias of a tile that would be found with probability .8, in the median
    /// tile; 0 where nothing is sampled.
    #[schemars(with = "Option<f64>")]
    pub detectable: f64,
    /// Welch's tests made.
    pub tests: usize,
    /// What each scale could see and how many of its tests reject, from pixels to the
    /// whole image.
    pub scales: Vec<Seen>,
    /// The image's noise beside the golden's; null where it was not tested.
    pub noise: Option<Noise>,
    /// The perceptual numbers, where they decide.
    pub measured: Vec<Measured>,
}

/// What the tests of one scale could see.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Seen {
    /// The scale.
    pub scale: Scale,
    /// Tests made.
    pub tests: usize,
    /// Tests that reject.
    pub rejected: usize,
    /// The bias that would be found with probability .8, in the median place; null
    /// where errors are unknown.
    #[schemars(with = "Option<f64>")]
    pub detectable: f64,
}

/// How a comparison is to be made.
#[derive(Clone, Copy, Debug)]
pub struct Terms<'a> {
    /// Family error: the chance that any comparison of a family rejects although
    /// nothing moved.
    pub alpha: f64,
    /// Comparisons of the family.
    pub family: usize,
    /// What may differ between images without noise.
    pub limits: Limits,
    /// The golden's regions, a list of pixels each.
    pub regions: &'a BTreeMap<Region, Vec<usize>>,
}

impl Comparison {
    /// Whether the image may stand for its golden.
    pub fn passes(&self) -> bool {
        self.moved.is_empty()
    }

    /// Whether it finds nothing because it could see nothing.
    pub fn is_blind(&self) -> bool {
        matches!(self.method, Method::Pixels | Method::Replicates) && self.passes() && self.detectable >= MUST_SEE
    }

    fn new(golden: &Sampled, image: &Sampled, method: Method) -> Self {
        let [bias, squares] = moments(golden, image);
        Comparison {
            method,
            same_seeds: same_seeds(golden, image),
            moved: Vec::new(),
            bias,
            distance: squares.sqrt(),
            detectable: 0.0,
            tests: 0,
            scales: Vec::new(),
            noise: None,
            measured: Vec::new(),
        }
    }
}

/// Compares an image with its golden, both of the same resolution.
///
/// In this order:
/// 1. The hash of the decoded means: the same bits are the same image.
/// 2. Pixels that hold a number on one side only.
/// 3. Images without noise on both sides are held against perceptual limits.
/// 4. With the golden's own seeds no more than 1 ray in 10,000 may be decided
///    differently, and in a tile or pixel no more than chance lets gather there at that
///    rate. Where more are, the tests of samples tell what moved: the images share
///    their noise, so what rejects is surer than it says.
/// 5. Samples: [`three_scales`], noise against noise, and whether noise explains how
///    pixels differ. Each of these five kinds of test has a fifth of the family error.
pub fn compare(golden: &Sampled, image: &Sampled, terms: &Terms<'_>) -> Comparison {
    if pixel_hash(&golden.mean) == pixel_hash(&image.mean) {
        return Comparison::new(golden, image, Method::Identical);
    }
    let sided = one_sided(golden, image);
    let still = golden.is_deterministic() && image.is_deterministic() || golden.replicates.min(image.replicates) < 2;
    let method = match (same_seeds(golden, image), still, &golden.tiles, &image.tiles) {
        (_, true, ..) => Method::Limits,
        (true, ..) => Method::SameSeeds,
        (_, _, Some(_), Some(_)) => Method::Replicates,
        _ => Method::Pixels,
    };
    let mut found = Comparison::new(golden, image, method);
    if !sided.is_empty() {
        found.moved = sided;
        return found;
    }
    match method {
        Method::SameSeeds => {
            if let Some(moved) = rays::moved(golden, image, terms) {
                found.moved.push(moved);
                by_tests(golden, image, terms, &mut found);
            }
        }
        Method::Limits => by_limits(golden, image, terms, &mut found),
        _ => by_tests(golden, image, terms, &mut found),
    }
    found
}

/// Whether the random numbers are the same. One seed gives other numbers for other
/// rays.
fn same_seeds(golden: &Sampled, image: &Sampled) -> bool {
    golden.seed.is_some()
        && golden.seed == image.seed
        && golden.replicates == image.replicates
        && golden.rays == image.rays
}

/// Pixels that hold a number in one image only.
fn one_sided(golden: &Sampled, image: &Sampled) -> Vec<Moved> {
    let width = golden.resolution[0].max(1);
    let count = |of: &[f32], other: &[f32]| {
        let mut pixels = of.iter().zip(other).enumerate().filter(|(_, (a, b))| a.is_finite() && !b.is_finite());
        let first = pixels.next().map(|(i, _)| [i as u32 % width, i as u32 / width]);
        first.map(|first| (1 + pixels.count(), first))
    };
    let lost = count(&golden.mean, &image.mean).map(|(pixels, first)| Moved::NotANumber { pixels, first });
    let new = count(&image.mean, &golden.mean).map(|(pixels, first)| Moved::Structure { pixels, first });
    lost.into_iter().chain(new).collect()
}

fn by_limits(golden: &Sampled, image: &Sampled, terms: &Terms<'_>, found: &mut Comparison) {
    let as_image = |s: &Sampled| Image::new(s.resolution.map(|n| n as usize), vec![s.mean.clone()], Encoding::Linear);
    let measured = || -> Result<Vec<Measured>, ImageError> {
        let (a, b) = (as_image(golden)?, as_image(image)?);
        terms.limits.measure(&Pair::new(&a, &b, None)?)
    };
    match measured() {
        Ok(all) => {
            found.moved.extend(all.iter().filter(|m| !m.holds()).copied().map(Moved::Beyond));
            found.measured = all;
        }
        // Of equal size and with the same holes, images differ in nothing else.
        Err(_) => found.moved.push(Moved::Structure { pixels: golden.mean.len(), first: [0, 0] }),
    }
}

fn by_tests(golden: &Sampled, image: &Sampled, terms: &Terms<'_>, found: &mut Comparison) {
    let level = sidak_alpha(terms.alpha, KINDS.saturating_mul(terms.family.max(1)));
    // The share of `alpha` that leaves each of three scales `level`.
    let of_scales = -((-terms.alpha).ln_1p() * Scale::ALL.len() as f64 / KINDS as f64).exp_m1();
    let of_pixels = three_scales(golden.resolution, &image.pixels(), &golden.pixels(), of_scales, terms.family);
    let (scales, noise, p) = match (&golden.tiles, &image.tiles) {
        (Some(old), Some(new)) => {
            let (a, b) = (new.sample(image.rays), old.sample(golden.rays));
            let of_tiles = three_scales(old.size, &a, &b, of_scales, terms.family);
            let noise = noise_of_replicates(&new.replicates, &old.replicates);
            (of_dependent(of_pixels, of_tiles, golden.resolution), noise, None)
        }
        _ => {
            let replicates = [image.replicates, golden.replicates];
            let p = unexplained([&image.mean, &golden.mean], [&image.variance, &golden.variance], replicates);
            (of_pixels, noise_of_pixels(&image.variance, &golden.variance), Some(p))
        }
    };
    let rejected: usize = scales.iter().map(|s| s.rejected.len()).sum();
    if scales.iter().any(|s| s.scale != Scale::Pixel && !s.rejected.is_empty()) {
        let regions = region_shifts(golden, image, terms.regions);
        found.moved.push(Moved::Shift { places: surest(&scales), rejected, regions });
    } else if rejected > 0 || p.is_some_and(|p| p < level) {
        found.moved.push(Moved::Pattern { places: surest(&scales), rejected, p });
    }
    if noise.p < level {
        found.moved.push(Moved::Noise(noise));
    }
    found.noise = Some(noise);
    found.detectable = scales.iter().find(|s| s.scale == Scale::Tile).map_or(0.0, |s| s.detectable);
    found.tests = scales.iter().map(|s| s.tests).sum();
    found.scales = scales
        .iter()
        .map(|s| Seen { scale: s.scale, tests: s.tests, rejected: s.rejected.len(), detectable: s.detectable })
        .collect();
}

/// Pixels one by one, whose own variance is right however they depend on others; tiles
/// and image by the means of tiles, which are the pixels of an image of tiles.
fn of_dependent(of_pixels: [ScaleTest; 3], of_tiles: [ScaleTest; 3], [width, height]: [u32; 2]) -> [ScaleTest; 3] {
    let tile = crate::stats::TILE;
    let [pixels, ..] = of_pixels;
    let [mut tiles, _, mut image] = of_tiles;
    tiles.scale = Scale::Tile;
    for d in &mut tiles.rejected {
        let [x, y] = [d.place[0] * tile, d.place[1] * tile];
        d.place = [x, y, tile.min(width.saturating_sub(x)), tile.min(height.saturating_sub(y))];
    }
    for d in &mut image.rejected {
        d.place = [0, 0, width, height];
    }
    [pixels, tiles, image]
}

/// Rejections of all scales, the surest first; of equal ones the larger place.
fn surest(scales: &[ScaleTest; 3]) -> Vec<Difference> {
    let mut all: Vec<Difference> = scales.iter().rev().flat_map(|s| s.rejected.iter().copied()).collect();
    all.sort_by(|a, b| a.p.total_cmp(&b.p));
    all.truncate(NAMED);
    all
}

fn region_shifts(golden: &Sampled, image: &Sampled, regions: &BTreeMap<Region, Vec<usize>>) -> Vec<RegionShift> {
    let depends = golden.tiles.is_some();
    let (new, old) = (image.pixels(), golden.pixels());
    let mut shifts: Vec<(f64, RegionShift)> = regions
        .iter()
        .filter_map(|(region, pixels)| {
            let known: Vec<usize> = pixels.iter().copied().filter(|&i| new.is_known(i) && old.is_known(i)).collect();
            if known.is_empty() {
                return None;
            }
            let Estimate { value, se, df } = new.mean(&known).less(&old.mean(&known));
            let t = (value / se).abs();
            let p = (!depends).then(|| 2.0 * upper_tail(df, t));
            Some((t, RegionShift { region: *region, pixels: known.len(), bias: value, p }))
        })
        .collect();
    shifts.sort_by(|a, b| b.0.total_cmp(&a.0));
    shifts.into_iter().map(|(_, shift)| shift).collect()
}

/// Mean and mean square of image less golden, over pixels known in both; 0 of none.
fn moments(golden: &Sampled, image: &Sampled) -> [f64; 2] {
    let pairs = image.mean.iter().zip(&golden.mean).map(|(a, b)| f64::from(*a) - f64::from(*b));
    let (mut n, mut sums) = (0usize, [0.0; 2]);
    for d in pairs.filter(|d| d.is_finite()) {
        n += 1;
        sums = [sums[0] + d, sums[1] + d * d];
    }
    sums.map(|s| s / n.max(1) as f64)
}
