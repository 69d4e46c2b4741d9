//! The command line: one file a verb, and what they share: exit codes.

mod bench;
mod compare;
mod composite;
mod doctor;
mod explain;
mod flatland;
mod golden;
mod init;
mod merge;
mod on_gpu;
mod render;
mod report;
mod run;
mod scene;
mod schema;
mod score;

use crate::{
    disk::DiskError,
    record::{End, Record},
    render::RenderError,
    report::ReportError,
    run::RunError,
    scenes::SceneError,
    suite::SuiteError,
    untrusted::logged_lines,
};
use clap::{Parser, Subcommand, ValueEnum};
use std::fmt;

/// How a command ended, as the shell sees it. Where several hold, the first of
/// 2, 4, 5, 3, 1, 6, 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All is well.
    Pass = 0,
    /// A gate failed.
    Failed = 1,
    /// Wrong usage or configuration.
    Usage = 2,
    /// A golden is missing or unusable.
    Golden = 3,
    /// Nothing was selected.
    Nothing = 4,
    /// The run is incomplete.
    Incomplete = 5,
    /// The data do not decide.
    Inconclusive = 6,
}

impl Exit {
    /// How a run that made this record ends.
    fn of(record: &Record) -> Self {
        match record.end() {
            End::Incomplete => Exit::Incomplete,
            End::Fail => Exit::Failed,
            End::Inconclusive => Exit::Inconclusive,
            End::Nothing => Exit::Nothing,
            End::Pass => Exit::Pass,
        }
    }
}

/// Judges the image quality of ambient-occlusion renderers.
#[derive(Debug, Parser)]
#[command(name = "aogauge", version, about, max_term_width = 100)]
#[command(
    after_help = "Examples:\n  aogauge run\n  aogauge run --out reports/mine --seed 7\n  aogauge golden verify reports/mine\n\n\
Exit codes: 0 pass, 1 gate failed, 2 usage or configuration, 3 golden missing or unusable,\n\
4 nothing selected, 5 run incomplete, 6 inconclusive."
)]
pub struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Run(run::Args),
    Merge(merge::Args),
    Render(render::Args),
    Compare(compare::Args),
    Composite(composite::Args),
    Report(report::Args),
    Explain(explain::Args),
    #[command(subcommand)]
    Golden(golden::Verb),
    #[command(subcommand)]
    Scene(scene::Verb),
    Score(score::Args),
    Flatland(flatland::Args),
    #[command(subcommand)]
    Bench(bench::Verb),
    Doctor(doctor::Args),
    Init(init::Args),
    Schema(schema::Args),
}

/// How results are printed on standard output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people.
    #[default]
    Text,
    /// For programs.
    Json,
}

/// What went wrong, in one sentence, and the exit code it asks for.
#[derive(Debug)]
pub struct Failure {
    /// For the shell.
    pub exit: Exit,
    /// For people.
    pub message: String,
}

impl Failure {
    fn usage(message: impl Into<String>) -> Self {
        Failure { exit: Exit::Usage, message: message.into() }
    }
}

/// The message, as a log may hold it: it may quote what others wrote.
impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&logged_lines(&self.message))
    }
}

macro_rules! usage {
    ($($error:ty),*) => {$(
        impl From<$error> for Failure {
            fn from(e: $error) -> Self {
                Failure::usage(e.to_string())
            }
        }
    )*};
}
usage!(DiskError, crate::preview::PreviewError, ReportError, SceneError, SuiteError);

impl From<RunError> for Failure {
    fn from(e: RunError) -> Self {
        let exit = match e {
            // It began well and could not go on.
            RunError::Disk(_) | RunError::Stopped => Exit::Incomplete,
            _ => Exit::Usage,
        };
        Failure { exit, message: e.to_string() }
    }
}

impl Failure {
    /// What a renderer says of a scene: a device that fails leaves the work
    /// incomplete, all else is how it was asked.
    fn render(scene: &str, e: &RenderError) -> Self {
        let exit = if matches!(e, RenderError::Device(_)) { Exit::Incomplete } else { Exit::Usage };
        Failure { exit, message: format!("scene '{scene}': {e}") }
    }
}

impl Cli {
    /// Does what was asked.
    ///
    /// # Errors
    /// A [`Failure`] with its message and exit code.
    pub fn execute(self) -> Result<Exit, Failure> {
        match self.verb {
            Verb::Run(args) => run::execute(&args),
            Verb::Merge(args) => merge::execute(&args),
            Verb::Render(args) => render::execute(&args),
            Verb::Compare(args) => compare::execute(&args),
            Verb::Composite(args) => composite::execute(&args),
            Verb::Report(args) => report::execute(&args),
            Verb::Explain(args) => explain::execute(&args),
            Verb::Golden(verb) => golden::execute(&verb),
            Verb::Scene(verb) => scene::execute(&verb),
            Verb::Score(args) => score::execute(&args),
            Verb::Flatland(args) => flatland::execute(&args),
            Verb::Bench(verb) => bench::execute(&verb),
            Verb::Doctor(args) => doctor::execute(&args),
            Verb::Init(args) => init::execute(&args),
            Verb::Schema(args) => schema::execute(&args),
        }
    }
}

/// Prints a line for programs on standard output. A closed pipe is no error: the
/// reader has what it wanted.
fn print(text: &str) -> Result<(), Failure> {
    use std::io::Write;
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::usage(format!("cannot write to standard output: {e}")))
        }
        _ => Ok(()),
    }
}

/// Prints for people on standard error. Whatever the text quotes, no line of it is a command to GitHub's runner.
fn tell(text: &str) {
    tell_raw(&logged_lines(text));
}

/// Prints on standard error as it is: commands to GitHub's runner, which are meant.
#[allow(clippy::print_stderr)] // the one place that does
fn tell_raw(text: &str) {
    eprintln!("{text}");
}

fn json(value: &impl serde::Serialize) -> Result<String, Failure> {
    serde_json::to_string_pretty(value).map(|s| s + "\n").map_err(|e| Failure::usage(e.to_string()))
}
