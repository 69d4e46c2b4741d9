//! `aogauge scene export`

use super::load;
use crate::{
    cli::{
        Exit, Failure,
        run::{bar, interrupt},
        tell,
    },
    counted::counted,
    disk::is_same,
    judge_cache::JudgeCache,
    kit::{self, KitError},
    record::Machine,
    render::cpu::Cpu,
    run::{Means, Prepared, Stop},
    suite::{Plan, Platform, Suite},
};
use std::path::{Path, PathBuf};

/// Pack scenes for another renderer: glb with and without the occluder, views, G-buffer,
/// and a page that says what to render. Of a suite also judge, converged images and region maps, so that
/// `aogauge score` can judge what it renders.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge scene export curtain-arcade --out curtain/\n  \
aogauge scene export --suite thin-occluders --out kit/\n\nA kit takes as long as a run of the suite without its cases: \
minutes. What an unfinished export\nleft is not rendered again. docs/your-renderer.md takes you through it.")]
pub struct Args {
    /// A built-in scene by name, or a scene file.
    #[arg(required_unless_present = "suite", conflicts_with = "suite")]
    scene: Option<String>,
    /// A built-in suite by name, or a suite file: all of its scenes, and what images of them
    /// are scored against.
    #[arg(long)]
    suite: Option<String>,
    /// The folder to write into. Of a suite it must be empty; of a scene nothing in it is replaced but an earlier
    /// export of the same scene.
    #[arg(long)]
    out: PathBuf,
    /// Seed of the judge and the converged images; the suite's unless given.
    #[arg(long, requires = "suite")]
    seed: Option<u32>,
    /// Trace the judge anew, without the images that earlier runs left in the user's cache
    /// folder, and leave none.
    #[arg(long, requires = "suite")]
    no_cache: bool,
}

impl From<KitError> for Failure {
    fn from(e: KitError) -> Self {
        match e {
            KitError::Run(e) => Failure::from(e),
            e => Failure::usage(e.to_string()),
        }
    }
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    match (&args.suite, &args.scene) {
        (Some(suite), _) => of_suite(args, suite),
        (None, Some(scene)) => {
            let file = scene;
            let scene = load(file)?;
            check_own(Path::new(file), &args.out.join(format!("{}.toml", scene.name)))?;
            kit::write_alone(&scene, &args.out)?;
            tell(&format!("{}: scene '{}' is packed", args.out.display(), scene.name));
            Ok(Exit::Pass)
        }
        (None, None) => Err(Failure::usage("name a scene, or a suite with --suite".to_owned())),
    }
}

/// Refuses to write a scene file over the one that was read: what its author wrote would be gone.
fn check_own(file: &Path, out: &Path) -> Result<(), Failure> {
    if !is_same(file, out) {
        return Ok(());
    }
    Err(Failure::usage(format!("{}: the scene would be written over its own file: name another folder", out.display())))
}

fn of_suite(args: &Args, suite: &str) -> Result<Exit, Failure> {
    let suite = Suite::load(suite)?;
    let plan = Plan::new(&suite, Platform::Cpu, args.seed);
    let prepared = Prepared::new(&plan)?;
    let cache = if args.no_cache { None } else { JudgeCache::of_user() };
    let stop = Stop::default();
    interrupt::listen(&stop);
    let machine = Machine::here("not used".to_owned(), None);
    let means = Means { cache: cache.as_ref(), stop, ..Means::new(&Cpu, machine) };
    kit::write_suite(&prepared, &suite, &means, &args.out, &bar())?;
    let readme = args.out.join("README.md");
    let scenes = counted(suite.scenes.len(), "scene", "scenes");
    tell(&format!("{}: {scenes} of suite '{}' are packed; begin here", readme.display(), suite.name));
    Ok(Exit::Pass)
}
