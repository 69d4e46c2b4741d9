//! Files that are whole or not there at all: writes go to a temporary name in the
//! same folder, then are renamed.

use crate::untrusted::{cut, line};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::{
    fs,
    io::{self, BufWriter, Read, Write},
    path::{Path, PathBuf},
};

/// A file or folder that could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum DiskError {
    /// The system refused.
    #[error("{path}: cannot {action}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// Why not.
        source: io::Error,
    },
    /// The content is not what it should be.
    #[error("{path}: {message}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
}

impl DiskError {
    /// Wraps an error of the system.
    pub fn io(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> DiskError {
        let path = path.to_owned();
        move |source| DiskError::Io { path, action, source }
    }

    /// Says what is wrong with a file.
    pub fn content(path: &Path, message: impl Into<String>) -> DiskError {
        DiskError::Content { path: path.to_owned(), message: message.into() }
    }
}

/// Creates the file's folder, writes the file under a temporary name, syncs it
/// and renames it.
///
/// # Errors
/// Where the folder cannot be made, or the file cannot be written or renamed.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut fs::File>) -> io::Result<()>,
) -> Result<(), DiskError> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(DiskError::io(folder, "create the folder"))?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(PART[0]).suffix(PART[1]);
    // The temporary file's own mode is private; a record is meant to be shared.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644));
    let mut file = builder.tempfile_in(folder).map_err(DiskError::io(folder, "write into the folder"))?;
    let mut buffer = BufWriter::new(file.as_file_mut());
    write(&mut buffer).and_then(|()| buffer.flush()).map_err(DiskError::io(path, "write the file"))?;
    drop(buffer);
    file.as_file().sync_all().map_err(DiskError::io(path, "write the file"))?;
    file.persist(path).map_err(|e| DiskError::io(path, "rename the finished file")(e.error))?;
    Ok(())
}

/// How temporary names begin and end.
const PART: [&str; 2] = [".aogauge-", ".part"];

/// A folder within another for what is moved there once all of it is written; it goes when it is dropped.
///
/// # Errors
/// Where it cannot be made.
pub(crate) fn part_folder(folder: &Path) -> Result<tempfile::TempDir, DiskError> {
    let made = tempfile::Builder::new().prefix(PART[0]).suffix(PART[1]).tempdir_in(folder);
    made.map_err(DiskError::io(folder, "write into the folder"))
}

/// Whether a file is one that [`write_whole`] was writing when it was killed.
pub fn is_part(name: &str) -> bool {
    name.starts_with(PART[0]) && name.ends_with(PART[1])
}

/// Of a file that a command may have written, where its marks must stand: so many bytes from its beginning.
const MARKED: u64 = 1 << 16;

/// Refuses to write over what others wrote, under names that a command chose itself: files or folders of `names`
/// may be in the folder only where its file `page` is one that `by` wrote, whose beginning holds all of `marks`.
/// `by` is such as "report of aogauge".
///
/// # Errors
/// Where one is there and `page` is not such a file; the message says that nothing is written.
pub(crate) fn refuse_foreign<Name: AsRef<str>>(
    folder: &Path,
    page: &str,
    marks: &[&str],
    names: impl IntoIterator<Item = Name>,
    by: &str,
) -> Result<(), DiskError> {
    let mut text = Vec::new();
    let read = fs::File::open(folder.join(page)).and_then(|file| file.take(MARKED).read_to_end(&mut text));
    let text = String::from_utf8_lossy(&text);
    if read.is_ok() && marks.iter().all(|mark| text.contains(mark)) {
        return Ok(());
    }
    // A link that leads nowhere is somebody's too.
    let there = |path: &PathBuf| fs::symlink_metadata(path).is_ok();
    match names.into_iter().map(|name| folder.join(name.as_ref())).find(there) {
        Some(path) => {
            let why = format!("no {by} wrote this: name another folder; nothing is written");
            Err(DiskError::content(&path, why))
        }
        None => Ok(()),
    }
}

/// Whether two paths lead to the same file or folder, links followed; not where one leads nowhere.
pub(crate) fn is_same(a: &Path, b: &Path) -> bool {
    fs::canonicalize(a).is_ok_and(|a| fs::canonicalize(b).is_ok_and(|b| a == b))
}

/// Whether it is a file that calls itself a zip archive, as CI systems hand out artifacts.
pub(crate) fn is_zip(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("zip")) && path.is_file()
}

/// Writes a value as JSON, indented, by [`write_whole`]; `what` it is, in errors.
///
/// # Errors
/// Where it is no JSON, or as [`write_whole`].
pub(crate) fn write_json(path: &Path, value: &impl Serialize, what: &str) -> Result<(), DiskError> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|e| DiskError::content(path, format!("{what} cannot be written: {e}")))?;
    write_whole(path, |buffer| buffer.write_all(format!("{text}\n").as_bytes()))
}

/// Reads JSON of one version, which is told from others before all of it is read. In errors
/// it is not `what` ("a shard"), or of another version than `it_is` ("it is a shard") says.
///
/// # Errors
/// Where it cannot be read, is malformed or of another version.
pub(crate) fn read_json<T: DeserializeOwned>(path: &Path, reads: u32, what: &str, it_is: &str) -> Result<T, DiskError> {
    #[derive(Deserialize)]
    struct Versioned {
        version: u32,
    }
    let text = read_text(path)?;
    let malformed = |e: String| DiskError::content(path, format!("not {what}: {e}"));
    let Versioned { version } = parse_json(&text).map_err(malformed)?;
    if version != reads {
        let why = format!("{it_is} of version {version}, this tool reads version {reads}");
        return Err(DiskError::content(path, why));
    }
    parse_json(&text).map_err(malformed)
}

/// Reads JSON. An error names the field that it is of, on one line: it may hold words of the file.
///
/// All that is large is read by this one reader: each other one is compiled anew for every type of
/// a record. Three were 5 % of the library's code.
///
/// # Errors
/// Where it is malformed, or not of this type.
pub(crate) fn parse_json<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, String> {
    let told = |e: &str| cut(&line(e), 500).into_owned();
    let mut json = serde_json::Deserializer::from_str(text);
    let value = serde_path_to_error::deserialize(&mut json).map_err(|e| {
        let field = e.path().to_string();
        // Of the whole, such as a field that is missing.
        let at = if field == "." { String::new() } else { format!("{field}: ") };
        told(&format!("{at}{}", e.into_inner()))
    })?;
    json.end().map_err(|e| told(&e.to_string()))?;
    Ok(value)
}

/// Reads a text file.
///
/// # Errors
/// Where it cannot be read or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String, DiskError> {
    fs::read_to_string(path).map_err(DiskError::io(path, "read the file"))
}
