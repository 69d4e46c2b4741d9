//! Reports: a record becomes Markdown with its pictures, and what CI systems read. Nothing
//! here renders; a report can be made again from a record at any time.

pub mod bench;
mod convergence;
mod definitions;
pub mod digest;
mod error_maps;
pub mod flatland;
mod gallery;
pub mod github;
pub(crate) mod handed_in;
pub mod html;
pub mod junit;
mod markdown;
mod occluders;
pub(crate) mod own;
pub(crate) mod picture;
pub mod plots;
mod pooled;
pub mod table;

use crate::{
    disk::{DiskError, is_same, part_folder, write_whole},
    gate::Verdict,
    layers::Layers,
    metrics::judge::too_noisy,
    picture::error_map::MapError,
    record::{
        CaseRecord, Record, SceneRecord,
        pictures::{self, LOOK, MEASURE, MINUS_CONVERGED, MINUS_Q},
    },
    untrusted,
};
use gallery::Gallery;
use std::{collections::BTreeMap, fs, io::Write, path::Path};

/// The name of the report in its folder.
pub const FILE: &str = "report.md";

/// What a record is made into.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// report.md and its pictures.
    Markdown,
    /// report.html: one file to look around in, with all images.
    Html,
    /// junit.xml, for the test reports of Jenkins, GitLab and GitHub.
    Junit,
    /// The job's summary on GitHub, and at most 10 annotations on standard output.
    Github,
    /// What came of the gates, on standard output, for scripts.
    Json,
}

