//! The artifact: highlight contrast K, its error dK against the judge, and how
//! much of it a method takes away.

use super::{
    Absent, Metric, MetricName,
    judge::{JudgedRegions, contrast_of_means},
    regions::{Region, Regions},
};
use crate::stats::{Estimate, Group, column_means, jackknife};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which flank the footprint is compared with. The brighter one, not the mean of
/// both: a profile that climbs from dark to bright has no apex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Brighter {
    /// The left flank.
    Left,
    /// The right flank.
    Right,
}

impl Brighter {
    /// Decides by the flanks' means of a converged image.
    pub fn of(left: f64, right: f64) -> Self {
        if left >= right { Brighter::Left } else { Brighter::Right }
    }

    /// The flank's region.
    pub fn region(self) -> Region {
        match self {
            Brighter::Left => Region::Left,
            Brighter::Right => Region::Right,
        }
    }
}

/// Weber contrast, footprint / flank - 1.
pub fn contrast(footprint: f64, flank: f64) -> f64 {
    footprint / flank - 1.0
}

/// The same estimator with many rays: replicates, and their mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Converged {
    /// Independent images, at least two.
    pub replicates: Vec<Vec<f32>>,
    /// Their mean a pixel.
    pub mean: Vec<f32>,
}

impl Converged {
    /// Averages replicates of one size.
    pub fn new(replicates: Vec<Vec<f32>>) -> Self {
        let pixels = replicates.first().map_or(0, Vec::len);
        let n = replicates.len() as f64;
        let mean = (0..pixels).map(|i| (replicates.iter().map(|r| f64::from(r[i])).sum::<f64>() / n) as f32).collect();
        Converged { replicates, mean }
    }
}

/// One method's images in one scene: replicates, and its converged image.
#[derive(Clone, Copy, Debug)]
pub struct Method<'a> {
    /// One openness image a replicate.
    pub replicates: &'a [Vec<f32>],
    /// The same estimator with many rays.
    pub converged: &'a Converged,
    /// Where to look.
    pub regions: &'a Regions,
}

impl Method<'_> {
    /// Which flank is brighter, decided once, on the converged image.
    ///
    /// # Errors
    /// Where a flank is too small.
    pub fn brighter(&self) -> Result<Brighter, Absent> {
        let mean = |region| self.regions.mean(region, &self.converged.mean);
        Ok(Brighter::of(mean(Region::Left)?, mean(Region::Right)?))
    }

    /// A row a replicate: mean of the footprint, mean of the brighter flank.
    fn rows(&self) -> Result<Group, Absent> {
        let flank = self.brighter()?.region();
        self.replicates
            .iter()
            .map(|image| Ok(vec![self.regions.mean(Region::Footprint, image)?, self.regions.mean(flank, image)?]))
            .collect()
    }

    /// K, and the same as Michelson contrast.
    pub fn contrasts(&self) -> [Metric; 2] {
        let of = |f: fn(&[f64]) -> f64| self.rows().map(|rows| jackknife(&[rows], |m| f(&m[0])));
        [
            Metric::new(MetricName::Contrast, None, of(|m| contrast(m[0], m[1]))),
            Metric::new(MetricName::Michelson, None, of(|m| (m[0] - m[1]) / (m[0] + m[1]))),
        ]
    }

    /// dK = K - K(Q), with its reading as the note where it is clearly not zero.
    pub fn contrast_error(&self, judge: Result<&JudgedRegions, Absent>) -> Metric {
        let estimate = judge.clone().and_then(|judge| {
            Ok(jackknife(&[self.rows()?, judge.means.clone()], |m| {
                contrast(m[0][0], m[0][1]) - contrast_of_means(&m[1], judge.brighter)
            }))
        });
        let of_judge = judge.ok().map(JudgedRegions::contrast);
        let reading = estimate.as_ref().ok().zip(of_judge).and_then(|(e, j)| reading(e, j.value));
        let mut metric = Metric::new(MetricName::ContrastError, None, estimate).with_floor(of_judge);
        if metric.value.is_some() {
            metric.note = reading.map(str::to_owned);
        }
        metric
    }

    /// 1 - max(0, dK) / dK(classic). The two methods share their seeds, so
    /// replicates are paired.
    pub fn removed(&self, classic: &Method<'_>, judge: Result<&JudgedRegions, Absent>) -> Metric {
        let (estimate, of_judge) = judge
            .and_then(|judge| self.removed_estimates(classic, judge))
            .map_or_else(|absent| (Err(absent), None), |[estimate, of_judge]| (Ok(estimate), Some(of_judge)));
        Metric::new(MetricName::Removed, None, estimate).with_floor(of_judge)
    }

    /// What is removed, and the same as if the judge alone had an error.
    ///
    /// All above 0 counts as dK of the method, so that its noise is not cut off with its sign: an estimate
    /// below 0 is no proof that nothing is left. There the value is 1, and its error what it is at dK = 0,
    /// se(dK) / dK(classic). Of replicates that were cut off one by one, a method that removes .9 at 1 ray
    /// passed 4 of 20 gates of more than .9 with p = 0.
    fn removed_estimates(&self, classic: &Method<'_>, judge: &JudgedRegions) -> Result<[Estimate; 2], Absent> {
        let error = classic.contrast_error(Ok(judge));
        // One image alone has no error of its own: there the judge's has to do.
        let of_judge = error.floor.map(|f| Estimate { value: 0.0, se: f.se, df: f.df });
        let alone = of_judge.filter(|_| classic.replicates.len() == 1).zip(error.value);
        let known = alone.map(|(judge, value)| Estimate { value, ..judge }).or(error.estimate());
        let clear = known.is_some_and(|e| e.interval(0.95)[0] > 0.0);
        if !clear {
            return Err(Absent(
                "classic shows no false highlight here that is clear of the noise, so there is nothing to remove"
                    .into(),
            ));
        }
        let paired: Group = self.rows()?.into_iter().zip(classic.rows()?).map(|(a, b)| [a, b].concat()).collect();
        let errors = |own: &[f64], q: &[f64]| {
            let kq = contrast_of_means(q, judge.brighter);
            [contrast(own[0], own[1]) - kq, contrast(own[2], own[3]) - kq]
        };
        let removed = |groups: &[Group], errors: &dyn Fn(&[Vec<f64>]) -> [f64; 2]| {
            let share = |m: &[Vec<f64>]| {
                let [method, classic] = errors(m);
                1.0 - method / classic
            };
            let estimate = jackknife(groups, share);
            if estimate.value > 1.0 {
                let method = jackknife(groups, |m| errors(m)[0]);
                let [_, classic] = errors(&groups.iter().map(column_means).collect::<Vec<_>>());
                return Estimate { value: 1.0, se: method.se / classic, df: method.df };
            }
            estimate
        };
        let own = column_means(&paired);
        let of_judge = removed(std::slice::from_ref(&judge.means), &|m| errors(&own, &m[0]));
        Ok([removed(&[paired, judge.means.clone()], &|m| errors(&m[0], &m[1])), of_judge])
    }
}

