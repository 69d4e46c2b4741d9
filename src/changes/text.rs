//! What changed, as text for a terminal.

use super::{
    Changes,
    tables::{Cell, Table, runs, sentences, tables},
};
use crate::untrusted::logged as line;

/// Everything that changed, as aligned tables.
pub fn text(changes: &Changes) -> String {
    let mut text = format!("{}: {}\n\n", line(&changes.suite), line(&changes.headline()));
    let mut rows = vec![[String::new(), "base".to_owned(), "new".to_owned()].to_vec()];
    rows.extend(runs(changes).into_iter().map(|r| r.to_vec()));
    text += &aligned(&rows);
    text += &format!("\n{}\n", sentences(changes).join("\n"));
    for table in tables(changes) {
        text += &format!("\n{}\n", table.title);
        if !table.intro.is_empty() {
            text += &format!("  {}\n", table.intro);
        }
        text += &aligned(&words(&table));
    }
    text
}

fn words(table: &Table) -> Vec<Vec<String>> {
    let word = |c: &Cell| match c {
        Cell::Plain(s) | Cell::Number(s) | Cell::Code(s) | Cell::Strong(s) => s.clone(),
    };
    let header = table.columns.iter().map(|c| (*c).to_owned()).collect();
    std::iter::once(header).chain(table.rows.iter().map(|r| r.iter().map(word).collect())).collect()
}

/// Columns of equal width; the last one is as long as it is.
fn aligned(rows: &[Vec<String>]) -> String {
    let rows: Vec<Vec<String>> = rows.iter().map(|r| r.iter().map(|c| line(c)).collect()).collect();
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let of = |i: usize| rows.iter().filter_map(move |r: &Vec<String>| r.get(i)).map(|c| c.chars().count()).max();
    let widths: Vec<usize> = (0..columns).map(|i| of(i).unwrap_or(0).min(60)).collect();
    let mut text = String::new();
    for row in &rows {
        let cells: Vec<String> = row.iter().zip(&widths).map(|(cell, &w)| format!("{cell:<w$}")).collect();
        text += &format!("  {}\n", cells.join("  ").trim_end());
    }
    text
}
