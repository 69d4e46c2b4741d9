//! The images of one case, from its files.

use super::{ScoreError, encoding::Encodings, self_check, together::Looked};
use crate::{
    counted::counted,
    disk::DiskError,
    intake::{
        self, Declared, Finding, Handed, HandedImage, IntakeError, Keys, Means, Pair, PairCause, Reference, Shown,
    },
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
    /// What is declared of a curve.
    pub curve: Curved,
    /// Whether an image of the self-check was handed in.
    pub is_checked: bool,
}

/// What is declared of a curve, and whether it is undone by now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Curved {
    /// Nothing.
    #[default]
    No,
    /// It is yet to be found: until then, what it does is no fault.
    Unfitted,
    /// It was found on the control scenes and is undone.
    Fitted,
    /// It was declared and is undone.
    Known,
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
    /// Of a pair whose ratio is not as it should be: what explains that, the nearest first.
    pub causes: Option<Vec<PairCause>>,
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
    /// The images of a case, or why they cannot be used; what explains the first pair of frames whose ratio is not as
    /// it should be.
    pub fn case(&self, handed: &Handed, renderer: &str) -> (CaseImages, Option<Vec<PairCause>>) {
        let case = Case {
            scene: handed.scene.clone(),
            estimator: handed.estimator.clone(),
            renderer: renderer.to_owned(),
            rays: handed.rays,
        };
        let shows = shows(handed.images.first().map(|i| i.shown));
        let files = handed.images.iter().flat_map(|i| [Some(&i.path), i.without.as_ref()].into_iter().flatten());
        let files = files.map(|path| self.relative(path)).collect();
        let mut causes = None;
        let (images, encoding, warnings) = match self.all(handed) {
            Ok(read) => {
                causes = read.causes;
                (Ok(read.images), read.encoding, self.told(&read.warnings, handed.images.len()))
            }
            Err(e) => (Err(e.to_string()), String::new(), Vec::new()),
        };
        let is_one = images.as_ref().is_ok_and(|i| i.len() == 1);
        let intervals = if is_one { Intervals::Tiles } else { Intervals::Replicates };
        let read_as = self.read_as(shows, &encoding);
        (CaseImages { case, images, source: Some(Source { files, shows, read_as, intervals, warnings }) }, causes)
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
        let mut all = Read { images: Vec::new(), encoding: String::new(), warnings: Vec::new(), causes: None };
        for image in &handed.images {
            let read = self.image(image, &handed.estimator, view, &reference)?;
            all.images.extend(read.images);
            all.encoding = read.encoding;
            all.warnings.extend(read.warnings);
            all.causes = all.causes.or(read.causes);
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
        let (mut warnings, mut causes) = (Vec::new(), None);
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
                let encoding = with.encoding;
                let pair = Pair { with: &with.light, without: &without.light, ratio: &ratio.openness, encoding };
                causes = intake::pair_causes(&pair, reference, view.map(|side| side as usize));
                (vec![ratio.openness], encoding)
            }
            _ => {
                let frame = frame(&image.path)?;
                frame.warnings.into_iter().for_each(|w| warn(&image.path, w));
                warn(&image.path, intake::LONE_FRAME.to_owned());
                (vec![frame.light], frame.encoding)
            }
        };
        Ok(Read { images, encoding: encoding.label().to_owned(), warnings, causes })
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

    /// What is found of the images of a case, one by one.
    pub fn look(&self, case: &CaseImages) -> Result<Looked, DiskError> {
        let (Ok(images), Some(scene)) = (&case.images, self.references.scene(&case.case.scene)) else {
            return Ok(Looked::default());
        };
        let reference = self.reference(&case.case.scene, &case.case.estimator)?;
        let size = scene.facts.resolution.map(|side| side as usize);
        let shows = case.shows();
        let of = |image: &Vec<f32>| match shows {
            Shows::Frame => Vec::new(),
            _ => intake::examine(image, &reference, size, &self.declared_of(shows)),
        };
        let findings = images.iter().map(of).collect();
        Ok(Looked { reference, size, findings, shared: None })
    }

    /// Frames are no occlusion, whatever is declared of AO.
    fn declared_of(&self, shows: Shows) -> Declared {
        let means = if shows == Shows::Ratio { Means::Openness } else { self.declared.means };
        Declared { means, ..self.declared.clone() }
    }

    /// Ends a case whose images are wrong as a whole, and notes what is doubtful.
    pub fn diagnose(
        &self,
        case: &mut CaseImages,
        looked: &Looked,
        causes: Option<&[PairCause]>,
    ) -> Result<(), ScoreError> {
        let Ok(images) = &case.images else { return Ok(()) };
        let Some(scene) = self.references.scene(&case.case.scene) else { return Ok(()) };
        let Looked { reference, size, findings, .. } = looked;
        let shows = case.shows();
        let light = if shows == Shows::Frame { self.references.light(scene)? } else { None };
        let mut found = Diagnosis::default();
        for (number, (image, findings)) in images.iter().zip(findings).enumerate() {
            let mut own = match shows {
                Shows::Frame => of_frame(image, reference, light.as_deref(), *size),
                _ => self.judged(findings.clone(), shows, causes),
            };
            // What is doubtful is so in all of them.
            match number {
                0 => own.doubtful.extend(self.apart(image, case, looked, &own, causes)),
                _ => own.doubtful.clear(),
            }
            if shows != Shows::Frame
                && let Some(other) = self.rather(image, case, reference)?
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

    /// What is wrong with openness.
    pub fn of_openness(
        &self,
        image: &[f32],
        reference: &Reference,
        size: [usize; 2],
        shows: Shows,
        causes: Option<&[PairCause]>,
    ) -> Diagnosis {
        self.judged(intake::examine(image, reference, size, &self.declared_of(shows)), shows, causes)
    }

    /// What was found, as what is wrong and what is doubtful. Where a ratio is not known, nothing is missing. Codes are
    /// doubtful alone where it is declared what numbers stand for.
    fn judged(&self, findings: Vec<Finding>, shows: Shows, causes: Option<&[PairCause]>) -> Diagnosis {
        let mut found = Diagnosis { findings, ..Diagnosis::default() };
        let declared = self.declared_of(shows);
        for finding in &found.findings {
            let is_ratio = shows == Shows::Ratio;
            if is_ratio && matches!(finding, Finding::Holes { .. }) {
                continue;
            }
            if self.curve == Curved::Unfitted && finding.is_meaning() {
                continue;
            }
            let is_value = finding.is_meaning() || matches!(finding, Finding::Scaled { .. } | Finding::Between { .. });
            if is_ratio && is_value && self.curve == Curved::No && causes.is_some_and(|c| !c.is_empty()) {
                let causes = causes.unwrap_or_default();
                let is_meant = self.is_declared && !matches!(causes[..], [PairCause::Exposure(_), ..]);
                let is_wrong = (causes[0].is_wrong() || !finding.is_doubt()) && !is_meant || !finding.is_meaning();
                let to = if is_wrong { &mut found.wrong } else { &mut found.doubtful };
                to.push(of_pair(causes));
                continue;
            }
            // Where a frame is nearly dark, noise alone brings a ratio beyond its range.
            let is_noise = is_ratio && matches!(finding, Finding::Range { scale: None, .. });
            let is_doubt = finding.is_doubt() || finding.is_encoded() && self.is_declared || is_noise;
            let to = if is_doubt { &mut found.doubtful } else { &mut found.wrong };
            to.push(self.sentence(finding, &declared));
        }
        found
    }

    /// What was found and what to do about it, by what is declared and handed in.
    fn sentence(&self, finding: &Finding, declared: &Declared) -> String {
        let title = finding.title();
        match (self.curve, finding) {
            (Curved::Known, f) if f.is_meaning() => format!(
                "{title}, with the declared curve undone: correct `curve`, declare `curve = \"fit\"`, or take it away"
            ),
            (Curved::Fitted, f) if f.is_meaning() => format!(
                "{title}, with the curve undone that was fitted on the control scenes: what was done to these images is not what \
                 was done to those"
            ),
            (_, Finding::Either(_)) if self.is_checked => format!(
                "{title}; the image of the self-check shows something else: save both in the same way, and look what is done to \
                 AO after it is traced"
            ),
            _ => finding.told(declared, Keys::Score),
        }
    }

    /// How far an image of classic AO is from its converged image, by more than noise, where nothing explains it.
    /// Another falloff or radius may be meant.
    fn apart(
        &self,
        image: &[f32],
        case: &CaseImages,
        looked: &Looked,
        own: &Diagnosis,
        causes: Option<&[PairCause]>,
    ) -> Option<String> {
        let is_classic = self.references.suite().is_classic(&case.case.estimator);
        let is_of_frame = case.shows() == Shows::Frame;
        if !is_classic || self.is_declared || is_of_frame || !own.findings.is_empty() {
            return None;
        }
        let apart = |found: &[Finding]| intake::agreement(image, &looked.reference, looked.size, found);
        let disagreement = apart(&[]);
        if case.shows() == Shows::Ratio {
            return disagreement.map(|d| d.because(&of_pair(causes.unwrap_or_default()))).or_else(|| exposure(causes));
        }
        let disagreement = disagreement?;
        // What is done to the other images of the method is done to this one, where it explains it.
        let shared = looked.shared.as_ref().filter(|f| apart(std::slice::from_ref(*f)).is_none());
        Some(shared.map_or_else(|| disagreement.to_string(), |f| self.sentence(f, &self.declared_of(case.shows()))))
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

/// What is said of frames of which nothing else is to be said, but that their exposure differs by little.
pub(super) fn exposure(causes: Option<&[PairCause]>) -> Option<String> {
    causes.filter(|c| matches!(c, [PairCause::Exposure(_)])).map(of_pair)
}

/// What makes the ratio of two frames differ from openness, or may do so.
pub(super) fn of_pair(causes: &[PairCause]) -> String {
    let told: Vec<String> = causes.iter().map(ToString::to_string).collect();
    match told.len() {
        0 => "what it is, the frames do not tell: exposure that differs between them, a tone curve, light that AO does not dim \
              (direct or emitted), values cut off below white, strength of the AO, or R"
            .to_owned(),
        1 => told.concat(),
        _ => format!("one of these, which the frames do not tell from each other: {}", told.join("; or: ")),
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
        let are = counted(seen().filter(|v| *v < 0.0).count(), "pixel is", "pixels are");
        found.doubtful.push(format!("negative light: {are} below 0, the least is {least:.3}"));
    }
    let like: Vec<&[f32]> = std::iter::once(reference.openness.as_slice()).chain(light).collect();
    if let Some(turn) = intake::frame_turn(frame, &like, size) {
        found.doubtful.push(format!("it looks {}; {}", turn.title(), turn.remedy()));
    }
    found
}
