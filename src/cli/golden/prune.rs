//! `aogauge golden prune`

use super::{Exit, Failure, notice, pending, print_path, tell};
use crate::{
    counted::counted,
    golden::{Candidates, Slot, Store, named_by_record, named_by_suite},
    record::Record,
    suite::{BUILT_IN, Suite},
};
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

/// Remove goldens that no case names any more. What did not run is not gone: refused
/// where a record lacks cases of its suite.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge golden prune thin-occluders --dry-run\n  \
aogauge golden prune my-suite.toml artifact.zip")]
pub struct Args {
    /// Suites, by name or file, and records, by folder or zip file. A golden stays if
    /// any of them names its case. Beside a record its suite must be given, unless it is
    /// a built-in one: the record alone cannot tell what was left out of it.
    #[arg(required = true)]
    named_by: Vec<String>,
    /// Only say what would be removed.
    #[arg(long)]
    dry_run: bool,
    /// The folder of goldens.
    #[arg(long, default_value = "goldens")]
    goldens: PathBuf,
}

pub(super) fn execute(args: &Args) -> Result<Exit, Failure> {
    let named = named(&args.named_by)?;
    let store = Store::new(&args.goldens);
    let orphans = if args.dry_run { store.orphans(&named)? } else { store.prune(&named, &notice)? };
    for slot in &orphans {
        print_path(&store.path(slot))?;
    }
    if args.dry_run {
        pending(store.is_interrupted()?);
    }
    let done = if args.dry_run { "would be removed" } else { "removed" };
    tell(&format!(
        "{} {done}; {} named",
        counted(orphans.len(), "golden", "goldens"),
        counted(named.len(), "case is", "cases are")
    ));
    Ok(Exit::Pass)
}

/// The slots of all golden cases that suites and records name.
fn named(by: &[String]) -> Result<BTreeSet<Slot>, Failure> {
    let (records, suites): (Vec<&String>, Vec<&String>) = by.iter().partition(|n| Candidates::is_one(Path::new(n)));
    let given: Vec<Suite> = suites.iter().map(|name| Suite::load(name)).collect::<Result<_, _>>()?;
    let mut named = BTreeSet::new();
    let mut add = |name: &str, mut slots: BTreeSet<Slot>| {
        if slots.is_empty() {
            let message = format!("'{name}' names no case that goldens are kept of; nothing is removed");
            return Err(Failure { exit: Exit::Nothing, message });
        }
        named.append(&mut slots);
        Ok(())
    };
    for (name, suite) in suites.iter().zip(&given) {
        add(name, named_by_suite(suite))?;
    }
    for name in records {
        add(name, of_record(name, &given)?)?;
    }
    Ok(named)
}

fn of_record(name: &str, given: &[Suite]) -> Result<BTreeSet<Slot>, Failure> {
    let candidates = Candidates::open(Path::new(name))?;
    let record = Record::read(candidates.folder())?;
    let refused =
        |why: String| Failure { exit: Exit::Incomplete, message: format!("{name}: {why}; nothing is removed") };
    let own = &record.suite.name;
    let mut suites: Vec<Suite> = given.iter().filter(|s| s.name == *own).cloned().collect();
    if suites.is_empty() {
        if BUILT_IN.iter().all(|(n, _)| n != own) {
            return Err(refused(format!(
                "whether it is of the whole suite '{own}' only the suite's file can tell: give it too"
            )));
        }
        suites.push(Suite::load(own)?);
    }
    named_by_record(&record, &suites.iter().flat_map(named_by_suite).collect()).map_err(refused)
}
