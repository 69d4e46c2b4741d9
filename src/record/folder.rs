//! The folder of a record, while a run fills it.

use super::{BEGUN, FILE, Record};
use crate::disk::{DiskError, is_part, parse_json, read_text, write_whole};
use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// In [`BEGUN`]: what is run, so that the same can go on.
const PLAN: &str = "plan.txt";

/// In [`BEGUN`]: held by the run that fills the folder.
const LOCK: &str = "lock";

/// A folder that a run fills. Until the run is done it holds the folder `.aogauge-run`:
/// what the run is of, a line for every unit that is done, and working images.
#[derive(Debug)]
pub struct RecordFolder {
    path: PathBuf,
    /// Whether an unfinished run of the same plan had begun to fill it.
    resumed: bool,
    /// Where the record or shard went that was here.
    moved: Option<PathBuf>,
    /// Held while it is filled; the system lets go of it if the run is killed.
    _lock: fs::File,
}

impl RecordFolder {
    /// Makes an empty folder for a record. A record of that name, or a finished shard, is
    /// moved aside to `NAME.previous` first. What a killed run left is removed, unless there are
    /// files among it that no run writes; such a folder is refused, and any other that is not empty.
    ///
    /// # Errors
    /// Where the folder cannot be written, holds something else, or another run fills
    /// it right now.
    pub fn create(path: &Path) -> Result<Self, DiskError> {
        Self::open(path, None)
    }

    /// The same, but what an unfinished run of the same plan left is kept, so that only
    /// the rest needs to be done. `plan` is whatever decides what is rendered.
    ///
    /// # Errors
    /// As [`RecordFolder::create`].
    pub fn resume(path: &Path, plan: &str) -> Result<Self, DiskError> {
        Self::open(path, Some(plan))
    }

    fn open(path: &Path, plan: Option<&str>) -> Result<Self, DiskError> {
        // Without a slash at its end, so that a name can be appended.
        let path = &path.components().collect::<PathBuf>();
        if path.file_name().is_none() {
            return Err(DiskError::content(
                path,
                "the folder of a record is moved aside to NAME.previous by the next run, so it must be given by its name: name \
                 one, such as reports/latest",
            ));
        }
        let occupied = match fs::read_dir(path) {
            Ok(mut entries) => entries.next().is_some(),
            Err(e) if e.kind() == io::ErrorKind::NotFound => false,
            Err(e) => return Err(DiskError::io(path, "use this as the output folder")(e)),
        };
        let (mut resumed, mut moved) = (false, None);
        if occupied {
            let begun = path.join(BEGUN).exists();
            if !path.join(FILE).exists() && !path.join(super::SHARD).exists() && !begun {
                return Err(DiskError::content(
                    path,
                    "the output folder holds files that are not a record: name another folder",
                ));
            }
            if begun && path.join(BEGUN).join(LOCK).exists() {
                // Let go of at once: on some systems a folder with open files cannot be moved.
                lock(path)?;
            }
            resumed = begun && plan.is_some() && read_text(&path.join(BEGUN).join(PLAN)).ok().as_deref() == plan;
            if resumed {
                // What it says of units that were not done is about to be wrong.
                for stale in [FILE, super::SHARD] {
                    remove(&path.join(stale))?;
                }
                sweep(path)?;
            } else if path.join(FILE).exists() || path.join(super::SHARD).exists() {
                moved = Some(move_aside(path)?);
            } else {
                // What a killed run left is worth less than the record before it.
                if let Some(foreign) = foreign(path, path)? {
                    return Err(DiskError::content(
                        &foreign,
                        "no run writes this file, and it lies where an unfinished run would be removed: move it, or \
                         name another output folder",
                    ));
                }
                fs::remove_dir_all(path).map_err(DiskError::io(path, "remove what an unfinished run left"))?;
            }
        }
        let begun = path.join(BEGUN);
        fs::create_dir_all(&begun).map_err(DiskError::io(path, "create the output folder"))?;
        let lock = lock(path)?;
        if !resumed {
            write_whole(&begun.join(PLAN), |buffer| io::Write::write_all(buffer, plan.unwrap_or_default().as_bytes()))?;
        }
        Ok(RecordFolder { path: path.to_owned(), resumed, moved, _lock: lock })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether it goes on where an unfinished run of the same plan ended.
    pub fn is_resumed(&self) -> bool {
        self.resumed
    }

    /// Where the record or finished shard went that was here before.
    pub fn moved(&self) -> Option<&Path> {
        self.moved.as_deref()
    }

    /// The folder of what the run alone needs.
    pub(crate) fn work(&self) -> PathBuf {
        self.path.join(BEGUN)
    }

    /// A file of what the run alone needs, relative to the record.
    pub(crate) fn work_file(name: &str) -> PathBuf {
        Path::new(BEGUN).join(name)
    }

    /// Writes `record.json`, which makes the folder a record. What the run alone needed
    /// goes, unless the record is incomplete: the run can go on from it.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn commit(&self, record: &Record) -> Result<(), DiskError> {
        let path = self.path.join(FILE);
        let unfit = |e: String| DiskError::content(&path, format!("the record cannot be written: {e}"));
        let text = serde_json::to_string_pretty(record).map_err(|e| unfit(e.to_string()))?;
        // JSON has no NaN and no infinity: what could not be read must not look whole.
        parse_json::<Record>(&text).map_err(unfit)?;
        write_whole(&path, |buffer| io::Write::write_all(buffer, format!("{text}\n").as_bytes()))?;
        if record.incomplete.is_some() {
            return Ok(());
        }
        let begun = self.path.join(BEGUN);
        fs::remove_dir_all(&begun).map_err(DiskError::io(&begun, "remove what the run alone needed"))
    }
}

