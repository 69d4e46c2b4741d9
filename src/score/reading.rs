//! The images of one case, from its files.

use super::ScoreError;
use crate::{
    disk::DiskError,
    intake::{self, Declared, Finding, Handed, Reference, Shown},
    metrics::regions::Region,
    record::{Intervals, Shows, Source},
    run::{CaseImages, References},
    suite::Case,
};
use std::path::Path;

/// Reads images as they are declared.
pub(super) struct Reader<'a> {
    pub folder: &'a Path,
    pub references: &'a References,
    pub declared: Declared,
}

/// Images of one case, and what there is to say of them.
#[derive(Default)]
struct Read {
    images: Vec<Vec<f32>>,
    encoding: String,
    warnings: Vec<String>,
}

impl Reader<'_> {
    /// The images of a case, or why they cannot be used.
    pub fn case(&self, handed: &Handed, renderer: &str) -> CaseImages {
        let case = Case {
            scene: handed.scene.clone(),
            estimator: handed.estimator.clone(),
            renderer: renderer.to_owned(),
            rays: handed.rays,
        };
        let shows = match handed.images.first().map(|i| i.shown) {
            Some(Shown::With | Shown::Without) => Shows::Ratio,
            Some(Shown::Frame) => Shows::Frame,
            _ => Shows::Openness,
        };
        let files = handed.images.iter().flat_map(|i| [Some(&i.path), i.without.as_ref()].into_iter().flatten());
        let files = files.map(|path| self.relative(path)).collect();
        let read = self.read(handed, shows);
        let (images, encoding, warnings) = match read {
            Ok(read) => (Ok(read.images), read.encoding, read.warnings),
            Err(e) => (Err(e.to_string()), String::new(), Vec::new()),
        };
        let is_one = images.as_ref().is_ok_and(|i| i.len() == 1);
        let intervals = if is_one { Intervals::Tiles } else { Intervals::Replicates };
        let read_as = self.read_as(shows, &encoding);
        CaseImages { case, images, source: Some(Source { files, shows, read_as, intervals, warnings }) }
    }

    fn relative(&self, path: &Path) -> String {
        path.strip_prefix(self.folder).unwrap_or(path).display().to_string().replace('\\', "/")
    }

    fn read_as(&self, shows: Shows, encoding: &str) -> String {
        let d = &self.declared;
        let what = match shows {
            Shows::Openness => d.means.label().to_owned(),
            Shows::Ratio => "a frame with AO over one without".to_owned(),
            Shows::Frame => "a whole frame".to_owned(),
        };
        let rows = d.rows.label();
        let scaled = match d.resolution {
            intake::Share::Full => String::new(),
            share => format!(", {} resolution, upsampled {}", share.label(), d.upsample.label()),
        };
        format!("{what}, {encoding}, rows from the {rows}{scaled}")
    }

    fn read(&self, handed: &Handed, shows: Shows) -> Result<Read, ScoreError> {
        let Some(scene) = self.references.scene(&handed.scene) else {
            return Err(ScoreError::Nothing(format!("the kit has no scene '{}'", handed.scene)));
        };
        let view = scene.facts.resolution;
        let mut read = Read::default();
        let mut warn = |file: &Path, text: String| {
            let text = format!("{}: {text}", self.relative(file));
            if !read.warnings.contains(&text) {
                read.warnings.push(text);
            }
        };
        let reference = match shows {
            Shows::Openness => self.reference(&handed.scene, &handed.estimator)?,
            Shows::Ratio | Shows::Frame => Reference::default(),
        };
        for image in &handed.images {
            match (shows, &image.without) {
                (Shows::Openness, _) => {
                    let taken = intake::read_against(&image.path, &self.declared, view, &reference)?;
                    taken.warnings.into_iter().for_each(|w| warn(&image.path, w));
                    read.encoding = taken.encoding.label().to_owned();
                    read.images.extend(taken.replicates);
                }
                (Shows::Ratio, Some(without)) => {
                    let frame = |path| intake::frame(path, &self.declared, view);
                    let (with, without) = (frame(&image.path)?, frame(without)?);
                    let ratio = intake::ratio(&with, &without)?;
                    read.encoding = with.encoding.label().to_owned();
                    with.warnings.into_iter().chain(without.warnings).for_each(|w| warn(&image.path, w));
                    if ratio.masked > 0 {
                        let n = ratio.masked;
                        warn(
                            &image.path,
                            format!("{n} pixels are too dark, too roughly rounded or cut off at white: left out"),
                        );
                    }
                    if ratio.brighter > 0 {
                        let n = ratio.brighter;
                        warn(&image.path, format!("{n} pixels are brighter with AO than without it"));
                    }
                    read.images.push(ratio.openness);
                }
                _ => {
                    let frame = intake::frame(&image.path, &self.declared, view)?;
                    frame.warnings.into_iter().for_each(|w| warn(&image.path, w));
                    warn(&image.path, intake::LONE_FRAME.to_owned());
                    read.encoding = frame.encoding.label().to_owned();
                    read.images.push(frame.light);
                }
            }
        }
        Ok(read)
    }

    /// What images of an estimator look like: its converged image, else that of classic AO.
    pub fn reference(&self, scene: &str, estimator: &str) -> Result<Reference, DiskError> {
        let suite = self.references.suite();
        let known = self.references.converged(scene, estimator)?;
        let converged = match known {
            Some(own) => Some(own),
            None => self.references.converged(scene, &suite.methods[suite.classic()].name)?,
        };
        Ok(Reference { openness: converged.map(|c| c.mean).unwrap_or_default(), scaled: Vec::new() })
    }

    /// Ends a case whose images are wrong as a whole, and notes what is doubtful.
    pub fn diagnose(&self, case: &mut CaseImages) -> Result<(), ScoreError> {
        let (Ok(images), true) = (&case.images, case.is_openness()) else { return Ok(()) };
        let Some(scene) = self.references.scene(&case.case.scene) else { return Ok(()) };
        let regions = self.references.regions(scene)?;
        let mut reference = self.reference(&case.case.scene, &case.case.estimator)?;
        // What the view does not show is not looked at.
        let mut seen = vec![f32::NAN; reference.openness.len()];
        for &i in regions.pixels(Region::All) {
            seen[i as usize] = reference.openness[i as usize];
        }
        reference.openness = seen;
        let size = scene.facts.resolution.map(|side| side as usize);
        let mut wrong = Vec::new();
        let mut doubtful = Vec::new();
        for (number, image) in images.iter().enumerate() {
            for finding in intake::diagnose(image, &reference, size) {
                let is_declared = matches!(finding, Finding::Encoded { .. }) && self.declared.encoding.is_some();
                let is_doubt = finding.is_doubt() || is_declared;
                // What is doubtful is so in all of them.
                if is_doubt && number == 0 {
                    doubtful.push(finding.to_string());
                } else if !is_doubt {
                    wrong.push(format!("image {number}: {finding}"));
                }
            }
            if !wrong.is_empty() {
                break;
            }
        }
        if let Some(source) = &mut case.source {
            source.warnings.extend(doubtful);
        }
        if !wrong.is_empty() {
            case.images = Err(format!("its images are wrong: {}", wrong.join("; and: ")));
        }
        Ok(())
    }
}
