//! The image of a case.

use super::CaseRecord;
use crate::{
    disk::DiskError,
    layers::{Layers, pixel_hash, short_hash},
};
use std::path::Path;

impl CaseRecord {
    /// The layers of its image out of the record's folder: the image that was measured, by the
    /// hash of its mean.
    ///
    /// # Errors
    /// Where the case has no image, as [`Layers::read`], and where the file holds another image
    /// than the record tells of.
    pub fn layers(&self, folder: &Path) -> Result<Layers, DiskError> {
        let Some(image) = &self.image else {
            return Err(DiskError::content(folder, format!("the record has no image of {}", self.case.id())));
        };
        let path = folder.join(image);
        let layers = Layers::read(&path)?;
        let found = layers.get("mean").map(pixel_hash);
        if found == self.hash || self.hash.is_none() {
            return Ok(layers);
        }
        let short = |hash: &Option<String>| hash.as_deref().map_or("none".to_owned(), |h| short_hash(h).to_owned());
        let why = format!(
            "not the image that was measured: the hash of its mean is {}, in the record {}; restore the file, or run again",
            short(&found),
            short(&self.hash)
        );
        Err(DiskError::content(&path, why))
    }
}
