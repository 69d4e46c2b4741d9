//! Where a command leaves its image: a folder that nobody has used before, and that is
//! removed with all that is in it.

use super::ExternalError;
use crate::{claim::MAX_BYTES, disk::DiskError};
use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// One attempt at one image.
pub(crate) struct Attempt {
    /// Removed when this is dropped.
    folder: tempfile::TempDir,
    /// The folder without links.
    real: PathBuf,
    output: PathBuf,
}

impl Attempt {
    /// A fresh folder in one of the run's.
    ///
    /// # Errors
    /// Where it cannot be made.
    pub fn new(within: &Path, format: &str) -> Result<Self, DiskError> {
        let folder = tempfile::Builder::new()
            .prefix("image-")
            .tempdir_in(within)
            .map_err(DiskError::io(within, "create a folder for an image"))?;
        let real = fs::canonicalize(folder.path()).map_err(DiskError::io(folder.path(), "find the folder"))?;
        let output = folder.path().join(format!("image.{format}"));
        Ok(Attempt { folder, real, output })
    }

    /// Where the image is to be left.
    pub fn output(&self) -> &Path {
        &self.output
    }

    /// The image, if it is a plain file there; None where there is none.
    ///
    /// # Errors
    /// Where it is a link, no file, or too large to be read, or where the folder was put
    /// in another's place.
    pub fn taken(&self) -> Result<Option<PathBuf>, ExternalError> {
        let refused = |what| Err(ExternalError::NotPlain { what });
        match fs::canonicalize(self.folder.path()) {
            Ok(real) if real == self.real => {}
            Ok(_) => return refused("in a folder that was put in the place of its own"),
            Err(_) => return Ok(None),
        }
        let found = match fs::symlink_metadata(&self.output) {
            Ok(found) => found,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(DiskError::io(&self.output, "look at the image")(e).into()),
        };
        let kind = found.file_type();
        if kind.is_symlink() {
            return refused("a symbolic link");
        }
        if kind.is_dir() {
            return refused("a folder");
        }
        if !kind.is_file() {
            return refused("no file");
        }
        #[cfg(unix)]
        if std::os::unix::fs::MetadataExt::nlink(&found) > 1 {
            return refused("a file with a second name (a hard link)");
        }
        if found.len() > MAX_BYTES {
            return refused("larger than 3 GiB");
        }
        Ok(Some(self.output.clone()))
    }
}
