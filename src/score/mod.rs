//! Images of somebody else's renderer, from a folder to what can be measured: names become
//! cases, files openness, and what is wrong with them is found before it is taken for a bad
//! renderer.

mod declaration;
mod encoding;
mod reading;
pub mod self_check;
mod together;

pub use declaration::{CurveChoice, Declaration, FILE, Fit, KnownCurve};

use crate::{
    counted::counted,
    disk::DiskError,
    intake::{self, Defaults, Handed, IntakeError},
    record::{HandedIn, Shows, UndoneCurve},
    run::{CaseImages, References, ReferencesError},
    suite::{Case, is_taken},
};
use encoding::Encodings;
use reading::{Curved, Reader};
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
    /// The image of the self-check is not as expected, and no cause explains it.
    #[error("the self-check does not agree, and neither may the others: {0}")]
    Disagrees(String),
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

impl ScoreError {
    /// With what is to be said of the images besides, where the self-check ended it all.
    fn with(self, warnings: &[String]) -> Self {
        match self {
            ScoreError::SelfCheck(what) => ScoreError::SelfCheck(lines(what, warnings)),
            ScoreError::Disagrees(what) => ScoreError::Disagrees(lines(what, warnings)),
            other => other,
        }
    }
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
    check_kit(declaration, references)?;
    let mut scenes: Vec<&str> = file.scenes.iter().map(|s| s.facts.name.as_str()).collect();
    scenes.push(SELF_CHECK);
    let estimators: Vec<&str> = references.suite().methods.iter().map(|m| m.name.as_str()).collect();
    let free = Some(SELF_CHECK.to_owned());
    let defaults = Defaults { estimator: declaration.estimator.clone(), rays: declaration.rays, free };
    let found = intake::files(folder, &scenes, &estimators, &defaults)?;
    let mut warnings = found.warnings;
    let mut reader = reader(folder, references, declaration);
    let (encodings, taken) = Encodings::find(&reader, &found.cases, &|h| reader.expected(h))?;
    reader.encodings = encodings;
    warnings.extend(taken);
    let (checks, handed): (Vec<_>, Vec<_>) = found.cases.into_iter().partition(|c| c.scene == SELF_CHECK);
    reader.is_checked = !checks.is_empty();
    let known = match &declaration.curve {
        Some(CurveChoice::Known(known)) => Some(known.curve()),
        _ => None,
    };
    let mut checked = self_check::check(&reader, known, &checks).map_err(|e| e.with(&warnings))?;
    reader.is_declared = declaration.encoding.is_some();
    check_taken(folder, &scenes[..scenes.len() - 1], &handed, (found.not_taken, is_partial), &warnings)?;
    check_used(declaration, &handed).map_err(ScoreError::Declared)?;
    if let Some(own) = declaration.estimator.as_deref().filter(|own| !estimators.contains(own)) {
        let known = estimators.join(", ");
        warnings
            .push(format!("The estimator '{own}' is none of the kit's ({known}): of it there is no converged image."));
    }
    let (renderer, told) = declaration.renderer.clone().map_or_else(|| name_of(folder), |name| (name, None));
    warnings.extend(told);
    warnings.append(&mut checked.doubts);
    let (mut cases, causes): (Vec<CaseImages>, Vec<_>) = handed.iter().map(|h| reader.case(h, &renderer)).unzip();
    let curve = undo_curve(&mut cases, references, declaration)?;
    if let Some(undone) = curve.as_ref().filter(|_| reader.curve == Curved::Unfitted) {
        reader.curve = Curved::Fitted;
        warnings.extend(self_check::check_fitted(&reader, undone, &checks));
    }
    let looked = together::look(&reader, &cases, &checked)?;
    for ((case, looked), causes) in cases.iter_mut().zip(&looked).zip(&causes) {
        reader.diagnose(case, looked, causes.as_deref())?;
    }
    if !is_partial {
        let strays = strays(&handed);
        warnings.extend(strays.iter().map(|h| stray(h, folder)));
        let strays: Vec<(&str, u32)> = strays.iter().map(|h| (h.estimator.as_str(), h.rays)).collect();
        cases.extend(missing(&cases, references, &strays));
    }
    let kit = format!("{}, aogauge {}, suite {}, seed {}", file.id(), file.tool, file.suite, file.seed);
    Ok(Gathered { cases, handed_in: HandedIn { renderer, kit, curve, warnings } })
}

