//! `aogauge scene`

mod export;
mod list;
mod show;

use super::{Exit, Failure};
use crate::scenes::{Scene, SceneError, library};
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
fn load(name: &str) -> Result<Scene, SceneError> {
    if name.ends_with(".toml") { Scene::from_file(Path::new(name)) } else { library::scene(name) }
}
