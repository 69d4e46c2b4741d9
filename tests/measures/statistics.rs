//! How often the statistics err, by simulation. Seeds are fixed. A band stated as
//! "within" is nominal +- 3 standard errors of the simulation or wider.

use aogauge::stats::{
    Better, Estimate, Group, ImageSample, IndependentPixels, Moments, Replicates, Scale, SplitMix64, bca, chi_square,
    non_inferior, pixel_p_values, student, student_pooled, three_scales, tost, uniformity, welch, welch_of_estimates,
};

const REPLICATES: usize = 16;
const RAYS: u32 = 32;
const SHARES: [f64; 8] = [0.05, 0.15, 0.3, 0.4, 0.5, 0.65, 0.8, 0.95];

struct Random(SplitMix64);

impl Random {
    fn new(seed: u64) -> Self {
        Random(SplitMix64(seed))
    }

    fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    fn uniform(&mut self) -> f64 {
        self.0.uniform()
    }

    /// Box and Muller's.
    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    fn normals(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.normal()).collect()
    }
}

/// Binomial weights of the open rays of n, where they are above 1e-17 of the
/// greatest: the first count, and the distribution function from there.
struct Binomial {
    first: u64,
    cumulated: Vec<f64>,
}

impl Binomial {
    fn new(n: u64, p: f64) -> Self {
        let odds = (p / (1.0 - p)).ln();
        let mode = (n as f64 * p) as u64;
        // ln of the weight over that of the mode, outwards from there.
        let up = |k: u64| ((n - k) as f64 / (k + 1) as f64).ln() + odds;
        let (mut first, mut weights, mut ln) = (mode, vec![1.0], 0.0);
        while first > 0 && ln > -40.0 {
            first -= 1;
            ln -= up(first);
            weights.push(f64::exp(ln));
        }
        weights.reverse();
        let (mut k, mut ln) = (mode, 0.0);
        while k < n && ln > -40.0 {
            ln += up(k);
            k += 1;
            weights.push(f64::exp(ln));
        }
        let sum: f64 = weights.iter().sum();
        let mut reached = 0.0;
        let cumulated = weights
            .iter()
            .map(|w| {
                reached += w / sum;
                reached
            })
            .collect();
        Binomial { first, cumulated }
    }

    fn draw(&self, random: &mut Random) -> f64 {
        let u = random.uniform();
        (self.first + self.cumulated.partition_point(|c| *c < u) as u64) as f64
    }

    /// Counts for each of 65,536 equal parts of chance: quick to draw from, and alike on
    /// both sides of a test.
    fn table(&self) -> Vec<u8> {
        (0..65_536)
            .map(|i| {
                (self.first + self.cumulated.partition_point(|c| *c < (f64::from(i) + 0.5) / 65_536.0) as u64) as u8
            })
            .collect()
    }
}

/// Mean and variance a pixel over 16 replicates x 32 rays.
#[derive(Default)]
struct Image {
    mean: Vec<f32>,
    variance: Vec<f32>,
}

impl Image {
    fn push(&mut self, table: &[u8], random: &mut Random) {
        let (mut sum, mut squares) = (0u32, 0u32);
        for _ in 0..REPLICATES / 4 {
            let bits = random.bits();
            for part in 0..4 {
                let count = u32::from(table[(bits >> (16 * part)) as usize & 0xffff]);
                sum += count;
                squares += count * count;
            }
        }
        let (n, rays) = (REPLICATES as f64, f64::from(RAYS));
        let mean = f64::from(sum) / n;
        self.mean.push((mean / rays) as f32);
        self.variance.push(((f64::from(squares) - n * mean * mean) / (n - 1.0) / (rays * rays)) as f32);
    }

    fn drawn(pixels: usize, table: &[u8], random: &mut Random) -> Image {
        let mut image = Image::default();
        (0..pixels).for_each(|_| image.push(table, random));
        image
    }

    fn sample(&self) -> IndependentPixels<'_> {
        IndependentPixels {
            mean: &self.mean,
            variance: &self.variance,
            replicates: REPLICATES as u32,
            quantum: 1.0 / f64::from(RAYS),
        }
    }
}

