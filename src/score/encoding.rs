//! Which encoding the integers of a folder have, where it is not declared: one answer for all images of a
//! format and a method.

use super::reading::{Expected, Reader};
use crate::{
    counted::counted,
    disk::DiskError,
    intake::{self, Evidence, Handed, HandedImage, Shown},
    metrics::image::Encoding,
};
use std::{collections::BTreeMap, path::Path};

/// The encodings that were found, by format and estimator.
#[derive(Default)]
pub(super) struct Encodings(BTreeMap<(String, String), Encoding>);

/// The format of a file by its name.
fn format(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

impl Encodings {
    /// What a file's numbers stand for, where that was found.
    pub fn of(&self, path: &Path, estimator: &str) -> Option<Encoding> {
        self.0.get(&(format(path), estimator.to_owned())).copied()
    }

    /// Weighs all images against their references, and says what was taken. What cannot be read tells nothing here.
    ///
    /// # Errors
    /// Where references cannot be read.
    pub fn find(
        reader: &Reader<'_>,
        handed: &[Handed],
        view: &dyn Fn(&Handed) -> Result<Expected, DiskError>,
    ) -> Result<(Self, Vec<String>), DiskError> {
        let (mut found, mut told) = (Encodings::default(), Vec::new());
        if reader.declared.encoding.is_some() {
            return Ok((found, told));
        }
        let mut votes: BTreeMap<(String, String), Evidence> = BTreeMap::new();
        for h in handed {
            // OpenEXR holds no integers of brightness.
            let may_tell = |i: &&HandedImage| i.shown == Shown::Openness && format(&i.path) != "exr";
            if !h.images.iter().any(|i| may_tell(&i)) {
                continue;
            }
            let Some((view, reference)) = view(h)? else { continue };
            for image in h.images.iter().filter(may_tell) {
                if let Ok(Some(evidence)) = intake::evidence(&image.path, &reader.declared, view, &reference) {
                    let vote = votes.entry((format(&image.path), h.estimator.clone())).or_default();
                    *vote = vote.with(evidence);
                }
            }
        }
        for ((format, estimator), own) in &votes {
            // Where no image of a method tells, those of the others do.
            let others = votes.iter().filter(|((f, _), _)| f == format).map(|(_, vote)| *vote);
            let vote = if own.images > 0 { *own } else { others.fold(Evidence::default(), Evidence::with) };
            let Some(encoding) = vote.encoding() else { continue };
            told.push(format!(
                "no encoding is declared and .{format} files of {estimator} store integers: all are taken as \"{}\", which \
                 is nearer to the references ({}); declare `encoding`",
                encoding.label(),
                counted(vote.images, "image that varies", "images that vary")
            ));
            found.0.insert((format.clone(), estimator.clone()), encoding);
        }
        Ok((found, told))
    }
}
