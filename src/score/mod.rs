//! Images of somebody else's renderer, from a folder to what can be measured: names become
//! cases, files openness, and what is wrong with them is found before it is taken for a bad
//! renderer.

mod declaration;
mod reading;
pub mod self_check;

pub use declaration::{CurveChoice, Declaration, FILE, Fit, KnownCurve};

use crate::{
    disk::DiskError,
    intake::{self, Defaults, Handed, IntakeError},
    record::{HandedIn, UndoneCurve},
    run::{CaseImages, References, ReferencesError},
    suite::{Case, is_taken},
};
use reading::Reader;
use self_check::SCENE as SELF_CHECK;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

/// Why images cannot be scored.
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// A file could not be read or written.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// The folder or an image of it cannot be taken.
    #[error(transparent)]
    Intake(#[from] IntakeError),
    /// The references cannot be used.
    #[error(transparent)]
    References(#[from] ReferencesError),
    /// Something that was declared is out of its range.
    #[error("{0}")]
    Declared(String),
    /// The image of the self-check is wrong, so all are.
    #[error("the self-check image is wrong, and so will the others be: {0}")]
    SelfCheck(String),
    /// There is no image of the kit's scenes.
    #[error("{0}")]
    Nothing(String),
    /// Some images are of nobody knows what.
    #[error("{0}")]
    NotTaken(String),
    /// No curve can be found.
    #[error("{0}")]
    Curve(String),
}

/// What was found in a folder.
#[derive(Clone, Debug)]
pub struct Gathered {
    /// Cases with their images, or why these cannot be used.
    pub cases: Vec<CaseImages>,
    /// What holds for all of them.
    pub handed_in: HandedIn,
}

/// Reads the images of a folder. Where a scene of the kit has no image of an estimator and
/// ray count that other scenes have, its case ends with an error, and images whose names say nothing known are an error,
/// unless `is_partial`.
///
/// # Errors
/// [`ScoreError`]; what is wrong with the images of one case ends that case alone.
pub fn gather(
    folder: &Path,
    references: &References,
    declaration: &Declaration,
    is_partial: bool,
) -> Result<Gathered, ScoreError> {
    declaration.check().map_err(ScoreError::Declared)?;
    let file = references.file();
    let mut scenes: Vec<&str> = file.scenes.iter().map(|s| s.facts.name.as_str()).collect();
    scenes.push(SELF_CHECK);
    let estimators: Vec<&str> = references.suite().methods.iter().map(|m| m.name.as_str()).collect();
    let free = Some(SELF_CHECK.to_owned());
    let defaults = Defaults { estimator: declaration.estimator.clone(), rays: declaration.rays, free };
    let found = intake::files(folder, &scenes, &estimators, &defaults)?;
    let mut warnings = found.warnings;
    let renderer = declaration.renderer.clone().unwrap_or_else(|| name_of(folder));
    let reader = Reader { folder, references, declared: declaration.of_images() };
    let (checks, handed): (Vec<_>, Vec<_>) = found.cases.into_iter().partition(|c| c.scene == SELF_CHECK);
    warnings.extend(self_check::check(&reader, &checks)?);
    if handed.is_empty() {
        let scenes = scenes[..scenes.len() - 1].join(", ");
        let what = if warnings.is_empty() { String::new() } else { format!(" ({})", warnings.join(" ")) };
        return Err(ScoreError::Nothing(format!(
            "{}: no image is called like a scene of the kit{what}; names are SCENE.ESTIMATOR.RAYS.REPLICATE.exr, the \
             scenes {scenes}",
            folder.display()
        )));
    }
    check_used(declaration, &handed).map_err(ScoreError::Declared)?;
    if let Some(own) = declaration.estimator.as_deref().filter(|own| !estimators.contains(own)) {
        let known = estimators.join(", ");
        warnings
            .push(format!("The estimator '{own}' is none of the kit's ({known}): of it there is no converged image."));
    }
    // A slip in a name must not leave out what was to be judged.
    if found.not_taken > 0 && !is_partial {
        return Err(ScoreError::NotTaken(format!(
            "{} images are {}; an estimator that the kit does not have is named by --estimator; --partial leaves them out",
            found.not_taken,
            warnings.join("; ")
        )));
    }
    let mut cases: Vec<CaseImages> = handed.iter().map(|h| reader.case(h, &renderer)).collect();
    let curve = undo_curve(&mut cases, references, declaration)?;
    for case in &mut cases {
        reader.diagnose(case)?;
    }
    if !is_partial {
        cases.extend(missing(&cases, references));
    }
    let kit = format!("aogauge {}, suite {}, seed {}", file.tool, file.suite, file.seed);
    Ok(Gathered { cases, handed_in: HandedIn { renderer, kit, curve, warnings } })
}

/// Refuses an estimator or a number of rays that is declared and that no image is of: the
/// names of files win, and what was declared may be a slip.
fn check_used(declaration: &Declaration, handed: &[Handed]) -> Result<(), String> {
    let counted = |of: &dyn Fn(&Handed) -> String| {
        let mut found: BTreeMap<String, usize> = BTreeMap::new();
        for h in handed {
            *found.entry(of(h)).or_default() += h.images.len();
        }
        found.into_iter().map(|(what, n)| format!("{what} ({n} images)")).collect::<Vec<_>>().join(", ")
    };
    let unused = |field: &str, value: &str, found: String| {
        Err(format!(
            "{field} is {value}, but no image is of it: the files' names say {found}, and they win; correct it or leave it out"
        ))
    };
    if let Some(own) = declaration.estimator.as_ref().filter(|own| !handed.iter().any(|h| h.estimator == **own)) {
        return unused("estimator", &format!("'{own}'"), counted(&|h| h.estimator.clone()));
    }
    if let Some(own) = declaration.rays.filter(|own| !handed.iter().any(|h| h.rays == *own)) {
        return unused("rays", &own.to_string(), counted(&|h| h.rays.to_string()));
    }
    Ok(())
}

/// A legal name from that of a folder.
fn name_of(folder: &Path) -> String {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let name = whole.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let legal: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).take(64).collect();
    match aogauge_scenes::check_name(&legal) {
        // The names of our own renderers are not free.
        Ok(()) if !is_taken(&legal) => legal,
        _ => "handed-in".to_owned(),
    }
}

