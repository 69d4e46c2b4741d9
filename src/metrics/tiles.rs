//! Intervals from one image: block bootstrap over tiles, where there are no replicates.

use super::{
    Metric, MetricName,
    artifact::reading,
    regions::{Region, Regions},
};
use crate::stats::{Estimate, SplitMix64, TILE, mean_variance};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// How often tiles are drawn anew.
pub const DRAWS: usize = 1000;
/// Fixed, so that the same image has the same intervals.
const SEED: u64 = 0x7469_6c65;
/// Noise of pixels this far apart is taken for independent where their correlation is below
/// [`UNCORRELATED`].
const LAGS: usize = 16;
/// Three standard errors of the correlation of 900 pixels.
const UNCORRELATED: f64 = 0.1;
/// Draws without a value that leave a metric without an error: a share of all.
const LOST: f64 = 0.1;

/// The metrics of one image, each with the standard error that its own noise gives it.
///
/// `measure` is called with one replicate and the regions. Its values stay; where it cannot
/// tell a standard error, the deviation of the value over [`DRAWS`] draws is taken: the
/// pixels of each region fall into tiles, and as many tiles of a region are drawn from its
/// own, with replacement (block bootstrap: Künsch 1989; Davison and Hinkley 1997, section
/// 8.3). Its error is combined with the metric's [`floor`](Metric::floor), the judge's or the
/// converged image's part. Degrees of freedom are the tiles of the smallest region that it
/// reads, less one for each part of a region that is drawn by itself.
///
/// What differs from tile to tile is noise only as far as it differs from `converged`, the
/// same estimator with many rays. So means, contrasts and biases take the draws of image less
/// `converged`; where that is None, and for absolute and squared errors and what compares two images, whole
/// tiles are drawn, and the scene's own light and shade widens the interval. Tiles have 4, 8 or
/// 16 pixels a side, at least about twice as far as noise is correlated, which is read from image less
/// `converged`; 16 where that is None. Noise that reaches further than 8 pixels makes intervals too narrow: the mean of
/// 208 x 104 pixels under a box filter of 21 pixels was held by 79 % of 300 intervals, of 41 pixels by 70 %. Tiles of 32 and
/// 64 mend that where regions are large, and leave a narrow footprint without any interval.
///
/// Intervals are of this frame's noise alone: a bias that another seed would not share is not
/// told from one that it would.
pub fn of_one_frame<F>(
    image: &[f32],
    converged: Option<&[f32]>,
    regions: &Regions,
    resolution: [u32; 2],
    measure: F,
) -> Vec<Metric>
where
    F: Fn(&[Vec<f32>], &Regions) -> Vec<Metric> + Sync,
{
    with_draws(DRAWS, image, converged, regions, resolution, measure)
}

fn with_draws<F>(
    draws: usize,
    image: &[f32],
    converged: Option<&[f32]>,
    regions: &Regions,
    resolution: [u32; 2],
    measure: F,
) -> Vec<Metric>
where
    F: Fn(&[Vec<f32>], &Regions) -> Vec<Metric> + Sync,
{
    let own = [image.to_vec()];
    let mut metrics = measure(&own, regions);
    let width = (resolution[0] as usize).max(1);
    let side = converged.map_or(TILE as usize, |c| side(image, c, width));
    let parts = parts(regions, width, side);
    let weighs = |m: &Metric| converged.is_some() && is_mean(m.name);
    let [any_mean, any_other] = [true, false].map(|mean| metrics.iter().any(|m| lacks(m) && weighs(m) == mean));
    let drawn: Vec<Vec<Option<f64>>> = (0..draws)
        .into_par_iter()
        .map(|draw| {
            let mut random = SplitMix64(SEED ^ ((draw as u64) << 32));
            let counts: Vec<Vec<f64>> = parts.iter().map(|p| p.draw(&mut random)).collect();
            let values = |metrics: Vec<Metric>| metrics.into_iter().map(|m| m.value).collect::<Vec<_>>();
            let by_weight = converged.filter(|_| any_mean).map(|c| {
                let weighted = weighted(image, c, &parts, &counts);
                values(measure(&[weighted], regions))
            });
            let by_tiles = any_other.then(|| values(measure(&own, &repeated(&parts, &counts))));
            let pick = |(i, m): (usize, &Metric)| {
                let from = if weighs(m) { &by_weight } else { &by_tiles };
                from.as_ref().and_then(|v| v.get(i).copied().flatten())
            };
            metrics.iter().enumerate().map(pick).collect()
        })
        .collect();
    for (i, metric) in metrics.iter_mut().enumerate().filter(|(_, m)| lacks(m)) {
        let values: Vec<f64> = drawn.iter().filter_map(|d| d[i]).collect();
        let (df, inflation) = freedom(metric, &parts);
        if (values.len() as f64) < (1.0 - LOST) * draws as f64 || values.len() < 2 || df <= 0.0 {
            continue;
        }
        let corrected = if weighs(metric) { 1.0 } else { inflation };
        set(metric, mean_variance(&values).1.sqrt() * corrected, df);
    }
    read_contrast_error(&mut metrics);
    metrics
}

