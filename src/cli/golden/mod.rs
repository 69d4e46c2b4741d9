//! `aogauge golden`

mod approve;
mod list;
mod prune;
mod remove;
mod review;
mod size;
mod verify;

use super::{Exit, Failure, Format, json, print, tell};
use crate::{
    counted::counted,
    golden::{Notice, Outcome, Store, Verification},
    record::Record,
    untrusted::logged,
};
use clap::Subcommand;
use std::path::Path;

pub(super) use list::Listing;
pub(super) use size::Sizes;

/// Beyond this a repository is slow to clone, bytes.
const LARGE: u64 = 50_000_000;

/// Accept images as goldens, and hold records against them.
#[derive(Debug, Subcommand)]
pub enum Verb {
    Verify(verify::Args),
    Approve(approve::Args),
    List(list::Args),
    Prune(prune::Args),
    Remove(remove::Args),
    Review(review::Args),
    Size(size::Args),
}

pub fn execute(verb: &Verb) -> Result<Exit, Failure> {
    match verb {
        Verb::Verify(args) => verify::execute(args),
        Verb::Approve(args) => approve::execute(args),
        Verb::List(args) => list::execute(args),
        Verb::Prune(args) => prune::execute(args),
        Verb::Remove(args) => remove::execute(args),
        Verb::Review(args) => review::execute(args),
        Verb::Size(args) => size::execute(args),
    }
}

fn nothing(record: &Record, only: &str) -> Failure {
    let message = match record.suite.golden_rays {
        None => format!("suite '{}' keeps no goldens: it sets no golden_rays", record.suite.name),
        Some(rays) => {
            format!("the record has no case at {} that contains '{only}'", counted(rays, "ray", "rays"))
        }
    };
    Failure { exit: Exit::Nothing, message }
}

/// Prints a golden's file. Files in a store may have any name.
fn print_path(path: &Path) -> Result<(), Failure> {
    print(&(logged(&path.display().to_string()) + "\n"))
}

/// Says what happens before a store is changed.
fn notice(notice: Notice) {
    match notice {
        Notice::Waiting => tell("aogauge: another command reads or changes the goldens; waiting for it to end"),
        Notice::Finished { written, removed } => tell(&format!(
            "aogauge: a change of the goldens had been decided and interrupted; it is finished now: {} \
             put in place, {removed} removed. `git status` shows which",
            counted(written, "golden", "goldens")
        )),
        Notice::Size { after, .. } => warn_if_large(after, LARGE),
    }
}

/// Says that the files in the store are not what the verb shows.
fn pending(interrupted: bool) {
    if interrupted {
        tell(
            "aogauge: a change of the goldens was decided and then interrupted. It counts as made here, but some files \
             still are the old ones, and git sees a mixture: commit nothing before the next approve, prune or remove \
             has finished it; then check with `git status`",
        );
    }
}

/// The store in a folder that is there: a mistyped one holds no golden either.
fn existing(folder: &Path) -> Result<Store, Failure> {
    if folder.is_dir() {
        return Ok(Store::new(folder));
    }
    Err(Failure { exit: Exit::Golden, message: format!("there is no folder of goldens {}", folder.display()) })
}

/// Says what a large store costs.
fn warn_if_large(total: u64, limit: u64) {
    if total > limit {
        tell(&format!(
            "goldens hold {}, more than {}: every clone carries them and their history; prune, take smaller views, or keep them in Git LFS",
            bytes(total),
            bytes(limit)
        ));
    }
}

/// Bytes for people, by powers of 1,000.
fn bytes(n: u64) -> String {
    let (value, unit) = match n {
        0..1_000 => return format!("{n} B"),
        1_000..1_000_000 => (n as f64 / 1e3, "kB"),
        1_000_000..1_000_000_000 => (n as f64 / 1e6, "MB"),
        _ => (n as f64 / 1e9, "GB"),
    };
    format!("{value:.1} {unit}")
}

/// The exit code of a verification.
fn exit(found: &Verification) -> Exit {
    let ends = [
        (Outcome::Lost, Exit::Incomplete),
        (Outcome::Missing, Exit::Golden),
        (Outcome::Fail, Exit::Failed),
        (Outcome::Blind, Exit::Inconclusive),
    ];
    // One that cannot be read may be another device's, and that another holds does not mend it.
    let is_end = |outcome| found.count(outcome) > 0 || outcome == Outcome::Missing && found.has_unreadable();
    ends.into_iter().find(|(outcome, _)| is_end(*outcome)).map_or(Exit::Pass, |(_, exit)| exit)
}
