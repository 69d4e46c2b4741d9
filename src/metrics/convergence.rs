//! How fast a method's error falls with its rays: bias apart from variance, the
//! slope of RMSE over rays, and what the error tends to.
//!
//! A replicate of n rays differs from the truth by a bias b and by noise of
//! variance v; its mean square error over some pixels is b² + v. Both are estimated
//! without bias from R replicates with mean m and variance s² a pixel, against the
//! converged image c, the mean of C images with variance u of that mean:
//!
//! ```text
//! v  = mean over pixels of s²
//! b² = mean over pixels of (m - c)² - s²/R - u
//! ```
//!
//! so that neither the noise that the mean still has nor that of the converged image
//! counts as bias. b² may come out below 0 where there is none: it is not clamped.
//! Intervals are jackknifed over replicates, left out of all ray counts at once,
//! because these share their seeds; and over the converged images. Where b is 0 the
//! estimate of b² is degenerate and its interval too wide rather than too narrow.

use super::{Absent, Quantity, artifact::Converged, regions::Region};
use crate::stats::{Estimate, jackknife_of};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The RMSE whose rays are asked for unless a suite says otherwise: a hundredth of the
/// range of openness, two to three steps of an 8-bit picture.
pub const TARGET: f64 = 0.01;

/// How far beyond the ray counts measured the power law is followed.
const EXTRAPOLATE: f64 = 10.0;

/// How one method converges on one renderer, over one region.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Convergence {
    /// The estimator.
    pub estimator: String,
    /// The renderer.
    pub renderer: String,
    /// Over which pixels.
    pub region: Region,
    /// The error at each ray count, fewest rays first.
    pub points: Vec<Point>,
    /// Slope of ln RMSE over ln rays, by least squares: -1/2 for independent samples,
    /// lower (faster) for Sobol samples, 0 where a bias is all that is left.
    pub slope: Quantity,
    /// b² of the model RMSE² = b² + v/n: what the error tends to. Below 0 where it
    /// falls faster than 1/n.
    pub limit: Quantity,
    /// v of that model: the variance of one ray.
    pub per_ray: Quantity,
    /// What an RMSE takes; null in records made before this was kept.
    #[serde(default)]
    pub target: Option<Target>,
}

/// The rays that an RMSE takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// The RMSE.
    pub rmse: f64,
    /// Rays a pixel, by the power law through the points; fewer is better. Null where
    /// there is no slope, the error does not fall, or the rays lie more than a factor
    /// of 10 beyond those measured: nothing is known there.
    pub rays: Quantity,
}

/// The error at one ray count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Rays a pixel.
    pub rays: u32,
    /// Root of b² + v: that of one replicate against the truth. Lower is better.
    pub rmse: Quantity,
    /// b², mean over the pixels; may be below 0 by chance.
    pub bias_squared: Quantity,
    /// v, mean over the pixels.
    pub variance: Quantity,
}

/// The replicates of one ray count.
#[derive(Clone, Copy, Debug)]
pub struct Level<'a> {
    /// Rays a pixel.
    pub rays: u32,
    /// One image a replicate.
    pub replicates: &'a [Vec<f32>],
}

/// b² and v.
#[derive(Clone, Copy, Debug)]
struct Moments {
    bias_squared: f64,
    variance: f64,
}

impl Moments {
    fn mse(self) -> f64 {
        self.bias_squared + self.variance
    }
}

/// What a statistic of all levels is taken of: the moments of each level from all
/// images, and with one image left out, by group.
struct Sample {
    whole: Vec<Moments>,
    left_out: [Vec<Vec<Moments>>; 2],
}

impl Sample {
    fn estimate(&self, f: impl Fn(&[Moments]) -> f64) -> Estimate {
        let without = self.left_out.each_ref().map(|group| group.iter().map(|levels| f(levels)).collect());
        jackknife_of(f(&self.whole), &without)
    }

    fn quantity(&self, f: impl Fn(&[Moments]) -> f64) -> Quantity {
        Quantity::new(Ok(self.estimate(f)))
    }
}

