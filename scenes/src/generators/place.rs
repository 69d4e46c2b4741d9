//! Where a shape stands.

use crate::bounded::Coordinate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A place on the floor.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct At {
    /// Metres along x.
    pub x: Coordinate,
    /// Metres along z.
    pub z: Coordinate,
}

impl At {
    /// The point over this place at height `y`, shifted by `x` and `z`.
    pub(crate) fn point(self, x: f32, y: f32, z: f32) -> glam::Vec3 {
        glam::Vec3::new(self.x.0 + x, y, self.z.0 + z)
    }
}
