//! What comparisons find, and how often they err. Seeds are fixed.

use super::*;
use crate::{metrics::regions::Region, render::sampler::Sampler, stats::mean_variance};
use std::collections::BTreeMap;

const RESOLUTION: [u32; 2] = [64, 32];
const REPLICATES: u32 = 16;
const RAYS: u32 = 32;

/// Replicates of binary openness of a probability a pixel.
fn replicates(seed: u32, p: impl Fn(u32, u32) -> f64) -> Vec<Vec<f32>> {
    let value = |pixel: u32, r: u32| {
        // One dimension a ray, so that rays are independent.
        let (sampler, p) = (Sampler::new(seed, pixel, r), p(pixel % 64, pixel / 64));
        let open = (0..RAYS).filter(|&i| f64::from(sampler.pair(0, i)[0]) < p).count();
        open as f32 / RAYS as f32
    };
    (0..REPLICATES).map(|r| (0..64 * 32).map(|pixel| value(pixel, r)).collect()).collect()
}

/// As a record keeps it.
fn sampled(seed: u32, replicates: &[Vec<f32>]) -> Sampled {
    let (mut mean, mut variance) = (vec![], vec![]);
    for pixel in 0..64 * 32 {
        let values: Vec<f64> = replicates.iter().map(|r| f64::from(r[pixel])).collect();
        let (m, v) = mean_variance(&values);
        mean.push(m as f32);
        variance.push(v as f32);
    }
    let (replicates, seed) = (replicates.len() as u32, Some(seed));
    Sampled { resolution: RESOLUTION, mean, variance, tiles: None, replicates, rays: RAYS, seed }
}

fn slope(x: u32) -> f64 {
    0.55 + 0.4 * f64::from(x) / 64.0
}

/// A slope, plus a bias in one tile.
fn sample(seed: u32, bias: f64) -> Sampled {
    sampled(seed, &replicates(seed, |x, y| slope(x) + if x < 16 && y < 16 { bias } else { 0.0 }))
}

fn regions() -> BTreeMap<Region, Vec<usize>> {
    let of = |keep: fn(usize) -> bool| (0..64 * 32).filter(|&i| keep(i % 64)).collect();
    BTreeMap::from([(Region::Left, of(|x| x < 12)), (Region::Right, of(|x| x >= 40)), (Region::Far, vec![])])
}

fn held(golden: &Sampled, image: &Sampled, alpha: f64, family: usize) -> Comparison {
    compare(golden, image, &Terms { alpha, family, limits: Limits::default(), regions: &regions() })
}

/// At alpha .01, 300 comparisons of fresh seeds reject 3 on average; the binomial 99.9 %
/// band is 0 to 9.
#[test]
fn fresh_seeds_pass_at_the_stated_rate() {
    let golden = sample(1, 0.0);
    let rejected = (2..302).filter(|&seed| !held(&golden, &sample(seed, 0.0), 0.01, 1).passes()).count();
    println!("{rejected} of 300 at .01");
    assert!(rejected <= 9, "{rejected} of 300");
}

#[test]
fn a_shift_of_one_tile_is_found_and_placed() {
    let golden = sample(1, 0.0);
    let c = held(&golden, &sample(2, 0.04), 0.01, 20);
    let Moved::Shift { places, regions, rejected } = &c.moved[0] else { panic!("{c:?}") };
    assert_eq!(places[0].place, [0, 0, 16, 16]);
    assert!((places[0].bias - 0.04).abs() < 0.01 && *rejected >= 1);
    assert_eq!((regions[0].region, regions.len()), (Region::Left, 2), "empty regions are left out");
    assert!(regions[0].p.unwrap() < 1e-3 && regions[0].bias > 0.0);
    assert!(c.detectable > 0.0 && c.detectable < 0.04, "{}", c.detectable);
    assert!(c.line().contains("shift: brighter") && c.line().contains("region left"), "{}", c.line());
}

#[test]
fn the_same_pixels_are_identical_whatever_the_seed() {
    let golden = sample(1, 0.0);
    for seed in [Some(1), Some(2), None] {
        let c = held(&golden, &Sampled { seed, ..golden.clone() }, 0.01, 1);
        assert!(c.method == Method::Identical && c.passes());
    }
}

#[test]
fn numbers_on_one_side_are_named() {
    let golden = sample(1, 0.0);
    let mut image = sample(2, 0.0);
    image.mean[5] = f32::NAN;
    image.mean[70] = f32::INFINITY;
    assert_eq!(held(&golden, &image, 0.01, 1).moved, [Moved::NotANumber { pixels: 2, first: [5, 0] }]);
    assert_eq!(held(&image, &golden, 0.01, 1).moved, [Moved::Structure { pixels: 2, first: [5, 0] }]);
    // Also with the golden's own seeds.
    image.seed = Some(1);
    assert!(held(&golden, &image, 0.01, 1).line().contains("NaN: 2 pixels"));
}

#[test]
fn with_the_same_seeds_a_shift_is_no_noise() {
    let golden = sample(1, 0.0);
    let mut image = golden.clone();
    for v in &mut image.mean {
        *v += 0.001;
    }
    let c = held(&golden, &image, 0.01, 1);
    assert!(matches!(c.moved[0], Moved::Rays { pixels: 2048, place: [0, 0, 64, 32], .. }), "{c:?}");
    image = golden.clone();
    image.mean[7] -= 2.0 / (16.0 * 32.0);
    let c = held(&golden, &image, 0.01, 1);
    assert!(c.passes() && c.method == Method::SameSeeds);
    // A change that is large is named as with fresh seeds, and its place with it.
    for v in &mut image.mean[64 * 4..64 * 8] {
        *v -= 0.1;
    }
    let c = held(&golden, &image, 0.01, 1);
    assert!(matches!(c.moved[..], [Moved::Rays { place: [0, 0, 64, 8], .. }, Moved::Shift { .. }, ..]), "{c:?}");
}

