//! How far an image is from another: from its own converged image, from the
//! judge, from classic, from the CPU.

use super::{
    Absent, Metric, MetricName,
    artifact::Method,
    judge::QImage,
    regions::{MIN_PIXELS, Region, Regions},
};
use crate::{counted::counted, stats::Estimate};
use std::collections::HashSet;

/// One value a replicate.
fn over_replicates(
    replicates: &[Vec<f32>],
    mut f: impl FnMut(usize, &[f32]) -> Result<f64, Absent>,
) -> Result<Estimate, Absent> {
    let values: Result<Vec<f64>, Absent> = replicates.iter().enumerate().map(|(r, image)| f(r, image)).collect();
    Ok(Estimate::of_mean(&values?))
}

/// Mean openness of regions; null for one that is too small.
pub fn openness(method: &Method<'_>, regions: &[Region]) -> Vec<Metric> {
    regions
        .iter()
        .map(|&region| {
            let estimate = over_replicates(method.replicates, |_, image| method.regions.mean(region, image));
            Metric::new(MetricName::Openness, Some(region), estimate)
        })
        .collect()
}

/// Bias, MAE and RMSE of the replicates against the converged image.
///
/// MAE and RMSE are those of one replicate, so they hold its noise and fall with
/// the ray count; bias does not. The interval of the bias holds the noise of the
/// converged image too, which is a mean of replicates of its own.
pub fn against_converged(method: &Method<'_>, region: Region) -> [Metric; 3] {
    let regions = method.regions;
    let of = |f: fn(f64) -> f64, finish: fn(f64) -> f64| {
        let pixels = regions.measurable(region)?;
        over_replicates(method.replicates, |_, image| {
            let sum: f64 = pixels
                .iter()
                .map(|&i| f(f64::from(image[i as usize]) - f64::from(method.converged.mean[i as usize])))
                .sum();
            Ok(finish(sum / pixels.len() as f64))
        })
    };
    let mean = |images: &[Vec<f32>]| over_replicates(images, |_, image| regions.mean(region, image));
    let (own, converged) = (mean(method.replicates), mean(&method.converged.replicates));
    let of_converged = converged.clone().ok();
    let bias = own.and_then(|own| Ok(own.less(&converged?)));
    [
        Metric::new(MetricName::Bias, Some(region), bias).with_floor(of_converged),
        Metric::new(MetricName::Mae, Some(region), of(f64::abs, |m| m)),
        Metric::new(MetricName::Rmse, Some(region), of(|d| d * d, f64::sqrt)),
    ]
}

/// The physical error of a region: mean openness less the region's Q, and mean
/// absolute value and root mean square of O - Q over the pixels whose Q is not
/// masked. Of one replicate each, as against the converged image; the noise of Q's
/// image, below 5 % of Q a pixel, is part of the last two. Where many pixels are masked, these
/// two speak of the others only, and may come out below the bias.
pub fn against_judge(
    method: &Method<'_>,
    q: Result<Estimate, Absent>,
    image: &Result<&QImage, Absent>,
    region: Region,
) -> [Metric; 3] {
    let of_judge = q.as_ref().ok().copied();
    let bias = q.and_then(|q| Ok(over_replicates(method.replicates, |_, o| method.regions.mean(region, o))?.less(&q)));
    let of = |f: fn(f64) -> f64, finish: fn(f64) -> f64| {
        let image = image.clone()?;
        let all = method.regions.measurable(region)?;
        let pixels: Vec<usize> = all.iter().map(|&i| i as usize).filter(|&i| !image.masked(i)).collect();
        if pixels.len() < MIN_PIXELS {
            return Err(Absent(format!(
                "only {} not masked",
                counted(pixels.len(), "pixel of Q is", "pixels of Q are")
            )));
        }
        over_replicates(method.replicates, |_, own| {
            let sum: f64 = pixels.iter().map(|&i| f(f64::from(own[i] - image.q[i]))).sum();
            Ok(finish(sum / pixels.len() as f64))
        })
    };
    [
        Metric::new(MetricName::JudgeBias, Some(region), bias).with_floor(of_judge),
        Metric::new(MetricName::JudgeMae, Some(region), of(f64::abs, |m| m)),
        Metric::new(MetricName::JudgeRmse, Some(region), of(|d| d * d, f64::sqrt)),
    ]
}

