//! `aogauge report`

use super::{Exit, Failure, tell};
use crate::report;
use std::path::PathBuf;

/// Make the report of a record again, without rendering.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  aogauge report reports/latest --out reports/copy")]
pub struct Args {
    /// The record's folder.
    record: PathBuf,
    /// Folder for report.md and its pictures; the record's unless given.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Put the pictures into report.md as data URIs, so that it is one file. GitHub does
    /// not show such pictures.
    #[arg(long)]
    embed_images: bool,
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let out = args.out.as_ref().unwrap_or(&args.record);
    let record = report::write(&args.record, out, &report::Options { embed_images: args.embed_images })?;
    tell(&format!("{}: {}", out.join(report::FILE).display(), record.summary_line()));
    Ok(Exit::Pass)
}
