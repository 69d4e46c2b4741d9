//! `aogauge golden size`

use super::{Exit, Failure, Format, LARGE, bytes, existing, json, pending, print, warn_if_large};
use crate::{golden::VERSION, untrusted::logged};
use schemars::JsonSchema;
use serde::Serialize;
use std::{collections::BTreeMap, path::PathBuf};

/// Show how much goldens hold, by scene, and warn before the repository grows.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge golden size\n  aogauge golden size --limit 20MB")]
pub struct Args {
    /// Exit with 1 above this: bytes, or a number with kB, MB, GB, KiB, MiB or GiB.
    #[arg(long, value_parser = parse)]
    limit: Option<u64>,
    /// The folder of goldens.
    #[arg(long, default_value = "goldens")]
    goldens: PathBuf,
    /// How the sizes are printed.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// What `golden size --format json` prints.
#[derive(Serialize, JsonSchema)]
pub struct Sizes {
    /// Version of this format.
    version: u32,
    /// Bytes of all goldens.
    total: u64,
    /// The limit that was given, bytes.
    limit: Option<u64>,
    /// Bytes of each scene's goldens.
    scenes: BTreeMap<String, u64>,
    /// Whether a change was cut short and counts as made.
    interrupted: bool,
}

pub(super) fn execute(args: &Args) -> Result<Exit, Failure> {
    let store = existing(&args.goldens)?;
    let scenes = store.sizes()?;
    let interrupted = store.is_interrupted()?;
    let sizes = Sizes { version: VERSION, total: scenes.values().sum(), limit: args.limit, scenes, interrupted };
    match args.format {
        Format::Json => print(&json(&sizes)?)?,
        Format::Text => {
            for (scene, size) in &sizes.scenes {
                print(&format!("{:>10}  {}\n", bytes(*size), logged(scene)))?;
            }
            print(&format!("{:>10}  all\n", bytes(sizes.total)))?;
        }
    }
    pending(interrupted);
    warn_if_large(sizes.total, args.limit.unwrap_or(LARGE));
    let above = args.limit.is_some_and(|limit| sizes.total > limit);
    Ok(if above { Exit::Failed } else { Exit::Pass })
}

pub(super) fn parse(text: &str) -> Result<u64, String> {
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let factor = match unit.trim() {
        "" | "B" => 1.0,
        "kB" => 1e3,
        "MB" => 1e6,
        "GB" => 1e9,
        "KiB" => 1024.0,
        "MiB" => 1_048_576.0,
        "GiB" => 1_073_741_824.0,
        _ => return Err("give bytes, or a number with kB, MB, GB, KiB, MiB or GiB".into()),
    };
    let value: f64 = number.parse().map_err(|_| "give a number of 0 or more".to_owned())?;
    Ok((value * factor) as u64)
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn sizes_have_units() {
        for (text, n) in [("0", 0), ("20MB", 20_000_000), ("1.5 KiB", 1536), ("2GiB", 2 << 30), ("7B", 7)] {
            assert_eq!(parse(text), Ok(n));
        }
        for bad in ["", "MB", "-1", "5 parsecs", "1.2.3"] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
