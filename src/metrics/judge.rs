//! The judge: the occlusion ratio Q = E_with / E_without, from path-traced
//! irradiance with the occluder in place and taken away, at the same points and
//! with the same random numbers.

use super::{
    Absent,
    artifact::{Brighter, contrast},
    regions::{Region, Regions},
};
use crate::{
    counted::counted,
    stats::{Estimate, Group, jackknife, mean_variance},
};

/// Pixels whose Q has a larger relative standard error are masked in images.
pub const MASK_ABOVE: f64 = 0.05;

/// Irradiance over pi of one replicate, a value a pixel; NaN where the view meets
/// no surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// With the occluder.
    pub with: Vec<f32>,
    /// Without it.
    pub without: Vec<f32>,
}

/// What metrics need of the judge: the regions' irradiances, and images.
#[derive(Clone, Debug, PartialEq)]
pub struct Judge {
    /// Means over the regions.
    pub regions: JudgedRegions,
    /// Q a pixel.
    pub image: QImage,
}

/// Mean irradiance of footprint and flanks in each replicate.
#[derive(Clone, Debug, PartialEq)]
pub struct JudgedRegions {
    /// A row a replicate: E_with, then E_without, of footprint, left, right.
    pub means: Group,
    /// Which flank's Q is brighter.
    pub brighter: Brighter,
}

/// Images of the judge, a value a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct QImage {
    /// Q; NaN where E_without is zero or there is no surface.
    pub q: Vec<f32>,
    /// Relative standard error of Q.
    pub relative_se: Vec<f32>,
    /// Irradiance over pi, with and without the occluder.
    pub irradiance: [Vec<f32>; 2],
}

/// Q of a region from the column means of a judge group.
fn ratio(means: &[f64], region: usize) -> f64 {
    means[region] / means[3 + region]
}

/// K(Q) from the column means of a judge group.
pub fn contrast_of_means(means: &[f64], brighter: Brighter) -> f64 {
    let flank = ratio(means, if brighter == Brighter::Left { 1 } else { 2 });
    contrast(ratio(means, 0), flank)
}

/// Half width of an estimate's 95 % interval over its value; infinite where it is
/// not known.
fn relative_half_width(e: Estimate) -> f64 {
    let [lo, hi] = e.interval(0.95);
    let half = (hi - lo) / 2.0;
    // Exactly nothing, as under a sealed occluder, is exactly known.
    let relative = if half == 0.0 { 0.0 } else { half / e.value };
    if relative.is_nan() { f64::INFINITY } else { relative }
}

/// Q of one region, where its irradiances and their ratio are known to the
/// precision wanted: half width of the 95 % interval over the value.
///
/// # Errors
/// Where the region is too small or the judge too vague there.
pub fn region_q(pairs: &[Pair], regions: &Regions, region: Region, precision: f64) -> Result<Estimate, Absent> {
    let rows: Result<Group, Absent> =
        pairs.iter().map(|p| Ok(vec![regions.mean(region, &p.with)?, regions.mean(region, &p.without)?])).collect();
    let rows = [rows?];
    let q = jackknife(&rows, |m| m[0][0] / m[0][1]);
    let widest = (0..2).map(|c| jackknife(&rows, |m| m[0][c])).chain([q]).map(relative_half_width).fold(0.0, f64::max);
    if widest <= precision { Ok(q) } else { Err(vague(widest, pairs.len(), precision)) }
}

/// Why metrics take nothing from a judge that is less precise than asked.
pub fn vague(precision: f64, replicates: usize, wanted: f64) -> Absent {
    Absent(format!(
        "the judge is less precise than asked: {:.2} % of a region mean after {}, {:.2} % wanted",
        precision * 100.0,
        counted(replicates, "replicate", "replicates"),
        wanted * 100.0
    ))
}

impl JudgedRegions {
    /// Averages a judge's replicates over regions.
    ///
    /// # Errors
    /// Where a region is too small to measure.
    pub fn new(replicates: &[Pair], regions: &Regions) -> Result<Self, Absent> {
        let mut means = Vec::with_capacity(replicates.len());
        for pair in replicates {
            let mut row = Vec::with_capacity(6);
            for image in [&pair.with, &pair.without] {
                for region in Judge::REGIONS {
                    row.push(regions.mean(region, image)?);
                }
            }
            means.push(row);
        }
        let mut judged = JudgedRegions { means, brighter: Brighter::Left };
        judged.brighter = Brighter::of(judged.region(1).value, judged.region(2).value);
        Ok(judged)
    }