#[test]
fn without_noise_limits_decide() {
    let mut golden = sample(1, 0.0);
    golden.mean.fill(1.0);
    golden.variance.fill(0.0);
    let mut image = Sampled { seed: Some(2), ..golden.clone() };
    // One ray of one replicate in one pixel.
    image.mean[100] = 1.0 - 1.0 / (16.0 * 32.0);
    let c = held(&golden, &image, 0.01, 1);
    assert!(c.method == Method::Limits && c.passes(), "{c:?}");
    for v in &mut image.mean[100..110] {
        *v = 1.0 - 2.0 / 16.0;
    }
    let c = held(&golden, &image, 0.01, 1);
    assert!(matches!(c.moved[0], Moved::Beyond(_)), "{c:?}");
    let limits = "flip=1,flip-max=1,ssim=-1".parse().unwrap();
    assert!(compare(&golden, &image, &Terms { alpha: 0.01, family: 1, limits, regions: &regions() }).passes());
    // One replicate has no noise to test with either.
    let (one, other) = (Sampled { replicates: 1, ..golden }, Sampled { replicates: 1, seed: Some(2), ..image });
    assert_eq!(held(&one, &other, 0.01, 1).method, Method::Limits);
}

/// Half the rays and the same expectation: twice the variance.
#[test]
fn more_noise_and_less_are_named() {
    let golden = sample(1, 0.0);
    let noisy: Vec<Vec<f32>> = {
        let all = replicates(2, |x, _| slope(x));
        let coarse = |r: &Vec<f32>, s: &Vec<f32>| r.iter().zip(s).map(|(a, b)| 1.5 * a - 0.5 * b).collect();
        (0..16).map(|i| coarse(&all[i], &all[(i + 1) % 16])).collect()
    };
    // Variance 1.5^2 + .5^2 = 2.5 times, means kept.
    let image = sampled(2, &noisy);
    let c = held(&golden, &image, 0.01, 20);
    let noise = c.moved.iter().find_map(|m| if let Moved::Noise(n) = m { Some(*n) } else { None }).unwrap();
    assert!((2.2..2.8).contains(&noise.ratio) && noise.p < 1e-6, "{noise:?}");
    assert!(c.line().contains("noisier"), "{}", c.line());
    assert!(held(&image, &golden, 0.01, 20).line().contains("less noisy"));
    // A tenth more variance on 2,048 pixels is seen too.
    let mut little = sample(3, 0.0);
    for v in &mut little.variance {
        *v *= 1.1;
    }
    let c = held(&golden, &little, 0.01, 1);
    assert!(matches!(c.moved[..], [Moved::Noise(_)]), "{c:?}");
}

/// A checkerboard of +-.04: no tile's mean moves, and hardly a pixel is beyond doubt.
#[test]
fn a_pattern_without_a_shift_is_structure() {
    let golden = sample(1, 0.0);
    let board = |x: u32, y: u32| if (x + y).is_multiple_of(2) { 0.03 } else { -0.03 };
    let image = sampled(2, &replicates(2, |x, y| slope(x) + board(x, y)));
    let c = held(&golden, &image, 0.01, 20);
    let Moved::Pattern { p, .. } = &c.moved[0] else { panic!("{c:?}") };
    assert!(p.unwrap() < 1e-5, "{p:?}");
    assert!(c.line().contains("structure: pixels moved"), "{}", c.line());
}

/// A 5 x 5 box filter: pixels share their noise.
fn filtered(image: &[f32]) -> Vec<f32> {
    let near = |v: usize, end: usize| v.saturating_sub(2)..(v + 3).min(end);
    let pixel = |i: usize| {
        let rows = near(i / 64, 32);
        let values: Vec<f32> = rows.flat_map(|y| near(i % 64, 64).map(move |x| image[y * 64 + x])).collect();
        values.iter().sum::<f32>() / values.len() as f32
    };
    (0..image.len()).map(pixel).collect()
}

fn smooth(seed: u32, bias: f64) -> Sampled {
    let all: Vec<Vec<f32>> = replicates(seed, |x, _| slope(x) + bias).iter().map(|r| filtered(r)).collect();
    let images: Vec<&[f32]> = all.iter().map(Vec::as_slice).collect();
    Sampled { tiles: Some(TileMeans::of(RESOLUTION, &images)), ..sampled(seed, &all) }
}

/// The same images taken as independent pixels are nearly all refused; by replicates at
/// most the stated share: at alpha .05 of 60 the binomial 99.9 % band ends at 9.
#[test]
fn filtered_images_are_compared_by_their_replicates() {
    let golden = smooth(1, 0.0);
    let [mut by_replicates, mut by_pixels] = [0, 0];
    for seed in 2..62 {
        let image = smooth(seed, 0.0);
        let c = held(&golden, &image, 0.05, 1);
        assert_eq!(c.method, Method::Replicates);
        by_replicates += usize::from(!c.passes());
        by_pixels += usize::from(!held(&golden, &Sampled { tiles: None, ..image }, 0.05, 1).passes());
    }
    println!("filtered, at .05: by replicates {by_replicates} of 60, by pixels {by_pixels}");
    assert!(by_replicates <= 9 && by_pixels >= 48, "{by_replicates}, {by_pixels}");
    let c = held(&golden, &smooth(200, 0.02), 0.05, 1);
    let Moved::Shift { places, regions, .. } = &c.moved[0] else { panic!("{c:?}") };
    assert!(places[0].bias > 0.01 && regions[0].p.is_none(), "{places:?}");
    assert!(c.line().contains("by replicates"), "{}", c.line());
}
