//! `aogauge init`

use super::{Exit, Failure, tell};
use crate::disk::{DiskError, write_whole};
use clap::ValueEnum;
use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

/// The suite, by the path it gets.
const SUITE: (&str, &str) = ("aogauge.toml", include_str!("../init/aogauge.toml"));
const GITHUB: (&str, &str) = (".github/workflows/aogauge.yml", include_str!("../init/github.yml"));
const GITLAB: (&str, &str) = (".gitlab/aogauge.yml", include_str!("../init/gitlab.yml"));

/// Write a commented suite and a CI workflow that runs it into a repository.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge init\n  aogauge init ../engine --ci gitlab\n\n\
Writes aogauge.toml, and .github/workflows/aogauge.yml or .gitlab/aogauge.yml. A file that is\n\
already there is an error, and nothing is written.")]
pub struct Args {
    /// The repository's root; made where it does not exist.
    #[arg(default_value = ".")]
    dir: PathBuf,
    /// Whose CI.
    #[arg(long, value_enum, default_value_t)]
    ci: Ci,
    /// Replace files that are already there.
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Ci {
    /// GitHub Actions.
    #[default]
    Github,
    /// GitLab CI.
    Gitlab,
    /// None: the suite alone.
    None,
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let files: Vec<(PathBuf, &str)> = match args.ci {
        Ci::Github => vec![SUITE, GITHUB],
        Ci::Gitlab => vec![SUITE, GITLAB],
        Ci::None => vec![SUITE],
    }
    .into_iter()
    .map(|(path, text)| (args.dir.join(path), text))
    .collect();
    for (path, _) in &files {
        check(path, args.force)?;
    }
    for (path, text) in &files {
        write_whole(path, |buffer| buffer.write_all(text.as_bytes()))?;
        tell(&format!("wrote {}", path.display()));
    }
    if matches!(args.ci, Ci::Gitlab) {
        tell(&format!("to use it, add to .gitlab-ci.yml: include: [{{ local: {} }}]", GITLAB.0));
    }
    let of_ci =
        if matches!(args.ci, Ci::None) { "" } else { ", aogauge-record/, aogauge-base/ and aogauge-comment.md" };
    tell(&format!("records are no sources: add reports/{of_ci} to .gitignore"));
    tell(&format!("try it: aogauge run {}", args.dir.join(SUITE.0).display()));
    Ok(Exit::Pass)
}

/// Whether the file may be written: all are looked at before the first is.
fn check(path: &Path, force: bool) -> Result<(), Failure> {
    // A link that leads nowhere is somebody's too.
    match fs::symlink_metadata(path) {
        Ok(found) if found.is_dir() => {
            return Err(DiskError::content(path, "this is a folder: nothing is written").into());
        }
        Ok(_) if !force => {
            let why = "the file is already there, and nothing is written: --force replaces it";
            return Err(DiskError::content(path, why).into());
        }
        _ => {}
    }
    match path.ancestors().skip(1).find(|folder| folder.exists()) {
        Some(file) if !file.is_dir() => {
            Err(DiskError::content(file, "this is no folder, so nothing can be written below it").into())
        }
        _ => Ok(()),
    }
}
