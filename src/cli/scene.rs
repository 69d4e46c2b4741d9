//! `aogauge scene`

use super::{Exit, Failure, Format, json, print};
use crate::scenes::library;
use clap::{Args, Subcommand};
use serde::Serialize;

/// Look at the built-in scenes.
#[derive(Debug, Subcommand)]
pub enum Verb {
    List(List),
}

/// List the built-in scenes.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  aogauge scene list --format json")]
pub struct List {
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

pub fn execute(verb: &Verb) -> Result<Exit, Failure> {
    let Verb::List(args) = verb;
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
