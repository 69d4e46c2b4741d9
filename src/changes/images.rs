//! Images that are not the same to the last bit: what moved, by the tests that goldens
//! are held against.

use super::{
    coverage::{by_id, is_identical},
    grounds::Grounds,
};
use crate::{
    counted::counted,
    disk::DiskError,
    golden::{ALPHA, Comparison, Limits, Moved, Terms, compare, regions, sampled},
    layers::Layers,
    metrics::regions::Region,
    record::{CaseRecord, Record},
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;
use std::{collections::BTreeMap, path::Path};

/// What came of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ImageState {
    /// It moved.
    Moved,
    /// One of the two images could not be read.
    Unreadable,
    /// Nothing was found, and a difference that matters could not have been seen.
    Blind,
    /// It differs no more than noise or rounding explain.
    Alike,
}

/// An image that is not the same to the last bit.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ImageChange {
    /// The case.
    pub case: String,
    /// What came of it.
    pub state: ImageState,
    /// Mean of the new image less mean of the base's.
    pub bias: Option<f64>,
    /// Root mean square of the difference of the means. Of runs of two seeds it holds
    /// the noise of both.
    pub rmse: Option<f64>,
    /// The least p-value of what moved, where it is by a test of samples.
    pub p: Option<f64>,
    /// What moved, or why it could not be read.
    pub what: String,
}

/// Compares the images of the cases in both records that are not the same to the last
/// bit, the surest change first. Those of other scenes and methods are left out. An image
/// that cannot be read, or is not the one that was measured, costs its case alone: records are
/// often kept without their images. Of images that are the same by their records, only those
/// are told of that are there and are not what their record says.
pub fn images(base: (&Path, &Record), new: (&Path, &Record)) -> Vec<ImageChange> {
    let grounds = Grounds::of(base.1, new.1);
    let old = by_id(base.1);
    let (same, changed): (Vec<_>, Vec<_>) = new
        .1
        .cases
        .iter()
        .filter(|c| c.error.is_none() && grounds.has_case(&c.case))
        .filter_map(|c| Some((*old.get(&c.case.id())?, c)))
        .filter(|(was, _)| was.error.is_none())
        .partition(|(was, is)| is_identical(was, is));
    let regions = regions_of(new);
    let none = BTreeMap::new();
    let one = |(was, is): &(&CaseRecord, &CaseRecord)| {
        let regions = regions.get(&is.case.scene).unwrap_or(&none);
        let terms = Terms { alpha: ALPHA, family: changed.len(), limits: Limits::default(), regions };
        let found = compared((base.0, base.1, was), (new.0, new.1, is), &terms);
        change(is.case.id(), found)
    };
    let spoilt = |(was, is): &(&CaseRecord, &CaseRecord)| {
        let error = [(base.0, *was), (new.0, *is)].into_iter().find_map(|(folder, case)| {
            let is_there = folder.join(case.image.as_deref()?).exists();
            is_there.then(|| case.layers(folder).err()).flatten()
        });
        Some(change(is.case.id(), Err(error?)))
    };
    let mut found: Vec<ImageChange> = changed.par_iter().map(one).collect();
    found.par_extend(same.par_iter().filter_map(spoilt));
    let sure = |i: &ImageChange| i.p.unwrap_or(0.0);
    let size = |i: &ImageChange| i.rmse.unwrap_or(0.0);
    found.sort_by(|a, b| a.state.cmp(&b.state).then(sure(a).total_cmp(&sure(b))).then(size(b).total_cmp(&size(a))));
    found
}

/// The regions of each scene of a record, where its image can be read: they only tell
/// where something moved.
fn regions_of((folder, record): (&Path, &Record)) -> BTreeMap<String, BTreeMap<Region, Vec<usize>>> {
    let of = |image: &str| Layers::read(&folder.join(image)).ok().map(|layers| regions(&layers));
    record.scenes.iter().filter_map(|s| Some((s.name.clone(), of(&s.image)?))).collect()
}

