//! Renderers that are commands: a program is told where the scene lies, what to render
//! and where to leave the image. No shell reads what it is told.
//!
//! Each image has a fresh folder of its own under the run's, and nothing is read but a plain file
//! at the one place that was named.

mod capture;
mod logged;
mod output;
mod process;
mod template;

pub(crate) use capture::Capped;
pub(crate) use output::Attempt;
pub(crate) use template::{Slot, Template};

use crate::{
    disk::DiskError,
    intake::{Declared, Keys},
    layers::hex,
    untrusted::{cut, line},
};
use process::{End, Ran};
use sha2::{Digest, Sha256};
use std::{
    collections::BTreeMap,
    ffi::OsString,
    fs,
    io::{self, Read},
    path::{Path, PathBuf},
    process::Command,
    time::Duration,
};

/// The last lines of what a command said, that an error quotes.
const LINES: usize = 5;

/// A command that renders, as the suite describes it.
#[derive(Clone, Debug)]
pub struct External {
    /// Its name: the renderer of its cases.
    pub name: String,
    /// A path from `suite_folder`, an absolute one, or a bare name on `PATH`.
    pub(crate) program: String,
    pub(crate) arguments: Vec<Template>,
    /// Whether it has our environment, too.
    pub(crate) inherit: bool,
    pub(crate) environment: BTreeMap<String, Template>,
    /// Where it works.
    pub(crate) folder: PathBuf,
    /// Where the suite file lies, absolute.
    pub(crate) suite_folder: PathBuf,
    /// What one image may take.
    pub(crate) timeout: Duration,
    /// How often an image is tried again.
    pub(crate) retries: u32,
    /// The ending of the image's name, and so its format.
    pub(crate) format: &'static str,
    /// What its images are.
    pub(crate) image: Declared,
}

/// A command whose program is found.
#[derive(Clone, Debug)]
pub struct Ready<'a> {
    /// The command.
    pub external: &'a External,
    program: PathBuf,
}

/// What one image is of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shot<'a> {
    /// The scene as glb.
    pub scene: &'a Path,
    /// The same as a scene file of ours.
    pub scene_toml: &'a Path,
    /// Its views.
    pub views: &'a Path,
    pub estimator: &'a str,
    pub rays: u32,
    /// R and R', metres.
    pub radii: [f32; 2],
    /// Of the measure view.
    pub resolution: [u32; 2],
    /// The run's seed.
    pub seed: u32,
    pub replicate: u32,
}

/// Why a command cannot be run, or left no image.
#[derive(Debug, thiserror::Error)]
pub enum ExternalError {
    /// There is no such program.
    #[error("renderer '{name}': command: the program '{program}' is not found {place}{hint}")]
    NoProgram {
        /// The renderer.
        name: String,
        /// As the suite has it.
        program: String,
        /// Where it was looked for.
        place: String,
        /// What may be meant.
        hint: String,
    },
    /// Its working folder is not there.
    #[error("renderer '{name}': folder: '{folder}' is no folder")]
    NoFolder {
        /// The renderer.
        name: String,
        /// The folder.
        folder: PathBuf,
    },
    /// The system refused to start it.
    #[error("the command could not be started: {0}")]
    Start(io::Error),
    /// It ended otherwise than well.
    #[error("the command failed ({status}){last}")]
    Failed {
        /// How it ended.
        status: std::process::ExitStatus,
        /// What it said last.
        last: String,
    },
    /// It took too long.
    #[error("the command took longer than {seconds} s (timeout) and was ended{last}")]
    TimedOut {
        /// What it was given, seconds.
        seconds: f64,
        /// What it said last.
        last: String,
    },
    /// It ended well without an image.
    #[error("the command ended without an error, but left no file at {{output}}{last}")]
    NoOutput {
        /// What it said last.
        last: String,
    },
    /// What it left is not to be read.
    #[error("what the command left at {{output}} is {what}: only a plain file in the folder it was given is read")]
    NotPlain {
        /// What it is.
        what: &'static str,
    },
    /// The run's own folder could not be used.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// Its image cannot be used.
    #[error("{0}")]
    Image(String),
}

