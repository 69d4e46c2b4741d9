//! `aogauge compare` of two records.

use super::Args;
use crate::{
    changes::{Outcome, changes, images, markdown, text},
    cli::{Exit, Failure, json, print},
    metrics::image::DEFAULT_PPD,
    record::{FILE, Record},
};
use clap::ValueEnum;
use std::path::PathBuf;

/// Where a record's images lie.
const IMAGES: &str = "images";

/// `--format`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Printed {
    /// For people.
    #[default]
    Text,
    /// For programs.
    Json,
    /// Of two records: a comment for a pull request.
    Markdown,
}

impl Args {
    fn are_records(&self) -> bool {
        [&self.reference, &self.test].iter().all(|f| f.join(FILE).is_file())
    }

    /// Whether two records are to be compared as such.
    pub(super) fn as_records(&self) -> bool {
        !self.images && self.are_records()
    }

    /// The images or folders of images to compare.
    pub(super) fn as_images(&self) -> Result<[PathBuf; 2], Failure> {
        if self.format == Printed::Markdown {
            return Err(Failure::usage("--format markdown tells of two records: give two folders with a record.json"));
        }
        if !self.images {
            return Ok([self.reference.clone(), self.test.clone()]);
        }
        if !self.are_records() {
            return Err(Failure::usage(
                "--images takes the images of two records: give two folders with a record.json",
            ));
        }
        Ok([self.reference.join(IMAGES), self.test.join(IMAGES)])
    }

    /// The first option given that says how images are compared.
    fn image_option(&self) -> Option<&'static str> {
        let given = [
            ("--exact", self.exact),
            ("--tolerance", self.tolerance != 0.0),
            ("--fail", !self.fail.is_empty()),
            ("--warn", !self.warn.is_empty()),
            ("--limits", self.limits.is_some()),
            ("--layer", self.layer.is_some()),
            ("--all-layers", self.all_layers),
            ("--encoding", self.encoding.is_some()),
            ("--reference-encoding", self.reference_encoding.is_some()),
            ("--test-encoding", self.test_encoding.is_some()),
            ("--mask", self.mask.is_some()),
            ("--ignore", !self.ignore.is_empty()),
            ("--only", !self.only.is_empty()),
            ("--crop", self.crop.is_some()),
            ("--ppd", self.ppd != DEFAULT_PPD),
            ("--hdr", self.hdr),
            ("--ssimulacra2", self.ssimulacra2),
            ("--maps", self.maps.is_some()),
            ("--diff", self.diff.is_some()),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(name, _)| name)
    }
}

/// Tells what changed between two records.
pub(super) fn execute(args: &Args) -> Result<Exit, Failure> {
    if let Some(option) = args.image_option() {
        return Err(Failure::usage(format!("{option} is for images: to compare those of two records, add --images")));
    }
    let (base, new) = (Record::read(&args.reference)?, Record::read(&args.test)?);
    let images = images((&args.reference, &base), (&args.test, &new));
    let found = changes(&base, &new, images, args.allow_missing);
    match args.format {
        Printed::Text => print(&text(&found))?,
        Printed::Json => print(&json(&found)?)?,
        Printed::Markdown => print(&markdown(&found))?,
    }
    Ok(match found.outcome {
        Outcome::Lost => Exit::Incomplete,
        Outcome::Worse => Exit::Failed,
        Outcome::Nothing => Exit::Nothing,
        Outcome::Pass => Exit::Pass,
    })
}
