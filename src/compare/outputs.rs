//! That nothing is written over what is compared.

use super::{CompareError, Pairing, pictures};
use std::{
    collections::BTreeSet,
    fs,
    path::{Component, Path, PathBuf},
};

/// What a comparison reads.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// An image, or a folder of images.
    pub reference: &'a Path,
    /// Likewise.
    pub test: &'a Path,
    /// The mask, which may be a folder of masks.
    pub mask: Option<&'a Path>,
    /// The file of limits.
    pub limits: Option<&'a Path>,
}

/// What it is asked to write.
#[derive(Clone, Copy, Debug)]
pub struct Outputs<'a> {
    /// The folder for maps; of folders it holds one an image.
    pub maps: Option<&'a Path>,
    /// Whether maps lie in a folder a layer.
    pub by_layer: bool,
    /// The file for the difference.
    pub diff: Option<&'a Path>,
}

impl Outputs<'_> {
    /// Refuses to write over what is read, however it is spelled and whatever links lead there, and
    /// into a folder of references, where the next comparison would take maps for references.
    /// Inputs that cannot be found are left for the comparison to tell.
    ///
    /// # Errors
    /// Where an output is an input, or a folder of references cannot be looked through.
    pub fn check(&self, inputs: &Inputs<'_>) -> Result<(), CompareError> {
        if self.maps.is_none() && self.diff.is_none() {
            return Ok(());
        }
        let (read, names) = inputs.files()?;
        let refused = |option, file: &Path| {
            let over = read.contains(&resolved(file));
            if over { Err(CompareError::Overwrites { option, file: file.to_owned() }) } else { Ok(()) }
        };
        if let Some(file) = self.diff {
            refused("--diff", file)?;
        }
        let Some(maps) = self.maps else { return Ok(()) };
        if inputs.reference.is_dir() && resolved(maps).starts_with(resolved(inputs.reference)) {
            return Err(CompareError::IntoReferences { folder: maps.to_owned() });
        }
        for name in names {
            let folder =
                name.split('/').fold(maps.to_owned(), |at, part| if part.is_empty() { at } else { at.join(part) });
            refused("--maps", &folder)?;
            for folder in self.folders(folder) {
                pictures::FILES.iter().try_for_each(|file| refused("--maps", &folder.join(file)))?;
            }
        }
        Ok(())
    }

    /// The folder of a pair, and where they lie by layer those in it that are there.
    fn folders(&self, folder: PathBuf) -> Vec<PathBuf> {
        let within = self.by_layer.then(|| fs::read_dir(&folder).ok()).flatten();
        let within = within.into_iter().flatten().flatten().map(|entry| entry.path()).filter(|path| path.is_dir());
        let mut folders: Vec<_> = within.collect();
        folders.push(folder);
        folders
    }
}

impl Inputs<'_> {
    /// All files that are read, and the paths of the pairs within two folders; one empty path of two files.
    fn files(&self) -> Result<(BTreeSet<PathBuf>, Vec<String>), CompareError> {
        let [reference, test] = [self.reference, self.test];
        let mut read: BTreeSet<_> =
            [Some(reference), Some(test), self.mask, self.limits].into_iter().flatten().map(resolved).collect();
        if !(reference.is_dir() && test.is_dir()) {
            return Ok((read, vec![String::new()]));
        }
        let pairing = Pairing::of(reference, test)?;
        for name in &pairing.both {
            let of_both = [Some(reference), Some(test), self.mask].into_iter().flatten();
            read.extend(of_both.map(|folder| resolved(&folder.join(name))));
        }
        read.extend(pairing.missing.iter().map(|name| resolved(&reference.join(name))));
        read.extend(pairing.new.iter().map(|name| resolved(&test.join(name))));
        Ok((read, pairing.both))
    }
}

/// Where a path leads, links followed, whether or not anything is there.
fn resolved(path: &Path) -> PathBuf {
    let here = if path.is_absolute() { None } else { std::env::current_dir().and_then(fs::canonicalize).ok() };
    let mut at = here.unwrap_or_default();
    for part in path.components() {
        match part {
            Component::CurDir => continue,
            // Not of the text: a link may have led elsewhere.
            Component::ParentDir => {
                at.pop();
            }
            part => at.push(part),
        }
        if let Ok(real) = fs::canonicalize(&at) {
            at = real;
        }
    }
    at
}
