//! What changed, as a comment for a pull request.

use super::{
    Changes, Outcome, Turn,
    tables::{Cell, Table, runs, sentences, tables},
};
use crate::untrusted;

/// A comment has this many bytes at most: GitHub drops one of 65,536 characters whole.
pub const MAX_BYTES: usize = 65_535;

/// Characters of a cell.
const CELL: usize = 200;

/// Rows that every table has room for before the first gets more.
const FAIR: usize = 10;

/// The first line of the comment on a suite: by it CI finds the comment of the last run
/// and updates it.
///
/// ```
/// assert_eq!(aogauge::changes::marker("thin-occluders"), "<!-- aogauge: thin-occluders -->");
/// assert_eq!(aogauge::changes::marker("x --><b>"), "<!-- aogauge: x_--__b_ -->");
/// ```
pub fn marker(suite: &str) -> String {
    let legal = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    format!("<!-- aogauge: {} -->", suite.chars().take(64).map(legal).collect::<String>())
}

/// The comment: marker, headline, what differs between the runs, and the tables; what
/// got worse is in sight, the rest folded away. It is whole by itself: no pictures, no
/// links. Where [`MAX_BYTES`] do not hold all rows, whole rows are left out at the end of
/// the longest tables, and counted.
pub fn markdown(changes: &Changes) -> String {
    let head = head(changes);
    let sections: Vec<Section> = tables(changes).into_iter().map(Section::of).collect();
    let mut kept = vec![0; sections.len()];
    let fixed: usize = sections.iter().map(|s| s.frame(usize::MAX).len()).sum();
    let mut left = MAX_BYTES.saturating_sub(head.len() + fixed);
    for most in [FAIR, usize::MAX] {
        for (section, kept) in sections.iter().zip(&mut kept) {
            while let Some(row) = section.rows.get(*kept).filter(|row| *kept < most && row.len() <= left) {
                left -= row.len();
                *kept += 1;
            }
        }
    }
    head + &sections.iter().zip(kept).map(|(s, kept)| s.text(kept)).collect::<String>()
}

fn head(changes: &Changes) -> String {
    let summary = &changes.summary.new;
    let doubt =
        summary.fail + summary.inconclusive + changes.warns() + changes.metrics.turned(Turn::Worse) + changes.moved();
    let sign = match changes.outcome {
        Outcome::Lost | Outcome::Worse => "❌ FAIL",
        Outcome::Nothing => "⚠️ CHECK",
        Outcome::Pass if doubt > 0 => "⚠️ CHECK",
        Outcome::Pass => "✅ PASS",
    };
    let mut text =
        format!("{}\n### {sign} · {}: {}\n\n", marker(&changes.suite), cell(&changes.suite), cell(&changes.headline()));
    text += "| | base | new |\n|---|---|---|\n";
    for [what, base, new] in runs(changes) {
        text += &format!("| {} | {} | {} |\n", cell(&what), cell(&base), cell(&new));
    }
    text + &format!("\n{}\n", sentences(changes).join(" "))
}

/// A table with its rows as Markdown.
struct Section {
    title: String,
    intro: String,
    is_open: bool,
    header: String,
    rows: Vec<String>,
}

impl Section {
    fn of(table: Table) -> Self {
        let header = format!("| {} |\n|{}\n", table.columns.join(" | "), "---|".repeat(table.columns.len()));
        let row = |row: &Vec<Cell>| format!("| {} |\n", row.iter().map(cell_of).collect::<Vec<_>>().join(" | "));
        let rows = table.rows.iter().map(row).collect();
        Section { title: table.title, intro: table.intro, is_open: table.is_open, header, rows }
    }

    /// All but the rows, where so many are left out.
    fn frame(&self, left_out: usize) -> String {
        self.around("", left_out)
    }

    fn text(&self, kept: usize) -> String {
        self.around(&self.rows[..kept].concat(), self.rows.len() - kept)
    }

    fn around(&self, rows: &str, left_out: usize) -> String {
        let Section { title, intro, header, .. } = self;
        let intro = if intro.is_empty() { String::new() } else { format!("{intro}\n\n") };
        let rest = match left_out {
            0 => String::new(),
            n => format!(
                "\n_{n} more are left out, for a comment has a limit of size; `aogauge compare` prints them all._\n"
            ),
        };
        if self.is_open {
            format!("\n#### {title}\n\n{intro}{header}{rows}{rest}")
        } else {
            format!("\n<details><summary>{title}</summary>\n\n{intro}{header}{rows}{rest}\n</details>\n")
        }
    }
}

fn cell_of(of: &Cell) -> String {
    match of {
        Cell::Plain(s) => cell(s),
        // A hyphen is where lines break, a minus is not.
        Cell::Number(s) => cell(s).replace(' ', "\u{a0}").replace('-', "\u{2212}"),
        Cell::Code(s) if s.is_empty() => String::new(),
        Cell::Code(s) => format!("<code>{}</code>", cell(s)),
        Cell::Strong(s) => format!("<b>{}</b>", cell(s)),
    }
}

/// Text as it reads, whatever it holds, of at most 200 characters.
fn cell(text: &str) -> String {
    untrusted::markdown(&untrusted::cut(text, CELL))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_hold_no_markup_and_are_cut() {
        assert_eq!(cell("a|b\n@c"), "a&#124;b &#64;\u{200b}c");
        assert_eq!(cell(&"x".repeat(300)).chars().count(), CELL + 1);
    }
}