/// The share of experiments whose p-value is below alpha.
fn rate(experiments: u32, alpha: f64, mut p: impl FnMut() -> f64) -> f64 {
    f64::from((0..experiments).filter(|_| p() < alpha).count() as u32) / f64::from(experiments)
}

fn within(what: &str, value: f64, band: [f64; 2]) {
    println!("{what}: {value:.5}");
    assert!(band[0] <= value && value <= band[1], "{what}: {value} is not within {band:?}");
}

/// Nominal .05, 40,000 experiments: 3 standard errors are .0033.
const FIVE: [f64; 2] = [0.0467, 0.0533];
/// Nominal .01, 40,000 experiments: 3 standard errors are .0015.
const ONE: [f64; 2] = [0.0085, 0.0115];

#[test]
fn welch_of_a_tile_of_independent_pixels_keeps_its_level() {
    let (mut random, pixels): (_, Vec<usize>) = (Random::new(11), (0..256).collect());
    let tables = SHARES.map(|p| Binomial::new(u64::from(RAYS), p).table());
    let mut i = 0;
    let value = rate(40_000, 0.01, || {
        i += 1;
        let [a, b] = [0; 2].map(|_| Image::drawn(256, &tables[i % 8], &mut random).sample().mean(&pixels));
        welch_of_estimates(&a, &b).p_two
    });
    within("tile, independent pixels", value, ONE);
}

/// Means of whole places in each replicate: binomial sums of their rays.
#[test]
fn welch_of_replicates_keeps_its_level_for_tiles_and_images() {
    for (what, pixels) in [("tile, replicates", 256u64), ("image, replicates", 256 * 256)] {
        let mut random = Random::new(pixels);
        let rays = pixels * u64::from(RAYS);
        let sums = SHARES.map(|p| Binomial::new(rays, p));
        let mut i = 0;
        let value = rate(40_000, 0.01, || {
            i += 1;
            let mut side =
                || -> Vec<f64> { (0..REPLICATES).map(|_| sums[i % 8].draw(&mut random) / rays as f64).collect() };
            welch(&side(), &side()).p_two
        });
        within(what, value, ONE);
    }
}

#[test]
fn welch_of_a_pixel_stays_near_its_level() {
    let mut random = Random::new(5);
    let mut all = 0.0;
    for p in SHARES {
        let table = Binomial::new(u64::from(RAYS), p).table();
        let [a, b] = [0; 2].map(|_| Image::drawn(5000, &table, &mut random));
        let values = pixel_p_values([100, 50], &a.sample(), &b.sample());
        all += values.iter().filter(|p| **p < 0.01).count() as f64 / 40_000.0;
    }
    within("pixel", all, [0.0085, 0.0125]);
}

/// What ships, at the scales it ships: [`three_scales`] over images of 20 x 20, whose
/// share of open rays differs from pixel to pixel. `rejects` tells for each image how
/// many places of a scale reject at a nominal .01.
fn level_of(scale: Scale, experiments: u32, mut test: impl FnMut(f64) -> [aogauge::stats::ScaleTest; 3]) -> f64 {
    let at = Scale::ALL.iter().position(|s| *s == scale).unwrap();
    let places = test(0.03)[at].tests;
    // The family error that leaves .01 for each place of the scale.
    let share = 1.0 - 0.99f64.powi(places as i32);
    let alpha = 1.0 - (1.0 - share).powi(3);
    let rejected: usize = (0..experiments).map(|_| test(alpha)[at].rejected.len()).sum();
    rejected as f64 / (f64::from(experiments) * places as f64)
}

/// A whole tile, and parts of tiles beside it.
const EDGE: u32 = 20;

/// Nominal .01 within the band asked of it: 3 standard errors of 10,000 tests.
const SHIPPED: [f64; 2] = [0.007, 0.013];

