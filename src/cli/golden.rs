//! `aogauge golden`

use super::{Exit, Failure, Format, json, print, tell};
use crate::{
    golden::{ALPHA, Checked, Outcome, Store, golden_cases},
    record::Record,
};
use clap::Subcommand;
use std::path::PathBuf;

/// Accept images as goldens, and hold records against them.
#[derive(Debug, Subcommand)]
pub enum Verb {
    Approve(Approve),
    Verify(Verify),
}

/// Accept the CPU's images of a record as goldens.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  aogauge golden approve reports/latest --reason \"first goldens\"")]
pub struct Approve {
    /// The record's folder.
    record: PathBuf,
    /// Why these images are right; kept with each golden.
    #[arg(long)]
    reason: String,
    /// Only cases whose scene/estimator/renderer/rays contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// The folder of goldens.
    #[arg(long, default_value = "goldens")]
    goldens: PathBuf,
}

/// Hold the images of a record against their goldens, without rendering. A
/// missing golden is never created, and never passes.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  aogauge run --seed 7 --out /tmp/fresh && aogauge golden verify /tmp/fresh")]
pub struct Verify {
    /// The record's folder.
    record: PathBuf,
    /// The folder of goldens.
    #[arg(long, default_value = "goldens")]
    goldens: PathBuf,
    /// How the verdicts are printed.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

pub fn execute(verb: &Verb) -> Result<Exit, Failure> {
    match verb {
        Verb::Approve(args) => approve(args),
        Verb::Verify(args) => verify(args),
    }
}

fn nothing(record: &Record, only: &str) -> Failure {
    let message = match record.suite.golden_rays {
        None => format!("suite '{}' keeps no goldens: it sets no golden_rays", record.suite.name),
        Some(rays) => format!("the record has no case at {rays} rays that contains '{only}'"),
    };
    Failure { exit: Exit::Nothing, message }
}

fn approve(args: &Approve) -> Result<Exit, Failure> {
    if args.reason.trim().is_empty() {
        return Err(Failure::usage("--reason must say why the images are right"));
    }
    let record = Record::read(&args.record)?;
    let written = Store::new(&args.goldens).approve(&args.record, &record, &args.reason, &args.only)?;
    if written.is_empty() {
        return Err(nothing(&record, &args.only));
    }
    for path in &written {
        print(&format!("{}\n", path.display()))?;
    }
    tell(&format!("{} goldens approved: {}", written.len(), args.reason));
    Ok(Exit::Pass)
}

fn verify(args: &Verify) -> Result<Exit, Failure> {
    let record = Record::read(&args.record)?;
    if golden_cases(&record).next().is_none() {
        return Err(nothing(&record, ""));
    }
    let checked = Store::new(&args.goldens).verify(&args.record, &record);
    if args.format == Format::Json {
        print(&json(&checked)?)?;
    }
    for case in &checked {
        tell(&case.line());
    }
    let count = |o: Outcome| checked.iter().filter(|c| c.outcome() == o).count();
    let [pass, fail, blind, missing, lost] =
        [Outcome::Pass, Outcome::Fail, Outcome::Blind, Outcome::Missing, Outcome::Lost].map(count);
    tell(&format!(
        "{pass} hold, {fail} differ, {blind} too noisy to tell, {missing} missing or unusable, {lost} lost; family error {ALPHA}{}",
        stale(&checked).map_or_else(String::new, |s| format!("\n{s}"))
    ));
    Ok(if lost > 0 {
        Exit::Incomplete
    } else if missing > 0 {
        Exit::Golden
    } else if fail > 0 {
        Exit::Failed
    } else if blind > 0 {
        Exit::Inconclusive
    } else {
        Exit::Pass
    })
}

/// Most cases shifted one way is a stale reference, not noise.
fn stale(checked: &[Checked]) -> Option<String> {
    let shifts: Vec<f64> = checked
        .iter()
        .filter(|c| c.outcome() == Outcome::Fail)
        .filter_map(|c| match &c.verdict {
            crate::golden::Verdict::Compared(c) => Some(c.bias),
            _ => None,
        })
        .collect();
    let alike = shifts.len() >= 4 && shifts.len() * 2 > checked.len();
    let one_way = shifts.iter().all(|b| *b > 0.0) || shifts.iter().all(|b| *b < 0.0);
    (alike && one_way)
        .then(|| "most cases moved the same way: the goldens are probably stale, or a setting changed".to_owned())
}
