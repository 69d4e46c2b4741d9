//! What GitHub Actions show of a run: a summary on the job's page, and annotations.
//!
//! GitHub drops a summary above 1 MiB whole, shows 10 annotations of a kind a step, and
//! shows no pictures but those that lie at an address of their own.

mod annotations;
mod summary;

pub use annotations::{MOST_ANNOTATIONS, annotations};
pub use summary::summary;

use super::ReportError;
use crate::{
    disk::{DiskError, write_whole},
    record::Record,
};
use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
    str::FromStr,
};

/// The variable by which GitHub's runner names the file of a step's summary.
pub const VARIABLE: &str = "GITHUB_STEP_SUMMARY";

/// The name of the summary in its folder, where no runner asks for it.
pub const FILE: &str = "summary.md";

/// A step's summary has this many bytes at most, those of earlier commands in the step
/// included. GitHub takes 1 MiB; what is missing to it is room for a command that follows.
pub const MAX_BYTES: usize = 1_000_000;

/// An address that pictures lie under.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageBase(String);

impl FromStr for ImageBase {
    type Err = String;

    /// Takes an address that begins with `https://` or `http://`, without `?` and `#`.
    fn from_str(text: &str) -> Result<Self, String> {
        let host = text.strip_prefix("https://").or_else(|| text.strip_prefix("http://"));
        let legal = |c: char| c.is_ascii_alphanumeric() || "-._~:/%@+,;=&".contains(c);
        match host {
            Some(host) if !host.is_empty() && !host.starts_with('/') && host.chars().all(legal) => {
                Ok(ImageBase(text.trim_end_matches('/').to_owned()))
            }
            _ => Err("give an address like https://example.org/reports/42, without spaces, quotes, '?' and '#'".into()),
        }
    }
}

impl ImageBase {
    /// The address of a file of the record's folder.
    fn of(&self, path: &str) -> String {
        let mut url = format!("{}/", self.0);
        for byte in path.bytes() {
            match byte {
                b if b.is_ascii_alphanumeric() || b"-._~/".contains(&b) => url.push(b.into()),
                b => url += &format!("%{b:02X}"),
            }
        }
        url
    }
}

/// Where a summary went.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Written {
    /// To the end of the file that the runner named.
    Appended(PathBuf),
    /// Into a file of its own: no runner asked for it.
    Alone(PathBuf),
    /// Into a file of its own: what earlier commands of the step wrote leaves no room.
    NoRoom(PathBuf),
}

/// Writes the summary to the end of the file that the runner names, or else as
/// [`FILE`] into `out`.
///
/// # Errors
/// Where it cannot be written.
pub fn write(
    record: &Record,
    images: Option<&ImageBase>,
    runner: Option<&Path>,
    out: &Path,
) -> Result<Written, ReportError> {
    let alone = |text: &str| write_whole(&out.join(FILE), |buffer| buffer.write_all(text.as_bytes()));
    let Some(path) = runner else {
        alone(&summary(record, images, MAX_BYTES).unwrap_or_default())?;
        return Ok(Written::Alone(out.join(FILE)));
    };
    let there = fs::metadata(path).map_or(0, |m| usize::try_from(m.len()).unwrap_or(usize::MAX));
    // A line's end before it, for what is there may lack one.
    let room = MAX_BYTES.saturating_sub(there).saturating_sub(2);
    let Some(text) = summary(record, images, room) else {
        alone(&summary(record, images, MAX_BYTES).unwrap_or_default())?;
        return Ok(Written::NoRoom(out.join(FILE)));
    };
    // The file is the runner's, and may hold more than this: it is not replaced.
    let opened = fs::File::options().create(true).append(true).open(path);
    let mut file = opened.map_err(DiskError::io(path, "open the summary that GITHUB_STEP_SUMMARY names"))?;
    let text = if there > 0 { format!("\n\n{text}") } else { text };
    file.write_all(text.as_bytes()).map_err(DiskError::io(path, "append to the summary"))?;
    Ok(Written::Appended(path.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_have_an_address() {
        let base: ImageBase = "https://example.org/a%20b/".parse().unwrap();
        assert_eq!(base.of("pictures/x/q.png"), "https://example.org/a%20b/pictures/x/q.png");
        assert_eq!(base.of("a b)\"é"), "https://example.org/a%20b/a%20b%29%22%C3%A9");
        for bad in
            ["", "https://", "https:///x", "ftp://x", "//x", "https://x y", "https://x)", "https://x\"", "reports"]
        {
            assert!(bad.parse::<ImageBase>().is_err(), "{bad}");
        }
    }
}
