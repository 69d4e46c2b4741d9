//! The images of one case, from its files.

use super::{ScoreError, encoding::Encodings, self_check};
use crate::{
    disk::DiskError,
    intake::{self, Declared, Finding, Handed, HandedImage, IntakeError, Keys, Means, Reference, Shown},
    record::{Intervals, Shows, Source, told_once},
    run::{CaseImages, References},
    suite::Case,
};
use std::path::{Path, PathBuf};

/// Reads images as they are declared.
pub(super) struct Reader<'a> {
    pub folder: &'a Path,
    pub references: &'a References,
    pub declared: Declared,
    /// What was found of integers whose encoding is not declared.
    pub encodings: Encodings,
    /// Whether codes that are not linear are meant to be so.
    pub is_declared: bool,
}

/// The size that an image should have and what it should show, where a kit tells.
pub(super) type Expected = Option<([u32; 2], Reference)>;

/// What a file, or a pair of them, holds.
pub(super) struct Read {
    /// Openness, or the light of a lone frame; an image a replicate. Of a pair, NaN where it is not known.
    pub images: Vec<Vec<f32>>,
    encoding: String,
    /// What there is to say of it, with the file.
    pub warnings: Vec<(PathBuf, String)>,
}

/// What is wrong with images as a whole, and what is doubtful.
#[derive(Default)]
pub(super) struct Diagnosis {
    pub wrong: Vec<String>,
    pub doubtful: Vec<String>,
    /// Both, of openness.
    pub findings: Vec<Finding>,
}

