//! `aogauge golden remove`

use super::{Exit, Failure, notice, print_path, tell};
use crate::{
    counted::counted,
    disk::is_same,
    golden::{Slot, Store},
};
use std::{
    collections::BTreeSet,
    ffi::{OsStr, OsString},
    path::{Path, PathBuf},
};

/// Remove goldens by name, such as those that later ones have superseded: all that are
/// given, or none.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge golden remove curtain-room/classic.32.radeon\n  \
aogauge golden remove goldens/*/*.radeon.exr")]
pub struct Args {
    /// Goldens as `golden list` names them, with or without .exr, or by their files in
    /// the folder of goldens.
    #[arg(required = true, value_name = "GOLDEN")]
    names: Vec<PathBuf>,
    /// The folder of goldens.
    #[arg(long, default_value = "goldens")]
    goldens: PathBuf,
}

pub(super) fn execute(args: &Args) -> Result<Exit, Failure> {
    let store = Store::new(&args.goldens);
    let slots: BTreeSet<Slot> =
        args.names.iter().map(|name| slot(name, &args.goldens)).collect::<Result<_, Failure>>()?;
    let missing = store.remove(&slots, &notice)?;
    if let Some(first) = missing.first() {
        let path = store.path(first).display().to_string();
        let message = match (missing.len(), slots.len()) {
            (_, 1) => format!("there is no {path}; nothing is removed"),
            (n, all) => {
                let do_not = if n == 1 { "does not" } else { "do not" };
                format!("{n} of {all} goldens {do_not} exist, the first is {path}; nothing is removed")
            }
        };
        return Err(Failure { exit: Exit::Golden, message });
    }
    for slot in &slots {
        print_path(&store.path(slot))?;
    }
    tell(&format!("{} removed", counted(slots.len(), "golden", "goldens")));
    Ok(Exit::Pass)
}

fn slot(name: &Path, goldens: &Path) -> Result<Slot, Failure> {
    let mut parts: Vec<OsString> = name.iter().rev().take(2).map(OsStr::to_owned).collect();
    if let Some(file) = parts.first_mut().filter(|f| !f.to_string_lossy().ends_with(".exr")) {
        file.push(".exr");
    }
    let folder = name.parent().and_then(Path::parent).unwrap_or(Path::new(""));
    let is_within = folder.as_os_str().is_empty() || is_same(folder, goldens);
    let slot = Slot::of_path(&parts.iter().rev().collect::<PathBuf>()).filter(|_| is_within);
    slot.ok_or_else(|| {
        Failure::usage(format!(
            "'{}' is no golden of {}: give SCENE/ESTIMATOR.RAYS or SCENE/ESTIMATOR.RAYS.NAME",
            name.display(),
            goldens.display()
        ))
    })
}
