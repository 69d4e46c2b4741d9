//! Occluders one by one, in scenes that show several.

use super::{
    case_metrics,
    judging::{Judged, region_q},
    on_screen::Shown,
};
use crate::{
    metrics::{
        Absent, Metric, MetricName,
        artifact::Method,
        judge::{self, Judge, JudgedRegions, Pair, QImage},
        regions::{OccluderRegions, Region, Regions},
    },
    record::{OccluderMetrics, OccluderRecord},
    stats::Estimate,
};

/// An occluder with the pixels it is measured on.
pub(super) struct Occluder {
    pub name: String,
    pub regions: Regions,
    /// Those that the camera of screen-space methods shows.
    pub shown: Option<Regions>,
}

/// What the judge says of an occluder: of its regions, with all occluders of the
/// scene in place over all taken away.
pub(super) struct JudgedOccluder {
    pub means: Result<JudgedRegions, Absent>,
    pub q: [Result<Estimate, Absent>; 3],
}

impl Occluder {
    /// All that were found in view.
    pub fn all(found: Vec<OccluderRegions>, pixels: usize, screen: Option<&Shown>) -> Vec<Self> {
        let mut visible = vec![false; pixels];
        for &i in screen.map_or(&[][..], |s| s.regions.pixels(Region::All)) {
            visible[i as usize] = true;
        }
        found
            .into_iter()
            .map(|o| Occluder {
                shown: screen.map(|_| o.regions.only(|i| visible[i as usize])),
                name: o.name,
                regions: o.regions,
            })
            .collect()
    }

    /// Judges the occluder by the scene's replicates: over its regions, and over what
    /// a screen shows of them.
    pub fn judge(&self, pairs: &[Pair], precision: f64) -> [Option<JudgedOccluder>; 2] {
        [Some(&self.regions), self.shown.as_ref()].map(|r| r.map(|r| JudgedOccluder::new(pairs, r, precision)))
    }

    /// What is recorded of it, whatever the method.
    pub fn record(&self, index: usize, judged: Result<&Judged, Absent>) -> OccluderRecord {
        let judged = judged.and_then(|j| j.occluder(index, false).ok_or_else(|| Absent("it was not judged".into())));
        let count = |of: &Regions| Judge::REGIONS.into_iter().map(|r| (r, of.pixels(r).len())).collect();
        let contrast = judged.clone().and_then(|j| Ok(j.means.as_ref().map_err(Clone::clone)?.contrast()));
        let q = |i: usize| region_q(judged.clone().and_then(|j| j.q[i].clone()));
        OccluderRecord {
            name: self.name.clone(),
            regions: count(&self.regions),
            shown: self.shown.as_ref().map(count),
            contrast: Metric::new(MetricName::JudgeContrast, None, contrast),
            q: (0..).zip(Judge::REGIONS).map(|(i, r)| (r, q(i))).collect(),
        }
    }

    /// The metrics of a case under it.
    pub fn metrics(
        &self,
        method: &Method<'_>,
        classic: Option<&Method<'_>>,
        judged: &Result<&JudgedOccluder, Absent>,
        image: &Result<&QImage, Absent>,
    ) -> OccluderMetrics {
        let metrics = case_metrics::of_occluder(method, classic, judged, image);
        OccluderMetrics { name: self.name.clone(), metrics }
    }
}

impl JudgedOccluder {
    fn new(pairs: &[Pair], regions: &Regions, precision: f64) -> Self {
        let means = JudgedRegions::new(pairs, regions).and_then(|judged| match judged.widest() {
            widest if widest <= precision => Ok(judged),
            widest => Err(judge::vague(widest, pairs.len(), precision)),
        });
        JudgedOccluder { means, q: Judge::REGIONS.map(|r| judge::region_q(pairs, regions, r, precision)) }
    }
}