/// Cases that the images of other scenes ask for.
fn missing(cases: &[CaseImages], references: &References) -> Vec<CaseImages> {
    let kinds: BTreeSet<(&str, &str, u32)> =
        cases.iter().map(|c| (c.case.estimator.as_str(), c.case.renderer.as_str(), c.case.rays)).collect();
    let mut missing = Vec::new();
    for scene in &references.file().scenes {
        for &(estimator, renderer, rays) in &kinds {
            let case = Case {
                scene: scene.facts.name.clone(),
                estimator: estimator.to_owned(),
                renderer: renderer.to_owned(),
                rays,
            };
            if !cases.iter().any(|c| c.case == case) {
                let why = format!(
                    "no image was handed in: {}.{estimator}.{rays}.0000.exr was looked for (--partial leaves it out)",
                    case.scene
                );
                missing.push(CaseImages { case, images: Err(why), source: None });
            }
        }
    }
    missing
}

/// Undoes the curve that is declared, or that the control scenes show.
fn undo_curve(
    cases: &mut [CaseImages],
    references: &References,
    declaration: &Declaration,
) -> Result<Option<UndoneCurve>, ScoreError> {
    let (curve, undone) = match &declaration.curve {
        None => return Ok(None),
        Some(CurveChoice::Known(known)) => {
            let curve = intake::Curve { gain: known.gain, exponent: known.exponent, ..intake::Curve::IDENTITY };
            (curve, UndoneCurve { gain: known.gain, exponent: known.exponent, rmse: None, scenes: Vec::new() })
        }
        Some(CurveChoice::Fit(_)) => fit(cases, references)?,
    };
    for case in cases {
        if case.is_openness()
            && let Ok(images) = &mut case.images
        {
            for image in images {
                *image = curve.undo(image);
            }
        }
    }
    Ok(Some(undone))
}

fn fit(cases: &[CaseImages], references: &References) -> Result<(intake::Curve, UndoneCurve), ScoreError> {
    let is_control = |scene: &str| references.scene(scene).is_some_and(|s| s.facts.control);
    let mut known = Vec::new();
    let mut scenes = BTreeSet::new();
    for case in cases.iter().filter(|c| is_control(&c.case.scene) && c.is_openness()) {
        let Ok(images) = &case.images else { continue };
        if let Some(converged) = references.converged(&case.case.scene, &case.case.estimator)? {
            scenes.insert(case.case.scene.clone());
            known.push((images, converged.mean));
        }
    }
    let pairs: Vec<(&[f32], &[f32])> =
        known.iter().flat_map(|(images, mean)| images.iter().map(|i| (i.as_slice(), mean.as_slice()))).collect();
    let names = || scenes.iter().cloned().collect::<Vec<_>>();
    let Some(curve) = intake::fit_curve(&pairs) else {
        let of = if scenes.is_empty() { "no control scene".to_owned() } else { names().join(", ") };
        return Err(ScoreError::Curve(format!(
            "no curve can be found on {of}: it takes images of several rays, of an estimator of the suite, in control scenes \
             whose openness varies; declare curve.gain and curve.exponent, or no curve"
        )));
    };
    let (gain, exponent, rmse) = (curve.gain, curve.exponent, Some([curve.before, curve.after]));
    Ok((curve, UndoneCurve { gain, exponent, rmse, scenes: names() }))
}
