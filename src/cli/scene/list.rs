//! `aogauge scene list`

use crate::{
    cli::{Exit, Failure, Format, json, print},
    scenes::library,
};
use serde::Serialize;

/// List the built-in scenes.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  aogauge scene list --format json")]
pub struct Args {
    /// How the list is printed.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

#[derive(Serialize)]
struct Entry {
    name: String,
    control: bool,
    triangles: usize,
    hash: String,
    description: String,
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let mut entries = Vec::new();
    for (name, _) in library::SCENES {
        let scene = library::scene(name)?;
        entries.push(Entry {
            name: name.to_owned(),
            control: scene.control,
            triangles: scene.triangles().count(),
            hash: scene.hash(),
            description: scene.description,
        });
    }
    let text = match args.format {
        Format::Json => json(&entries)?,
        Format::Text => entries
            .iter()
            .map(|e| format!("{:<16} {:>7} triangles  {}\n", e.name, e.triangles, e.description))
            .collect(),
    };
    print(&text)?;
    Ok(Exit::Pass)
}
