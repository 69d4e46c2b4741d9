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
    fn removed_estimates(&self, classic: &Method<'_>, judge: &JudgedRegions) -> Result<[Estimate; 2], Absent> {
        let error = classic.contrast_error(Ok(judge));
        // One image alone has no error of its own: there the judge's has to do.
        let of_judge = error.floor.map(|f| Estimate { value: 0.0, se: f.se, df: f.df });
        let alone = of_judge.filter(|_| classic.replicates.len() == 1).zip(error.value);
        let known = alone.map(|(judge, value)| Estimate { value, ..judge }).or(error.estimate());
        let clear = known.is_some_and(|e| e.interval(0.95)[0] > 0.0);
        if !clear {
            return Err(Absent("classic shows no false highlight here, so there is nothing to remove".into()));
        }
        let paired: Group = self.rows()?.into_iter().zip(classic.rows()?).map(|(a, b)| [a, b].concat()).collect();
        let removed = |own: &[f64], q: &[f64]| {
            let kq = contrast_of_means(q, judge.brighter);
            let (method, classic) = (contrast(own[0], own[1]) - kq, contrast(own[2], own[3]) - kq);
            1.0 - method.max(0.0) / classic
        };
        let own = column_means(&paired);
        let of_judge = jackknife(std::slice::from_ref(&judge.means), |m| removed(&own, &m[0]));
        Ok([jackknife(&[paired, judge.means.clone()], |m| removed(&m[0], &m[1])), of_judge])
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

    #[test]
    fn readings_follow_the_signs() {
        let e = |value| Estimate { value, se: 0.01, df: 15.0 };
        assert_eq!(reading(&e(0.2), -0.1), Some("false highlight"));
        assert_eq!(reading(&e(-0.2), 0.1), Some("lost highlight"));
        assert_eq!(reading(&e(-0.2), -0.1), Some("over-correction"));
        assert_eq!(reading(&e(0.005), -0.1), None);
    }
}
