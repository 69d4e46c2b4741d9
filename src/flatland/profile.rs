//! Profiles of openness across a box: the paper's Fig. 3.

use super::{Apex, Estimator, Model, Slab, study::mirrored};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How far the values of a profile may be off.
const TOLERANCE: f64 = 1e-5;

/// Openness across one box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// w, metres.
    pub width: f64,
    /// m, metres.
    pub gap: f64,
    /// A curve an estimator.
    pub curves: Vec<ProfileCurve>,
}

/// Openness across one box by one estimator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProfileCurve {
    /// The estimator's name.
    pub label: String,
    /// Apex, trough and contrast.
    pub apex: Apex,
    /// Openness, a value a place; off by less than 1e-5.
    pub openness: Vec<f64>,
}

impl Profile {
    /// Openness at the places `t` >= 0, ascending, metres from the box's middle, and
    /// at their mirror images, for each estimator in place of the model's own.
    pub fn new(model: &Model, estimators: &[Estimator], slab: &Slab, t: &[f64]) -> Self {
        let curves = estimators
            .par_iter()
            .map(|&estimator| {
                let model = Model { estimator, ..*model };
                let right: Vec<f64> = t.par_iter().map(|&t| model.openness(slab, t, TOLERANCE)).collect();
                ProfileCurve {
                    label: estimator.label().to_owned(),
                    apex: Apex::new(&model, slab, TOLERANCE),
                    openness: mirrored(&right, 1.0),
                }
            })
            .collect();
        Profile { width: slab.width, gap: slab.gap, curves }
    }
}