type Place<'a> = (&'a Path, &'a Record, &'a CaseRecord);

fn compared(base: Place<'_>, new: Place<'_>, terms: &Terms<'_>) -> Result<Comparison, DiskError> {
    let (was, is) = (sampled(base.0, base.1, base.2)?, sampled(new.0, new.1, new.2)?);
    if was.resolution != is.resolution {
        let [w, h] = was.resolution;
        let path = new.0.join(new.2.image.as_deref().unwrap_or_default());
        let [own, wide] = is.resolution;
        return Err(DiskError::content(&path, format!("{own} x {wide} pixels; the base has {w} x {h}")));
    }
    Ok(compare(&was, &is, terms))
}

fn change(case: String, found: Result<Comparison, DiskError>) -> ImageChange {
    let found = match found {
        Ok(found) => found,
        Err(e) => {
            let what = e.to_string();
            return ImageChange { case, state: ImageState::Unreadable, bias: None, rmse: None, p: None, what };
        }
    };
    let what: Vec<String> = found.moved.iter().map(words).collect();
    let (state, what) = match what.is_empty() {
        false => (ImageState::Moved, what.join("; ")),
        true if found.is_blind() => {
            (ImageState::Blind, format!("could only see a bias of {:.3} in a tile", found.detectable))
        }
        true if found.same_seeds => (ImageState::Alike, "no more than rounding explains".to_owned()),
        true => (ImageState::Alike, "no more than noise explains".to_owned()),
    };
    let finite = |v: f64| Some(v).filter(|v| v.is_finite());
    let p = found.moved.iter().filter_map(p_of).min_by(f64::total_cmp);
    ImageChange { case, state, bias: finite(found.bias), rmse: finite(found.distance), p, what }
}

/// The surest p-value of what moved.
fn p_of(moved: &Moved) -> Option<f64> {
    let p = match moved {
        Moved::Shift { places, .. } => places.first()?.p,
        Moved::Pattern { places, p, .. } => places.first().map_or(f64::NAN, |d| d.p).min(p.unwrap_or(f64::NAN)),
        Moved::Noise(noise) => noise.p,
        _ => return None,
    };
    Some(p).filter(|p| p.is_finite())
}

fn words(moved: &Moved) -> String {
    match moved {
        Moved::NotANumber { pixels, first: [x, y] } => {
            format!("{} became no number, the first at {x}, {y}", counted(*pixels, "pixel", "pixels"))
        }
        Moved::Structure { pixels, first: [x, y] } => {
            let hold = counted(*pixels, "pixel holds", "pixels hold");
            format!("{hold} a number that held none, the first at {x}, {y}")
        }
        Moved::Rays { share, pixels, place: [x, y, w, h], .. } => {
            let share = 100.0 * share;
            let pixels = counted(*pixels, "pixel", "pixels");
            format!("{share:.3} % of rays or more decided differently; {pixels} in {x}, {y} ({w} x {h})")
        }
        Moved::Shift { places, regions, .. } => {
            let kind = if places.first().is_some_and(|d| d.bias > 0.0) { "brighter" } else { "darker" };
            let at = places.first().map_or_else(String::new, |d| {
                let [x, y, w, h] = d.place;
                format!(", surest at {x}, {y} ({w} x {h}): {:+.4}", d.bias)
            });
            let most = regions
                .first()
                .map_or_else(String::new, |r| format!(", most in region {}: {:+.4}", r.region.label(), r.bias));
            format!("{kind}{at}{most}")
        }
        Moved::Pattern { rejected, .. } => {
            format!("fine structure moved, no tile did: {}", counted(*rejected, "pixel rejects", "pixels reject"))
        }
        Moved::Noise(noise) => {
            let kind = if noise.ratio > 1.0 { "noisier" } else { "less noisy" };
            format!("{kind}: {:.3} times the variance", noise.ratio)
        }
        Moved::Beyond(measured) => measured.to_string(),
    }
}