/// Measures how a method converges from its levels, over some pixels. With fewer
/// than two levels there is no slope, with fewer than three no model, and with fewer
/// than three replicates nothing: each is null then and says why.
pub fn convergence(
    [estimator, renderer]: [&str; 2],
    region: Region,
    mut levels: Vec<Level<'_>>,
    converged: &Converged,
    pixels: Result<&[u32], Absent>,
    target: f64,
) -> Convergence {
    levels.sort_by_key(|l| l.rays);
    let found = pixels.and_then(|pixels| sample(&levels, converged, pixels));
    let rays: Vec<f64> = levels.iter().map(|l| f64::from(l.rays)).collect();
    let of = |f: &dyn Fn(&[Moments]) -> f64, least: usize| match &found {
        Err(why) => Quantity::new(Err(why.clone())),
        Ok(_) if rays.len() < least => Quantity::new(Err(Absent(format!(
            "this needs {least} ray counts or more, and the method has {}",
            rays.len()
        )))),
        Ok(sample) => sample.quantity(f),
    };
    let mse = |m: &[Moments]| -> Vec<f64> { m.iter().map(|m| m.mse()).collect() };
    let points = levels.iter().enumerate().map(|(i, level)| Point {
        rays: level.rays,
        rmse: of(&|m| m[i].mse().max(0.0).sqrt(), 1),
        bias_squared: of(&|m| m[i].bias_squared, 1),
        variance: of(&|m| m[i].variance, 1),
    });
    let slope = match &found {
        Ok(sample) if sample.whole.iter().any(|m| m.mse() <= 0.0) => {
            Quantity::new(Err(Absent("the error is zero at a ray count, so it has no slope".into())))
        }
        _ => of(&|m| power_law(&rays, &mse(m))[1], 2),
    };
    let needed = match slope.value {
        None => Quantity::new(Err(Absent("the slope of its error is not known".into()))),
        Some(s) if s >= 0.0 => Quantity::new(Err(Absent("its error does not fall with its rays".into()))),
        Some(_) => within_reach(&rays, of(&|m| rays_for(&rays, &mse(m), target), 2)),
    };
    Convergence {
        estimator: estimator.to_owned(),
        renderer: renderer.to_owned(),
        region,
        points: points.collect(),
        slope,
        target: Some(Target { rmse: target, rays: needed }),
        limit: of(&|m| model(&rays, &mse(m))[0], 3),
        per_ray: of(&|m| model(&rays, &mse(m))[1], 3),
    }
}

/// The moments of every level, whole and with each image left out.
fn sample(levels: &[Level<'_>], converged: &Converged, pixels: &[u32]) -> Result<Sample, Absent> {
    let count = levels.first().map_or(0, |l| l.replicates.len());
    if count < 3 || converged.replicates.len() < 3 || levels.iter().any(|l| l.replicates.len() != count) {
        return Err(Absent("bias and variance need three replicates or more of every ray count".into()));
    }
    let truth = Images::of(&converged.replicates, converged, pixels);
    let own: Vec<Images<'_>> = levels.iter().map(|l| Images::of(l.replicates, converged, pixels)).collect();
    let moments = |own_out: Option<usize>, truth_out: Option<usize>| -> Vec<Moments> {
        let [truth_mean, truth_variance] = truth.without(truth_out);
        let images = (converged.replicates.len() - usize::from(truth_out.is_some())) as f64;
        let replicates = (count - usize::from(own_out.is_some())) as f64;
        own.iter()
            .map(|own| {
                let [mean, variance] = own.without(own_out);
                let (mut bias_squared, mut v) = (0.0, 0.0);
                for p in 0..pixels.len() {
                    let noise = variance[p] / replicates + truth_variance[p] / images;
                    bias_squared += (mean[p] - truth_mean[p]).powi(2) - noise;
                    v += variance[p];
                }
                let n = pixels.len() as f64;
                Moments { bias_squared: bias_squared / n, variance: v / n }
            })
            .collect()
    };
    Ok(Sample {
        whole: moments(None, None),
        left_out: [
            (0..count).map(|r| moments(Some(r), None)).collect(),
            (0..converged.replicates.len()).map(|r| moments(None, Some(r))).collect(),
        ],
    })
}

/// Images over some pixels, less the converged image, so that sums of squares lose
/// no digits.
struct Images<'a> {
    images: &'a [Vec<f32>],
    offset: Vec<f64>,
    pixels: &'a [u32],
    sums: Vec<[f64; 2]>,
}

impl<'a> Images<'a> {
    fn of(images: &'a [Vec<f32>], converged: &Converged, pixels: &'a [u32]) -> Self {
        let offset = pixels.iter().map(|&i| f64::from(converged.mean[i as usize])).collect();
        let mut own = Images { images, offset, pixels, sums: vec![[0.0; 2]; pixels.len()] };
        for r in 0..images.len() {
            for p in 0..pixels.len() {
                let d = own.at(r, p);
                own.sums[p][0] += d;
                own.sums[p][1] += d * d;
            }
        }
        own
    }

    fn at(&self, image: usize, p: usize) -> f64 {
        f64::from(self.images[image][self.pixels[p] as usize]) - self.offset[p]
    }

