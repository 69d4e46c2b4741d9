//! Images that a reviewer refused, so that the next one is told: `rejected.json` in the
//! store, beside the goldens and committed with them.

use super::{Notice, Store};
use crate::disk::{DiskError, read_text, write_whole};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::{fs, io, io::Write, path::PathBuf};

/// The file in the store.
const FILE: &str = "rejected.json";
/// Version of its format.
const VERSION: u32 = 1;
/// A file larger than this is none of ours.
const LARGEST: u64 = 16 << 20;

/// An image that was refused.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rejected {
    /// The case, `scene/estimator/renderer/rays`.
    pub case: String,
    /// Hash of the image's pixels.
    pub pixel_hash: String,
    /// Why it is wrong.
    pub reason: String,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    version: u32,
    rejected: Vec<Rejected>,
}

impl Store {
    fn rejections_path(&self) -> PathBuf {
        self.folder().join(FILE)
    }

    /// All images that were refused, in the order of their cases.
    ///
    /// # Errors
    /// Where `rejected.json` cannot be read or is not what it should be.
    pub fn rejections(&self) -> Result<Vec<Rejected>, DiskError> {
        let path = self.rejections_path();
        match fs::metadata(&path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            meta => {
                if meta.map_err(DiskError::io(&path, "read what was rejected"))?.len() > LARGEST {
                    return Err(DiskError::content(&path, "this is no list of rejected images: it is too large"));
                }
            }
        }
        let broken = |e: serde_json::Error| DiskError::content(&path, format!("not a list of rejected images: {e}"));
        let file: File = serde_json::from_str(&read_text(&path)?).map_err(broken)?;
        if file.version != VERSION {
            let why = format!("version is {}; this aogauge reads version {VERSION}", file.version);
            return Err(DiskError::content(&path, why));
        }
        Ok(file.rejected)
    }

    /// Keeps that an image was refused. The goldens stay as they are. `told` as in
    /// [`Store::change`].
    ///
    /// # Errors
    /// Where the list cannot be read or written.
    pub fn reject(&self, rejected: &Rejected, told: &dyn Fn(Notice)) -> Result<(), DiskError> {
        self.change_rejections(told, |all| {
            all.retain(|r| !(r.case == rejected.case && r.pixel_hash == rejected.pixel_hash));
            all.push(rejected.clone());
        })
    }

    /// Forgets what was refused of a case whose image was approved.
    pub(super) fn forget_rejections(&self, cases: &[String], told: &dyn Fn(Notice)) -> Result<(), DiskError> {
        if self.rejections()?.iter().any(|r| cases.contains(&r.case)) {
            self.change_rejections(told, |all| all.retain(|r| !cases.contains(&r.case)))?;
        }
        Ok(())
    }

    fn change_rejections(&self, told: &dyn Fn(Notice), edit: impl FnOnce(&mut Vec<Rejected>)) -> Result<(), DiskError> {
        // Dropped uncommitted: it is here for its lock.
        let _change = self.change(told)?;
        let mut rejected = self.rejections()?;
        edit(&mut rejected);
        rejected.sort_by(|a, b| (&a.case, &a.pixel_hash).cmp(&(&b.case, &b.pixel_hash)));
        let path = self.rejections_path();
        let text = serde_json::to_string_pretty(&File { version: VERSION, rejected })
            .map_err(|e| DiskError::content(&path, e.to_string()))?;
        write_whole(&path, |buffer| writeln!(buffer, "{text}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rejected(case: &str, hash: &str, reason: &str) -> Rejected {
        Rejected { case: case.into(), pixel_hash: hash.into(), reason: reason.into() }
    }

    #[test]
    fn a_refusal_is_kept_until_the_case_is_approved() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::new(dir.path());
        assert_eq!(store.rejections().unwrap(), []);
        store.reject(&rejected("b/x/cpu/4", "1", "too dark"), &|_| ()).unwrap();
        store.reject(&rejected("a/x/cpu/4", "2", "NaN | <b>"), &|_| ()).unwrap();
        store.reject(&rejected("b/x/cpu/4", "1", "far too dark"), &|_| ()).unwrap();
        let expected = [rejected("a/x/cpu/4", "2", "NaN | <b>"), rejected("b/x/cpu/4", "1", "far too dark")];
        assert_eq!(store.rejections().unwrap(), expected);
        store.forget_rejections(&["b/x/cpu/4".to_owned()], &|_| ()).unwrap();
        assert_eq!(store.rejections().unwrap(), expected[..1]);
        for text in ["", "{}", r#"{"version":2,"rejected":[]}"#, r#"{"version":1,"rejected":[{"case":1}]}"#] {
            fs::write(dir.path().join(FILE), text).unwrap();
            assert!(store.rejections().unwrap_err().to_string().contains(FILE), "{text}");
        }
    }
}
