//! `aogauge merge`

use super::{
    Exit, Failure, Format,
    report::Beside,
    run::{bar, base, finish, tell_moved},
};
use crate::{
    run::{MergeError, Prepared, Shards, find_shards},
    suite::{Plan, Suite},
};
use std::path::PathBuf;

/// Put the shards of one run together: one record and its report, the same as of a run
/// that was not divided. Nothing is rendered; verdicts are taken over all of it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge run --shard 1/2 --out part-1; aogauge run --shard 2/2 --out part-2\n  \
aogauge merge part-1 part-2 --out reports/latest\n  aogauge merge artifacts --out reports/latest\n\n\
docs/scale.md has files for Slurm, Kubernetes, GitHub Actions and GitLab.")]
pub struct Args {
    /// Folders of shards, or folders that hold such folders.
    #[arg(required = true)]
    shards: Vec<PathBuf>,
    /// Folder for the record; none of the shards may be in it, and it in none of them. An
    /// older record of that name is moved aside to NAME.previous.
    #[arg(long, default_value = "reports/latest")]
    out: PathBuf,
    /// Where the suite lies now; where the shards had it unless given.
    #[arg(long)]
    suite: Option<String>,
    /// The folder of an earlier record, for gates `against = "base"`. Of shards that were
    /// run --until-sure, the one that they were given.
    #[arg(long, value_name = "DIR")]
    base: Option<PathBuf>,
    /// There is no earlier record yet: gates against it are left out.
    #[arg(long, conflicts_with = "base")]
    no_base: bool,
    #[command(flatten)]
    beside: Beside,
    /// What is printed on standard output: nothing, or the record.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

impl From<MergeError> for Failure {
    fn from(e: MergeError) -> Self {
        let exit = if matches!(e, MergeError::Missing(_)) { Exit::Incomplete } else { Exit::Usage };
        Failure { exit, message: e.to_string() }
    }
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    args.beside.check(args.format)?;
    let shards = Shards::read(&find_shards(&args.shards)?)?;
    let first = shards.first();
    let suite = Suite::load(args.suite.as_deref().unwrap_or(&first.suite))?;
    let mut plan = Plan::new(&suite, first.platform, Some(first.seed));
    if first.without_external {
        plan = plan.without_external();
    }
    plan.until_sure = first.until_sure;
    if let Some(filter) = &first.filter {
        plan = plan.only(filter);
    }
    plan.base = base(args.base.as_deref(), &suite)?;
    plan.no_base = args.no_base;
    let prepared = Prepared::new(&plan)?;
    let (folder, record) = shards.merge(&prepared, &args.out, &bar())?;
    tell_moved(&folder);
    finish(&record, &folder, &args.beside, args.format)
}