/// Reads images of which nothing is known yet but what is declared.
fn reader<'a>(folder: &'a Path, references: &'a References, declaration: &Declaration) -> Reader<'a> {
    let curve = match &declaration.curve {
        None => Curved::No,
        Some(CurveChoice::Fit(_)) => Curved::Unfitted,
        Some(CurveChoice::Known(_)) => Curved::Known,
    };
    Reader {
        folder,
        references,
        declared: declaration.of_images(),
        encodings: Encodings::default(),
        // A curve that is found on the images later explains codes, too.
        is_declared: curve == Curved::Unfitted,
        curve,
        is_checked: false,
    }
}

/// Refuses a kit that is not the one that is declared.
fn check_kit(declaration: &Declaration, references: &References) -> Result<(), ScoreError> {
    let file = references.file();
    let Some(kit) = declaration.kit.as_deref().filter(|kit| *kit != file.id()) else { return Ok(()) };
    let [kit, id, suite] = [kit, file.id(), &file.suite].map(crate::untrusted::line);
    Err(ScoreError::Declared(format!(
        "kit is '{kit}' in {FILE}, but the kit that the images were to be scored against is '{id}', of suite {suite}: score them \
         against the kit that they were rendered for"
    )))
}

/// Refuses a folder without an image of the kit's scenes, and images that are not taken: a slip in a name
/// must not leave out what was to be judged.
fn check_taken(
    folder: &Path,
    scenes: &[&str],
    handed: &[Handed],
    (not_taken, is_partial): (usize, bool),
    why: &[String],
) -> Result<(), ScoreError> {
    let folder = folder.display();
    if handed.is_empty() {
        let scenes = scenes.join(", ");
        let what = match not_taken {
            0 => format!("{folder}: no image is called like a scene of the kit"),
            1 => format!(
                "{folder}: the one image is not taken; an estimator that the kit does not have is named by --estimator"
            ),
            n => format!(
                "{folder}: none of {n} images is taken; an estimator that the kit does not have is named by --estimator"
            ),
        };
        let what = format!("{what}; names are SCENE.ESTIMATOR.RAYS.REPLICATE.exr, the scenes {scenes}");
        return Err(ScoreError::Nothing(lines(what, why)));
    }
    if not_taken > 0 && !is_partial {
        let what = format!(
            "{folder}: {} not taken; an estimator that the kit does not have is named by --estimator; --partial leaves such \
             images out",
            counted(not_taken, "image is", "images are")
        );
        return Err(ScoreError::NotTaken(lines(what, why)));
    }
    Ok(())
}

