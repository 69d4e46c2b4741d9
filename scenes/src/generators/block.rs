//! A closed, axis-aligned box: a pillar, a wall, a crate.

use crate::{Mesh, bounded::Triple};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The box between two corners.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// The corner with the smallest coordinates, metres.
    pub min: Triple,
    /// The corner with the largest coordinates, metres.
    pub max: Triple,
}

impl Block {
    pub(crate) fn mesh(&self) -> Result<Mesh, String> {
        let (min, max) = (self.min.vec(), self.max.vec());
        if !max.cmpgt(min).all() {
            return Err(format!("block: max is {max} and min is {min}: max must be above min on every axis"));
        }
        let mut mesh = Mesh::default();
        mesh.push_box(min, max);
        Ok(mesh)
    }
}
