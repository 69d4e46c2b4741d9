//! `aogauge golden approve`

use super::{Exit, Failure, LARGE, bytes, nothing, print, tell, waiting, warn_if_large};
use crate::{
    golden::{Approval, ApproveError, Candidates, Limits, Selection, Store, check_golden_name},
    record::Record,
};
use clap::ValueEnum;
use std::path::PathBuf;

/// Accept images of a record as goldens: all that are selected, or none.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge golden approve reports/latest --reason \"first goldens\"\n  \
aogauge golden approve artifact.zip --reason \"secondary rays are clipped\" --only extended-clipped\n  \
aogauge golden approve reports/latest --renderer gpu --as radeon --reason \"its driver rounds otherwise\"")]
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
    /// Whose images.
    #[arg(long, value_enum, default_value_t)]
    renderer: Renderer,
    /// What may differ where an image has no noise, as flip=, flip-max=, ssim= or max=,
    /// separated by commas.
    #[arg(long, value_name = "LIMITS")]
    tolerance: Option<Limits>,
    /// The folder of goldens.
    #[arg(long, default_value = "goldens")]
    goldens: PathBuf,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Renderer {
    /// The CPU's.
    #[default]
    Cpu,
    /// The GPU's.
    Gpu,
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
        renderer: match args.renderer {
            Renderer::Cpu => "cpu",
            Renderer::Gpu => "gpu",
        },
        name: args.name.as_deref(),
        limits: args.tolerance,
    };
    let approved = store.approve(candidates.folder(), &record, &approval, &waiting).map_err(|e| match e {
        ApproveError::Disk(e) => Failure::from(e),
        lost @ ApproveError::Lost { .. } => {
            let message = format!("{lost}. Run again, or select others with --only");
            Failure { exit: Exit::Incomplete, message }
        }
    })?;
    if approved.files.is_empty() {
        return Err(nothing(&record, &args.only));
    }
    for path in &approved.files {
        print(&format!("{}\n", path.display()))?;
    }
    let (before, after) = (approved.before, approved.after);
    let than = if after < before { "less" } else { "more" };
    tell(&format!(
        "{} goldens approved: {}; the store holds {}, {} {than} than before",
        approved.files.len(),
        args.reason,
        bytes(after),
        bytes(after.abs_diff(before))
    ));
    warn_if_large(after, LARGE);
    Ok(Exit::Pass)
}
