//! Scenes packed for renderers of others: one alone, or those of a suite with all that the
//! images are scored against.

mod manifest;
mod scene;
mod self_check;
mod suite;

pub use manifest::{Manifest, ManifestScene, ManifestSelfCheck};
pub use scene::{KitError, write_alone};
pub use suite::{SCENES, SCORING, write_suite};