/// How a contrast error reads, where its 95 % interval leaves out zero.
pub(super) fn reading(error: &Estimate, judge: f64) -> Option<&'static str> {
    let [lo, hi] = error.interval(0.95);
    match (lo > 0.0, hi < 0.0, judge > 0.0) {
        (true, _, false) => Some("false highlight"),
        (true, _, true) => Some("exaggerated highlight"),
        (_, true, true) => Some("lost highlight"),
        (_, true, false) => Some("over-correction"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::SplitMix64;

    /// A method that leaves 0.02 of dK = 0.2, with noise that hides the sign of what it leaves: 4,000 experiments of 16
    /// replicates. The 99.9 % interval may lie above the truth in 0.05 % of them, 2; the binomial 99.9 % bound is 9.
    /// With replicates cut off at 0 it did in 550.
    #[test]
    fn what_is_removed_is_not_surer_than_its_noise() {
        let pixels = |i: u32| vec![i; 100];
        let regions = Regions::of_pixels([vec![], pixels(0), pixels(1), pixels(2), vec![]]);
        let converged = Converged::new(vec![vec![0.6, 0.5, 0.4]; 2]);
        let judge = JudgedRegions { means: vec![vec![0.5, 0.5, 0.4, 1.0, 1.0, 1.0]; 4], brighter: Brighter::Left };
        let mut random = SplitMix64(7);
        let mut images = |dk: f64, noise: f64| -> Vec<Vec<f32>> {
            // The sum of 12 uniform numbers less 6 has variance 1.
            let mut image = || {
                let normal = (0..12).map(|_| random.uniform()).sum::<f64>() - 6.0;
                vec![(0.5 * (1.0 + dk + noise * normal)) as f32, 0.5, 0.4]
            };
            (0..16).map(|_| image()).collect()
        };
        let (mut surer, mut exact) = (0, 0);
        for _ in 0..4000 {
            let (own, classic) = (images(0.02, 0.072), images(0.2, 0.01));
            let [own, classic] =
                [&own, &classic].map(|r| Method { replicates: r, converged: &converged, regions: &regions });
            let removed = own.removed(&classic, Ok(&judge)).estimate().unwrap();
            assert!(removed.value <= 1.0);
            surer += u32::from(removed.interval(0.999)[0] > 0.9);
            exact += u32::from(removed.se == 0.0);
        }
        assert!(surer <= 9 && exact == 0, "{surer} surer, {exact} without any error");
    }

    #[test]
    fn readings_follow_the_signs() {
        let e = |value| Estimate { value, se: 0.01, df: 15.0 };
        assert_eq!(reading(&e(0.2), -0.1), Some("false highlight"));
        assert_eq!(reading(&e(-0.2), 0.1), Some("lost highlight"));
        assert_eq!(reading(&e(-0.2), -0.1), Some("over-correction"));
        assert_eq!(reading(&e(0.005), -0.1), None);
    }
}