/// The seed of a replicate, 0 to 2^31 - 1, as every program takes it. That of replicate 0
/// is the run's, and no two replicates of a run share one.
pub(crate) fn seed(run: u32, replicate: u32) -> u32 {
    // An odd factor: no two products are equal modulo a power of two.
    run.wrapping_add(replicate.wrapping_mul(0x9e37_79b1)) & 0x7fff_ffff
}

impl External {
    /// Finds the program: a path is looked up beside the suite file, a bare name on `PATH`.
    ///
    /// # Errors
    /// [`ExternalError::NoProgram`] and [`ExternalError::NoFolder`].
    pub fn find(&self) -> Result<Ready<'_>, ExternalError> {
        if !self.folder.is_dir() {
            return Err(ExternalError::NoFolder { name: self.name.clone(), folder: self.folder.clone() });
        }
        let program = which::which_in(&self.program, std::env::var_os("PATH"), &self.suite_folder);
        let program = program.map_err(|_| self.not_found())?;
        // A relative entry of PATH is found from our folder, not from the command's.
        let program = std::path::absolute(&program).unwrap_or(program);
        Ok(Ready { external: self, program })
    }

    fn not_found(&self) -> ExternalError {
        let is_bare = !self.program.contains(['/', std::path::MAIN_SEPARATOR]);
        let beside = self.suite_folder.join(&self.program);
        let hint = match (is_bare, beside.is_file()) {
            (true, true) => format!("; for the one beside the suite file write './{}'", self.program),
            (false, true) => " as a program: it may not be executable".to_owned(),
            _ => String::new(),
        };
        let place =
            if is_bare { "on PATH".to_owned() } else { format!("beside the suite file ({})", beside.display()) };
        ExternalError::NoProgram { name: self.name.clone(), program: self.program.clone(), place, hint }
    }
}

