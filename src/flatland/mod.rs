//! The paper's section 3: openness of the ground under a box, without rays.
//!
//! A box of width w and height h hangs m over the ground (Fig. 2); a point of the
//! ground lies t beside the box's middle. In *flatland* the world is the
//! cross-section; *extruded*, the box is infinitely long and directions are those
//! of 3D. `docs/flatland.md` has the formulas.

mod apex;
mod exponential;
mod extended;
mod map;
mod profile;
mod quadrature;
mod step;
mod study;
#[cfg(test)]
mod tests;

pub use crate::render::ReceiverPlane;
pub use apex::{Apex, contrast};
pub use map::{Map, MapCurve};
pub use profile::{Profile, ProfileCurve};
pub use step::Openness;
pub use study::{Setting, Study};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A box over the ground, metres (or any one unit), all above zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slab {
    /// w: width.
    pub width: f64,
    /// m: gap between the ground and its underside.
    pub gap: f64,
    /// h: height.
    pub height: f64,
}

/// In which world directions live.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Space {
    /// The cross-section: directions fill a half circle.
    Flat,
    /// 3D, the box infinitely long: directions fill a hemisphere.
    Extruded,
}

/// How directions are weighted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// All directions alike, as in the paper's Fig. 3.
    Uniform,
    /// By the cosine to the normal, Eq. 5.
    Cosine,
}

/// How openness is computed, with infinitely many rays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Estimator {
    /// A hit within R closes the direction.
    Classic,
    /// A hit at distance d lets 1 - exp(-sigma d) through (Eq. 2).
    Obscurance {
        /// Extinction, 1/m.
        sigma: f64,
        /// Whether rays end at R: what lies beyond is then open. Eq. 2 has no R.
        limited: bool,
    },
    /// The paper's section 5: an open direction counts 1 - closed/2 for its two
    /// secondary rays.
    Extended {
        /// R': half the length of a secondary ray, metres.
        secondary_radius: f64,
        /// Whether the ground closes secondary rays.
        receiver_plane: ReceiverPlane,
    },
}

impl Estimator {
    /// Its name in tables and plots.
    pub fn label(&self) -> &'static str {
        match self {
            Estimator::Classic => "classic",
            Estimator::Obscurance { .. } => "obscurance",
            Estimator::Extended { receiver_plane: ReceiverPlane::Clipped, .. } => "extended-clipped",
            Estimator::Extended { receiver_plane: ReceiverPlane::Counts, .. } => "extended-counts",
        }
    }
}

/// Everything about openness but the box and the place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// R: length of a primary ray, metres, above zero.
    pub radius: f64,
    /// In which world directions live.
    pub space: Space,
    /// How directions are weighted.
    pub measure: Measure,
    /// How openness is computed.
    pub estimator: Estimator,
}

impl Model {
    /// Openness in [0, 1] of the ground at `t` from the box's middle, t of either
    /// sign. Off by less than `tolerance`; the step, and the extended method in
    /// flatland, are closed forms and ignore it.
    ///
    /// # Example
    /// ```
    /// use aogauge::flatland::{Estimator, Measure, Model, ReceiverPlane, Slab, Space};
    /// let curtain = Slab { width: 0.02, gap: 0.10, height: 1.0 };
    /// let clipped = ReceiverPlane::Clipped;
    /// let estimator = Estimator::Extended { secondary_radius: 0.0625, receiver_plane: clipped };
    /// let model = Model { radius: 0.25, space: Space::Extruded, measure: Measure::Cosine, estimator };
    /// let (under, beside) = (model.openness(&curtain, 0.0, 1e-6), model.openness(&curtain, 0.08, 1e-6));
    /// assert!(under < beside, "extended AO: no highlight under the curtain");
    /// ```
    pub fn openness(&self, slab: &Slab, t: f64, tolerance: f64) -> f64 {
        match self.estimator {
            Estimator::Classic => slab.openness(t, self.radius).of(self.space, self.measure),
            Estimator::Obscurance { sigma, limited } => exponential::openness(self, slab, t, sigma, limited, tolerance),
            Estimator::Extended { secondary_radius, receiver_plane } => {
                extended::openness(self, slab, t, secondary_radius, receiver_plane, tolerance)
            }
        }
    }
}
