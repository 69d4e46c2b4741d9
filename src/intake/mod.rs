//! Images of renderers that are not ours: what is declared of them ([`Declared`]), how
//! one file becomes openness ([`read`]).

mod declared;
mod read;
mod upsample;

pub use declared::{Declared, Means, Rows, Share, Upsample};
pub use read::{Taken, read};

use crate::disk::DiskError;
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
    /// Pixels that see a surface hold no number.
    #[error(
        "{path}: {count} pixels that see a surface hold NaN or infinity, the first at column {}, row {} of the view; \
         every surface needs a number",
        first[0], first[1]
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