impl Ready<'_> {
    /// Hash of the files whose content decides what comes of the command, as far as the suite names
    /// them: the program, and arguments that are files as they stand. What those read in turn is
    /// not known here.
    ///
    /// # Errors
    /// Where one cannot be read.
    pub(crate) fn identity(&self) -> Result<String, DiskError> {
        let external = self.external;
        let only_folder =
            |slot| if slot == Slot::SuiteFolder { external.suite_folder.clone().into() } else { "\0".into() };
        let named = external.arguments.iter().map(|a| external.folder.join(a.fill(&only_folder)));
        let mut sha = Sha256::new();
        for path in std::iter::once(self.program.clone()).chain(named).filter(|path| path.is_file()) {
            let mut file = fs::File::open(&path).map_err(DiskError::io(&path, "read the file"))?;
            let mut chunk = [0; 65_536];
            loop {
                match file.read(&mut chunk).map_err(DiskError::io(&path, "read the file"))? {
                    0 => break,
                    n => sha.update(&chunk[..n]),
                }
            }
        }
        Ok(hex(&sha.finalize()))
    }

    /// Renders one image into the folder of an attempt, and says on `log` what was done and said. None where
    /// `go_on` said no. Seconds are those of the whole command.
    ///
    /// # Errors
    /// [`ExternalError`].
    pub(crate) fn render(
        &self,
        shot: &Shot<'_>,
        attempt: &Attempt,
        go_on: &dyn Fn() -> bool,
        log: &mut Capped,
    ) -> Result<Option<(Vec<f32>, f64)>, ExternalError> {
        let mut command = self.command(shot, attempt);
        log.push(logged::written(&command, self.external, &self.program).as_bytes());
        let ran = process::run(&mut command, self.external.timeout, go_on).map_err(ExternalError::Start)?;
        for (name, said) in [("stdout", &ran.stdout), ("stderr", &ran.stderr)] {
            if !said.is_empty() {
                let said = said.text();
                let end = if said.ends_with('\n') { "" } else { "\n" };
                log.push(format!("--- {name}\n{said}{end}").as_bytes());
            }
        }
        let status = match ran.end {
            End::Exited(status) => status.to_string(),
            End::TimedOut => "ended after its timeout".to_owned(),
            End::Asked => "ended because the run is".to_owned(),
        };
        log.push(format!("--- {status}, {:.2} s\n", ran.seconds).as_bytes());
        self.image(&ran, shot, attempt, log)
    }

    /// What a command that has run left.
    fn image(
        &self,
        ran: &Ran,
        shot: &Shot<'_>,
        attempt: &Attempt,
        log: &mut Capped,
    ) -> Result<Option<(Vec<f32>, f64)>, ExternalError> {
        match ran.end {
            End::Asked => return Ok(None),
            End::TimedOut => {
                let seconds = self.external.timeout.as_secs_f64();
                return Err(ExternalError::TimedOut { seconds, last: last(ran) });
            }
            End::Exited(status) if !status.success() => {
                return Err(ExternalError::Failed { status, last: last(ran) });
            }
            End::Exited(_) => {}
        }
        let Some(path) = attempt.taken()? else { return Err(ExternalError::NoOutput { last: last(ran) }) };
        let taken = crate::intake::read(&path, &self.external.image, shot.resolution)
            .map_err(|e| ExternalError::Image(e.of(Keys::Suite)))?;
        for warning in &taken.warnings {
            log.push(format!("warning: {warning}\n").as_bytes());
        }
        let mut images = taken.replicates.into_iter();
        match (images.next(), images.next()) {
            (Some(image), None) => Ok(Some((image, ran.seconds))),
            (None, _) => Err(ExternalError::Image("the image of the command holds no values".into())),
            _ => Err(ExternalError::Image(
                "the image of the command holds several replicates: it must be one, of the seed that was given".into(),
            )),
        }
    }

    fn command(&self, shot: &Shot<'_>, attempt: &Attempt) -> Command {
        let external = self.external;
        let value = |slot: Slot| -> OsString {
            match slot {
                Slot::Scene => shot.scene.into(),
                Slot::SceneToml => shot.scene_toml.into(),
                Slot::View => shot.views.into(),
                Slot::Output => attempt.output().into(),
                Slot::Rays => shot.rays.to_string().into(),
                Slot::Seed => seed(shot.seed, shot.replicate).to_string().into(),
                Slot::Radius => shot.radii[0].to_string().into(),
                Slot::SecondaryRadius => shot.radii[1].to_string().into(),
                Slot::Estimator => shot.estimator.into(),
                Slot::Width => self.size(shot)[0].to_string().into(),
                Slot::Height => self.size(shot)[1].to_string().into(),
                Slot::Replicate => shot.replicate.to_string().into(),
                Slot::SuiteFolder => external.suite_folder.clone().into(),
            }
        };
        let mut command = Command::new(&self.program);
        command.args(external.arguments.iter().map(|a| a.fill(&value))).current_dir(&external.folder);
        if !external.inherit {
            command.env_clear();
            // Without it no program of Windows finds its libraries.
            command.envs(std::env::var_os("SystemRoot").filter(|_| cfg!(windows)).map(|root| ("SystemRoot", root)));
        }
        command.envs(external.environment.iter().map(|(name, text)| (name, text.fill(&value))));
        command
    }

    /// Width and height that the image must have.
    fn size(&self, shot: &Shot<'_>) -> [usize; 2] {
        self.external.image.resolution.of(shot.resolution)
    }
}

/// The last lines that a command said, of its errors where there are any.
fn last(ran: &Ran) -> String {
    let said = if ran.stderr.text().trim().is_empty() { ran.stdout.text() } else { ran.stderr.text() };
    let lines: Vec<String> = said.lines().map(|l| line(l).trim().to_owned()).filter(|l| !l.is_empty()).collect();
    let lines = lines[lines.len().saturating_sub(LINES)..].iter().map(|l| cut(l, 200).into_owned());
    let lines: Vec<String> = lines.collect();
    if lines.is_empty() { "; it said nothing".to_owned() } else { format!("; it said last: {}", lines.join(" | ")) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn no_two_replicates_share_a_seed() {
        for run in [0, 1, 7, 0x7fff_ffff, u32::MAX] {
            let seeds: HashSet<u32> = (0..1024).map(|r| seed(run, r)).collect();
            assert_eq!(seeds.len(), 1024);
            assert!(seeds.iter().all(|s| i32::try_from(*s).is_ok()));
        }
        assert_eq!([seed(1, 0), seed(7, 0)], [1, 7]);
    }
}