    /// Mean and unbiased variance a pixel, without one of the images.
    fn without(&self, image: Option<usize>) -> [Vec<f64>; 2] {
        let n = (self.images.len() - usize::from(image.is_some())) as f64;
        let of = |p: usize| {
            let d = image.map_or(0.0, |r| self.at(r, p));
            let [sum, squares] = self.sums[p];
            let (sum, squares) = (sum - d, squares - d * d);
            (sum / n, ((squares - sum * sum / n) / (n - 1.0)).max(0.0))
        };
        let (mean, variance) = (0..self.pixels.len()).map(of).unzip();
        [mean, variance]
    }
}

/// Intercept and slope of ln sqrt(mse) over ln rays, by least squares; not finite
/// where an error is 0.
fn power_law(rays: &[f64], mse: &[f64]) -> [f64; 2] {
    let points: Vec<_> = rays.iter().zip(mse).map(|(n, e)| (n.ln(), e.ln() / 2.0, 1.0)).collect();
    line(&points)
}

/// The rays that an RMSE takes, by the power law.
fn rays_for(rays: &[f64], mse: &[f64], rmse: f64) -> f64 {
    let [intercept, slope] = power_law(rays, mse);
    ((rmse.ln() - intercept) / slope).exp()
}

/// Rays that lie no further than [`EXTRAPOLATE`] from those measured, few first.
fn within_reach(measured: &[f64], needed: Quantity) -> Quantity {
    let (least, most) = (measured[0] / EXTRAPOLATE, measured[measured.len() - 1] * EXTRAPOLATE);
    let beyond = |what: String| Quantity::new(Err(Absent(format!("{what} rays: beyond what was measured"))));
    match needed.value {
        Some(n) if n < least => beyond(format!("fewer than {least:.1}")),
        Some(n) if n > most => beyond(format!("more than {most:.0}")),
        // No finite number: so slow a fall that the power overflows.
        None => beyond(format!("more than {most:.0}")),
        Some(_) => needed,
    }
}

/// b² and v of mse = b² + v/n, by least squares weighted by 1/mse², because the
/// errors of mse are alike relative to it.
fn model(rays: &[f64], mse: &[f64]) -> [f64; 2] {
    let points: Vec<_> = rays.iter().zip(mse).map(|(n, e)| (1.0 / n, *e, 1.0 / (e * e))).collect();
    line(&points)
}