#[test]
fn independent_pixels_keep_their_level_through_three_scales() {
    let tables = SHARES.map(|p| Binomial::new(u64::from(RAYS), p).table());
    for (scale, experiments) in [(Scale::Tile, 2500), (Scale::Image, 10_000)] {
        let mut random = Random::new(31);
        let value = level_of(scale, experiments, |alpha| {
            let [a, b] = [0; 2].map(|_| {
                let mut image = Image::default();
                (0..EDGE * EDGE).for_each(|i| image.push(&tables[i as usize % 8], &mut random));
                image
            });
            three_scales([EDGE; 2], &a.sample(), &b.sample(), alpha, 1)
        });
        within(&format!("{scale:?}, independent pixels as shipped"), value, SHIPPED);
    }
}

#[test]
fn replicates_keep_their_level_through_three_scales() {
    let tables = SHARES.map(|p| Binomial::new(u64::from(RAYS), p).table());
    for (scale, experiments) in [(Scale::Tile, 2500), (Scale::Image, 10_000)] {
        let mut random = Random::new(37);
        let value = level_of(scale, experiments, |alpha| {
            let mut side = || -> Vec<Vec<f32>> {
                let mut image = || {
                    let mut pixels = Vec::with_capacity((EDGE * EDGE) as usize);
                    for i in 0..EDGE * EDGE / 4 {
                        let bits = random.bits();
                        let table = &tables[i as usize % 8];
                        let count = |part: u32| table[(bits >> (16 * part)) as usize & 0xffff];
                        pixels.extend((0..4).map(|part| f32::from(count(part)) / RAYS as f32));
                    }
                    pixels
                };
                (0..REPLICATES).map(|_| image()).collect()
            };
            let (a, b) = (side(), side());
            let [a, b] = [&a, &b].map(|images| Replicates {
                images: images.iter().map(Vec::as_slice).collect(),
                quantum: 1.0 / f64::from(RAYS),
            });
            three_scales([EDGE; 2], &a, &b, alpha, 1)
        });
        within(&format!("{scale:?}, replicates as shipped"), value, SHIPPED);
    }
}

/// The share of 100,000 pixels that reject at .01: 4 rays against 32, 16 replicates a
/// side, with or without the quantum.
fn unequal(replicates: usize, share: f64, quantum: bool) -> f64 {
    let mut random = Random::new(41);
    let mut side = |rays: u32| -> (Vec<f32>, Vec<f32>) {
        let table = Binomial::new(u64::from(rays), share).table();
        let pixel = |_| {
            let draw = |_| f64::from(table[(random.bits() & 0xffff) as usize]) / f64::from(rays);
            let moments: Moments = (0..replicates).map(draw).collect();
            (moments.mean() as f32, moments.variance() as f32)
        };
        (0..100_000).map(pixel).unzip()
    };
    let (few, many) = (side(4), side(32));
    let [a, b] = [(&few, 4.0), (&many, 32.0)].map(|((mean, variance), rays)| IndependentPixels {
        mean,
        variance,
        replicates: replicates as u32,
        quantum: if quantum { 1.0 / rays } else { 0.0 },
    });
    let p = pixel_p_values([1000, 100], &a, &b);
    p.iter().filter(|p| **p < 0.01).count() as f64 / 1e5
}

/// Where nearly all rays are open, the side of few rays often shows no scatter by
/// chance: the least standard error keeps the level there. At shares about .9 it shows
/// one or two misses where six are due, and rejects more than it should.
#[test]
fn pixels_of_unequal_rays_keep_their_level_where_nearly_all_are_open() {
    for replicates in [4, 16] {
        for share in [0.97, 0.999] {
            within("pixel, 4 rays against 32", unequal(replicates, share, true), [0.0, 0.01]);
        }
    }
    within("pixel, 4 rays against 32, share .5", unequal(16, 0.5, true), [0.007, 0.013]);
    within("pixel, 4 rays against 32, share .9", unequal(16, 0.9, true), [0.02, 0.03]);
    within("pixel, 4 rays against 32, without quantum", unequal(16, 0.97, false), [0.1, 0.15]);
}

