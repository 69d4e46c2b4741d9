//! `aogauge report`, and the reports that `run` and `merge` write.

use super::{Exit, Failure, Format as Printed, json, print, tell, tell_raw};
use crate::{
    disk::is_same,
    record::Record,
    report::{
        self, Format,
        digest::Digest,
        github::{self, ImageBase, Written},
        html, junit,
    },
    untrusted::logged,
};
use std::{
    io::Write,
    path::{Path, PathBuf},
};

/// Make the reports of a record, without rendering: to read, and for CI systems.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge report reports/latest --out reports/copy\n  \
aogauge report reports/latest --format markdown,html,junit\n  \
aogauge report reports/latest --format github --image-base https://example.org/reports/42 --gate\n  \
aogauge report reports/latest --format json | jq -r '.failures[].subject'\n\n\
Exit codes: 0 the reports are made, 2 they cannot be. With --gate, where they are made, as the run's: 0 pass,\n\
1 a gate failed, 4 no gate was held against anything, 5 incomplete, 6 inconclusive. docs/reports.md tells more.")]
pub struct Args {
    /// The record's folder.
    record: PathBuf,
    /// What to make, one or several.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "markdown")]
    format: Vec<Format>,
    /// Folder for the files; the record's unless given. Nothing in it is replaced but earlier reports.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Where the record's folder can be seen on the web: the summary on GitHub shows
    /// pictures of what did not pass, which it can by no other way.
    #[arg(long, value_name = "URL")]
    image_base: Option<ImageBase>,
    /// Put the pictures into report.md as data URIs, so that it is one file. GitHub does
    /// not show such pictures.
    #[arg(long)]
    embed_images: bool,
    /// Exit as the run did.
    #[arg(long)]
    gate: bool,
}

/// What `run` and `merge` make of the record that they write.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct Beside {
    /// Reports to make of the record, one or several.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "markdown", value_name = "FORMAT")]
    report: Vec<Format>,
    /// With --report github: where the folder can be seen on the web, for pictures.
    #[arg(long, value_name = "URL")]
    image_base: Option<ImageBase>,
}

impl Beside {
    /// Refuses what contradicts itself, before anything is rendered.
    pub(super) fn check(&self, printed: Printed) -> Result<(), Failure> {
        if self.report.contains(&Format::Json) && printed == Printed::Json {
            return Err(Failure::usage(
                "--report json and --format json both print on standard output: leave out one, or make the other by \
                 aogauge report",
            ));
        }
        check(&self.report, self.image_base.as_ref(), "--report")
    }

    /// Makes them beside the record. Returns the files.
    pub(super) fn make(&self, record: &Record, folder: &Path, printed: Printed) -> Result<Vec<PathBuf>, Failure> {
        let images = self.image_base.as_ref();
        Wanted { formats: &self.report, images, folder, out: folder, embed: false, printed }.make(record)
    }
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    check(&args.format, args.image_base.as_ref(), "--format")?;
    let record = Record::read(&args.record)?;
    let (formats, images, folder) = (&args.format[..], args.image_base.as_ref(), args.record.as_path());
    let (out, embed) = (args.out.as_deref().unwrap_or(folder), args.embed_images);
    if embed && !formats.contains(&Format::Markdown) {
        return Err(Failure::usage(
            "--embed-images is of use with --format markdown only: HTML always holds its images",
        ));
    }
    // What lies in a record's own folder is a run's.
    if !is_same(out, folder) {
        report::own::check(&record, formats, out, embed, github_file().is_none())?;
    }
    let wanted = Wanted { formats, images, folder, out, embed, printed: Printed::Text };
    let files = wanted.make(&record)?;
    tell(&told(&files, &record.summary_line()));
    Ok(if args.gate { Exit::of(&record) } else { Exit::Pass })
}

/// The file that a runner of GitHub takes a step's summary from.
fn github_file() -> Option<PathBuf> {
    std::env::var_os(github::VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from)
}

/// The files, and what there is to say of them.
pub(super) fn told(files: &[PathBuf], what: &str) -> String {
    let files: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
    if files.is_empty() { what.to_owned() } else { format!("{}: {what}", files.join(", ")) }
}

fn check(formats: &[Format], images: Option<&ImageBase>, option: &str) -> Result<(), Failure> {
    if images.is_some() && !formats.contains(&Format::Github) {
        return Err(Failure::usage(format!("--image-base is of use with {option} github only")));
    }
    Ok(())
}

/// What is made of a record, and where.
struct Wanted<'a> {
    formats: &'a [Format],
    images: Option<&'a ImageBase>,
    /// The record's.
    folder: &'a Path,
    out: &'a Path,
    /// Whether the Markdown holds its pictures.
    embed: bool,
    /// Whether something else is printed for programs.
    printed: Printed,
}

impl Wanted<'_> {
    /// Makes all, what is printed last. Returns the files without their pictures.
    fn make(&self, record: &Record) -> Result<Vec<PathBuf>, Failure> {
        let mut files = Vec::new();
        let wants = |format| self.formats.contains(&format);
        if wants(Format::Markdown) {
            report::write_markdown(record, self.folder, self.out, self.embed)?;
            files.push(self.out.join(report::FILE));
        }
        if wants(Format::Html) {
            files.push(html::write(record, self.folder, self.out)?);
        }
        if wants(Format::Junit) {
            let (path, xml) = (self.out.join(junit::FILE), junit::xml(record)?);
            crate::disk::write_whole(&path, |buffer| buffer.write_all(xml.as_bytes()))?;
            files.push(path);
        }
        if wants(Format::Github) {
            // The runner reads annotations from both streams; a script reads JSON from one.
            let is_read = wants(Format::Json) || self.printed == Printed::Json;
            files.push(self.github(record, is_read)?);
        }
        if wants(Format::Json) {
            print(&json(&Digest::new(record, Exit::of(record) as u8, &files))?)?;
        }
        Ok(files)
    }

    /// Writes the summary and prints the annotations. Returns the summary's file.
    fn github(&self, record: &Record, is_read: bool) -> Result<PathBuf, Failure> {
        let written = github::write(record, self.images, github_file().as_deref(), self.out)?;
        let lines: String = github::annotations(record).into_iter().map(|line| line + "\n").collect();
        if is_read {
            tell_raw(lines.trim_end());
        } else {
            print(&lines)?;
        }
        Ok(match written {
            Written::Appended(path) => path,
            Written::Alone(path) => {
                let why = format!("{} is not set", github::VARIABLE);
                tell(&format!("aogauge: {why}: the summary is in {}", logged(&path.display().to_string())));
                path
            }
            Written::NoRoom(path) => {
                let what = "what this step wrote before leaves the summary no room";
                tell(&format!("aogauge: {what}: it is in {}", logged(&path.display().to_string())));
                path
            }
        })
    }
}