/// Intercept and slope of a line through points (x, y, weight). Not
/// [`regress`](crate::stats::regress()): that takes its errors from the scatter about
/// the line and so refuses two points, which are enough here, where errors are
/// jackknifed.
fn line(points: &[(f64, f64, f64)]) -> [f64; 2] {
    let sum = |f: fn(&(f64, f64, f64)) -> f64| points.iter().map(f).sum::<f64>();
    let weight = sum(|(_, _, w)| *w);
    let (x, y) = (sum(|(x, _, w)| w * x) / weight, sum(|(_, y, w)| w * y) / weight);
    let across = points.iter().map(|(px, py, w)| w * (px - x) * (py - y)).sum::<f64>();
    let along = points.iter().map(|(px, _, w)| w * (px - x).powi(2)).sum::<f64>();
    let slope = across / along;
    [y - slope * x, slope]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::sampler::Sampler;

    const PIXELS: u32 = 96;

    /// Independent images of a ramp, with a bias at every pixel and noise of a
    /// standard deviation: sums of uniform numbers.
    fn images(salt: u32, count: u32, bias: f64, deviation: f64) -> Vec<Vec<f32>> {
        let image = |replicate| {
            (0..PIXELS).map(move |pixel| {
                // The first number of a sampler; numbers after it are stratified.
                let first = |k| f64::from(Sampler::new(salt, pixel * 4 + k, replicate).pair(0, 0)[0]);
                let sum: f64 = (0..4).map(|k| first(k) - 0.5).sum();
                let sign = if pixel % 2 == 0 { 1.0 } else { -1.0 };
                (0.5 + f64::from(pixel) / 500.0 + sign * bias + deviation * sum * 3f64.sqrt()) as f32
            })
        };
        (0..count).map(|r| image(r).collect()).collect()
    }

    fn measure(salt: u32, bias: f64, rays: &[u32], deviation: impl Fn(f64) -> f64) -> Convergence {
        measure_for(0.05, salt, bias, rays, deviation)
    }

    fn measure_for(target: f64, salt: u32, bias: f64, rays: &[u32], deviation: impl Fn(f64) -> f64) -> Convergence {
        let salt = salt * 16;
        let own: Vec<Vec<Vec<f32>>> =
            (1..).zip(rays).map(|(i, &n)| images(salt + i, 8, bias, deviation(f64::from(n)))).collect();
        let levels = rays.iter().zip(&own).map(|(&rays, r)| Level { rays, replicates: r }).collect();
        let converged = Converged::new(images(salt, 4, 0.0, 0.01));
        let pixels: Vec<u32> = (0..PIXELS).collect();
        convergence(["e", "cpu"], Region::All, levels, &converged, Ok(&pixels), target)
    }

    fn covered(q: &Quantity, truth: f64) -> usize {
        let [lo, hi] = q.estimate().unwrap().interval(0.95);
        usize::from(lo <= truth && truth <= hi)
    }

    /// RMSE² = b² + v/n with b = 0.03 and v = 0.04, so the noise of the mean of
    /// replicates and of the converged image must be taken off. In 400 experiments
    /// the mean of each estimate is the truth within 4 standard errors of that mean,
    /// and 95 % intervals hold the truth at least 366 times: the binomial 99.9 %
    /// bound of 95 %. Seeds are fixed.
    #[test]
    fn bias_and_variance_are_told_apart() {
        let (b, v) = (0.03f64, 0.04f64);
        let runs: Vec<Convergence> = (0..400).map(|i| measure(i, b, &[4, 16, 64], |n| (v / n).sqrt())).collect();
        let holds = |of: &dyn Fn(&Convergence) -> Quantity, truth: f64, what: &str| {
            let values: Vec<f64> = runs.iter().map(|c| of(c).value.unwrap()).collect();
            let mean = Estimate::of_mean(&values);
            assert!((mean.value - truth).abs() < 4.0 * mean.se, "{what}: {mean:?} is not {truth}");
            let inside: usize = runs.iter().map(|c| covered(&of(c), truth)).sum();
            assert!(inside >= 366, "{what}: {inside} of 400");
        };
        for (i, n) in [(0, 4.0), (1, 16.0), (2, 64.0)] {
            holds(&|c| c.points[i].bias_squared.clone(), b * b, "b²");
            holds(&|c| c.points[i].variance.clone(), v / n, "v");
        }
        holds(&|c| c.limit.clone(), b * b, "limit");
        holds(&|c| c.per_ray.clone(), v, "per ray");
    }

    /// Errors that fall as n^-0.75, as those of a low-discrepancy sequence may.
    #[test]
    fn the_slope_is_found_with_its_interval() {
        let runs: Vec<Convergence> =
            (0..400).map(|i| measure(i + 500, 0.0, &[4, 32], |n| 0.4 * n.powf(-0.75))).collect();
        let inside: usize = runs.iter().map(|c| covered(&c.slope, -0.75)).sum();
        assert!((366..=394).contains(&inside), "{inside} of 400");
        // 0.4 n^-0.75 is 0.05 at n = 16.
        let inside: usize = runs.iter().map(|c| covered(&c.target.as_ref().unwrap().rays, 16.0)).sum();
        assert!((366..=396).contains(&inside), "rays of a target: {inside} of 400");
        for (rmse, says) in [(1e-4, "more than 320 rays"), (0.9, "fewer than 0.4 rays")] {
            let beyond = measure_for(rmse, 500, 0.0, &[4, 32], |n| 0.4 * n.powf(-0.75)).target.unwrap();
            assert!(beyond.rmse == rmse && beyond.rays.note.unwrap().contains(says));
        }
        assert!(runs[0].limit.note.as_deref().unwrap().contains("3 ray counts"));
    }

    #[test]
    fn what_cannot_be_measured_says_why() {
        let one = measure(1, 0.0, &[4], |_| 0.1);
        assert!(one.points[0].rmse.value.is_some());
        assert!(one.slope.note.as_deref().unwrap().contains("2 ray counts"));
        assert!(one.target.unwrap().rays.note.unwrap().contains("not known"));
        // An error of exactly zero has no logarithm.
        let still = Converged::new(vec![vec![0.5; 64]; 4]);
        let images = vec![vec![0.5; 64]; 4];
        let levels = [4, 8].map(|rays| Level { rays, replicates: &images }).to_vec();
        let pixels: Vec<u32> = (0..64).collect();
        let exact = convergence(["e", "cpu"], Region::All, levels.clone(), &still, Ok(&pixels), TARGET);
        assert_eq!((exact.points[1].rmse.value, exact.slope.value), (Some(0.0), None));
        assert!(exact.slope.note.as_deref().unwrap().contains("the error is zero"));
        let none = convergence(["e", "cpu"], Region::All, levels, &still, Err(Absent("too small".into())), TARGET);
        assert_eq!(none.points[0].rmse.note.as_deref(), Some("too small"));
    }
}
