//! `[gltf]` of a scene file.

use super::Imported;
use crate::bounded::Fine;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// `[gltf]` of a scene file: geometry from a model.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GltfTable {
    /// A .gltf or .glb file; its path is relative to the scene file.
    file: String,
    /// Patterns of the names of nodes, meshes or materials that are the occluder
    /// under judgement; `*` stands for any text, `?` for one character.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    occluders: Vec<String>,
    /// Metres per unit of the model; 1 unless given.
    scale: Option<Fine<1, 1_000_000_000>>,
}

impl GltfTable {
    /// A model whose occluders are marked in itself.
    pub(crate) fn of(file: &str) -> Self {
        GltfTable { file: file.to_owned(), occluders: Vec::new(), scale: None }
    }

    /// Says what was left to defaults.
    pub(crate) fn fill(&mut self) {
        self.scale.get_or_insert(Fine(1.0));
    }

    /// Reads the model.
    pub(crate) fn load(&self, folder: Option<&Path>) -> Result<Imported, String> {
        let Some(folder) = folder else {
            return Err(format!("gltf.file is '{}', but this scene has no folder to look in", self.file));
        };
        let mut model = super::import(&folder.join(&self.file), self.scale.map_or(1.0, |s| s.0))
            .map_err(|e| format!("gltf.file: {e}"))?;
        model.mark_occluders(&self.occluders).map_err(|e| format!("gltf.occluders: {e}"))?;
        Ok(model)
    }
}
