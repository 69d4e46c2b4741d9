//! The folder of goldens: `SCENE/ESTIMATOR.RAYS.exr`, and `SCENE/ESTIMATOR.RAYS.NAME.exr`
//! for others of the same case.

use super::{
    Golden,
    change::{self, Change, Notice, Overlay},
};
use crate::{
    disk::DiskError,
    record::{CaseRecord, Record},
    scenes::check_name,
};
use schemars::JsonSchema;
use serde::Serialize;
use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

/// A folder of goldens.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

/// What a golden's file is called after.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
pub struct Slot {
    /// The scene.
    pub scene: String,
    /// The estimator.
    pub estimator: String,
    /// Primary rays a pixel.
    pub rays: u32,
    /// Which of several of one case; None for the first.
    pub name: Option<String>,
}

/// The files of a store at one moment, whole: before an approval or after it.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// Where each golden can be read, by what it is called after.
    pub files: BTreeMap<Slot, PathBuf>,
    /// Whether an approval was cut short after its decision. The snapshot shows it as
    /// done; the next change of the store finishes it.
    pub interrupted: bool,
}

/// A golden of a store, or why it cannot be read.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Entry {
    /// What its file is called after.
    #[serde(flatten)]
    pub slot: Slot,
    /// Its file.
    pub file: PathBuf,
    /// Bytes on disk.
    pub bytes: u64,
    /// What it says of itself; null where it cannot be read.
    pub golden: Option<About>,
    /// Why it cannot be read; null where it can.
    pub unreadable: Option<String>,
}

/// What a golden says of itself.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct About {
    /// What it is an image of.
    #[serde(flatten)]
    pub identity: super::Identity,
    /// Where it comes from.
    #[serde(flatten)]
    pub provenance: super::Provenance,
    /// Limits given at approval.
    pub tolerance: Option<String>,
}

impl Slot {
    /// The slot of a case's first golden.
    pub fn of(case: &CaseRecord) -> Slot {
        let case = &case.case;
        Slot { scene: case.scene.clone(), estimator: case.estimator.clone(), rays: case.rays, name: None }
    }

    /// Whether both are of one case.
    pub fn is_beside(&self, other: &Slot) -> bool {
        self.scene == other.scene && self.estimator == other.estimator && self.rays == other.rays
    }

    /// The file, relative to the store.
    pub fn path(&self) -> PathBuf {
        let name = self.name.as_ref().map_or_else(String::new, |n| format!(".{n}"));
        Path::new(&self.scene).join(format!("{}.{}{name}.exr", self.estimator, self.rays))
    }

    /// The golden whose file is `SCENE/FILE` in a store; None where that is no golden's.
    pub fn of_path(path: &Path) -> Option<Slot> {
        let mut parts = path.iter().map(|part| part.to_str());
        let (scene, file) = (parts.next()??, parts.next()??);
        if parts.next().is_some() { None } else { Slot::parse(scene, file) }
    }

    /// What a file is called after; None for files that are no goldens. Estimators may
    /// hold dots; a name holds none, and something besides digits, so nothing has two
    /// readings.
    fn parse(scene: &str, file: &str) -> Option<Slot> {
        let (head, last) = file.strip_suffix(".exr")?.rsplit_once('.')?;
        let (head, rays, name) = match last.parse::<u32>() {
            Ok(rays) => (head, rays, None),
            Err(_) => {
                let (head, rays) = head.rsplit_once('.')?;
                (head, rays.parse().ok()?, Some(last.to_owned()))
            }
        };
        let legal = check_name(scene).is_ok() && check_name(head).is_ok();
        legal.then(|| Slot { scene: scene.to_owned(), estimator: head.to_owned(), rays, name })
    }
}

/// Whether a golden may be called so, beside others of its case.
///
/// # Errors
/// One sentence that says what a name may hold.
pub fn check_golden_name(name: &str) -> Result<(), String> {
    check_name(name)?;
    if name.contains('.') || name.bytes().all(|b| b.is_ascii_digit()) {
        return Err(format!(
            "'{name}' is no name for a golden: use letters, digits, '-' and '_', not digits alone; it stands before '.exr'"
        ));
    }
    Ok(())
}

