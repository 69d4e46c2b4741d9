//! Profiles along the transect: the paper's Fig. 3, measured.

use super::judge::Judge;
use crate::stats::{Estimate, jackknife};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A curve with its pointwise 95 % interval, a value a column of the measure view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// Estimator, or `Q`.
    pub label: String,
    /// Whether it is light over that of the brighter flank, of whole frames that were handed in, and not
    /// openness.
    #[serde(skip_serializing_if = "std::ops::Not::not", default)]
    pub light: bool,
    /// Value a column; null where the column sees no surface.
    pub value: Vec<Option<f64>>,
    /// Lower end of the interval.
    pub lo: Vec<Option<f64>>,
    /// Upper end of the interval.
    pub hi: Vec<Option<f64>>,
}

/// Mean of a column over its rows that hold a number.
fn column_mean(image: &[f32], width: usize, column: usize) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for value in image.iter().skip(column).step_by(width).filter(|v| v.is_finite()) {
        sum += f64::from(*value);
        n += 1.0;
    }
    sum / n
}

fn curve(label: &str, columns: impl Iterator<Item = Estimate>) -> Curve {
    let mut curve = Curve { label: label.to_owned(), light: false, value: vec![], lo: vec![], hi: vec![] };
    for e in columns {
        let [lo, hi] = e.interval(0.95);
        let known = e.value.is_finite();
        for (list, v) in [(&mut curve.value, e.value), (&mut curve.lo, lo), (&mut curve.hi, hi)] {
            list.push((known && v.is_finite()).then_some(v));
        }
    }
    curve
}

/// The profile of a method: the mean of each column over rows and replicates.
pub fn of_method(label: &str, replicates: &[Vec<f32>], width: usize) -> Curve {
    curve(label, columns(replicates, width, 1.0))
}

/// The profile of whole frames: their light over `flank`, its mean over the brighter flank, above 0.
pub fn of_frames(label: &str, replicates: &[Vec<f32>], width: usize, flank: f64) -> Curve {
    Curve { light: true, ..curve(label, columns(replicates, width, flank)) }
}

/// The means of columns over rows and replicates, in a unit.
fn columns(replicates: &[Vec<f32>], width: usize, unit: f64) -> impl Iterator<Item = Estimate> {
    (0..width).map(move |c| {
        let means: Vec<f64> = replicates.iter().map(|image| column_mean(image, width, c) / unit).collect();
        Estimate::of_mean(&means)
    })
}

/// The profile of Q: each column's ratio of mean irradiances.
pub fn of_judge(pairs: &[super::judge::Pair], width: usize) -> Curve {
    curve(
        Judge::LABEL,
        (0..width).map(|c| {
            let rows = pairs.iter().map(|p| vec![column_mean(&p.with, width, c), column_mean(&p.without, width, c)]);
            jackknife(&[rows.collect()], |m| m[0][0] / m[0][1])
        }),
    )
}

impl Judge {
    /// What the judge's curve is called.
    pub const LABEL: &str = "Q";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_averaged_and_holes_left_out() {
        let images = [vec![1.0, f32::NAN, 0.5, f32::NAN], vec![0.0, f32::NAN, 0.5, f32::NAN]];
        let c = of_method("x", &images, 2);
        assert_eq!(c.value, vec![Some(0.5), None]);
        assert!(c.lo[0] < c.value[0] && c.value[0] < c.hi[0]);
    }
}
