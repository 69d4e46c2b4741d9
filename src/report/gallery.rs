//! The pictures of a report: which were drawn, why others were not, and how a page shows
//! them.

use crate::{
    disk::{DiskError, write_whole},
    untrusted,
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    io::Write as _,
    path::{Path, PathBuf},
};

/// Pictures by their place relative to the page.
#[derive(Debug)]
pub(super) struct Gallery {
    folder: PathBuf,
    embed: bool,
    drawn: BTreeSet<String>,
    /// Why there is no plot.
    missing: BTreeMap<String, String>,
}

impl Gallery {
    /// An empty gallery, in the page's folder. Where pictures are embedded the page holds
    /// their bytes.
    pub(super) fn new(folder: PathBuf, embed: bool) -> Self {
        Gallery { folder, embed, drawn: BTreeSet::new(), missing: BTreeMap::new() }
    }

    /// Where a picture is to be drawn, which counts as drawn from now on.
    pub(super) fn place(&mut self, picture: &str) -> PathBuf {
        self.drawn.insert(picture.to_owned());
        self.folder.join(picture)
    }

    /// Writes a plot, or keeps why there is none.
    pub(super) fn plot(&mut self, picture: &str, svg: Result<String, String>) -> Result<(), DiskError> {
        match svg {
            Ok(svg) => write_whole(&self.place(picture), |buffer| buffer.write_all(svg.as_bytes())),
            Err(why) => {
                self.missing.insert(picture.to_owned(), why);
                Ok(())
            }
        }
    }

    /// Moves all that was drawn into another folder of the same file system.
    pub(super) fn put_into(&self, folder: &Path) -> Result<(), DiskError> {
        for picture in &self.drawn {
            let to = folder.join(picture);
            let within = to.parent().unwrap_or(folder);
            fs::create_dir_all(within).map_err(DiskError::io(within, "create the folder"))?;
            fs::rename(self.folder.join(picture), &to).map_err(DiskError::io(&to, "rename the finished file"))?;
        }
        Ok(())
    }

    /// Whether the page holds its pictures.
    pub(super) fn embeds(&self) -> bool {
        self.embed
    }

    /// Why there is no such plot.
    pub(super) fn why(&self, picture: &str) -> Option<&str> {
        self.missing.get(picture).map(String::as_str)
    }

    /// What stands in a page for a picture: its place, percent-encoded, or itself as a
    /// data URI. None where it was not drawn.
    pub(super) fn link(&self, picture: &str) -> Result<Option<String>, DiskError> {
        if !self.drawn.contains(picture) {
            return Ok(None);
        }
        if !self.embed {
            return Ok(Some(untrusted::path(picture)));
        }
        let path = self.folder.join(picture);
        let bytes = fs::read(&path).map_err(DiskError::io(&path, "read the picture"))?;
        let kind = if picture.ends_with(".svg") { "svg+xml" } else { "png" };
        Ok(Some(format!("data:image/{kind};base64,{}", STANDARD.encode(bytes))))
    }
}
