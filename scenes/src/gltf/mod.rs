//! glTF 2.0 in and out.
//!
//! [`import`] reads `.gltf` and `.glb` files from anywhere: nothing a file says
//! is believed before it is held against the bytes that are there, so a broken
//! or hostile file ends in one sentence that names it, never in a panic and
//! never in memory taken on the word of a header. [`write_glb`] writes a scene
//! that reads back the same.
//!
//! What is read: node transforms, triangles of all modes, sparse and quantised
//! accessors, base colour (factor and texture), metallic, roughness, emission,
//! cameras, punctual lights. Alpha masks become cut-outs in the geometry; alpha
//! blending is taken as opaque. Textures repeat, whatever their sampler says.
//! Animation, skins and morph targets are left out.

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

pub use export::write_glb;
pub(crate) use table::GltfTable;

use crate::{Camera, Light, Object};
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
    /// How many triangles without area were dropped.
    pub degenerate: usize,
    /// The names each object goes by: its nodes', its mesh's, its material's.
    names: Vec<Vec<Arc<str>>>,
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
