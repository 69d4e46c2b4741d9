//! Signed error maps of a scene: each method against Q, and at its fewest rays
//! against its own converged image. Each kind has one scale in all scenes, so that its
//! bar is drawn once.

use super::{ReportError, gallery::Gallery, middle};
use crate::{
    layers::write_png,
    picture::{
        color_bar::color_bar,
        error_map::{ErrorMap, MapError},
        scale::Scale,
    },
    record::{
        CaseRecord, Record, SceneRecord,
        pictures::{MINUS_CONVERGED, MINUS_Q, bar},
    },
};
use std::path::Path;

/// How far the scale of O - Q reaches to both sides of 0.
pub const LIMIT_Q: f64 = 0.5;
/// How far that of the mean less the converged image does.
pub const LIMIT_CONVERGED: f64 = 0.1;

/// Width of the bars, pixels: about that of a picture of the measure view.
const BAR_WIDTH: u32 = 416;

/// Squares of as many pixels as the measure view's own pictures have.
const FACTOR: u32 = 4;

/// Draws the two bars, where any scene has a judge.
pub fn bars(record: &Record, gallery: &mut Gallery) -> Result<(), ReportError> {
    if record.scenes.iter().all(|s| s.judge.is_none()) {
        return Ok(());
    }
    for (name, limit) in [(MINUS_Q, LIMIT_Q), (MINUS_CONVERGED, LIMIT_CONVERGED)] {
        let scale = Scale::signed(limit).map_err(|source| ReportError::Map { image: name.to_owned(), source })?;
        write_png(&gallery.place(&bar(name)), &color_bar(&scale, "openness", BAR_WIDTH))?;
    }
    Ok(())
}

/// The case that shows the noise of a method best: on the CPU, where it ran there, of
/// the fewest rays. None where all ended with an error.
pub fn fewest<'a>(record: &'a Record, scene: &SceneRecord, method: &str) -> Option<&'a CaseRecord> {
    let own = record.cases.iter().filter(|c| c.case.scene == scene.name && c.case.estimator == method);
    own.filter(|c| c.image.is_some()).min_by_key(|c| (c.case.renderer != "cpu", c.case.rays))
}

/// What is held against what: a method's image, and one to take from it.
pub struct Pair<'a> {
    /// The method's image.
    pub test: &'a [f32],
    /// What is taken from it.
    pub reference: &'a [f32],
    /// Where the reference comes from, for errors.
    pub image: &'a str,
}

/// Writes the map of the middle of the measure view.
pub fn write(scene: &SceneRecord, pair: &Pair<'_>, limit: f64, path: &Path) -> Result<(), ReportError> {
    let fail = |source: MapError| ReportError::Map { image: pair.image.to_owned(), source };
    let (test, size) = middle(scene, pair.test);
    let (reference, _) = middle(scene, pair.reference);
    let map = ErrorMap::signed(size, &test, &reference, limit).map_err(fail)?;
    Ok(write_png(path, &map.plain(FACTOR))?)
}

/// The mean image of a case.
pub fn mean(folder: &Path, case: &CaseRecord) -> Result<Vec<f32>, ReportError> {
    let image = case.image.as_deref().unwrap_or_default();
    super::layer(&case.layers(folder)?, image, "mean")
}
