//! aogauge judges the image quality of ambient-occlusion renderers.

pub mod bench;
pub mod changes;
mod claim;
pub mod cli;
pub mod compare;
pub mod disk;
pub mod escape;
pub mod flatland;
pub mod gate;
pub mod golden;
pub mod judge_cache;
pub mod kit;
pub mod layers;
pub mod metrics;
pub mod picture;
pub mod pooled;
pub mod preview;
pub mod record;
pub mod render;
pub mod report;
pub mod run;
pub mod screen_camera;
pub mod stats;
pub mod suite;
pub mod trace;
pub use aogauge_scenes as scenes;
