//! That a report is written over a report alone.

use super::{FILE, Format, github, html, junit};
use crate::{
    disk::{DiskError, refuse_foreign},
    record::{
        Record,
        pictures::{self, MINUS_CONVERGED, MINUS_Q, PICTURES},
    },
};
use std::path::Path;

/// Whose files may be replaced.
const BY: &str = "report of aogauge";

/// Refuses to write reports of a record into a folder of its own over files that no report wrote. `embed`: `report.md`
/// holds its pictures; `summary`: `summary.md` is written, since no runner of GitHub takes it.
///
/// # Errors
/// Where such a file is there.
pub fn check(record: &Record, formats: &[Format], out: &Path, embed: bool, summary: bool) -> Result<(), DiskError> {
    for format in formats {
        match format {
            Format::Markdown => {
                let pictures = if embed { Vec::new() } else { pictures_of(record) };
                let names = pictures.into_iter().chain([FILE.to_owned()]);
                refuse_foreign(out, FILE, &["Intervals are 95 %, over "], names, BY)?;
            }
            Format::Html => refuse_foreign(out, html::FILE, &["aogauge</title>"], [html::FILE], BY)?,
            Format::Junit => refuse_foreign(out, junit::FILE, &["name=\"tool\" value=\"aogauge "], [junit::FILE], BY)?,
            Format::Github if summary => {
                refuse_foreign(out, github::FILE, &[" with seed ", " by aogauge "], [github::FILE], BY)?;
            }
            Format::Github | Format::Json => {}
        }
    }
    Ok(())
}

/// Folders and files of pictures that `report.md` has beside it.
fn pictures_of(record: &Record) -> Vec<String> {
    let scenes = record.scenes.iter().map(|s| format!("{PICTURES}/{}", s.name));
    let bars = [MINUS_Q, MINUS_CONVERGED].map(pictures::bar);
    let plots = [pictures::contrast_error(), pictures::cost(), pictures::p_values()];
    scenes.chain(bars).chain(plots).collect()
}