/// What files show, by the word in their names.
pub(super) fn shows(shown: Option<Shown>) -> Shows {
    match shown {
        Some(Shown::With | Shown::Without) => Shows::Ratio,
        Some(Shown::Frame) => Shows::Frame,
        _ => Shows::Openness,
    }
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
        let shows = shows(handed.images.first().map(|i| i.shown));
        let files = handed.images.iter().flat_map(|i| [Some(&i.path), i.without.as_ref()].into_iter().flatten());
        let files = files.map(|path| self.relative(path)).collect();
        let (images, encoding, warnings) = match self.all(handed) {
            Ok(read) => (Ok(read.images), read.encoding, self.told(&read.warnings, handed.images.len())),
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

    /// Warnings of so many images, the same of several once; of all of them without their names.
    pub fn told(&self, warnings: &[(PathBuf, String)], images: usize) -> Vec<String> {
        let named: Vec<(String, String)> = warnings.iter().map(|(p, w)| (self.relative(p), w.clone())).collect();
        told_once(&named, "files", images)
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

    fn all(&self, handed: &Handed) -> Result<Read, ScoreError> {
        let Some(scene) = self.references.scene(&handed.scene) else {
            return Err(ScoreError::Nothing(format!("the kit has no scene '{}'", handed.scene)));
        };
        let view = scene.facts.resolution;
        let reference = self.reference(&handed.scene, &handed.estimator)?;
        let mut all = Read { images: Vec::new(), encoding: String::new(), warnings: Vec::new() };
        for image in &handed.images {
            let read = self.image(image, &handed.estimator, view, &reference)?;
            all.images.extend(read.images);
            all.encoding = read.encoding;
            all.warnings.extend(read.warnings);
        }
        Ok(all)
    }

    /// One file, or a pair. Every surface that the reference sees must have a number in whole frames; of
    /// openness the diagnosis tells.
    pub fn image(
        &self,
        image: &HandedImage,
        estimator: &str,
        view: [u32; 2],
        reference: &Reference,
    ) -> Result<Read, ScoreError> {
        let mut warnings = Vec::new();
        let mut warn = |path: &Path, text: String| warnings.push((path.to_owned(), text));
        let frame = |path: &Path| {
            let frame = intake::frame(path, &self.declared, view)?;
            intake::check_numbers(path, &frame.light, &reference.openness, view[0] as usize)?;
            Ok::<_, ScoreError>(frame)
        };
        let (images, encoding) = match (shows(Some(image.shown)), &image.without) {
            (Shows::Openness, _) => {
                let encoding = self.declared.encoding.or_else(|| self.encodings.of(&image.path, estimator));
                let taken = intake::read(&image.path, &Declared { encoding, ..self.declared.clone() }, view)?;
                taken.warnings.into_iter().for_each(|w| warn(&image.path, w));
                (taken.replicates, taken.encoding)
            }
            (Shows::Ratio, Some(beside)) => {
                let (with, without) = (frame(&image.path)?, frame(beside)?);
                let ratio = intake::ratio(&with, &without)?;
                ratio.check_order(&image.path, beside)?;
                check_different([&with.light, &without.light], reference)?;
                with.warnings.iter().for_each(|w| warn(&image.path, w.clone()));
                without.warnings.iter().for_each(|w| warn(beside, w.clone()));
                ratio.remarks().into_iter().for_each(|w| warn(&image.path, w));
                (vec![ratio.openness], with.encoding)
            }
            _ => {
                let frame = frame(&image.path)?;
                frame.warnings.into_iter().for_each(|w| warn(&image.path, w));
                warn(&image.path, intake::LONE_FRAME.to_owned());
                (vec![frame.light], frame.encoding)
            }
        };
        Ok(Read { images, encoding: encoding.label().to_owned(), warnings })
    }

    /// The size of the view and what images of a case look like; None where the kit has no such scene.
    pub fn expected(&self, handed: &Handed) -> Result<Expected, DiskError> {
        if handed.scene == self_check::SCENE {
            return self_check::read(self.references).map(|(reference, view)| Some((view, reference)));
        }
        let Some(scene) = self.references.scene(&handed.scene) else { return Ok(None) };
        Ok(Some((scene.facts.resolution, self.reference(&handed.scene, &handed.estimator)?)))
    }

    /// What images of an estimator look like, where the view sees a surface: its converged image, else that of
    /// classic AO.
    pub fn reference(&self, scene: &str, estimator: &str) -> Result<Reference, DiskError> {
        let suite = self.references.suite();
        let known = self.references.converged(scene, estimator)?;
        let converged = match known {
            Some(own) => Some(own),
            None => self.references.converged(scene, &suite.methods[suite.classic()].name)?,
        };
        let (Some(converged), Some(scene)) = (converged, self.references.scene(scene)) else {
            return Ok(Reference::default());
        };
        Ok(Reference::over(&converged.mean, &self.references.regions(scene)?))
    }

    /// Ends a case whose images are wrong as a whole, and notes what is doubtful.
    pub fn diagnose(&self, case: &mut CaseImages) -> Result<(), ScoreError> {
        let Ok(images) = &case.images else { return Ok(()) };
        let Some(scene) = self.references.scene(&case.case.scene) else { return Ok(()) };
        let reference = self.reference(&case.case.scene, &case.case.estimator)?;
        let size = scene.facts.resolution.map(|side| side as usize);
        let shows = case.shows();
        let light = if shows == Shows::Frame { self.references.light(scene)? } else { None };
        let mut found = Diagnosis::default();
        for (number, image) in images.iter().enumerate() {
            let mut own = match shows {
                Shows::Frame => of_frame(image, &reference, light.as_deref(), size),
                _ => self.of_openness(image, &reference, size, shows),
            };
            // What is doubtful is so in all of them.
            match number {
                0 => own.doubtful.extend(self.apart(image, case, &reference, &own, size)),
                _ => own.doubtful.clear(),
            }
            if shows != Shows::Frame
                && let Some(other) = self.rather(image, case, &reference)?
            {
                // What else is said of it compares it with the wrong scene.
                own.wrong.retain(|w| w.starts_with("constant"));
                own.wrong.insert(0, other);
                own.doubtful.clear();
            }
            found.wrong.extend(own.wrong.into_iter().map(|w| format!("image {number}: {w}")));
            found.doubtful.extend(own.doubtful);
            if !found.wrong.is_empty() {
                break;
            }
        }
        if let Some(source) = &mut case.source {
            source.warnings.extend(found.doubtful);
        }
        if !found.wrong.is_empty() {
            case.images = Err(format!("its images are wrong: {}", found.wrong.join("; and: ")));
        }
        Ok(())
    }

    /// What is wrong with openness. Where a ratio is not known, nothing is missing. Codes are doubtful alone
    /// where it is declared what numbers stand for.
    pub fn of_openness(&self, image: &[f32], reference: &Reference, size: [usize; 2], shows: Shows) -> Diagnosis {
        let mut found = Diagnosis::default();
        // Frames are no occlusion, whatever is declared of AO.
        let means = if shows == Shows::Ratio { Means::Openness } else { self.declared.means };
        let declared = Declared { means, ..self.declared.clone() };
        found.findings = intake::examine(image, reference, size, &declared);
        for finding in &found.findings {
            if shows == Shows::Ratio && matches!(finding, Finding::Holes { .. }) {
                continue;
            }
            if let (Shows::Ratio, Some((why, is_exposure))) = (shows, finding.of_frames()) {
                let to = if is_exposure { &mut found.wrong } else { &mut found.doubtful };
                to.push(why);
                continue;
            }
            // Where a frame is nearly dark, noise alone brings a ratio beyond its range.
            let is_noise = shows == Shows::Ratio && matches!(finding, Finding::Range { scale: None, .. });
            let is_declared = matches!(finding, Finding::Encoded { .. }) && self.is_declared;
            let is_doubt = finding.is_doubt() || is_declared || is_noise;
            let to = if is_doubt { &mut found.doubtful } else { &mut found.wrong };
            to.push(finding.told(&declared, Keys::Score));
        }
        found
    }

    /// How far an image of classic AO is from its converged image, by more than noise, where nothing explains it.
    /// Another falloff or radius may be meant.
    fn apart(
        &self,
        image: &[f32],
        case: &CaseImages,
        reference: &Reference,
        own: &Diagnosis,
        size: [usize; 2],
    ) -> Option<String> {
        let is_classic = self.references.suite().is_classic(&case.case.estimator);
        if !is_classic || self.is_declared || !case.is_openness() || !own.findings.is_empty() {
            return None;
        }
        intake::agreement(image, reference, size, &[]).map(|apart| apart.to_string())
    }

    /// Which other scene of the kit an image looks like, where it does not look like its own.
    fn rather(&self, image: &[f32], case: &CaseImages, reference: &Reference) -> Result<Option<String>, ScoreError> {
        let own = &case.case.scene;
        let size = self.references.scene(own).map(|s| s.facts.resolution);
        for other in self.references.file().scenes.iter().map(|s| &s.facts) {
            if other.name == *own || Some(other.resolution) != size {
                continue;
            }
            let like = self.reference(&other.name, &case.case.estimator)?;
            if intake::is_rather(image, &reference.openness, &like.openness, other.resolution[0] as usize) {
                return Ok(Some(format!(
                    "it looks like the scene '{}' of the kit and not like '{own}': are the two exchanged?",
                    other.name
                )));
            }
        }
        Ok(None)
    }
}

/// Refuses a frame with AO that is the one without, to the last bit, where there is AO to be seen.
fn check_different([with, without]: [&[f32]; 2], reference: &Reference) -> Result<(), IntakeError> {
    let is_closed = |v: &&f32| **v < 0.95;
    let alike = with.iter().zip(without).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
    if alike && reference.openness.iter().any(|v| is_closed(&v)) {
        let why =
            "the two are identical, to the last bit: save one of them with AO turned on, and one with it turned off";
        return Err(IntakeError::Ratio(why.to_owned()));
    }
    Ok(())
}

/// What is wrong with a whole frame: that it holds nothing, and, where that is plain, that it lies otherwise.
/// `light` is what the judge sees of the receiver.
pub(super) fn of_frame(frame: &[f32], reference: &Reference, light: Option<&[f32]>, size: [usize; 2]) -> Diagnosis {
    let mut found = Diagnosis::default();
    let seen = || frame.iter().zip(&reference.openness).filter(|(_, r)| r.is_finite()).map(|(v, _)| *v);
    let (least, most) = seen().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, m), v| (l.min(v), m.max(v)));
    if most <= 0.0 {
        found.wrong.push("black: no pixel that sees a surface has light; save the frame after it was drawn".to_owned());
        return found;
    }
    if least < 0.0 {
        let count = seen().filter(|v| *v < 0.0).count();
        found.doubtful.push(format!("negative light: {count} pixels are below 0, the least is {least:.3}"));
    }
    let like: Vec<&[f32]> = std::iter::once(reference.openness.as_slice()).chain(light).collect();
    if let Some(turn) = intake::frame_turn(frame, &like, size) {
        found.doubtful.push(format!("it looks {}; {}", turn.title(), turn.remedy()));
    }
    found
}
