//! A convex ridge: a control without any occluder, where AO has nothing to do.

use super::At;
use crate::{Mesh, bounded::Length};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A roof on the floor, its ridge along z.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Ridge {
    /// Extent of its foot along x, metres.
    pub width: Length<1, 100_000>,
    /// Height of the ridge over y = 0, metres.
    pub height: Length<1, 50_000>,
    /// Extent along z, metres.
    pub length: Length<1, 100_000>,
    /// x and z of its middle, metres; the origin unless given.
    pub at: At,
}

impl Default for Ridge {
    fn default() -> Self {
        Ridge { width: Length(1.2), height: Length(0.35), length: Length(3.0), at: At::default() }
    }
}

impl Ridge {
    pub(crate) fn mesh(&self) -> Mesh {
        let (x, z) = (self.width.0 / 2.0, self.length.0 / 2.0);
        let positions = [-z, z]
            .into_iter()
            .flat_map(|z| [self.at.point(-x, 0.0, z), self.at.point(x, 0.0, z), self.at.point(0.0, self.height.0, z)])
            .collect();
        // The two gables, then foot, +x slope and -x slope.
        let triangles = vec![[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]];
        Mesh { positions, triangles, uvs: vec![] }
    }
}
