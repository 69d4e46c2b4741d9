//! Where a profile has its apex, and how high it is.

use super::{Model, Slab, quadrature::panel};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The footprint's margin beyond the box, and the flank's ends from the box's
/// side, in R: as in images.
const MARGIN: f64 = 0.02;
const FLANK: [f64; 2] = [0.15, 0.45];

/// A profile's apex. Profiles are symmetric; places are those of the side t >= 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Apex {
    /// Highlight contrast K = mean(footprint) / mean(flank) - 1; null where the
    /// flank is closed.
    pub contrast: Option<f64>,
    /// Openness under the box's middle.
    pub centre: f64,
    /// Where the trough is, t/R: the least openness from the box's side to R
    /// beyond it, where the box is out of reach.
    pub trough_at: f64,
    /// Openness there.
    pub trough: f64,
    /// Where the apex is, t/R: the greatest openness from the middle to the trough.
    pub apex_at: f64,
    /// Openness there.
    pub apex: f64,
    /// Centre above trough; below zero where the box darkens what it stands over.
    pub height: f64,
}

/// Highlight contrast K of a box: footprint |t| <= w/2 + 0.02 R, flank 0.15 R to
/// 0.45 R from the box's side. None where the flank is closed. Openness is off by
/// less than `tolerance`; the means over t, by 15 points a piece, add up to 3e-4.
pub fn contrast(model: &Model, slab: &Slab, tolerance: f64) -> Option<f64> {
    let (edge, r) = (slab.width / 2.0, model.radius);
    let sum = |from: f64, to: f64, whole: f64| panel(|t| model.openness(slab, t, tolerance), from, to) / whole;
    let foot = edge + MARGIN * r;
    let footprint = sum(0.0, edge, foot) + sum(edge, foot, foot);
    let flank = sum(edge + FLANK[0] * r, edge + FLANK[1] * r, (FLANK[1] - FLANK[0]) * r);
    (flank > 1e-6).then(|| footprint / flank - 1.0)
}

/// The greatest value of `f` on [from, to] and where: on a grid, then by golden
/// section about the best of it.
fn greatest(f: impl Fn(f64) -> f64, from: f64, to: f64) -> [f64; 2] {
    const STEPS: u32 = 48;
    let at = |i: u32| from + (to - from) * f64::from(i) / f64::from(STEPS);
    let better = |a: [f64; 2], b: [f64; 2]| if b[1] > a[1] { b } else { a };
    let value = |t: f64| [t, f(t)];
    let (mut best, mut i_best) = (value(from), 0);
    for i in 1..=STEPS {
        let here = value(at(i));
        if here[1] > best[1] {
            (best, i_best) = (here, i);
        }
    }
    let (mut lo, mut hi) = (at(i_best.saturating_sub(1)), at((i_best + 1).min(STEPS)));
    for _ in 0..24 {
        let cut = 0.381_966_011_250_105 * (hi - lo);
        let [a, b] = [value(lo + cut), value(hi - cut)];
        best = better(better(best, a), b);
        if a[1] >= b[1] { hi = b[0] } else { lo = a[0] }
    }
    best
}

impl Apex {
    /// Finds a box's apex; openness is off by less than `tolerance`, places by
    /// less than R/1000 where the profile is not flat.
    pub fn new(model: &Model, slab: &Slab, tolerance: f64) -> Self {
        let openness = |t: f64| model.openness(slab, t, tolerance);
        let (edge, r) = (slab.width / 2.0, model.radius);
        let [trough_at, trough] = greatest(|t| -openness(t), edge, edge + r);
        let trough = -trough;
        let [apex_at, apex] = greatest(openness, 0.0, trough_at);
        let centre = openness(0.0);
        Apex {
            contrast: contrast(model, slab, tolerance),
            centre,
            trough_at: trough_at / r,
            trough,
            apex_at: apex_at / r,
            apex,
            height: centre - trough,
        }
    }
}
