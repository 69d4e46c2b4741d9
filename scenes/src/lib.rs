//! Scenes that provoke thin-occluder errors in ambient occlusion, their
//! controls, and the light they stand in.
//!
//! This crate knows geometry and light only: it traces no ray and renders no
//! picture. A [`Scene`] is read from TOML ([`Scene::from_toml`]) or taken from
//! the built-in [`library`]; [`Scene::twin`] is the same scene with the occluder
//! under judgement taken away.
//!
//! Units are metres and linear radiance; axes are right-handed with +Y up and
//! -Z forward, as in glTF.

mod bounded;
mod camera;
mod derive;
mod environment;
mod file;
pub mod generators;
pub mod gltf;
pub mod library;
mod light;
mod material;
mod mesh;
mod scene;
mod surface;
mod texture;
mod view;
mod view_table;
mod views_json;

pub use bounded::{Count, check_name};
pub use camera::{Camera, Projection};
pub use environment::{Environment, Portal, Sky};
pub use file::{Parameters, SceneError};
pub use light::{Light, LightKind};
pub use material::{MAX_ALBEDO, Material, luminance};
pub use mesh::{Mesh, MeshError, clip, closest_point};
pub use scene::{AoScale, Object, Scene};
pub use texture::{Texture, Wrap, srgb};
pub use view::{LookView, MeasureView, View, WorldToImage};
pub use views_json::views_json;
