//! aogauge judges the image quality of ambient-occlusion renderers.

pub mod render;
pub mod trace;
pub use aogauge_scenes as scenes;
