//! `aogauge golden review`

use super::{Exit, Failure, exit, nothing, print, tell};
use crate::{
    counted::counted,
    golden::{Candidates, Store},
    review::{Decision, Ended, Review, serve},
};
use std::path::PathBuf;

/// Look at images that do not hold beside their goldens, in a browser, and approve or
/// reject them one by one.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge golden review reports/latest\n  \
aogauge golden review artifact.zip --only curtain-room --port 8080\n\n\
The page is served on 127.0.0.1, to whoever has the address that is printed: it holds a token of this run.\n\
It ends by the button on the page or by Ctrl-C. Exit codes are those of `golden verify`, after what was decided.")]
pub struct Args {
    /// The record's folder, or a zip file that holds one.
    record: PathBuf,
    /// Only cases whose scene/estimator/renderer/rays contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// Cases that hold, too.
    #[arg(long)]
    all: bool,
    /// The folder of goldens.
    #[arg(long, default_value = "goldens")]
    goldens: PathBuf,
    /// The port; a free one unless given.
    #[arg(long, default_value_t = 0)]
    port: u16,
}

pub(super) fn execute(args: &Args) -> Result<Exit, Failure> {
    let candidates = Candidates::open_for_review(&args.record)?;
    let review = Review::new(Store::new(&args.goldens), candidates.folder(), &args.only, args.all)?;
    if review.verification().cases.is_empty() {
        return Err(nothing(review.record(), &args.only));
    }
    let shown = review.shown().count();
    if shown == 0 {
        tell("every golden holds: nothing to review (--all shows them)");
        return Ok(Exit::Pass);
    }
    let mut told = Ok(());
    let (ended, review) = serve(review, args.port, |address| {
        told = print(&format!("{address}\n"));
        tell(&format!(
            "{} to review: open the address above in a browser; Ctrl-C ends",
            counted(shown, "case", "cases")
        ));
    })
    .map_err(|e| Failure::usage(e.to_string()))?;
    told?;
    let how = match ended {
        Ended::Finished => "finished",
        Ended::Interrupted => "interrupted",
    };
    let [approved, rejected] = [Decision::Approve, Decision::Reject].map(|d| review.count(d));
    tell(&format!(
        "review {how}: {approved} approved, {rejected} rejected, {} left",
        shown - (approved + rejected).min(shown)
    ));
    Ok(exit(review.verification()))
}
