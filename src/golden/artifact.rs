//! Records inside the zip files that CI keeps as artifacts.

use crate::{
    disk::{DiskError, write_whole},
    record::{self, Record},
};
use std::{
    collections::BTreeSet,
    fs::File,
    io::{self, BufReader, Read, Write},
    path::{Path, PathBuf},
};
use tempfile::TempDir;
use zip::ZipArchive;

/// More entries than this are no artifact of ours.
const MOST_ENTRIES: usize = 100_000;
/// Bytes of a `record.json`.
const LARGEST_RECORD: u64 = 64 << 20;
/// Bytes of one image, and of all of them.
const LARGEST_IMAGE: u64 = 2 << 30;
const LARGEST_TOTAL: u64 = 8 << 30;
/// Images are compressed already. Beyond the first MiB, more bytes than this for a byte
/// of archive are no image.
const MAX_RATIO: u64 = 100;

/// What is taken out of an archive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    /// What goldens are made of and held against.
    Goldens,
    /// What a review shows, too.
    Review,
}

/// A record's folder, or a copy of what goldens need out of an archive.
#[derive(Debug)]
pub struct Candidates {
    folder: PathBuf,
    /// Removed when dropped.
    _unpacked: Option<TempDir>,
}

impl Candidates {
    /// A record by its folder or a zip file that holds one, at its top or in a folder.
    /// Of an archive only the record's own files are read, by the names the record
    /// gives; no name in the archive becomes a path here. Those are the images of cases, and of
    /// scenes for their regions.
    ///
    /// # Errors
    /// Where there is no such file, it is no zip file or holds no record or several,
    /// lacks one of these files, or holds more than a record can.
    pub fn open(path: &Path) -> Result<Self, DiskError> {
        Self::with(path, Wanted::Goldens)
    }

    /// The same with what is shown beside images that are looked at: the judge's images and those of look views. An
    /// archive may lack them.
    ///
    /// # Errors
    /// As [`Candidates::open`].
    pub fn open_for_review(path: &Path) -> Result<Self, DiskError> {
        Self::with(path, Wanted::Review)
    }

    fn with(path: &Path, wanted: Wanted) -> Result<Self, DiskError> {
        if !path.is_file() {
            return Ok(Candidates { folder: path.to_owned(), _unpacked: None });
        }
        let unpacked = tempfile::Builder::new()
            .prefix("aogauge-record-")
            .tempdir()
            .map_err(DiskError::io(&std::env::temp_dir(), "make a temporary folder"))?;
        unpack(path, unpacked.path(), wanted)?;
        Ok(Candidates { folder: unpacked.path().to_owned(), _unpacked: Some(unpacked) })
    }

    /// Whether this is a folder or begins as a zip file does: a record, if it is anything
    /// here, and no suite file.
    pub fn is_one(path: &Path) -> bool {
        let mut begin = [0; 2];
        path.is_dir() || File::open(path).and_then(|mut f| f.read_exact(&mut begin)).is_ok() && begin == *b"PK"
    }

    /// The record's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}

fn unpack(path: &Path, folder: &Path, wanted: Wanted) -> Result<(), DiskError> {
    let file = File::open(path).map_err(DiskError::io(path, "read the archive"))?;
    let archive = ZipArchive::new(BufReader::new(file))
        .map_err(|e| DiskError::content(path, format!("neither a record's folder nor a readable zip file: {e}")))?;
    if archive.len() > MOST_ENTRIES {
        return Err(DiskError::content(
            path,
            format!("the archive has {} entries, more than {MOST_ENTRIES}", archive.len()),
        ));
    }
    let prefix = prefix(path, &archive)?;
    let mut from = Unpacking { path, archive, prefix, folder, total: 0 };
    from.take(record::FILE, LARGEST_RECORD, u64::MAX)?;
    // It refuses paths that lead out of the folder.
    let record = Record::read(folder)?;
    let of_cases = record.cases.iter().filter_map(|c| c.image.as_deref());
    let mut files: BTreeSet<&str> = of_cases.chain(record.scenes.iter().map(|s| s.image.as_str())).collect();
    if wanted == Wanted::Review {
        let judged = record.scenes.iter().filter_map(|s| Some(s.judge.as_ref()?.image.as_str()));
        let beside = judged.chain(record.scenes.iter().map(|s| s.look.as_str()));
        files.extend(beside.filter(|name| from.holds(name)));
    }
    files.into_iter().try_for_each(|name| from.take(name, LARGEST_IMAGE, MAX_RATIO))
}

/// An archive, and the folder that the record's files are copied to.
struct Unpacking<'a> {
    path: &'a Path,
    archive: ZipArchive<BufReader<File>>,
    /// What stands before the names of the record's files.
    prefix: String,
    folder: &'a Path,
    /// Bytes copied so far.
    total: u64,
}

impl Unpacking<'_> {
    fn holds(&self, name: &str) -> bool {
        self.archive.index_for_name(&format!("{}{name}", self.prefix)).is_some()
    }

    /// Copies a file of the record: at most `most` bytes, and beyond the first MiB `ratio` for a byte of archive.
    fn take(&mut self, name: &str, most: u64, ratio: u64) -> Result<(), DiskError> {
        let full = format!("{}{name}", self.prefix);
        let mut entry = self
            .archive
            .by_name(&full)
            .map_err(|e| DiskError::content(self.path, format!("cannot read '{full}': {e}")))?;
        let most = most.min(entry.compressed_size().saturating_mul(ratio).saturating_add(1 << 20));
        let most = most.min(LARGEST_TOTAL - self.total);
        self.total += copy(&mut entry, &self.folder.join(name), most)
            .map_err(|e| DiskError::content(self.path, format!("cannot unpack '{full}': {e}")))?;
        Ok(())
    }
}

/// What stands before the names of the record's files.
fn prefix(path: &Path, archive: &ZipArchive<BufReader<File>>) -> Result<String, DiskError> {
    let found: Vec<String> = archive
        .file_names()
        // A name that is no text is none of ours.
        .filter_map(Result::ok)
        .filter_map(|name| Some(name.strip_suffix(record::FILE)?.to_owned()))
        .filter(|folder| folder.is_empty() || folder.ends_with('/'))
        .collect();
    match found.as_slice() {
        [one] => Ok(one.clone()),
        [] => Err(DiskError::content(path, format!("the archive holds no {}: it is no record", record::FILE))),
        several => {
            let mut several = several.to_vec();
            several.sort_unstable();
            several.truncate(8);
            Err(DiskError::content(
                path,
                format!("the archive holds several records, unpack the one you mean: '{}'", several.join("', '")),
            ))
        }
    }
}

/// Copies at most `most` bytes, whatever the entry claims to hold.
fn copy(entry: &mut impl Read, to: &Path, most: u64) -> Result<u64, String> {
    let mut copied = 0;
    let mut large = false;
    let mut limited = entry.take(most.saturating_add(1));
    write_whole(to, |buffer| {
        copied = io::copy(&mut limited, buffer)?;
        large = copied > most;
        if large { Err(io::ErrorKind::FileTooLarge.into()) } else { buffer.flush() }
    })
    .map_err(|e| if large { format!("it holds more than {most} bytes, more than it may") } else { e.to_string() })?;
    Ok(copied)
}
