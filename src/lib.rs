//! aogauge judges the image quality of ambient-occlusion renderers.

pub mod flatland;
pub mod render;
pub mod stats;
pub mod trace;
pub use aogauge_scenes as scenes;
