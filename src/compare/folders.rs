//! Folders of images: which image belongs to which.

use super::CompareError;
use crate::picture::read::has_image_extension;
use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

/// How deep folders may lie in each other.
const MAX_DEPTH: usize = 64;

/// The images of two folders by their path within the folder, with `/` between
/// names, sorted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pairing {
    /// In both.
    pub both: Vec<String>,
    /// In the reference alone.
    pub missing: Vec<String>,
    /// In the test folder alone.
    pub new: Vec<String>,
    /// Files that are no images by their extension, and links that lead out of the
    /// folder or to a folder: left out, counted over both.
    pub left_out: usize,
}

impl Pairing {
    /// Looks through two folders and all folders within. A link to a file within the
    /// same folder is followed; one that leads out of it, or to a folder, is not.
    ///
    /// # Errors
    /// Where a folder cannot be read, is a record, or lies deeper than 64, and where the name of an image is not UTF-8.
    pub fn of(reference: &Path, test: &Path) -> Result<Self, CompareError> {
        let (mut left_out, mut images) = (0, Vec::new());
        for folder in [reference, test] {
            refuse_record(folder)?;
            let root = fs::canonicalize(folder).map_err(|e| unreadable(folder, e))?;
            let mut found = BTreeSet::new();
            walk(&root, &root, 0, &mut found, &mut left_out)?;
            images.push(found);
        }
        let [ours, theirs] = [&images[0], &images[1]];
        let list = |set: &mut dyn Iterator<Item = &String>| set.cloned().collect();
        Ok(Pairing {
            both: list(&mut ours.intersection(theirs)),
            missing: list(&mut ours.difference(theirs)),
            new: list(&mut theirs.difference(ours)),
            left_out,
        })
    }
}

/// A record is compared as a record, which knows its cases and replicates.
pub(super) fn refuse_record(folder: &Path) -> Result<(), CompareError> {
    if folder.join("record.json").is_file() {
        return Err(CompareError::Record { folder: folder.to_owned() });
    }
    Ok(())
}

fn unreadable(folder: &Path, source: std::io::Error) -> CompareError {
    crate::disk::DiskError::io(folder, "read the folder")(source).into()
}

fn walk(
    root: &Path,
    folder: &Path,
    depth: usize,
    found: &mut BTreeSet<String>,
    left_out: &mut usize,
) -> Result<(), CompareError> {
    if depth > MAX_DEPTH {
        return Err(CompareError::Deep { folder: folder.to_owned(), most: MAX_DEPTH });
    }
    for entry in fs::read_dir(folder).map_err(|e| unreadable(folder, e))? {
        let entry = entry.map_err(|e| unreadable(folder, e))?;
        let path = entry.path();
        let kind = entry.file_type().map_err(|e| unreadable(&path, e))?;
        if kind.is_dir() {
            walk(root, &path, depth + 1, found, left_out)?;
        } else if has_image_extension(&path) && (kind.is_file() || kind.is_symlink() && is_file_within(root, &path)) {
            let name = relative(root, &path).ok_or_else(|| CompareError::Name { file: path.clone() })?;
            found.insert(name);
        } else {
            *left_out += 1;
        }
    }
    Ok(())
}

fn is_file_within(root: &Path, link: &Path) -> bool {
    fs::canonicalize(link).is_ok_and(|target: PathBuf| target.starts_with(root) && target.is_file())
}

/// None where a name on the way is no text.
fn relative(root: &Path, path: &Path) -> Option<String> {
    let within = path.strip_prefix(root).unwrap_or(path);
    let names: Option<Vec<&str>> = within.components().map(|c| c.as_os_str().to_str()).collect();
    Some(names?.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_matched_by_relative_path() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|n| folder.path().join(n));
        for file in ["a/x.png", "a/sub/y.EXR", "a/gone.jpg", "a/notes.txt", "b/x.png", "b/sub/y.EXR", "b/sub/new.hdr"] {
            let path = folder.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "x").unwrap();
        }
        #[cfg(unix)]
        {
            use std::os::unix::fs::symlink;
            symlink(b.join("x.png"), a.join("out.png")).unwrap();
            symlink(a.join("x.png"), a.join("within.png")).unwrap();
            symlink(&a, a.join("sub/round")).unwrap();
            symlink(a.join("nowhere"), a.join("dangling.png")).unwrap();
            fs::write(b.join("within.png"), "x").unwrap();
        }
        let found = Pairing::of(&a, &b).unwrap();
        #[cfg(unix)]
        assert_eq!((found.both, found.left_out), (vec!["sub/y.EXR".into(), "within.png".into(), "x.png".into()], 4));
        assert_eq!((found.missing, found.new), (vec!["gone.jpg".into()], vec!["sub/new.hdr".into()]));
        #[cfg(target_os = "linux")]
        {
            use std::{ffi::OsStr, os::unix::ffi::OsStrExt};
            let odd = a.join(OsStr::from_bytes(b"\xe9"));
            fs::create_dir(&odd).unwrap();
            fs::write(odd.join("notes.txt"), "x").unwrap();
            assert!(Pairing::of(&a, &b).is_ok());
            fs::write(odd.join("x.png"), "x").unwrap();
            let told = Pairing::of(&a, &b).unwrap_err().to_string();
            assert!(told.contains("\\xE9/x.png") && told.contains("not UTF-8"), "{told}");
            fs::remove_file(odd.join("x.png")).unwrap();
        }
        fs::write(b.join("record.json"), "{}").unwrap();
        assert!(Pairing::of(&a, &b).unwrap_err().to_string().contains("is a record"));
    }
}
