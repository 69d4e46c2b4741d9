//! Rays that are decided differently although the random numbers are the same.

use super::{Sampled, Terms, compare::Moved};
use crate::stats::{Scale, TILE, sidak_alpha};
use statrs::distribution::{Binomial, DiscreteCDF};
use std::collections::BTreeMap;

/// Rays that rounding may move, a share of all. It is what the GPU is allowed against
/// the CPU.
const SHARE: f64 = 1e-4;

/// A place whose means differ by more than rounding explains.
struct Worst {
    scale: Scale,
    share: f64,
    limit: f64,
    place: [u32; 4],
}

/// What moved, if rounding does not explain it. Images of one seed have no other noise,
/// so a single wrong pixel shows.
///
/// A mean that is off by d needs d x rays of them decided otherwise, at least; ones that
/// cancel are not seen. Over the image their share may be [`SHARE`]. A tile or pixel may
/// hold as many as a binomial of that rate exceeds with a third of the family error,
/// over all tiles or pixels of all comparisons. Named is the place that is furthest beyond
/// its limit.
pub(super) fn moved(golden: &Sampled, image: &Sampled, terms: &Terms<'_>) -> Option<Moved> {
    let [width, height] = golden.resolution;
    let difference = |i: usize| match (golden.mean.get(i), image.mean.get(i)) {
        (Some(a), Some(b)) if a.is_finite() && b.is_finite() => Some((f64::from(*a) - f64::from(*b)).abs()),
        _ => None,
    };
    let in_pixel = u64::from(golden.rays.max(1)) * u64::from(golden.replicates);
    let mut worst: Option<Worst> = None;
    for (scale, side) in [(Scale::Image, width.max(height).max(1)), (Scale::Tile, TILE), (Scale::Pixel, 1)] {
        let (across, down) = (width.div_ceil(side), height.div_ceil(side));
        let places = across as usize * down as usize;
        let alpha = sidak_alpha(terms.alpha, places.saturating_mul(3).saturating_mul(terms.family.max(1)));
        let mut limits = BTreeMap::new();
        for (left, top) in (0..down).flat_map(|y| (0..across).map(move |x| (x * side, y * side))) {
            let place = [left, top, side.min(width - left), side.min(height - top)];
            let pixels = (top..top + place[3]).flat_map(|y| (left..left + place[2]).map(move |x| (x, y)));
            let known = pixels.filter_map(|(x, y)| difference(y as usize * width as usize + x as usize));
            let (pixels, sum) = known.fold((0u64, 0.0), |(n, sum), d| (n + 1, sum + d));
            if sum == 0.0 {
                continue;
            }
            let limit = *limits.entry(pixels).or_insert_with(|| match scale {
                Scale::Image => SHARE,
                _ => chance(pixels * in_pixel, alpha) as f64 / (pixels * in_pixel) as f64,
            });
            let share = sum / pixels as f64;
            if share > limit && worst.as_ref().is_none_or(|w| share / limit > w.share / w.limit) {
                worst = Some(Worst { scale, share, limit, place });
            }
        }
    }
    let worst = worst?;
    let (pixels, place) = differing(golden, image);
    Some(Moved::Rays { scale: worst.scale, share: worst.share, limit: worst.limit, worst: worst.place, pixels, place })
}

/// The rays of so many that may be moved: more have a chance below `alpha`. At least 1.
fn chance(rays: u64, alpha: f64) -> u64 {
    let Ok(moved) = Binomial::new(SHARE, rays) else { return rays };
    // Beyond the mean the tail falls fast: a few dozen steps at most for a tile.
    let from = (rays as f64 * SHARE) as u64;
    (from.max(1)..=rays).find(|&k| moved.sf(k) < alpha).unwrap_or(rays)
}

/// How many means differ, and the least rectangle that holds them.
fn differing(golden: &Sampled, image: &Sampled) -> (usize, [u32; 4]) {
    let width = golden.resolution[0].max(1);
    let (mut pixels, mut low, mut high) = (0, [u32::MAX; 2], [0; 2]);
    for (i, (a, b)) in golden.mean.iter().zip(&image.mean).enumerate() {
        if a != b && a.is_finite() && b.is_finite() {
            pixels += 1;
            let at = [i as u32 % width, i as u32 / width];
            low = [low[0].min(at[0]), low[1].min(at[1])];
            high = [high[0].max(at[0]), high[1].max(at[1])];
        }
    }
    let side = |k: usize| high[k] + 1 - low[k];
    (pixels, if pixels > 0 { [low[0], low[1], side(0), side(1)] } else { [0; 4] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden::Limits;
    use std::collections::BTreeMap;

    fn sampled(mean: Vec<f32>) -> Sampled {
        let variance = vec![0.01; mean.len()];
        Sampled { resolution: [64, 32], mean, variance, tiles: None, replicates: 16, rays: 32, seed: Some(1) }
    }

    fn found(change: impl Fn(&mut Vec<f32>)) -> Option<(Scale, [u32; 4])> {
        let golden = vec![0.5; 64 * 32];
        let mut image = golden.clone();
        change(&mut image);
        let regions = BTreeMap::new();
        let terms = Terms { alpha: 0.01, family: 30, limits: Limits::default(), regions: &regions };
        match moved(&sampled(golden), &sampled(image), &terms)? {
            Moved::Rays { scale, worst, share, limit, .. } => {
                assert!(share > limit, "{share} {limit}");
                Some((scale, worst))
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn one_wrong_pixel_a_tile_and_an_image_are_found_and_named() {
        let ray = 1.0 / 512.0;
        assert_eq!(found(|_| ()), None);
        // Rounding: 3 rays of one pixel, 10 of a tile.
        assert_eq!(found(|image| image[700] += 3.0 * ray), None);
        assert_eq!(found(|image| (0..10).for_each(|i| image[i] += ray)), None);
        assert_eq!(found(|image| image[700] += 0.03), Some((Scale::Pixel, [700 % 64, 700 / 64, 1, 1])));
        // No pixel is off by more than a ray, but 64 of 256 are.
        assert_eq!(
            found(|image| (16..24).for_each(|y| (16..24).for_each(|x| image[y * 64 + x] -= ray))),
            Some((Scale::Tile, [16, 16, 16, 16]))
        );
        // Everywhere a little.
        assert_eq!(found(|image| image.iter_mut().for_each(|v| *v += 0.1 * ray)), Some((Scale::Image, [0, 0, 64, 32])));
    }

    #[test]
    fn the_bounds_are_those_of_the_binomial() {
        // 512 rays at 1e-4: P(X > 3) = 2.7e-7, P(X > 4) = 2.8e-9, by the Poisson terms .0512^k / k!.
        assert_eq!(chance(512, 1e-6), 3);
        assert_eq!(chance(512, 1e-8), 4);
        assert_eq!(chance(1, 1e-6), 1);
    }
}
