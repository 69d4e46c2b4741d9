//! `aogauge golden prune`

use super::{Exit, Failure, print, tell, waiting};
use crate::{
    golden::{Slot, Store, named_by_record},
    record::Record,
    suite::{Plan, Platform, Suite},
};
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

/// Remove goldens that no case names any more. Refused where a record lacks cases:
/// what did not run is not gone.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge golden prune thin-occluders --dry-run\n  \
aogauge golden prune reports/latest my-suite.toml")]
pub struct Args {
    /// Suites, by name or file, and records, by folder. A golden stays if any of them
    /// names its case.
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
    let mut named = BTreeSet::new();
    for name in &args.named_by {
        let mut slots = slots(name)?;
        if slots.is_empty() {
            let message = format!("'{name}' names no case that goldens are kept of; nothing is removed");
            return Err(Failure { exit: Exit::Nothing, message });
        }
        named.append(&mut slots);
    }
    let store = Store::new(&args.goldens);
    let orphans = store.orphans(&named)?;
    for slot in &orphans {
        print(&format!("{}\n", store.path(slot).display()))?;
    }
    if !orphans.is_empty() && !args.dry_run {
        store.remove(&orphans, &waiting)?;
    }
    let done = if args.dry_run { "would be removed" } else { "removed" };
    tell(&format!("{} goldens {done}; {} cases are named", orphans.len(), named.len()));
    Ok(Exit::Pass)
}

fn slots(name: &str) -> Result<BTreeSet<Slot>, Failure> {
    if Path::new(name).is_dir() {
        let record = Record::read(Path::new(name))?;
        let refused = |why| Failure { exit: Exit::Incomplete, message: format!("{name}: {why}; nothing is removed") };
        return named_by_record(&record).map_err(refused);
    }
    let suite = Suite::load(name)?;
    let plan = Plan::new(&suite, Platform::Cpu, None);
    let golden = suite.file.golden_rays.map(crate::suite::Rays::get);
    let cases = plan.cases.into_iter().filter(|c| Some(c.rays) == golden);
    Ok(cases.map(|c| Slot { scene: c.scene, estimator: c.estimator, rays: c.rays, name: None }).collect())
}
