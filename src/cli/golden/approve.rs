//! `aogauge golden approve`

use super::{Exit, Failure, bytes, nothing, notice, print_path, size::parse, tell};
use crate::{
    counted::counted,
    golden::{Approval, ApproveError, Candidates, Limits, Selection, Store, check_golden_name},
    record::Record,
    scenes::check_name,
};
use std::path::PathBuf;

/// Accept images of a record as goldens: all that are selected, or none.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge golden approve reports/latest --reason \"first goldens\"\n  \
aogauge golden approve artifact.zip --reason \"secondary rays are clipped\" --only extended-clipped\n  \
aogauge golden approve reports/latest --renderer gpu --as radeon --reason \"its driver rounds otherwise\"\n  \
aogauge golden approve reports/latest --reason \"larger views\" --dry-run --limit 20MB")]
pub struct Args {
    /// The record's folder, or a zip file that holds one, as CI keeps it.
    record: PathBuf,
    /// Why these images are right; kept with each golden.
    #[arg(long)]
    reason: String,
    /// Only cases whose scene/estimator/renderer/rays contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// Beside the golden there is, under this name: an image holds if any of its
    /// goldens does.
    #[arg(long = "as", value_name = "NAME", value_parser = named)]
    name: Option<String>,
    /// Whose images: cpu, gpu, or an external renderer of the suite by name.
    #[arg(long, default_value = "cpu", value_name = "NAME", value_parser = renderer)]
    renderer: String,
    /// What may differ where an image has no noise, as flip=, flip-max=, ssim= or max=,
    /// separated by commas.
    #[arg(long, value_name = "LIMITS")]
    tolerance: Option<Limits>,
    /// Refuse, with exit code 1, what makes all goldens hold more than this: bytes, or a
    /// number with kB, MB, GB, KiB, MiB or GiB.
    #[arg(long, value_name = "SIZE", value_parser = parse)]
    limit: Option<u64>,
    /// Only say what would be approved, and by how much the store would grow.
    #[arg(long)]
    dry_run: bool,
    /// The folder of goldens.
    #[arg(long, default_value = "goldens")]
    goldens: PathBuf,
}

fn renderer(name: &str) -> Result<String, String> {
    check_name(name).map(|()| name.to_owned())
}

fn named(name: &str) -> Result<String, String> {
    check_golden_name(name).map(|()| name.to_owned())
}

pub(super) fn execute(args: &Args) -> Result<Exit, Failure> {
    if args.reason.trim().is_empty() {
        return Err(Failure::usage("--reason must say why the images are right"));
    }
    let candidates = Candidates::open(&args.record)?;
    let record = Record::read(candidates.folder())?;
    let store = Store::new(&args.goldens);
    let approval = Approval {
        reason: &args.reason,
        only: Selection::Containing(&args.only),
        renderer: &args.renderer,
        name: args.name.as_deref(),
        limits: args.tolerance,
        most: args.limit,
        dry_run: args.dry_run,
    };
    let approved = store.approve(candidates.folder(), &record, &approval, &notice).map_err(failure)?;
    if approved.files.is_empty() {
        return Err(nothing(&record, &args.only));
    }
    for path in &approved.files {
        print_path(path)?;
    }
    let (before, after) = (approved.before, approved.after);
    let than = if after < before { "less" } else { "more" };
    let [done, holds] = if args.dry_run { ["would be approved", "would hold"] } else { ["approved", "holds"] };
    tell(&format!(
        "{} {done}: {}; the store {holds} {}, {} {than} than before",
        counted(approved.files.len(), "golden", "goldens"),
        args.reason,
        bytes(after),
        bytes(after.abs_diff(before))
    ));
    Ok(Exit::Pass)
}

fn failure(e: ApproveError) -> Failure {
    let exit = match &e {
        ApproveError::Lost { .. } => Exit::Incomplete,
        ApproveError::Pointer { .. } => Exit::Golden,
        ApproveError::Large { .. } => Exit::Failed,
        ApproveError::Disk(_) => Exit::Usage,
    };
    let message = match e {
        ApproveError::Disk(e) => return e.into(),
        ApproveError::Lost { .. } => format!("{e}. Run again, or select others with --only"),
        ApproveError::Large { before, after, most } => format!(
            "the store holds {} and would hold {}, more than {}; nothing is approved",
            bytes(before),
            bytes(after),
            bytes(most)
        ),
        e @ ApproveError::Pointer { .. } => e.to_string(),
    };
    Failure { exit, message }
}