/// Whether a metric has a value but no standard error.
fn lacks(metric: &Metric) -> bool {
    metric.value.is_some() && metric.se.is_none()
}

/// Whether a metric depends on the image by means of regions alone.
fn is_mean(name: MetricName) -> bool {
    use MetricName::{Bias, Contrast, ContrastError, JudgeBias, Michelson, Openness};
    matches!(name, Openness | Contrast | Michelson | ContrastError | Bias | JudgeBias)
}

/// Gives a metric the error of its image, with the part that is not the image's.
fn set(metric: &mut Metric, se: f64, df: f64) {
    let own = Estimate { value: 0.0, se, df };
    let all = metric.floor.map_or(own, |f| own.less(&Estimate { value: 0.0, se: f.se, df: f.df }));
    (metric.se, metric.df) = (Some(all.se).filter(|v| v.is_finite()), Some(all.df).filter(|v| v.is_finite()));
}

/// How a contrast error reads, now that its interval is known. K(Q) = K - dK.
fn read_contrast_error(metrics: &mut [Metric]) {
    let value = |name| metrics.iter().find(|m| m.name == name).and_then(|m| m.value);
    let Some((k, dk)) = value(MetricName::Contrast).zip(value(MetricName::ContrastError)) else { return };
    for m in metrics.iter_mut().filter(|m| m.name == MetricName::ContrastError) {
        m.note = m.estimate().and_then(|e| reading(&e, k - dk)).map(str::to_owned);
    }
}

/// Pixels that belong to the same regions, by tile: what is drawn by itself.
struct Part {
    /// The regions, by [`Region::ALL`].
    within: [bool; 5],
    tiles: Vec<Vec<u32>>,
}

impl Part {
    /// How often each tile is drawn, in as many draws as there are tiles. One tile alone is
    /// always drawn.
    fn draw(&self, random: &mut SplitMix64) -> Vec<f64> {
        let mut counts = vec![0.0; self.tiles.len()];
        for _ in 0..self.tiles.len() {
            counts[random.below(self.tiles.len())] += 1.0;
        }
        counts
    }

    /// A mean of T tiles varies by 1/T of their variance, its bootstrap by T - 1 over T of
    /// that: this undoes it.
    fn inflation(&self) -> f64 {
        let tiles = self.tiles.len() as f64;
        if tiles > 1.0 { (tiles / (tiles - 1.0)).sqrt() } else { 1.0 }
    }
}

fn parts(regions: &Regions, width: usize, side: usize) -> Vec<Part> {
    let mut within: BTreeMap<u32, [bool; 5]> = BTreeMap::new();
    for region in Region::ALL {
        for &i in regions.pixels(region) {
            within.entry(i).or_default()[region as usize] = true;
        }
    }
    let mut pixels: BTreeMap<[bool; 5], Vec<u32>> = BTreeMap::new();
    for (i, within) in within {
        pixels.entry(within).or_default().push(i);
    }
    // From the corner of each part: a border across a narrow part would halve its tiles.
    let tiled = |(within, pixels): ([bool; 5], Vec<u32>)| {
        let place = |i: &u32| [*i as usize / width, *i as usize % width];
        let corner = pixels.iter().map(place).fold([usize::MAX; 2], |a, b| [a[0].min(b[0]), a[1].min(b[1])]);
        let mut tiles: BTreeMap<[usize; 2], Vec<u32>> = BTreeMap::new();
        for i in &pixels {
            let [y, x] = place(i);
            tiles.entry([(y - corner[0]) / side, (x - corner[1]) / side]).or_default().push(*i);
        }
        Part { within, tiles: tiles.into_values().collect() }
    };
    pixels.into_iter().map(tiled).collect()
}

