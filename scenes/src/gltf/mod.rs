//! glTF 2.0 in and out.
//!
//! [`import`] reads `.gltf` and `.glb` files from anywhere: nothing a file says
//! is believed before it is held against the bytes that are there, so a broken
//! or hostile file ends in one sentence that names it, never in a panic and
//! never in memory taken on the word of a header. [`write_glb`] writes a scene
//! that reads back the same.
//!
//! What is read: node transforms, triangles of all modes, sparse and quantised
//! accessors, base colour, metallic, roughness and emission (factors and
//! textures, with the wrap modes of their samplers), cameras, punctual lights.
//! Alpha masks become cut-outs in the geometry; what is blended is taken to be
//! there where it is at least half opaque. Textures share the coordinates of a
//! material's first one; one that has others counts by its mean. Normal and
//! occlusion maps, animation, skins and morph targets are left out.

// Why the container and the JSON are read here and not by the crate `gltf`
// (1.4.1, with gltf-json 1.4.1). What was tried is in tests/gltf/oracle.rs, which
// also holds what we write against that crate:
// - `json::Index`, component types, modes and wrap modes are cut to 32 bits
//   (`value as u32`): mesh 4294967296 is read as mesh 0, component type
//   4294972422 as 5126. A malformed file would be another model, not an error.
// - What it does not know (`Checked::Invalid`) it no longer names, so that
//   messages could not say which value is wrong.
// - `Glb::from_slice` takes files longer than their header says, refuses chunks
//   of unknown kind, which the format tells readers to pass over, and computes
//   `length - 12` unchecked; `Glb::from_reader` allocates by the header's length.
// - `scenes[].nodes` is required, though the format leaves it optional.
// - Its accessor iterators compute `stride * (count - 1)` unchecked, hold the
//   width of an element against component type and stride only by
//   `debug_assert`, and panic where the stride is the smaller. Quantised
//   positions (KHR_mesh_quantization) are read as if they were floats.
mod accessor;
mod bytes;
mod container;
mod document;
mod export;
mod export_views;
mod graph;
mod import;
mod mask;
mod material;
mod names;
mod punctual;
mod table;
mod texture;
mod views;

pub use export::write_glb;
pub(crate) use table::GltfTable;
pub(crate) use views::CAMERAS as VIEW_CAMERAS;

use crate::{Camera, Light, LookView, MeasureView, Object};
use std::path::Path;
use std::sync::Arc;

/// What a glTF file holds, in world space and metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Imported {
    /// One a primitive of triangles, named after its node.
    pub objects: Vec<Object>,
    /// The cameras.
    pub cameras: Vec<Camera>,
    /// The punctual lights.
    pub lights: Vec<Light>,
    /// The measure view, where the file was written from a scene.
    pub measure: Option<MeasureView>,
    /// The look view, where the file was written from a scene.
    pub look: Option<LookView>,
    /// How many triangles without area were dropped.
    pub degenerate: usize,
    /// The names each object goes by: its nodes', its mesh's, its material's.
    names: Vec<Vec<Arc<str>>>,
    /// What is there in the file, but has no triangles left.
    emptied: Vec<names::Emptied>,
}

/// Why a glTF file cannot be read or written. One sentence that names the file.
#[derive(Debug, thiserror::Error)]
pub enum GltfError {
    /// The file cannot be opened or read.
    #[error("{file}: cannot read the glTF file: {source}")]
    Read {
        /// The file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// The file says something that does not hold or is not supported.
    #[error("{file}: {message}")]
    Invalid {
        /// The file.
        file: String,
        /// What, and in which node, mesh, accessor, ...
        message: String,
    },
    /// The scene cannot be said in glTF.
    #[error("scene '{scene}' cannot be exported: {message}")]
    Export {
        /// The scene's name.
        scene: String,
        /// What, and in which object.
        message: String,
    },
    /// The output does not take the bytes.
    #[error("scene '{scene}': cannot write the GLB: {source}")]
    Write {
        /// The scene's name.
        scene: String,
        /// Why.
        source: std::io::Error,
    },
}

/// Reads a `.gltf` or `.glb` file; `scale` is metres per unit of the file.
///
/// # Errors
/// [`GltfError::Read`] where the file cannot be read, [`GltfError::Invalid`] for
/// anything in it, or in the files it names, that does not hold.
pub fn import(path: &Path, scale: f32) -> Result<Imported, GltfError> {
    let file = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|source| GltfError::Read { file: file.clone(), source })?;
    import_bytes(&file, &bytes, Some(path.parent().unwrap_or(Path::new("."))), scale)
}

/// Reads glTF from memory. `file` is what errors call it; files that it names are
/// looked for in `folder`, and are an error without one.
///
/// # Errors
/// [`GltfError::Invalid`] for anything that does not hold.
pub fn import_bytes(file: &str, bytes: &[u8], folder: Option<&Path>, scale: f32) -> Result<Imported, GltfError> {
    import::read(bytes, folder, scale).map_err(|message| GltfError::Invalid { file: file.to_owned(), message })
}
