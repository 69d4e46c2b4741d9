//! `aogauge scene export`

use super::load;
use crate::{
    cli::{Exit, Failure, tell},
    kit,
};
use std::path::PathBuf;

/// Pack a scene for another renderer: glb with and without the occluder, views,
/// region map, G-buffer, and a page that says what to render.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  aogauge scene export curtain-arcade --out kit/")]
pub struct Args {
    /// A built-in scene by name, or a scene file.
    scene: String,
    /// The folder to write into.
    #[arg(long)]
    out: PathBuf,
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let scene = load(&args.scene)?;
    kit::write(&scene, &args.out)?;
    tell(&format!("{}: scene '{}' is packed", args.out.display(), scene.name));
    Ok(Exit::Pass)
}
