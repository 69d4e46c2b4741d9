//! The report as one HTML page that can be looked around in: what is on it, of a
//! record. How it looks is [`viewer`](crate::viewer)'s.

mod pairs;
mod rows;

use super::{ReportError, definitions};
use crate::{
    counted::counted,
    disk::write_whole,
    record::Record,
    viewer::{Page, Planes},
};
pub(crate) use pairs::SceneImages;
use std::{
    collections::BTreeMap,
    io::Write,
    path::{Path, PathBuf},
};

/// The name of the page in its folder.
pub const FILE: &str = "report.html";

/// Makes `report.html` from a record that was read from `record_folder`, into `out`.
/// Returns its file.
///
/// # Errors
/// Where an image cannot be read, or the page not written.
pub fn write(record: &Record, record_folder: &Path, out: &Path) -> Result<PathBuf, ReportError> {
    let path = out.join(FILE);
    let html = page(record_folder, record)?;
    write_whole(&path, |buffer| buffer.write_all(html.as_bytes()))?;
    Ok(path)
}

/// The page of a record.
fn page(folder: &Path, record: &Record) -> Result<String, ReportError> {
    let mut planes = Planes::default();
    let mut items = Vec::new();
    let mut scenes = Vec::new();
    // By their places in the record, so that scenes are read one after the other.
    let mut order = BTreeMap::new();
    for scene in &record.scenes {
        let mut images = SceneImages::read(folder, record, scene)?;
        for (place, case) in record.cases.iter().enumerate().filter(|(_, c)| c.case.scene == scene.name) {
            order.insert(place, rows::item(record, case, images.pairs(case, &mut planes)?));
        }
        items.extend(rows::judge(record, scene, images.of_judge(&mut planes)));
        scenes.push(rows::scene(record, scene, images.converged()));
    }
    items.extend(order.into_values());
    items.sort_by_key(|item| rows::rank(item.outcome));
    let page = Page {
        title: record.suite.name.clone(),
        outcome: rows::overall(record),
        label: record.handed_in.as_ref().map(|by| format!("images of {}, handed in", by.renderer)),
        summary: format!(
            "{} in {}. {}",
            record.summary_line(),
            counted(record.summary.cases, "case", "cases"),
            record.suite.description
        ),
        notes: rows::notes(record),
        gates: rows::gates(record),
        items,
        scenes,
        plots: rows::plots(record),
        words: definitions::of(record)
            .into_iter()
            .map(|d| [d.word.to_owned(), format!("{} {}", d.word, d.meaning)])
            .collect(),
        facts: rows::facts(record),
        review: None,
    };
    Ok(page.html(&planes)?)
}