impl Store {
    /// The goldens in a folder, which need not exist yet.
    pub fn new(folder: &Path) -> Self {
        Store { folder: folder.to_owned() }
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The file of a golden.
    pub fn path(&self, slot: &Slot) -> PathBuf {
        self.folder.join(slot.path())
    }

    /// Reads the store while no approval changes it, and writes nothing. `read` may be
    /// called twice: where an approval began that this could not know of.
    ///
    /// # Errors
    /// Where the store cannot be listed or locked.
    pub fn reading<T>(&self, read: impl Fn(&Snapshot) -> T) -> Result<T, DiskError> {
        loop {
            let lock = change::lock_to_read(&self.folder)?;
            let result = read(&self.snapshot()?);
            // The lock's file is made by the first change and never removed.
            if lock.is_some() || !change::has_lock(&self.folder) {
                return Ok(result);
            }
        }
    }

    /// Begins a change. Waits while others read or change the store, and says so by
    /// `told` where that takes more than a second. Finishes first what a killed change
    /// had decided, and says that too.
    ///
    /// # Errors
    /// Where the store cannot be written or locked.
    pub fn change(&self, told: &dyn Fn(Notice)) -> Result<Change, DiskError> {
        Change::begin(&self.folder, told)
    }

    /// The files as they are now: whole only while a lock is held.
    pub(super) fn snapshot(&self) -> Result<Snapshot, DiskError> {
        let mut files = BTreeMap::new();
        for (scene, path) in entries(&self.folder)? {
            if scene.starts_with('.') || !path.is_dir() {
                continue;
            }
            for (file, path) in entries(&path)? {
                if let Some(slot) = Slot::parse(&scene, &file) {
                    files.insert(slot, path);
                }
            }
        }
        let overlay = Overlay::read(&self.folder)?;
        for removed in &overlay.removed {
            files.retain(|slot, _| slot.path() != *removed);
        }
        for (to, from) in &overlay.moved {
            let scene = to.parent().map(|p| p.to_string_lossy().into_owned()).unwrap_or_default();
            let file = to.file_name().map(|f| f.to_string_lossy().into_owned()).unwrap_or_default();
            if let Some(slot) = Slot::parse(&scene, &file) {
                files.insert(slot, from.clone());
            }
        }
        Ok(Snapshot { files, interrupted: overlay.interrupted })
    }

    /// Whether a change was cut short after its decision, which the next one finishes.
    ///
    /// # Errors
    /// Where the store cannot be listed.
    pub fn is_interrupted(&self) -> Result<bool, DiskError> {
        self.reading(|snapshot| snapshot.interrupted)
    }

    /// Every golden with its provenance, in order.
    ///
    /// # Errors
    /// Where the store cannot be listed; goldens that cannot be read are entries.
    pub fn entries(&self) -> Result<Vec<Entry>, DiskError> {
        self.reading(|snapshot| {
            let about = |g: Golden| About {
                identity: g.identity,
                provenance: g.provenance,
                tolerance: g.limits.map(|l| l.to_string()),
            };
            let entry = |(slot, path): (&Slot, &PathBuf)| {
                let (golden, unreadable) = match Golden::read(path) {
                    Ok(golden) => (Some(about(golden)), None),
                    Err(e) => (None, Some(e.to_string())),
                };
                let bytes = fs::metadata(path).map_or(0, |m| m.len());
                Entry { slot: slot.clone(), file: self.path(slot), bytes, golden, unreadable }
            };
            snapshot.files.iter().map(entry).collect()
        })
    }

    /// Bytes of each scene's goldens.
    ///
    /// # Errors
    /// Where the store cannot be listed.
    pub fn sizes(&self) -> Result<BTreeMap<String, u64>, DiskError> {
        self.reading(|snapshot| {
            let mut sizes = BTreeMap::new();
            for (slot, path) in &snapshot.files {
                *sizes.entry(slot.scene.clone()).or_insert(0) += fs::metadata(path).map_or(0, |m| m.len());
            }
            sizes
        })
    }
}

/// Names and paths in a folder; none where it does not exist.
fn entries(folder: &Path) -> Result<Vec<(String, PathBuf)>, DiskError> {
    let read = match fs::read_dir(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        read => read.map_err(DiskError::io(folder, "list the goldens"))?,
    };
    let mut found = Vec::new();
    for entry in read {
        let path = entry.map_err(DiskError::io(folder, "list the goldens"))?.path();
        if let Some(name) = path.file_name().and_then(|n| n.to_str()) {
            found.push((name.to_owned(), path.clone()));
        }
    }
    Ok(found)
}

/// The cases of a record that goldens are kept of, lost ones included.
pub fn golden_cases(record: &Record) -> impl Iterator<Item = &CaseRecord> {
    record.cases.iter().filter(|c| record.suite.golden_rays == Some(c.case.rays))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_have_one_reading() {
        let slot = |estimator: &str, rays, name: Option<&str>| Slot {
            scene: "s".into(),
            estimator: estimator.into(),
            rays,
            name: name.map(str::to_owned),
        };
        for s in
            [slot("classic", 32, None), slot("a.32", 4, None), slot("a.b", 4, Some("mesa-25")), slot("a.4.x", 8, None)]
        {
            let path = s.path();
            assert_eq!(Slot::parse("s", path.file_name().unwrap().to_str().unwrap()), Some(s));
        }
        for no in ["classic.exr", "classic.32.png", ".exr", "classic.x.exr", "-.-", "a b.4.exr"] {
            assert_eq!(Slot::parse("s", no), None, "{no}");
        }
        assert_eq!(Slot::parse(".approval", "a.4.exr"), None);
        for bad in ["2", "a.b", "", "../x", ".a", "a/b"] {
            assert!(check_golden_name(bad).is_err(), "{bad}");
        }
        assert!(check_golden_name("mesa-25_1").is_ok());
    }
}
