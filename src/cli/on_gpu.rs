//! How the GPU is to render: options that verbs which render share.

use super::Failure;
use crate::render::gpu::{GBufferBy, Options, Traversal};

/// For the GPU only.
#[derive(Debug, Default, clap::Args)]
pub(super) struct OnGpu {
    /// How the GPU finds what each pixel sees; rays unless given.
    #[arg(long, value_enum)]
    g_buffer: Option<GBufferBy>,
    /// How the GPU finds what a ray meets; software unless given.
    #[arg(long, value_enum)]
    traversal: Option<Traversal>,
}

impl OnGpu {
    /// With what is the default where nothing is given.
    pub fn options(&self) -> Options {
        Options {
            g_buffer: self.g_buffer.unwrap_or_default(),
            traversal: self.traversal.unwrap_or_default(),
            ..Options::default()
        }
    }

    /// Whether anything was asked for.
    pub fn is_given(&self) -> bool {
        self.g_buffer.is_some() || self.traversal.is_some()
    }

    /// Whether the G-buffer is to be drawn.
    pub fn draws(&self) -> bool {
        self.g_buffer == Some(GBufferBy::Raster)
    }

    /// Refuses what only the GPU knows.
    pub fn refuse(&self) -> Result<(), Failure> {
        let option = match (self.g_buffer, self.traversal) {
            (Some(_), _) => "--g-buffer",
            (_, Some(_)) => "--traversal",
            _ => return Ok(()),
        };
        Err(Failure::usage(format!("{option} is for the GPU, and --renderer is cpu")))
    }
}
