//! The summary on the page of a job.

use super::ImageBase;
use crate::{
    counted::counted,
    gate::{Outcome, Verdict},
    record::{End, Record},
    report::{
        errors,
        table::{detectable_text, outcome_text, value_text},
    },
    untrusted::{cut, markdown},
};

/// Characters of a cell.
const CELL: usize = 300;

/// The summary as Markdown: the headline, what ended with an error, what did not pass,
/// what was not held against anything, what passed, and pictures of what did not pass
/// where they have an address. It has at most `room` bytes: where that does not hold all,
/// pictures are left out first, then what passed, then rows at the end of the other tables,
/// and their number is told. None where not even the headline has room.
pub fn summary(record: &Record, images: Option<&ImageBase>, room: usize) -> Option<String> {
    let head = head(record);
    let sections = sections(record, images);
    let frames: usize = sections.iter().map(Section::largest_frame).sum();
    if head.len() + frames > room {
        return Some(head).filter(|h| h.len() <= room);
    }
    let mut left = room - head.len() - frames;
    let mut text = head;
    for section in &sections {
        let mut kept = 0;
        while let Some(row) = section.rows.get(kept) {
            let Some(rest) = left.checked_sub(row.len()) else {
                // A shorter row of less weight does not take its place.
                left = 0;
                break;
            };
            left = rest;
            kept += 1;
        }
        text += &section.text(kept);
    }
    Some(text)
}

fn head(record: &Record) -> String {
    let sign = match record.end() {
        End::Pass => "✅",
        End::Inconclusive | End::Nothing => "⚠️",
        End::Fail | End::Incomplete => "❌",
    };
    let machine = &record.machine;
    let mut text = format!(
        "### {sign} {} · {}: {}\n\n{} with seed {} by aogauge {} on {}, {} {}; GPU: {}.\n",
        record.end().text(),
        cell(&record.suite.name),
        cell(&record.summary_line()),
        counted(record.cases.len(), "case", "cases"),
        record.seed,
        cell(&record.tool),
        cell(&machine.cpu),
        cell(&machine.os),
        cell(&machine.arch),
        cell(&machine.gpu),
    );
    if let Some(why) = &record.incomplete {
        text += &format!("\n**The run ended early:** {}\n", cell(why));
    }
    text
}

/// In the order in which they get room.
fn sections(record: &Record, images: Option<&ImageBase>) -> Vec<Section> {
    let mut stopped: Vec<&Verdict> = record.verdicts.iter().filter(|v| v.outcome != Outcome::Pass).collect();
    stopped.sort_by_key(|v| v.outcome);
    let errors = errors(record).map(|(what, why)| format!("| {} | {} |\n", code(&what), cell(why)));
    let idle = record.idle_gates.iter().map(|g| {
        let excused = if g.excused { "no fault of the run" } else { "<b>inconclusive</b>" };
        format!("| {} | {} | {excused} |\n", cell(&g.gate), cell(&g.reason))
    });
    let passed = record.verdicts.iter().filter(|v| v.outcome == Outcome::Pass);
    let all = [
        Section::new("ended with an error", true, "| case | why |\n|---|---|\n", errors.collect()),
        Section::new(
            "did not pass",
            true,
            "| | gate | case | what is measured | value | limit | why |\n|---|---|---|---|---|---|---|\n",
            stopped.iter().map(|v| row_of_stopped(v)).collect(),
        ),
        Section::new("gates were not held against anything", true, "| gate | why | |\n|---|---|---|\n", idle.collect()),
        Section::new(
            "passed",
            false,
            "| gate | case | value | detectable | limit |\n|---|---|---|--:|---|\n",
            passed.map(row_of_passed).collect(),
        ),
        Section::new("pictures of what did not pass", false, "", images.map_or(vec![], |i| pictures(&stopped, i))),
    ];
    all.into_iter().filter(|s| !s.rows.is_empty()).collect()
}

fn row_of_stopped(v: &Verdict) -> String {
    format!(
        "| <b>{}</b> | {} | {} | {} | {} | {} | {} |\n",
        outcome_text(v.outcome),
        cell(&v.gate),
        code(&v.subject()),
        cell(&v.title()),
        number(&value_text(v.value(), v.interval)),
        cell(&v.limit.text()),
        cell(&v.reason)
    )
}

fn row_of_passed(v: &Verdict) -> String {
    format!(
        "| {} | {} | {} | {} | {} |\n",
        cell(&v.gate),
        code(&v.subject()),
        number(&value_text(v.value(), v.interval)),
        detectable_text(v.detectable),
        cell(&v.limit.text())
    )
}

/// Each picture once, under the first verdict that it shows.
fn pictures(stopped: &[&Verdict], base: &ImageBase) -> Vec<String> {
    let mut shown: Vec<&str> = Vec::new();
    let mut rows = Vec::new();
    for v in stopped {
        // GitHub shows no OpenEXR.
        let Some(picture) = v.picture.as_deref().filter(|p| p.ends_with(".png") || p.ends_with(".svg")) else {
            continue;
        };
        if !shown.contains(&picture) {
            shown.push(picture);
            rows.push(format!(
                "{}, {}:\n\n![{}]({})\n\n",
                cell(&v.gate),
                code(&v.subject()),
                cell(&v.subject()),
                base.of(picture)
            ));
        }
    }
    rows
}

/// A table, or pictures one below the other.
struct Section {
    title: &'static str,
    is_open: bool,
    header: &'static str,
    rows: Vec<String>,
}

impl Section {
    fn new(title: &'static str, is_open: bool, header: &'static str, rows: Vec<String>) -> Self {
        Section { title, is_open, header, rows }
    }

    /// The most bytes that it takes besides its rows, however many of them are kept.
    fn largest_frame(&self) -> usize {
        self.frame("", usize::MAX).len()
    }

    fn text(&self, kept: usize) -> String {
        self.frame(&self.rows[..kept].concat(), self.rows.len() - kept)
    }

    fn frame(&self, rows: &str, left_out: usize) -> String {
        let Section { title, header, .. } = self;
        let count = self.rows.len();
        let rest = match left_out {
            0 => String::new(),
            n => format!("\n_{n} of these {count} are not shown, for a summary has a limit of size._\n"),
        };
        if self.is_open {
            format!("\n#### {count} {title}\n\n{header}{rows}{rest}")
        } else {
            format!("\n<details><summary>{count} {title}</summary>\n\n{header}{rows}{rest}\n</details>\n")
        }
    }
}

fn cell(text: &str) -> String {
    markdown(&cut(text, CELL))
}

fn code(text: &str) -> String {
    format!("<code>{}</code>", cell(text))
}

/// On one line, and with minus for a hyphen, where lines break.
fn number(text: &str) -> String {
    cell(text).replace(' ', "\u{a0}").replace('-', "\u{2212}")
}
