//! Two boxes with a narrow slot between them: a real darkening.

use super::At;
use crate::{Mesh, bounded::Length};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Two boxes on the floor, side by side along x, with a slot along z.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Crevice {
    /// Between the boxes, metres.
    pub slot: Length<1, 10_000>,
    /// Extent of each box along x, metres.
    pub width: Length<1, 50_000>,
    /// Extent along y, metres.
    pub height: Length<1, 50_000>,
    /// Extent along z, metres.
    pub length: Length<1, 100_000>,
    /// x and z of the slot's middle, metres; the origin unless given.
    pub at: At,
}

impl Default for Crevice {
    fn default() -> Self {
        Crevice { slot: Length(0.06), width: Length(0.5), height: Length(0.4), length: Length(3.0), at: At::default() }
    }
}

impl Crevice {
    pub(crate) fn mesh(&self) -> Mesh {
        let (near, far, z) = (self.slot.0 / 2.0, self.slot.0 / 2.0 + self.width.0, self.length.0 / 2.0);
        let mut mesh = Mesh::default();
        for [from, to] in [[-far, -near], [near, far]] {
            mesh.push_box(self.at.point(from, 0.0, -z), self.at.point(to, self.height.0, z));
        }
        mesh
    }
}
