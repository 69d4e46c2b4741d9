//! One image by which a renderer shows that it draws the kit's scenes as they are meant.

use super::{
    ScoreError,
    reading::{Reader, of_frame, shows},
};
use crate::{
    disk::DiskError,
    intake::{self, Curve, Handed, HandedImage, Reference, Scaled},
    record::Shows,
    run::References,
};

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

/// Looks at the images of the self-check, with a curve undone that is declared. Returns what is doubtful.
///
/// # Errors
/// [`ScoreError::SelfCheck`] where one is wrong, [`ScoreError::Disagrees`] where nobody knows why.
pub(super) fn check(reader: &Reader<'_>, curve: Option<Curve>, handed: &[Handed]) -> Result<Vec<String>, ScoreError> {
    if handed.is_empty() {
        return Ok(vec![format!(
            "There is no image of {SCENE}: whether images lie the right way round, are linear and take R in metres is known \
             as far as each scene tells."
        )]);
    }
    let (reference, resolution) = read(reader.references)?;
    let size = resolution.map(|side| side as usize);
    let mut warnings = Vec::new();
    for (of, image) in handed.iter().flat_map(|h| h.images.iter().map(move |i| (&h.estimator, i))) {
        let wrong = |why: String| ScoreError::SelfCheck(format!("{}: {why}", name_of(image)));
        let read = reader.image(image, of, resolution, &reference).map_err(|e| match e {
            ScoreError::Intake(e) => ScoreError::SelfCheck(e.to_string()),
            other => other,
        })?;
        warnings.extend(read.warnings);
        let shows = shows(Some(image.shown));
        for values in &read.images {
            let plain = curve.filter(|_| shows != Shows::Frame).map(|curve| curve.undo(values));
            let values = plain.as_ref().unwrap_or(values);
            let found = match shows {
                Shows::Frame => of_frame(values, &reference, None, size),
                _ => reader.of_openness(values, &reference, size, shows),
            };
            if !found.wrong.is_empty() {
                return Err(wrong(found.wrong.join("; and: ")));
            }
            // What is expected is classic AO; a curve that is yet to be fitted is no disagreement.
            if shows != Shows::Frame
                && reader.references.suite().is_classic(of)
                && !reader.is_declared
                && let Some(apart) = intake::agreement(values, &reference, size, &found.findings)
            {
                return Err(ScoreError::Disagrees(format!("{}: {apart}", name_of(image))));
            }
            warnings.extend(found.doubtful.into_iter().map(|w| (image.path.clone(), w)));
        }
    }
    let images = handed.iter().map(|h| h.images.len()).sum();
    Ok(reader.told(&warnings, images).into_iter().map(|w| format!("{SCENE}: {w}")).collect())
}

fn name_of(image: &HandedImage) -> String {
    image.path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}
