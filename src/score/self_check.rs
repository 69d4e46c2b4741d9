//! One image by which a renderer shows that it draws the kit's scenes as they are meant.

use super::{
    ScoreError, lines,
    reading::{Reader, exposure, of_frame, of_pair, shows},
    together::Checked,
};
use crate::{
    disk::DiskError,
    intake::{self, Curve, Finding, Handed, HandedImage, Reference, Scaled},
    record::{Shows, UndoneCurve},
    run::References,
};
use std::path::PathBuf;

/// Its scene's name.
pub const SCENE: &str = "self-check";

/// Its references, in the folder of what images are scored against.
pub const FILE: &str = "self-check.exr";

/// The layer of what an image of it must look like.
pub const OPENNESS: &str = "openness";

/// How the layers begin of what it looks like with another R; the factor follows.
pub const SCALED: &str = "scaled-";

/// Reads the references.
pub(super) fn read(references: &References) -> Result<(Reference, [u32; 2]), DiskError> {
    let (path, layers) = references.beside(FILE)?;
    let openness = layers.get(OPENNESS).map(<[f32]>::to_vec);
    let openness = openness.ok_or_else(|| DiskError::content(&path, format!("it lacks '{OPENNESS}'")))?;
    let scaled = layers.layers.iter().filter_map(|(name, values)| {
        let factor = name.strip_prefix(SCALED)?.parse().ok()?;
        Some(Scaled { factor, openness: values.clone() })
    });
    Ok((Reference { openness, scaled: scaled.collect() }, layers.resolution))
}

/// Looks at the images of the self-check, with a curve undone that is declared.
///
/// # Errors
/// [`ScoreError::SelfCheck`] where one is wrong, [`ScoreError::Disagrees`] where nobody knows why. What else is to be said of
/// the images stands on lines of its own.
pub(super) fn check(reader: &Reader<'_>, curve: Option<Curve>, handed: &[Handed]) -> Result<Checked, ScoreError> {
    let mut checked = Checked::default();
    if handed.is_empty() {
        checked.doubts.push(format!(
            "There is no image of {SCENE}: whether images lie the right way round, are linear and take R in metres is known \
             as far as each scene tells."
        ));
        return Ok(checked);
    }
    let (reference, resolution) = read(reader.references)?;
    let size = resolution.map(|side| side as usize);
    let mut warnings = Vec::new();
    let images = handed.iter().map(|h| h.images.len()).sum();
    let told = |warnings: &[(PathBuf, String)]| -> Vec<String> {
        reader.told(warnings, images).into_iter().map(|w| format!("{SCENE}: {w}")).collect()
    };
    for (of, image) in handed.iter().flat_map(|h| h.images.iter().map(move |i| (&h.estimator, i))) {
        let read = reader.image(image, of, resolution, &reference).map_err(|e| match e {
            ScoreError::Intake(e) => ScoreError::SelfCheck(e.to_string()),
            other => other,
        })?;
        warnings.extend(read.warnings);
        let (shows, causes) = (shows(Some(image.shown)), read.causes.as_deref());
        for values in read.images {
            let undone = curve.filter(|_| shows != Shows::Frame).map(|curve| curve.undo(&values));
            let values = undone.unwrap_or(values);
            let found = match shows {
                Shows::Frame => of_frame(&values, &reference, None, size),
                _ => reader.of_openness(&values, &reference, size, shows, causes),
            };
            let why = |why: String| lines(format!("{}: {why}", name_of(image)), &told(&warnings));
            if !found.wrong.is_empty() {
                return Err(ScoreError::SelfCheck(why(found.wrong.join("; and: "))));
            }
            // What is expected is classic AO; a curve that is yet to be fitted is no disagreement.
            let is_expected = shows != Shows::Frame && reader.references.suite().is_classic(of) && !reader.is_declared;
            if is_expected && let Some(apart) = intake::agreement(&values, &reference, size, &found.findings) {
                let is_pair = shows == Shows::Ratio;
                let apart =
                    if is_pair { apart.because(&of_pair(causes.unwrap_or_default())) } else { apart.to_string() };
                return Err(ScoreError::Disagrees(why(apart)));
            }
            checked.has_meaning |= found.findings.iter().any(Finding::is_meaning);
            let little = exposure(causes).filter(|_| is_expected && found.findings.is_empty());
            warnings.extend(found.doubtful.into_iter().chain(little).map(|w| (image.path.clone(), w)));
            checked.images.push((values, shows));
        }
    }
    checked.doubts = told(&warnings);
    Ok(Checked { reference, width: size[0], ..checked })
}

/// What the images of the self-check show once the curve is undone that was fitted on the control scenes.
pub(super) fn check_fitted(reader: &Reader<'_>, undone: &UndoneCurve, handed: &[Handed]) -> Option<String> {
    if handed.is_empty() {
        return None;
    }
    let UndoneCurve { gain, exponent, .. } = *undone;
    let curve = Curve { gain, exponent, ..Curve::IDENTITY };
    let undone = format!(
        "the curve that was fitted on the control scenes, {gain:.2} times openness to the power {exponent:.2}, is undone in it, \
         as in all images"
    );
    Some(match check(reader, Some(curve), handed) {
        Ok(checked) if !checked.has_meaning => format!("{SCENE}: {undone}: it is as expected then"),
        Ok(_) => format!("{SCENE}: {undone}: what is done to it is not what is done to those"),
        Err(e) => format!("{SCENE}: {undone}, and then: {e}"),
    })
}

fn name_of(image: &HandedImage) -> String {
    image.path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}