/// Takes the folder for one run.
fn lock(path: &Path) -> Result<fs::File, DiskError> {
    let file = path.join(BEGUN).join(LOCK);
    let opened = fs::File::options().create(true).append(true).open(&file);
    let opened = opened.map_err(DiskError::io(&file, "open the lock of the run"))?;
    match opened.try_lock() {
        Ok(()) => Ok(opened),
        Err(fs::TryLockError::WouldBlock) => Err(DiskError::content(
            path,
            "another run is writing into this folder: wait for it, or name another folder",
        )),
        // A file system without locks cannot tell; it is no reason not to run.
        Err(fs::TryLockError::Error(e)) if e.kind() == io::ErrorKind::Unsupported => Ok(opened),
        Err(fs::TryLockError::Error(e)) => Err(DiskError::io(&file, "lock the folder of the run")(e)),
    }
}

/// Removes what was being written when a run was killed.
fn sweep(folder: &Path) -> Result<(), DiskError> {
    let entries = fs::read_dir(folder).map_err(DiskError::io(folder, "list what an unfinished run left"))?;
    for entry in entries.flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        if entry.file_type().is_ok_and(|t| t.is_dir()) {
            sweep(&path)?;
        } else if is_part(&name.to_string_lossy()) {
            remove(&path)?;
        }
    }
    Ok(())
}

fn remove(file: &Path) -> Result<(), DiskError> {
    match fs::remove_file(file) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => {
            Err(DiskError::io(file, "remove what an unfinished run left")(e))
        }
        _ => Ok(()),
    }
}

/// A file in the folder of a run that no run writes.
fn foreign(folder: &Path, top: &Path) -> Result<Option<PathBuf>, DiskError> {
    let entries = fs::read_dir(folder).map_err(DiskError::io(folder, "list what an unfinished run left"))?;
    for entry in entries.flatten() {
        let path = entry.path();
        let relative = path.strip_prefix(top).unwrap_or(&path);
        if relative == Path::new(BEGUN) {
            continue;
        }
        let is_folder = entry.file_type().is_ok_and(|t| t.is_dir());
        let found = match is_folder && WRITTEN.iter().any(|(start, _)| relative.starts_with(start)) {
            true => foreign(&path, top)?,
            false => Some(path.clone()).filter(|_| is_folder || !is_written(relative)),
        };
        if found.is_some() {
            return Ok(found);
        }
    }
    Ok(None)
}

/// Folders that a run writes, and the ends of the names of their files.
const WRITTEN: [(&str, &[&str]); 3] =
    [("images", &["exr"]), (super::pictures::PICTURES, &["png", "svg"]), ("logs", &["log"])];

/// Files that a run writes beside them: the record or shard, and reports.
const FILES: [&str; 7] = [FILE, super::SHARD, "report.md", "report.html", "report.json", "junit.xml", "summary.md"];

/// Whether a run writes a file of this name, relative to the record.
fn is_written(file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let end = file.extension().unwrap_or_default().to_string_lossy();
    is_part(&name)
        || FILES.iter().any(|f| file == Path::new(f))
        || WRITTEN.iter().any(|(folder, ends)| file.starts_with(folder) && ends.contains(&end.as_ref()))
}

/// What is put behind the name of a folder that is moved aside.
const ASIDE: &str = ".previous";

/// Where a record or shard is moved aside to: `NAME.previous`.
pub(crate) fn aside(path: &Path) -> PathBuf {
    // Without a slash at its end.
    let mut aside = path.components().collect::<PathBuf>().into_os_string();
    aside.push(ASIDE);
    PathBuf::from(aside)
}

/// Whether a folder has the name of one that was moved aside.
pub(crate) fn is_aside(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(ASIDE))
}

/// Moves a record or shard to `NAME.previous`, in place of what was moved there before.
fn move_aside(path: &Path) -> Result<PathBuf, DiskError> {
    let aside = aside(path);
    if aside.exists() {
        if ![FILE, BEGUN, super::SHARD].iter().any(|mark| aside.join(mark).exists()) {
            return Err(DiskError::content(
                &aside,
                "the older record cannot be moved here: the folder holds something else",
            ));
        }
        fs::remove_dir_all(&aside).map_err(DiskError::io(&aside, "remove the record before last"))?;
    }
    fs::rename(path, &aside).map_err(DiskError::io(path, "move the older record aside"))?;
    Ok(aside)
}
