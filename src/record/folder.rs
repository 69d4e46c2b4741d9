//! The folder of a record, while a run fills it.

use super::{BEGUN, FILE, Record};
use crate::disk::{DiskError, write_whole};
use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// A folder that a run fills.
#[derive(Debug)]
pub struct RecordFolder {
    path: PathBuf,
}

impl RecordFolder {
    /// Makes an empty folder for a record. A record of that name is moved aside to
    /// `NAME.previous` first, what a killed run left is removed; any other folder
    /// that is not empty is refused.
    ///
    /// # Errors
    /// Where the folder cannot be written, or holds something else.
    pub fn create(path: &Path) -> Result<Self, DiskError> {
        // Without a slash at its end, so that a name can be appended.
        let path = &path.components().collect::<PathBuf>();
        if path.file_name().is_none() {
            return Err(DiskError::content(path, "name a folder for the record, not one that holds others"));
        }
        let occupied = match fs::read_dir(path) {
            Ok(mut entries) => entries.next().is_some(),
            Err(e) if e.kind() == io::ErrorKind::NotFound => false,
            Err(e) => return Err(DiskError::io(path, "use this as the output folder")(e)),
        };
        if occupied {
            if !path.join(FILE).exists() && !path.join(BEGUN).exists() {
                return Err(DiskError::content(
                    path,
                    "the output folder holds files that are not a record: name another folder",
                ));
            }
            if path.join(FILE).exists() {
                move_aside(path)?;
            } else {
                // What a killed run left is worth less than the record before it.
                fs::remove_dir_all(path).map_err(DiskError::io(path, "remove what an unfinished run left"))?;
            }
        }
        fs::create_dir_all(path).map_err(DiskError::io(path, "create the output folder"))?;
        write_whole(&path.join(BEGUN), |_| Ok(()))?;
        Ok(RecordFolder { path: path.to_owned() })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes `record.json`, which makes the folder a record.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn commit(&self, record: &Record) -> Result<(), DiskError> {
        let path = self.path.join(FILE);
        let unfit = |e: serde_json::Error| DiskError::content(&path, format!("the record cannot be written: {e}"));
        let text = serde_json::to_string_pretty(record).map_err(unfit)?;
        // JSON has no NaN and no infinity: what could not be read must not look whole.
        serde_json::from_str::<Record>(&text).map_err(unfit)?;
        write_whole(&path, |buffer| io::Write::write_all(buffer, format!("{text}\n").as_bytes()))?;
        let begun = self.path.join(BEGUN);
        fs::remove_file(&begun).map_err(DiskError::io(&begun, "remove the mark of a running run"))
    }
}

/// Moves a record to `NAME.previous`, in place of the record before.
fn move_aside(path: &Path) -> Result<(), DiskError> {
    let mut aside = path.as_os_str().to_owned();
    aside.push(".previous");
    let aside = PathBuf::from(aside);
    if aside.exists() {
        if !aside.join(FILE).exists() && !aside.join(BEGUN).exists() {
            return Err(DiskError::content(
                &aside,
                "the older record cannot be moved here: the folder holds something else",
            ));
        }
        fs::remove_dir_all(&aside).map_err(DiskError::io(&aside, "remove the record before last"))?;
    }
    fs::rename(path, &aside).map_err(DiskError::io(path, "move the older record aside"))
}
