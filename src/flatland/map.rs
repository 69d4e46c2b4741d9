//! Where the artifact lives: highlight contrast over width and gap.

use super::{Estimator, Model, Slab, contrast};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicUsize, Ordering};

/// How far openness may be off.
const TOLERANCE: f64 = 1e-3;

/// Boxes along each side of the map.
const CELLS: u32 = 40;

/// The least contrast of the first curve that is worth taking away.
const LEAST: f64 = 0.01;

/// Highlight contrast K over w/R in (0.01, 1), in equal ratios, and m/R in (0, 1),
/// in equal steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Map {
    /// w/R, the middles of the columns.
    pub width: Vec<f64>,
    /// m/R, the middles of the rows.
    pub gap: Vec<f64>,
    /// A map an estimator; the first is what the others are held against.
    pub curves: Vec<MapCurve>,
}

/// One estimator's map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapCurve {
    /// The estimator's name.
    pub label: String,
    /// K, row by row (a row a gap), off by less than 1e-3; null where the flank is
    /// closed.
    pub contrast: Vec<Vec<Option<f64>>>,
    /// 1 - max(0, K) / K of the first estimator: the share taken away of a
    /// highlight that ought not to be there. Null where the first has K below 0.01.
    pub removed: Vec<Vec<Option<f64>>>,
}

impl Map {
    /// The left end of the map, w/R: thin occluders are where the artifact lives.
    pub const NARROWEST: f64 = 0.01;

    /// The map of boxes of one height, for each estimator in place of the model's
    /// own; `tell` hears how many of how many boxes are done. Results do not depend
    /// on the number of threads.
    pub fn new(model: &Model, estimators: &[Estimator], height: f64, tell: &(dyn Fn(usize, usize) + Sync)) -> Self {
        let middles: Vec<f64> = (0..CELLS).map(|i| (f64::from(i) + 0.5) / f64::from(CELLS)).collect();
        let widths: Vec<f64> = middles.iter().map(|x| Self::NARROWEST.powf(1.0 - x)).collect();
        let (done, total) = (AtomicUsize::new(0), estimators.len() * middles.len().pow(2));
        let grid = |estimator: Estimator| -> Vec<Vec<Option<f64>>> {
            let model = Model { estimator, ..*model };
            let cell = |gap: f64, width: f64| {
                let slab = Slab { width: width * model.radius, gap: gap * model.radius, height };
                let contrast = contrast(&model, &slab, TOLERANCE);
                tell(done.fetch_add(1, Ordering::Relaxed) + 1, total);
                contrast
            };
            middles.par_iter().map(|&gap| widths.par_iter().map(|&width| cell(gap, width)).collect()).collect()
        };
        let mut curves: Vec<MapCurve> = vec![];
        for &estimator in estimators {
            let contrast = grid(estimator);
            let first = curves.first().map_or(&contrast, |c| &c.contrast);
            let removed = first.iter().zip(&contrast).map(|(a, b)| removed(a, b)).collect();
            curves.push(MapCurve { label: estimator.label().to_owned(), contrast, removed });
        }
        Map { width: widths, gap: middles, curves }
    }
}

fn removed(first: &[Option<f64>], own: &[Option<f64>]) -> Vec<Option<f64>> {
    let share = |(a, b): (&Option<f64>, &Option<f64>)| Some((*a).filter(|a| *a >= LEAST)?).zip(*b);
    first.iter().zip(own).map(|pair| share(pair).map(|(a, b)| 1.0 - b.max(0.0) / a)).collect()
}
