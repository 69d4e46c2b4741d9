//! `aogauge golden verify`

use super::{Exit, Failure, Format, exit, json, nothing, pending, print, tell};
use crate::{
    golden::{ALPHA, Candidates, Checked, Stale, Store},
    record::Record,
    untrusted::logged,
};
use std::path::PathBuf;

/// Hold the images of a record against their goldens, without rendering. A
/// missing golden is never created, and never passes.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge run --seed 7 --out /tmp/fresh && aogauge golden verify /tmp/fresh\n  \
aogauge golden verify artifact.zip --only curtain-room --format json\n\n\
docs/goldens.md tells what each verdict means.")]
pub struct Args {
    /// The record's folder, or a zip file that holds one.
    record: PathBuf,
    /// Only cases whose scene/estimator/renderer/rays contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// The folder of goldens.
    #[arg(long, default_value = "goldens")]
    goldens: PathBuf,
    /// How the verdicts are printed.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

pub(super) fn execute(args: &Args) -> Result<Exit, Failure> {
    let candidates = Candidates::open(&args.record)?;
    let record = Record::read(candidates.folder())?;
    let found = Store::new(&args.goldens).verify(candidates.folder(), &record, &args.only)?;
    if found.cases.is_empty() {
        return Err(nothing(&record, &args.only));
    }
    let mut lines: Vec<String> = found.cases.iter().map(Checked::line).collect();
    lines.push(format!("{}; family error {ALPHA}", found.summary()));
    lines.extend(found.stale.as_ref().map(Stale::line));
    // They tell reasons and errors of others.
    let lines: Vec<String> = lines.iter().map(|line| logged(line)).collect();
    match args.format {
        Format::Text => print(&(lines.join("\n") + "\n"))?,
        Format::Json => {
            print(&json(&found)?)?;
            lines.iter().for_each(|line| tell(line));
        }
    }
    pending(found.interrupted);
    Ok(exit(&found))
}
