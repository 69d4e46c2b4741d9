//! Triangles given one by one, for shapes that no generator makes.

use crate::{Mesh, bounded::Triple};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An indexed triangle mesh written out in the scene file.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Polygons {
    /// Vertex positions, metres.
    pub positions: Vec<Triple>,
    /// Three vertex indices a triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Polygons {
    pub(crate) fn mesh(&self) -> Mesh {
        Mesh {
            positions: self.positions.iter().map(|p| p.vec()).collect(),
            triangles: self.triangles.clone(),
            uvs: vec![],
        }
    }
}
