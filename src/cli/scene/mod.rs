//! `aogauge scene`

mod export;
mod list;
mod show;

use super::{Exit, Failure};
use crate::{
    disk::read_text,
    scenes::{Scene, library},
};
use clap::Subcommand;
use std::path::Path;

/// Look at scenes, and take them elsewhere.
#[derive(Debug, Subcommand)]
pub enum Verb {
    List(list::Args),
    Show(show::Args),
    Export(export::Args),
}

pub fn execute(verb: &Verb) -> Result<Exit, Failure> {
    match verb {
        Verb::List(args) => list::execute(args),
        Verb::Show(args) => show::execute(args),
        Verb::Export(args) => export::execute(args),
    }
}

/// A built-in scene by name, or a scene file by path.
pub(super) fn load(name: &str) -> Result<Scene, Failure> {
    if name.ends_with(".toml") {
        return Ok(Scene::from_file(Path::new(name))?);
    }
    if name.ends_with(".glb") || name.ends_with(".gltf") {
        return Err(Failure::usage(format!(
            "{name} is a model, not a scene: write a scene file with `[gltf] file = \"{name}\"`, as docs/scenes.md shows"
        )));
    }
    Ok(library::scene(name)?)
}

/// The text that the scene was read from.
fn source(name: &str) -> Result<String, Failure> {
    match library::SCENES.iter().find(|(n, _)| *n == name) {
        Some((_, text)) => Ok((*text).to_owned()),
        None => Ok(read_text(Path::new(name))?),
    }
}
