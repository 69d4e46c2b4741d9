//! One image by which a renderer shows that it draws the kit's scenes as they are meant.

use super::{ScoreError, reading::Reader};
use crate::{
    disk::DiskError,
    intake::{self, Handed, Reference, Scaled},
    layers::Layers,
};
use std::path::Path;

/// Its scene's name.
pub const SCENE: &str = "self-check";

/// Its references, in the folder of what images are scored against.
pub const FILE: &str = "self-check.exr";

/// The layer of what an image of it must look like.
pub const OPENNESS: &str = "openness";

/// How the layers begin of what it looks like with another R; the factor follows.
pub const SCALED: &str = "scaled-";

/// Reads the references.
fn read(scoring: &Path) -> Result<(Reference, [u32; 2]), DiskError> {
    let path = scoring.join(FILE);
    let layers = Layers::read(&path)?;
    let openness = layers.get(OPENNESS).map(<[f32]>::to_vec);
    let openness = openness.ok_or_else(|| DiskError::content(&path, format!("it lacks '{OPENNESS}'")))?;
    let scaled = layers.layers.iter().filter_map(|(name, values)| {
        let factor = name.strip_prefix(SCALED)?.parse().ok()?;
        Some(Scaled { factor, openness: values.clone() })
    });
    Ok((Reference { openness, scaled: scaled.collect() }, layers.resolution))
}

/// Looks at the images of the self-check. Returns what is doubtful.
///
/// # Errors
/// [`ScoreError::SelfCheck`] where one is wrong.
pub(super) fn check(reader: &Reader<'_>, handed: &[Handed]) -> Result<Vec<String>, ScoreError> {
    if handed.is_empty() {
        return Ok(vec![format!(
            "There is no image of {SCENE}: whether images lie the right way round, are linear and take R in metres is known \
             as far as each scene tells."
        )]);
    }
    let (reference, resolution) = read(reader.references.folder())?;
    let size = resolution.map(|side| side as usize);
    let mut doubtful = Vec::new();
    for image in handed.iter().flat_map(|h| &h.images) {
        let name = image.path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let taken = intake::read_against(&image.path, &reader.declared, resolution, &reference)?;
        doubtful.extend(taken.warnings.into_iter().map(|w| format!("{name}: {w}")));
        let (mut wrong, mut odd) = (Vec::new(), Vec::new());
        for finding in taken.replicates.first().map(|i| intake::diagnose(i, &reference, size)).unwrap_or_default() {
            if finding.is_doubt() { odd.push(finding.to_string()) } else { wrong.push(finding.to_string()) }
        }
        if !wrong.is_empty() {
            return Err(ScoreError::SelfCheck(format!("{name}: {}", wrong.join("; and: "))));
        }
        doubtful.extend(odd.into_iter().map(|f| format!("{name}: {f}")));
    }
    Ok(doubtful)
}