/// The family error of pixels, tiles and image at shares up to .999, where pixels hold
/// hardly any noise.
#[test]
fn three_scales_keep_the_family_error() {
    let mut random = Random::new(77);
    let shares = [0.3, 0.7, 0.9, 0.97, 0.99, 0.999];
    let tables = shares.map(|p| Binomial::new(u64::from(RAYS), p).table());
    let mut i = 0;
    let value = rate(3000, 0.5, || {
        i += 1;
        let [a, b] = [0; 2].map(|_| Image::drawn(32 * 32, &tables[i % 6], &mut random));
        let scales = three_scales([32, 32], &a.sample(), &b.sample(), 0.05, 1);
        f64::from(u8::from(scales.iter().all(|s| s.rejected.is_empty())))
    });
    within("family of three scales", value, [0.0, 0.062]);
}

#[test]
fn a_bias_of_a_fiftieth_in_one_tile_is_found() {
    let mut random = Random::new(21);
    let [same, more] = [0.5, 0.52].map(|p| Binomial::new(u64::from(RAYS), p).table());
    let golden = Image::drawn(256 * 256, &same, &mut random);
    let (mut detectable, experiments) = (0.0, 100);
    let power = rate(experiments, 0.5, || {
        let mut image = Image::default();
        for i in 0..256 * 256 {
            let inside = (32..48).contains(&(i % 256)) && (64..80).contains(&(i / 256));
            image.push(if inside { &more } else { &same }, &mut random);
        }
        let scales = three_scales([256, 256], &image.sample(), &golden.sample(), 0.01, 1);
        let tile = scales.iter().find(|s| s.scale == Scale::Tile).unwrap();
        detectable = tile.detectable;
        let found = tile.rejected.iter().any(|d| d.place == [32, 64, 16, 16]);
        f64::from(u8::from(!found))
    });
    within("power for .02 in a tile", power, [0.9, 1.0]);
    within("detectable bias of a tile", detectable, [0.005, 0.015]);
}

/// Replicates under a box filter of 5 x 5: neighbours share their noise.
fn filtered(random: &mut Random, edge: usize) -> Vec<f32> {
    let noise: Vec<f32> = (0..edge * edge).map(|_| random.uniform() as f32).collect();
    let near = |i: usize| i.saturating_sub(2)..(i + 3).min(edge);
    let pixel = |i: usize| {
        let rows = near(i / edge);
        let values: Vec<f32> = rows.flat_map(|y| near(i % edge).map(move |x| y * edge + x)).map(|j| noise[j]).collect();
        values.iter().sum::<f32>() / values.len() as f32
    };
    (0..edge * edge).map(pixel).collect()
}

#[test]
fn filtered_images_need_replicates() {
    let (mut random, edge) = (Random::new(3), 32);
    let (mut by_pixels, mut by_replicates, experiments) = (0, 0, 150);
    for _ in 0..experiments {
        let [a, b] = [0; 2].map(|_| (0..REPLICATES).map(|_| filtered(&mut random, edge)).collect::<Vec<_>>());
        let of_pixels = |images: &[Vec<f32>]| -> Vec<Moments> {
            (0..edge * edge).map(|i| images.iter().map(|image| f64::from(image[i])).collect()).collect()
        };
        let layers = |images| -> (Vec<f32>, Vec<f32>) {
            of_pixels(images).iter().map(|m| (m.mean() as f32, m.variance() as f32)).unzip()
        };
        let ((mean_a, variance_a), (mean_b, variance_b)) = (layers(&a), layers(&b));
        let size = [edge as u32; 2];
        let rejects = |scales: [aogauge::stats::ScaleTest; 3]| usize::from(!scales[1].rejected.is_empty());
        let pixels = |mean, variance| IndependentPixels { mean, variance, replicates: 16, quantum: 0.0 };
        // A third of .03 for the tiles: they reject in 1 % of comparisons.
        by_pixels += rejects(three_scales(size, &pixels(&mean_a, &variance_a), &pixels(&mean_b, &variance_b), 0.03, 1));
        let sample = |images| Replicates { images, quantum: 0.0 };
        by_replicates += rejects(three_scales(
            size,
            &sample(a.iter().map(Vec::as_slice).collect()),
            &sample(b.iter().map(Vec::as_slice).collect()),
            0.03,
            1,
        ));
    }
    let share = |n: usize| n as f64 / f64::from(experiments);
    within("filtered, taken as independent pixels", share(by_pixels), [0.5, 1.0]);
    within("filtered, by replicates", share(by_replicates), [0.0, 0.045]);
}