/// Mean of O(classic) - O over the whole image, replicates paired by seed.
pub fn over_darkening(method: &Method<'_>, classic: &Method<'_>) -> Metric {
    Metric::new(MetricName::OverDarkening, None, difference(classic.replicates, method.replicates, method.regions))
}

/// What replicates of the same number in two rows have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pairing {
    /// The same random numbers, so that their noise cancels in the difference.
    Seeds,
    /// Nothing.
    None,
}

/// Mean of O less the CPU's O over the whole image. Replicates of our own renderers are
/// paired by seed. Those of others are independent of the CPU's: the interval is Welch's then, of the
/// difference of two means.
pub fn renderer_difference(own: &[Vec<f32>], cpu: &[Vec<f32>], regions: &Regions, pairing: Pairing) -> Metric {
    let estimate = difference(own, cpu, regions).and_then(|paired| {
        if pairing == Pairing::Seeds {
            return Ok(paired);
        }
        // Over the pixels that both show, as the paired one.
        let pixels = regions.measurable(Region::All)?;
        let shared: Vec<usize> = pixels
            .iter()
            .map(|&i| i as usize)
            .filter(|&i| own.iter().chain(cpu).all(|image| image[i].is_finite()))
            .collect();
        let mean = |images: &[Vec<f32>]| {
            over_replicates(images, |_, image| {
                Ok(shared.iter().map(|&i| f64::from(image[i])).sum::<f64>() / shared.len() as f64)
            })
        };
        Ok(mean(own)?.less(&mean(cpu)?))
    });
    Metric::new(MetricName::RendererDifference, None, estimate)
}

/// Replicates that are unlike all earlier ones, over all: a number without an error. All
/// statistics rest on it, and none shows it: with one seed for all they find no
/// variance, and are sure of whatever they see.
pub fn distinct_replicates(replicates: &[Vec<f32>]) -> Metric {
    if replicates.len() < 2 {
        let why = "there is one image alone, and nothing that it could differ from";
        return Metric::new(MetricName::DistinctReplicates, None, Err(Absent(why.into())));
    }
    let bits = |image: &[f32]| image.iter().map(|v| v.to_bits()).collect::<Vec<u32>>();
    let distinct: HashSet<Vec<u32>> = replicates.iter().map(|r| bits(r)).collect();
    let (n, value) = (replicates.len() as f64, distinct.len() as f64 / replicates.len() as f64);
    Metric::new(MetricName::DistinctReplicates, None, Ok(Estimate { value, se: 0.0, df: n - 1.0 }))
}

/// Pixels that may hold a number in one image only before a difference means
/// nothing: a share of all.
const APART: f64 = 1e-3;

fn difference(a: &[Vec<f32>], b: &[Vec<f32>], regions: &Regions) -> Result<Estimate, Absent> {
    if a.len() != b.len() {
        return Err(Absent("the two have different numbers of replicates".into()));
    }
    let pixels = regions.measurable(Region::All)?;
    over_replicates(a, |r, image| {
        let differences: Vec<f64> = pixels
            .iter()
            .map(|&i| f64::from(image[i as usize]) - f64::from(b[r][i as usize]))
            .filter(|d| d.is_finite())
            .collect();
        let apart = pixels.len() - differences.len();
        if apart as f64 > APART * pixels.len() as f64 {
            return Err(Absent(format!("{apart} of {} pixels see a surface in one image only", pixels.len())));
        }
        Ok(differences.iter().sum::<f64>() / differences.len() as f64)
    })
}