/// Why a report could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The record or an image of it cannot be read, or the report not written.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// An image lacks a layer that the record promises.
    #[error("{image}: there is no layer '{layer}' in this image")]
    Layer {
        /// The image.
        image: String,
        /// The layer.
        layer: String,
    },
    /// An image has another size than its scene.
    #[error("{image}: this image has {} x {} pixels, the scene's measure view {} x {}", found[0], found[1], wanted[0], wanted[1])]
    Size {
        /// The image.
        image: String,
        /// Its pixels across and down.
        found: [u32; 2],
        /// Those of the measure view.
        wanted: [u32; 2],
    },
    /// A scene has no pixel to be shown.
    #[error(
        "scene '{scene}': no column of its measure view lies within R of the middle, as transect in record.json has it"
    )]
    Transect {
        /// The scene.
        scene: String,
    },
    /// Two images of the record do not fit each other.
    #[error("{image}: no error map can be drawn: {source}")]
    Map {
        /// One of them.
        image: String,
        /// Why.
        source: MapError,
    },
    /// The built-in template failed.
    #[error("the report template failed: {0}")]
    Template(#[from] minijinja::Error),
    /// The test report could not be put into XML.
    #[error("the test report cannot be written as XML: {0}")]
    Xml(#[from] quick_junit::SerializeError),
}

/// Makes `report.md` and its pictures from the record in `record_folder`, into
/// `out`. Returns the record.
///
/// # Errors
/// Where the record or an image cannot be read, or the report not written.
pub fn write(record_folder: &Path, out: &Path) -> Result<Record, ReportError> {
    let record = Record::read(record_folder)?;
    write_markdown(&record, record_folder, out, false)?;
    Ok(record)
}

/// Makes `report.md` and its pictures from a record that was read from `record_folder`,
/// into `out`. `embed` puts the pictures into the page, as data URIs, with no file beside
/// it; GitHub does not show such pictures.
///
/// # Errors
/// Where an image cannot be read, or the report not written.
pub fn write_markdown(record: &Record, record_folder: &Path, out: &Path, embed: bool) -> Result<(), ReportError> {
    // Before anything is drawn, so that no half of a report is left.
    if let Some(scene) = record.scenes.iter().find(|s| !s.transect.iter().any(|&t| is_shown(t))) {
        return Err(ReportError::Transect { scene: scene.name.clone() });
    }
    let aside = if embed {
        Some(tempfile::tempdir().map_err(DiskError::io(&std::env::temp_dir(), "make a folder"))?)
    } else if is_same(record_folder, out) {
        None
    } else {
        // Drawn there, so that what fails leaves no pictures that the next report would take for those of others.
        fs::create_dir_all(out).map_err(DiskError::io(out, "create the folder"))?;
        Some(part_folder(out)?)
    };
    let folder = aside.as_ref().map_or(out, |aside| aside.path());
    let mut gallery = Gallery::new(folder.to_owned(), embed);
    for scene in &record.scenes {
        draw_scene(record_folder, record, scene, &mut gallery)?;
    }
    error_maps::bars(record, &mut gallery)?;
    gallery.plot(&pictures::contrast_error(), plots::contrast_error(record))?;
    gallery.plot(&pictures::cost(), plots::cost(record))?;
    gallery.plot(&pictures::p_values(), plots::p_values(record))?;
    let text = markdown::text(record, &gallery)?;
    if !embed && aside.is_some() {
        gallery.put_into(out)?;
    }
    write_whole(&out.join(FILE), |buffer| buffer.write_all(text.as_bytes()))?;
    Ok(())
}

/// A verdict's number and its limit, on one line: `contrast-error is 0.30 [0.27, 0.34], at
/// least 0.1: the limit holds`.
fn in_a_line(verdict: &Verdict) -> String {
    let value = table::value_text(verdict.value(), verdict.interval);
    let text = format!("{} is {value}, must be {}: {}", verdict.title(), verdict.limit.text(), verdict.reason);
    untrusted::line(&text)
}

/// What ended with an error, and why: cases by their id, judges as `scene (judge)`.
fn errors(record: &Record) -> impl Iterator<Item = (String, &str)> {
    let judges = record.scenes.iter().filter_map(|s| Some((format!("{} (judge)", s.name), s.judge_error.as_deref()?)));
    let cases = record.cases.iter().filter_map(|c| Some((c.case.id(), c.error.as_deref()?)));
    judges.chain(cases)
}

fn layer(layers: &Layers, image: &str, name: &str) -> Result<Vec<f32>, ReportError> {
    let missing = || ReportError::Layer { image: image.to_owned(), layer: name.to_owned() };
    layers.get(name).map(<[f32]>::to_vec).ok_or_else(missing)
}

/// Q, NaN where it is too noisy to show, and its relative standard error.
fn masked_q(layers: &Layers, image: &str) -> Result<[Vec<f32>; 2], ReportError> {
    let mut q = layer(layers, image, "q")?;
    let se = layer(layers, image, "q-relative-se")?;
    for (q, se) in q.iter_mut().zip(&se) {
        if too_noisy(*se) {
            *q = f32::NAN;
        }
    }
    Ok([q, se])
}

/// The pictures and plots of one scene.
fn draw_scene(folder: &Path, record: &Record, scene: &SceneRecord, gallery: &mut Gallery) -> Result<(), ReportError> {
    let read = |image: &str| Layers::read(&folder.join(image));
    let look = read(&scene.look)?;
    // Of an estimator that is not ours there is no picture, and no converged image.
    let is_ours = |name: &&String| record.suite.methods.contains_key(*name);
    for name in record.suite.estimators.iter().filter(is_ours) {
        let values = layer(&look, &scene.look, &format!("openness-{name}"))?;
        let place = gallery.place(&pictures::of_estimator(&scene.name, LOOK, name));
        picture::openness(&values, look.resolution, 1, &place)?;
    }
    let traced = layer(&look, &scene.look, "path-traced")?;
    picture::irradiance(&traced, look.resolution, &gallery.place(&pictures::path_traced(&scene.name)))?;

    let converged = read(&scene.image)?;
    let mut shown = BTreeMap::new();
    for name in &record.suite.estimators {
        let values = match shown_instead(record, scene, name) {
            Some(case) => error_maps::mean(folder, case)?,
            None if record.handed_in.is_some() => continue,
            None => layer(&converged, &scene.image, &format!("converged-{name}"))?,
        };
        let (middle, size) = middle(scene, &values);
        let place = gallery.place(&pictures::of_estimator(&scene.name, MEASURE, name));
        picture::openness(&middle, size, 4, &place)?;
        shown.insert(name.as_str(), values);
    }
    if scene.judge.is_some() {
        against_judge(folder, record, scene, (&converged, &shown), gallery)?;
    }
    let ranges = plots::Ranges::new(scene, &converged);
    let estimators = &record.suite.estimators;
    gallery.plot(&pictures::profile(&scene.name), plots::profile(estimators, scene, &ranges))?;
    gallery.plot(&pictures::convergence(&scene.name), plots::convergence(estimators, scene))?;
    Ok(())
}

/// Q, and each method less Q and less its converged image.
fn against_judge(
    folder: &Path,
    record: &Record,
    scene: &SceneRecord,
    (converged, shown): (&Layers, &BTreeMap<&str, Vec<f32>>),
    gallery: &mut Gallery,
) -> Result<(), ReportError> {
    let Some(judge) = &scene.judge else { return Ok(()) };
    let layers = Layers::read(&folder.join(&judge.image))?;
    let [q, _] = masked_q(&layers, &judge.image)?;
    for (name, test) in shown {
        let pair = error_maps::Pair { test, reference: &q, image: &judge.image };
        let place = gallery.place(&pictures::of_estimator(&scene.name, MINUS_Q, name));
        error_maps::write(scene, &pair, error_maps::LIMIT_Q, &place)?;
        let is_ours = record.suite.methods.contains_key(*name);
        let Some(case) = error_maps::fewest(record, scene, name).filter(|_| is_ours) else { continue };
        let reference = &layer(converged, &scene.image, &format!("converged-{name}"))?;
        let pair = error_maps::Pair { test: &error_maps::mean(folder, case)?, reference, image: &scene.image };
        let place = gallery.place(&pictures::of_estimator(&scene.name, MINUS_CONVERGED, name));
        error_maps::write(scene, &pair, error_maps::LIMIT_CONVERGED, &place)?;
    }
    let (q, size) = middle(scene, &q);
    Ok(picture::openness(&q, size, 4, &gallery.place(&pictures::q(&scene.name)))?)
}

/// The image of the most rays whose mean over replicates is shown in place of the converged
/// image: of a smoothed method, whose converged image is not smoothed, and of images that
/// were handed in. None for others.
fn shown_instead<'a>(record: &'a Record, scene: &SceneRecord, method: &str) -> Option<&'a CaseRecord> {
    let file = record.suite.methods.get(method);
    let is_smoothed = file.is_some_and(|f| f.temporal.is_some() || f.denoise.is_some());
    if !is_smoothed && record.handed_in.is_none() {
        return None;
    }
    let own = record.cases.iter().filter(|c| c.case.scene == scene.name && c.case.estimator == method);
    own.filter(|c| c.image.is_some()).max_by_key(|c| c.case.rays)
}

/// Whether a column of a measure image is shown, by its place along the transect in R.
fn is_shown(place: f64) -> bool {
    place.abs() <= 1.04
}

/// The columns of a measure image within R of its centre, so that pictures are
/// small enough to stand side by side; profiles show the rest.
fn middle(scene: &SceneRecord, values: &[f32]) -> (Vec<f32>, [u32; 2]) {
    let columns: Vec<usize> = (0..scene.transect.len()).filter(|&x| is_shown(scene.transect[x])).collect();
    let rows = values.chunks_exact(scene.transect.len().max(1));
    let height = rows.len() as u32;
    (rows.flat_map(|row| columns.iter().map(|&x| row[x])).collect(), [columns.len() as u32, height])
}
