//! What `aogauge flatland` finds: profiles over widths and gaps, and a map.

use super::{Estimator, Map, Measure, Model, Profile, Slab, Space};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What to compute; lengths in metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Setting {
    /// R.
    pub radius: f64,
    /// h.
    pub height: f64,
    /// In which world directions live.
    pub space: Space,
    /// How directions are weighted.
    pub measure: Measure,
    /// Widths of boxes, w.
    pub widths: Vec<f64>,
    /// Gaps under boxes, m.
    pub gaps: Vec<f64>,
    /// Estimators; the first is what the others are held against. At least one.
    pub estimators: Vec<Estimator>,
}

/// Profiles and, where asked for, a map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// What was asked for.
    pub setting: Setting,
    /// Places of the profiles, t/R.
    pub t: Vec<f64>,
    /// A profile a width and gap.
    pub profiles: Vec<Profile>,
    /// Highlight contrast over width and gap.
    pub map: Option<Map>,
}

/// Places on each side of the box's middle.
const PLACES: u32 = 120;

impl Setting {
    fn model(&self) -> Model {
        let estimator = self.estimators.first().copied().unwrap_or(Estimator::Classic);
        Model { radius: self.radius, space: self.space, measure: self.measure, estimator }
    }

    /// Profiles over all widths and gaps, wide enough that the widest box is out of
    /// reach at both ends.
    pub fn study(self) -> Study {
        let model = self.model();
        let widest = self.widths.iter().fold(0.0, |a: f64, &b| a.max(b));
        let end = widest / 2.0 + 1.1 * self.radius;
        let right: Vec<f64> = (0..=PLACES).map(|i| end * f64::from(i) / f64::from(PLACES)).collect();
        let boxes: Vec<Slab> = self
            .widths
            .iter()
            .flat_map(|&width| self.gaps.iter().map(move |&gap| (width, gap)))
            .map(|(width, gap)| Slab { width, gap, height: self.height })
            .collect();
        let profiles = boxes.par_iter().map(|slab| Profile::new(&model, &self.estimators, slab, &right)).collect();
        let t = mirrored(&right, -1.0).into_iter().map(|t| t / self.radius).collect();
        Study { setting: self, t, profiles, map: None }
    }

    /// The map of the same estimators. `tell` hears how many of how many boxes
    /// are done.
    pub fn map(&self, tell: &(dyn Fn(usize, usize) + Sync)) -> Map {
        Map::new(&self.model(), &self.estimators, self.height, tell)
    }
}

/// Values at places t >= 0, ascending, continued to t < 0 by `sign`.
pub(super) fn mirrored(right: &[f64], sign: f64) -> Vec<f64> {
    right.iter().skip(1).rev().map(|v| sign * v).chain(right.iter().copied()).collect()
}