/// Degrees of freedom of a metric's draws, and what undoes their shrinking.
fn freedom(metric: &Metric, parts: &[Part]) -> (f64, f64) {
    let of = |region: Region| {
        let own = parts.iter().filter(|p| p.within[region as usize]);
        own.fold((0.0, 1.0f64), |(df, most), p| (df + p.tiles.len() as f64 - 1.0, most.max(p.inflation())))
    };
    metric.regions().iter().map(|&r| of(r)).fold((f64::INFINITY, 1.0), |a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// An image whose means over the regions are those of `converged` and of the drawn tiles of
/// image less `converged`.
fn weighted(image: &[f32], converged: &[f32], parts: &[Part], counts: &[Vec<f64>]) -> Vec<f32> {
    let mut drawn = image.to_vec();
    for (part, counts) in parts.iter().zip(counts) {
        let inflation = part.inflation();
        let weights: Vec<f64> = counts.iter().map(|c| 1.0 + (c - 1.0) * inflation).collect();
        let pixels: f64 = part.tiles.iter().map(|t| t.len() as f64).sum();
        let taken: f64 = part.tiles.iter().zip(&weights).map(|(t, w)| w * t.len() as f64).sum();
        // Tiles differ in size: where hardly any pixel was drawn, the draw says nothing.
        let scale = if taken > 0.1 * pixels { pixels / taken } else { 1.0 };
        for (tile, weight) in part.tiles.iter().zip(weights) {
            for &i in tile {
                let i = i as usize;
                drawn[i] = converged[i] + (image[i] - converged[i]) * (weight * scale) as f32;
            }
        }
    }
    drawn
}

/// The regions with the pixels of each tile as often as it was drawn.
fn repeated(parts: &[Part], counts: &[Vec<f64>]) -> Regions {
    let mut pixels: [Vec<u32>; 5] = Default::default();
    for (part, counts) in parts.iter().zip(counts) {
        for (tile, &count) in part.tiles.iter().zip(counts) {
            for list in pixels.iter_mut().zip(part.within).filter_map(|(list, within)| within.then_some(list)) {
                (0..count as usize).for_each(|_| list.extend_from_slice(tile));
            }
        }
    }
    Regions::of_pixels(pixels)
}

/// Edge of the tiles, pixels: at least about twice as far as the differences of two images are
/// correlated along rows or columns.
fn side(image: &[f32], converged: &[f32], width: usize) -> usize {
    let noise: Vec<f64> = image.iter().zip(converged).map(|(a, b)| f64::from(a - b)).collect();
    let finite = || noise.iter().filter(|v| v.is_finite());
    let mean = finite().sum::<f64>() / finite().count() as f64;
    let variance = finite().map(|v| (v - mean).powi(2)).sum::<f64>() / finite().count() as f64;
    let correlation = |lag: usize, down: bool| {
        let step = if down { lag * width } else { lag };
        let (mut sum, mut n) = (0.0, 0.0);
        for (i, a) in noise.iter().enumerate().take(noise.len().saturating_sub(step)) {
            let product = (a - mean) * (noise[i + step] - mean);
            if (down || i % width + lag < width) && product.is_finite() {
                sum += product;
                n += 1.0;
            }
        }
        if n > 0.0 && variance > 0.0 { sum / n / variance } else { 0.0 }
    };
    let reach = |down| (1..=LAGS).take_while(|&lag| correlation(lag, down) >= UNCORRELATED).count();
    match reach(false).max(reach(true)) {
        0 => 4,
        1..=4 => 8,
        _ => TILE as usize,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{
        artifact::{Brighter, Converged, Method},
        error,
        judge::JudgedRegions,
    };

    const SIZE: [u32; 2] = [208, 32];

    fn masks() -> Vec<Vec<f32>> {
        let band = |low: usize, high: usize| {
            (0..208 * 32).map(|i| f32::from(u8::from((low..high).contains(&(i % 208))))).collect::<Vec<f32>>()
        };
        vec![band(0, 208), band(101, 107), band(80, 96), band(112, 128), band(0, 40)]
    }

    fn regions() -> Regions {
        let masks = masks();
        Regions::of_masks(|region| &masks[region as usize])
    }

    /// Openness that differs within each region.
    fn truth() -> Vec<f32> {
        let at = |x: f32, y: f32| 0.6 + 0.2 * ((x - 104.0) / 40.0).sin() + 0.1 * (y / 9.0).cos();
        (0..208 * 32).map(|i| at((i % 208) as f32, (i / 208) as f32)).collect()
    }

    /// Means of 4 rays that are open with the pixel's openness.
    fn noisy(truth: &[f32], random: &mut SplitMix64) -> Vec<f32> {
        let open = |v: f32, random: &mut SplitMix64| (0..4).filter(|_| random.uniform() < f64::from(v)).count();
        truth.iter().map(|v| open(*v, random) as f32 / 4.0).collect()
    }

    /// A box filter, `side` pixels wide and high, over noise.
    fn filtered(image: &[f32], truth: &[f32], side: isize) -> Vec<f32> {
        let noise: Vec<f32> = image.iter().zip(truth).map(|(a, b)| a - b).collect();
        let half = side / 2;
        let at = |i: usize| {
            let (x, y) = ((i % 208) as isize, (i / 208) as isize);
            let (mut sum, mut n) = (0.0, 0.0);
            for v in (y - half).max(0)..=(y + half).min(31) {
                for u in (x - half).max(0)..=(x + half).min(207) {
                    (sum, n) = (sum + noise[(v * 208 + u) as usize], n + 1.0);
                }
            }
            truth[i] + sum / n
        };
        (0..image.len()).map(at).collect()
    }

    /// A value that normal noise of this deviation is added to.
    fn normal(random: &mut SplitMix64, deviation: f64) -> f64 {
        let [u, v] = [random.uniform(), random.uniform()];
        deviation * (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    const NAMES: [MetricName; 6] = {
        use MetricName::{Bias, Contrast, ContrastError, Mae, Michelson, Openness};
        [Openness, Contrast, Michelson, ContrastError, Bias, Mae]
    };

    struct Coverage {
        covered: [f64; 6],
        width: [f64; 6],
    }

    /// How often the 95 % intervals of metrics over the footprint hold the true value, over
    /// `frames` simulated frames; with or without the converged image as the centre.
    fn coverage(frames: usize, filter: isize, centred: bool) -> Coverage {
        let (regions, truth) = (regions(), truth());
        let judge_truth = [0.3, 0.4, 0.38, 0.6, 0.6, 0.6];
        let mean = |region| regions.mean(region, &truth).unwrap();
        let [footprint, left, right] = [Region::Footprint, Region::Left, Region::Right].map(mean);
        let flank = left.max(right);
        let k = footprint / flank - 1.0;
        let kq = (judge_truth[0] / judge_truth[3]) / (judge_truth[1] / judge_truth[4]) - 1.0;
        let mae = |image: &[f32]| {
            let pixels = regions.pixels(Region::Footprint);
            pixels.iter().map(|&i| f64::from((image[i as usize] - truth[i as usize]).abs())).sum::<f64>()
                / pixels.len() as f64
        };
        let mut random = SplitMix64(5);
        let frame = |random: &mut SplitMix64| {
            let image = noisy(&truth, random);
            if filter > 1 { filtered(&image, &truth, filter) } else { image }
        };
        let expected_mae = (0..400).map(|_| mae(&frame(&mut random))).sum::<f64>() / 400.0;
        let expected = [footprint, k, (footprint - flank) / (footprint + flank), k - kq, 0.0, expected_mae];
        let mut found = Coverage { covered: [0.0; 6], width: [0.0; 6] };
        for _ in 0..frames {
            let image = frame(&mut random);
            // Replicates of the converged image and of the judge have small noise of their own.
            let replicate =
                |random: &mut SplitMix64| truth.iter().map(|v| v + normal(random, 0.02) as f32).collect::<Vec<f32>>();
            let converged = Converged::new((0..4).map(|_| replicate(&mut random)).collect());
            let means = (0..8).map(|_| judge_truth.map(|v| v + normal(&mut random, 0.005)).to_vec()).collect();
            let judge = JudgedRegions { means, brighter: Brighter::Left };
            let measure = |images: &[Vec<f32>], regions: &Regions| {
                let method = Method { replicates: images, converged: &converged, regions };
                let mut metrics = error::openness(&method, &[Region::Footprint]);
                metrics.extend(method.contrasts());
                metrics.push(method.contrast_error(Ok(&judge)));
                metrics.extend(error::against_converged(&method, Region::Footprint));
                metrics
            };
            let center = centred.then_some(converged.mean.as_slice());
            let metrics = with_draws(200, &image, center, &regions, SIZE, measure);
            for (i, name) in NAMES.into_iter().enumerate() {
                let metric = metrics.iter().find(|m| m.name == name).unwrap();
                let [lo, hi] = metric.estimate().unwrap().interval(0.95);
                found.covered[i] += f64::from(u8::from((lo..=hi).contains(&expected[i]))) / frames as f64;
                found.width[i] += (hi - lo) / frames as f64;
            }
        }
        found
    }

    /// Nominal .95; docs/statistics.md states what is measured. Three standard errors of 300
    /// frames are .04.
    #[test]
    fn intervals_of_one_frame_hold_the_truth_as_often_as_stated() {
        for (filter, centred, least, most) in [(1, true, 0.90, 0.99), (5, true, 0.85, 1.0), (1, false, 0.90, 1.0)] {
            let found = coverage(300, filter, centred);
            println!("filter {filter}, centred {centred}: {:.3?}, widths {:.3?}", found.covered, found.width);
            for (name, covered) in NAMES.into_iter().zip(found.covered) {
                assert!((least..=most).contains(&covered), "{name:?}, filter {filter}, centred {centred}: {covered}");
            }
        }
    }

    fn measure_openness(images: &[Vec<f32>], regions: &Regions) -> Vec<Metric> {
        let converged = Converged::new(vec![truth(); 2]);
        let method = Method { replicates: images, converged: &converged, regions };
        let mut metrics = error::openness(&method, &Region::ALL);
        metrics.extend(method.contrasts());
        metrics.push(error::distinct_replicates(images));
        metrics
    }

    #[test]
    fn values_stay_errors_repeat_and_freedom_is_that_of_tiles() {
        let (regions, truth) = (regions(), truth());
        let image = noisy(&truth, &mut SplitMix64(1));
        let run = || with_draws(100, &image, Some(&truth), &regions, SIZE, measure_openness);
        let metrics = run();
        assert_eq!(metrics, run());
        let plain = measure_openness(std::slice::from_ref(&image), &regions);
        assert!(metrics.iter().zip(&plain).all(|(a, b)| a.value == b.value));
        let of = |name, region| metrics.iter().find(|m| m.name == name && m.region == region).unwrap();
        // Tiles of 4 pixels: 6 columns by 32 rows are 2 x 8 tiles.
        assert_eq!(of(MetricName::Openness, Some(Region::Footprint)).df, Some(15.0));
        assert_eq!(of(MetricName::Contrast, None).df, Some(15.0));
        assert_eq!(of(MetricName::Openness, Some(Region::Left)).df, Some(31.0));
        // sqrt(p (1 - p) / 4 / n) of n independent pixels.
        let pixels = regions.pixels(Region::Left);
        let variance: f64 =
            pixels.iter().map(|&i| f64::from(truth[i as usize] * (1.0 - truth[i as usize])) / 4.0).sum();
        let expected = variance.sqrt() / pixels.len() as f64;
        let se = of(MetricName::Openness, Some(Region::Left)).se.unwrap();
        assert!((se / expected - 1.0).abs() < 0.3, "{se} against {expected}");
        // One image alone has none that it could be a copy of.
        let distinct = of(MetricName::DistinctReplicates, None);
        assert_eq!((distinct.value, distinct.se), (None, None));
    }

    #[test]
    fn tiles_are_as_large_as_noise_is_correlated() {
        let truth = truth();
        let image = noisy(&truth, &mut SplitMix64(3));
        let sides = [1, 3, 5, 13].map(|filter| side(&filtered(&image, &truth, filter), &truth, 208));
        assert_eq!(sides, [4, 8, 8, 16]);
        assert_eq!(side(&truth, &truth, 208), 4, "no noise at all");
        let bad = vec![f32::NAN; truth.len()];
        assert_eq!(side(&bad, &truth, 208), 4);
    }

    /// A region of one tile has an unknown error, and a small one none at all.
    #[test]
    fn what_cannot_be_known_is_not_stated() {
        let small: Vec<f32> = (0..208 * 32).map(|i| if i % 208 < 8 && i / 208 < 8 { 1.0 } else { 0.0 }).collect();
        let all = masks();
        let pick = |region| if region == Region::Far { &small } else { &all[region as usize] };
        let regions = Regions::of_masks(|region| pick(region));
        let image = noisy(&truth(), &mut SplitMix64(1));
        let metrics = with_draws(50, &image, None, &regions, SIZE, measure_openness);
        let of = |region| metrics.iter().find(|m| m.region == Some(region)).unwrap();
        assert!(of(Region::Far).value.is_some() && of(Region::Far).se.is_none());
        assert!(of(Region::Left).se.is_some());
        let none = Regions::of_masks(|_| &[]);
        let metrics = with_draws(50, &image, None, &none, SIZE, measure_openness);
        assert!(metrics.iter().filter(|m| m.name == MetricName::Openness).all(|m| m.value.is_none() && m.se.is_none()));
        let hollow = vec![f32::NAN; image.len()];
        let metrics = with_draws(50, &hollow, Some(&hollow), &regions, SIZE, measure_openness);
        assert!(metrics.iter().filter(|m| m.name == MetricName::Openness).all(|m| m.se.is_none()));
    }
}
