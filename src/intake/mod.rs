//! Images of renderers that are not ours: which files are images of what ([`files`]), what
//! is declared of them ([`Declared`]), how one becomes openness ([`read`], [`ratio`]), what
//! is wrong with it ([`diagnose`]), and which curve it was sent through ([`fit_curve`]).

mod curve;
mod declared;
mod detect;
mod diagnose;
mod files;
mod name;
mod ratio;
mod read;
mod told;
mod upsample;

pub use curve::{Curve, fit_curve};
pub use declared::{Declared, Means, Rows, Share, Upsample};
pub use detect::{Evidence, evidence};
pub use diagnose::{
    Cause, Disagreement, FACTORS, Finding, Held, Pair, PairCause, Reference, Scaled, Turn, agree, agreement, alike,
    diagnose, frame_turn, is_rather, meaning_of, pair_causes,
};
pub use files::{Defaults, Files, Handed, HandedImage, files};
pub use name::Shown;
pub use ratio::{Frame, LONE_FRAME, Ratio, frame, ratio};
pub use read::{Taken, check_numbers, read};
pub use told::{Keys, examine};

/// A scene of no suite, by whose picture a renderer shows that it holds its images the right
/// way, saves them linear, and takes R in metres: a scene file. It has no occluder, is like none of its
/// mirror images, and differs with R from a hundredth to ten times.
pub const SELF_CHECK: &str = include_str!("self-check.toml");

use crate::{counted::counted, disk::DiskError};
use std::path::PathBuf;

/// Why an image cannot be taken.
#[derive(Debug, thiserror::Error)]
pub enum IntakeError {
    /// A file or folder could not be read or decoded.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// An image has another size than the view.
    #[error(
        "{path}: the image has {} x {} pixels, a view of {} x {} at {} resolution needs {} x {}{hint}",
        found[0], found[1], view[0], view[1], share.label(), expected[0], expected[1]
    )]
    Size {
        /// The file.
        path: PathBuf,
        /// Width and height that it has.
        found: [usize; 2],
        /// Width and height that it should have.
        expected: [usize; 2],
        /// Width and height of the view.
        view: [u32; 2],
        /// The declared resolution.
        share: Share,
        /// What would be accepted, as the end of the sentence.
        hint: String,
    },
    /// The channels of an image are not alike.
    #[error(
        "{path}: red, green and blue differ by up to {difference:.4}, first at pixel ({}, {}): this is a colour picture, \
         not ambient occlusion alone; hand in the AO buffer, or the picture with and without AO",
        first[0], first[1]
    )]
    Color {
        /// The file.
        path: PathBuf,
        /// The greatest difference of two channels of a pixel, as stored: integers from 0 to 1.
        difference: f32,
        /// Column and row in the file of the first pixel that is coloured.
        first: [usize; 2],
    },
    /// Files contradict each other.
    #[error("{folder}: {what}")]
    Files {
        /// The folder that was handed in.
        folder: PathBuf,
        /// What is wrong, with the names of the files.
        what: String,
    },
    /// The frame with AO is the one without.
    #[error(
        "{with} and {without} are exchanged: {brighter} of {known} pixels are brighter in the frame with AO, which only takes \
         light away; exchange `.with` and `.without` in their names, or save both with the same exposure"
    )]
    Exchanged {
        /// The frame that is called to be with AO.
        with: PathBuf,
        /// The other.
        without: PathBuf,
        /// Pixels that are brighter with AO.
        brighter: usize,
        /// Pixels that are known.
        known: usize,
    },
    /// Two whole frames cannot be divided.
    #[error("the frames with and without AO cannot be divided: {0}")]
    Ratio(String),
    /// Pixels that see a surface hold no number.
    #[error(
        "{path}: {} NaN or infinity, the first at column {}, row {} of the view; every surface needs a number",
        counted(*count, "pixel that sees a surface holds", "pixels that see a surface hold"), first[0], first[1]
    )]
    Holes {
        /// The file.
        path: PathBuf,
        /// How many.
        count: usize,
        /// Column and row of the first, from the top left of the view.
        first: [usize; 2],
    },
}
