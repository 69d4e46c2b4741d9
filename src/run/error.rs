//! Why a run ends without a record.

use crate::{disk::DiskError, render::RenderError};

/// Images of one scene that are held at once, at most.
pub(super) const MAX_GIB: f64 = 8.0;

/// Why a run ended without a record.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A file could not be written.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// What images are scored against could not be read.
    #[error(transparent)]
    Kit(DiskError),
    /// The CPU reference could not render, so there is nothing to compare with.
    #[error("scene '{scene}': {source}")]
    Render {
        /// The scene.
        scene: String,
        /// Why.
        source: RenderError,
    },
    /// The measure view of a scene looks at the occluder.
    #[error("scene '{scene}': the measure view sees the occluder '{object}'; measure.clearance must end under it")]
    SeesOccluder {
        /// The scene.
        scene: String,
        /// The object it sees.
        object: String,
    },
    /// The measure view of a scene cuts off a flank of an occluder that it measures.
    #[error(
        "scene '{scene}': the measure view cuts off the {flank} flank of an occluder that it measures; raise measure.resolution[0], {columns} now, so that it spans 2 R to each side where the receiver reaches that far, or turn measure.transect across the occluder"
    )]
    CutsFlank {
        /// The scene.
        scene: String,
        /// `left` or `right`.
        flank: &'static str,
        /// Width of the view, pixels.
        columns: u32,
    },
    /// It was asked to stop before it was done.
    #[error("it was interrupted; what is done is kept, and the same command goes on from here")]
    Stopped,
    /// What images would be scored against cannot be made.
    #[error("scene '{scene}': its references cannot be used: {why}")]
    Reference {
        /// The scene.
        scene: String,
        /// Why.
        why: String,
    },
    /// No light reaches the receiver, so there is nothing to judge.
    #[error(
        "scene '{scene}': no light reaches the receiver even without the occluder; check environment and the openings towards it"
    )]
    NoLight {
        /// The scene.
        scene: String,
    },
    /// The images of a scene would not fit into memory.
    #[error(
        "scene '{scene}': its cases would hold {gib:.1} GiB of images at once, more than {MAX_GIB} GiB; lower replicates or measure.resolution"
    )]
    TooMuch {
        /// The scene.
        scene: String,
        /// What it would need.
        gib: f64,
    },
    /// The measure view of a scene sees nothing.
    #[error(
        "scene '{scene}': the measure view sees no surface; check measure.center, measure.normal and measure.clearance"
    )]
    SeesNothing {
        /// The scene.
        scene: String,
    },
}