    fn region(&self, index: usize) -> Estimate {
        jackknife(std::slice::from_ref(&self.means), |m| ratio(&m[0], index))
    }

    /// Q of a region: the ratio of its mean irradiances.
    pub fn q_of(&self, region: Region) -> Option<Estimate> {
        Judge::REGIONS.iter().position(|&r| r == region).map(|i| self.region(i))
    }

    /// The widest 95 % interval among the regions' irradiances and ratios, as
    /// half width over value; infinite where one is not known.
    pub fn widest(&self) -> f64 {
        (0..6)
            .map(|c| jackknife(std::slice::from_ref(&self.means), |m| m[0][c]))
            .chain((0..3).map(|r| self.region(r)))
            .map(relative_half_width)
            .fold(0.0, f64::max)
    }

    /// Whether light reaches every region of the twin: without it Q is not
    /// defined.
    pub fn has_light(&self) -> bool {
        (3..6).all(|column| self.means.iter().any(|row| row[column] > 0.0))
    }

    /// K(Q).
    pub fn contrast(&self) -> Estimate {
        jackknife(std::slice::from_ref(&self.means), |m| contrast_of_means(&m[0], self.brighter))
    }
}

impl QImage {
    /// Q a pixel from a judge's replicates.
    pub fn new(replicates: &[Pair]) -> Self {
        let pixels = replicates.first().map_or(0, |p| p.with.len());
        let empty = || Vec::with_capacity(pixels);
        let mut image = QImage { q: empty(), relative_se: empty(), irradiance: [empty(), empty()] };
        for i in 0..pixels {
            let (with, without): (Vec<f64>, Vec<f64>) =
                replicates.iter().map(|p| (f64::from(p.with[i]), f64::from(p.without[i]))).unzip();
            let (q, se) = ratio_of_means(&with, &without);
            image.q.push(q as f32);
            image.relative_se.push((se / q) as f32);
            image.irradiance[0].push(mean_variance(&with).0 as f32);
            image.irradiance[1].push(mean_variance(&without).0 as f32);
        }
        image
    }

    /// Whether a pixel of Q is too noisy to show.
    pub fn masked(&self, pixel: usize) -> bool {
        too_noisy(self.relative_se[pixel])
    }
}

impl Judge {
    /// The regions the judge speaks of, in the order of a group's columns: first
    /// their E_with, then their E_without.
    pub const REGIONS: [Region; 3] = [Region::Footprint, Region::Left, Region::Right];

    /// Works out the judge from its replicates.
    ///
    /// # Errors
    /// Where a region is too small to measure.
    pub fn new(replicates: &[Pair], regions: &Regions) -> Result<Self, Absent> {
        Ok(Judge { regions: JudgedRegions::new(replicates, regions)?, image: QImage::new(replicates) })
    }
}

/// Whether a relative standard error of Q asks for the mask; an unknown one does.
pub fn too_noisy(relative_se: f32) -> bool {
    relative_se.is_nan() || f64::from(relative_se) > MASK_ABOVE
}

/// A ratio of means of paired values with its standard error by linearisation:
/// the standard error of a - q b, over the mean of b.
fn ratio_of_means(a: &[f64], b: &[f64]) -> (f64, f64) {
    let (ma, mb) = (mean_variance(a).0, mean_variance(b).0);
    let q = ma / mb;
    let residuals: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - q * b).collect();
    let variance = mean_variance(&residuals).1;
    (q, (variance / a.len() as f64).sqrt() / mb)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratio_of_paired_values_has_no_error_where_they_move_together() {
        let b = [0.5, 0.7, 0.6, 0.9];
        let a = b.map(|v| v * 0.4);
        let (q, se) = ratio_of_means(&a, &b);
        assert!((q - 0.4).abs() < 1e-12 && se < 1e-12);
    }
}