/// Refuses an estimator or a number of rays that is declared and that no image is of: the
/// names of files win, and what was declared may be a slip.
fn check_used(declaration: &Declaration, handed: &[Handed]) -> Result<(), String> {
    let listed = |of: &dyn Fn(&Handed) -> String| {
        let mut found: BTreeMap<String, usize> = BTreeMap::new();
        for h in handed {
            *found.entry(of(h)).or_default() += h.images.len();
        }
        found
            .into_iter()
            .map(|(what, n)| format!("{what} ({})", counted(n, "file", "files")))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let unused = |field: &str, value: &str, found: String| {
        Err(format!(
            "{field} is {value}, but no image is of it: the files' names say {found}, and they win; correct it or leave it out"
        ))
    };
    if let Some(own) = declaration.estimator.as_ref().filter(|own| !handed.iter().any(|h| h.estimator == **own)) {
        return unused("estimator", &format!("'{own}'"), listed(&|h| h.estimator.clone()));
    }
    if let Some(own) = declaration.rays.filter(|own| !handed.iter().any(|h| h.rays == *own)) {
        return unused("rays", &own.to_string(), listed(&|h| h.rays.to_string()));
    }
    Ok(())
}

/// A sentence, and further ones on lines of their own.
fn lines(what: String, more: &[String]) -> String {
    more.iter().fold(what, |text, line| format!("{text}\n  {line}"))
}

/// Cases of a ray count that less than half as many scenes have as another one of the same
/// estimator: a slip in a name more likely than a plan, of which no other scene's images are missed.
fn strays(handed: &[Handed]) -> Vec<&Handed> {
    let mut scenes: BTreeMap<&str, BTreeMap<u32, usize>> = BTreeMap::new();
    for h in handed {
        *scenes.entry(&h.estimator).or_default().entry(h.rays).or_default() += 1;
    }
    let is_stray = |h: &&Handed| {
        let of = &scenes[h.estimator.as_str()];
        2 * of[&h.rays] < of.values().copied().max().unwrap_or(0)
    };
    handed.iter().filter(is_stray).collect()
}

/// What is said of one.
fn stray(h: &Handed, folder: &Path) -> String {
    let file = h.images.first().map(|i| i.path.strip_prefix(folder).unwrap_or(&i.path).display().to_string());
    format!(
        "{}: of {}, {} in few scenes only: this case is scored, and others of so many rays are not missed",
        crate::untrusted::line(&file.unwrap_or_default()),
        h.estimator,
        counted(h.rays, "ray is", "rays are")
    )
}

/// A legal name from that of a folder, and what is said where it is another.
fn name_of(folder: &Path) -> (String, Option<String>) {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let name = whole.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let is_legal = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let legal: String = name.chars().map(|c| if is_legal(c) { c } else { '-' }).take(64).collect();
    let legal = match aogauge_scenes::check_name(&legal) {
        // The names of our own renderers are not free.
        Ok(()) if !is_taken(&legal) => legal,
        _ => "handed-in".to_owned(),
    };
    let told = (legal != name).then(|| {
        let name = crate::untrusted::line(&name);
        format!("The renderer is called '{legal}': '{name}', as the folder is, cannot be its name; --renderer gives another.")
    });
    (legal, told)
}

/// Cases that the images of other scenes ask for.
fn missing(cases: &[CaseImages], references: &References, strays: &[(&str, u32)]) -> Vec<CaseImages> {
    let kinds: BTreeSet<(&str, &str, u32)> =
        cases.iter().map(|c| (c.case.estimator.as_str(), c.case.renderer.as_str(), c.case.rays)).collect();
    let kinds: Vec<_> = kinds.into_iter().filter(|(e, _, rays)| !strays.contains(&(e, *rays))).collect();
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
            (known.curve(), UndoneCurve { gain: known.gain, exponent: known.exponent, rmse: None, scenes: Vec::new() })
        }
        Some(CurveChoice::Fit(_)) => fit(cases, references)?,
    };
    for case in cases {
        // A pair's ratio is openness as well, by the same curve.
        if case.shows() != Shows::Frame
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
            known.push((images, converged));
        }
    }
    let pairs: Vec<(&[f32], &[f32])> =
        known.iter().flat_map(|(images, c)| images.iter().map(|i| (i.as_slice(), c.mean.as_slice()))).collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intake::{HandedImage, Shown};

    fn handed(scene: &str, estimator: &str, rays: u32) -> Handed {
        let path = format!("mine/{scene}.{estimator}.{rays}.exr").into();
        let image = HandedImage { replicate: None, shown: Shown::Openness, path, without: None };
        Handed { scene: scene.into(), estimator: estimator.into(), rays, images: vec![image] }
    }

    /// One scene of three is a slip, one of two may be meant.
    #[test]
    fn a_ray_count_of_few_scenes_is_a_stray() {
        let mut all: Vec<Handed> = ["a", "b", "c"].map(|s| handed(s, "classic", 4)).into();
        all.extend([handed("a", "classic", 8), handed("b", "extended", 4), handed("a", "extended", 8)]);
        let found = strays(&all);
        assert_eq!(found, [&all[3]]);
        let told = stray(found[0], Path::new("mine"));
        assert!(told.starts_with("a.classic.8.exr: of classic, 8 rays are in few scenes only"), "{told}");
        assert!(strays(&all[1..]).is_empty());
    }

    #[test]
    fn folders_lend_their_names_where_they_can() {
        let name = |folder: &str| name_of(Path::new(folder));
        assert_eq!(name("x/my_ao.v2"), ("my_ao.v2".into(), None));
        let (legal, told) = name("x/my ao");
        assert!(legal == "my-ao" && told.is_some_and(|t| t.contains("'my ao', as the folder is")));
        let (legal, told) = name("x/CPU");
        assert!(legal == "handed-in" && told.is_some_and(|t| t.contains("--renderer")));
    }
}