#[test]
fn students_tests_keep_their_level() {
    let mut random = Random::new(8);
    within("student, one sample", rate(40_000, 0.05, || student(&random.normals(16), 0.0).p_two), FIVE);
    let pooled = rate(40_000, 0.05, || student_pooled(&random.normals(16), &random.normals(8)).p_two);
    within("student, pooled", pooled, FIVE);
}

#[test]
fn equivalence_and_non_inferiority_keep_their_level_on_the_margin() {
    let mut random = Random::new(13);
    let mut mean = || Estimate::of_mean(&random.normals(16));
    within("tost on a margin of 8 se", rate(40_000, 0.05, || tost(&mean(), 2.0, 2.0)), FIVE);
    within("tost on a margin of 2 se", rate(40_000, 0.05, || tost(&mean(), 0.5, 0.5)), [0.02, 0.0533]);
    for better in [Better::Higher, Better::Lower] {
        let target = if better == Better::Higher { 0.5 } else { -0.5 };
        within("non-inferiority", rate(40_000, 0.05, || non_inferior(&mean(), target, 0.5, better)), FIVE);
    }
}

#[test]
fn chi_square_keeps_its_level() {
    let mut random = Random::new(2);
    let value = rate(40_000, 0.05, || {
        let mut counts = [0u64; 16];
        (0..200).for_each(|_| counts[(random.bits() >> 60) as usize] += 1);
        chi_square(&counts, &[1.0 / 16.0; 16]).unwrap().p
    });
    within("chi-square", value, FIVE);
}

#[test]
fn kolmogorov_smirnov_keeps_its_level_and_sees_a_skew() {
    let mut random = Random::new(4);
    let value = rate(40_000, 0.05, || uniformity(&(0..20).map(|_| random.uniform()).collect::<Vec<_>>()).unwrap().p);
    within("ks of 20", value, FIVE);
    let values: Vec<f64> = (0..400).map(|_| random.uniform().powf(1.4)).collect();
    assert!(uniformity(&values).unwrap().p < 1e-3);
}

/// p-values of Welch's test of true hypotheses are uniform.
#[test]
fn p_values_of_welch_are_uniform() {
    let mut random = Random::new(6);
    let values: Vec<f64> = (0..2000).map(|_| welch(&random.normals(16), &random.normals(8)).p_two).collect();
    assert!(uniformity(&values).unwrap().p > 1e-3);
}

#[test]
fn bca_intervals_cover_nearly_as_stated() {
    let mut random = Random::new(9);
    let covered = |experiments: u32, truth: f64, mut interval: Box<dyn FnMut(u32) -> [f64; 2] + '_>| {
        let hits = (0..experiments).filter(|&i| {
            let [lo, hi] = interval(i);
            lo <= truth && truth <= hi
        });
        hits.count() as f64 / f64::from(experiments)
    };
    let rows = |values: Vec<f64>| -> Group { values.into_iter().map(|v| vec![v]).collect() };
    let mean = |m: &[Vec<f64>]| m[0][0];
    for (what, n, band) in [("bca, mean of 16", 16, [0.90, 0.95]), ("bca, mean of 64", 64, [0.93, 0.965])] {
        let coverage =
            covered(2000, 0.0, Box::new(|seed| bca(&[rows(random.normals(n))], mean, 0.95, 500, seed).interval));
        within(what, coverage, band);
    }
    let ratio = |m: &[Vec<f64>]| m[0][0] / m[1][0];
    let coverage = covered(
        2000,
        1.0,
        Box::new(|seed| {
            let mut group = || rows((0..16).map(|_| 0.5 + random.uniform()).collect());
            bca(&[group(), group()], ratio, 0.95, 500, seed).interval
        }),
    );
    within("bca, ratio of means of 16", coverage, [0.90, 0.95]);
}
