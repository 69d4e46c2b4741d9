//! `aogauge golden list`

use super::{Exit, Failure, Format, bytes, existing, json, pending, print, tell};
use crate::{
    counted::counted,
    golden::{Entry, VERSION},
    untrusted::logged,
};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::PathBuf;

/// List goldens with where they come from.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge golden list\n  aogauge golden list --only curtain --format json")]
pub struct Args {
    /// Only goldens whose scene/estimator.rays.name contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// The folder of goldens.
    #[arg(long, default_value = "goldens")]
    goldens: PathBuf,
    /// How they are printed.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// What `golden list --format json` prints.
#[derive(Serialize, JsonSchema)]
pub struct Listing {
    /// Version of this format.
    version: u32,
    /// The goldens, in order.
    goldens: Vec<Entry>,
    /// Whether a change was cut short and counts as made.
    interrupted: bool,
}

pub(super) fn execute(args: &Args) -> Result<Exit, Failure> {
    let store = existing(&args.goldens)?;
    let mut entries = store.entries()?;
    let interrupted = store.is_interrupted()?;
    entries.retain(|e| e.slot.path().to_string_lossy().replace('\\', "/").contains(&args.only));
    if entries.is_empty() {
        let message = format!("{} holds no golden that contains '{}'", args.goldens.display(), args.only);
        return Err(Failure { exit: Exit::Nothing, message });
    }
    let broken = entries.iter().filter(|e| e.unreadable.is_some()).count();
    let total: u64 = entries.iter().map(|e| e.bytes).sum();
    let said = format!("{}, {}; {broken} cannot be read", counted(entries.len(), "golden", "goldens"), bytes(total));
    match args.format {
        Format::Text => print(&table(&entries))?,
        Format::Json => print(&json(&Listing { version: VERSION, goldens: entries, interrupted })?)?,
    }
    tell(&said);
    pending(interrupted);
    Ok(if broken > 0 { Exit::Golden } else { Exit::Pass })
}

/// A golden a line, and its reason on the next. All of it is others' text.
fn table(entries: &[Entry]) -> String {
    let row = |e: &Entry| {
        let path = e.slot.path().display().to_string();
        let begin = format!("{path:<48} {:>10}", bytes(e.bytes));
        match &e.golden {
            None => logged(&format!("{begin} UNREADABLE  {}", e.unreadable.as_deref().unwrap_or_default())) + "\n",
            Some(about) => {
                let (of, from) = (&about.identity, &about.provenance);
                let [width, height] = of.resolution;
                let tolerance = about.tolerance.as_ref().map_or_else(String::new, |t| format!("  tolerance {t}"));
                let line = format!(
                    "{begin} {:<11} {:>3} x {:<5} seed {:<6} {} on {}, aogauge {}{tolerance}",
                    format!("{width} x {height}"),
                    from.replicates,
                    of.rays,
                    from.seed,
                    from.renderer,
                    from.device,
                    from.tool
                );
                format!("{}\n{:60}{}\n", logged(&line), "", logged(&from.reason))
            }
        }
    };
    entries.iter().map(row).collect()
}
