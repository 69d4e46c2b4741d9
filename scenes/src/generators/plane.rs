//! A rectangle: open ground, a wall.

use crate::{Mesh, bounded::Triple};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The parallelogram `center +- u/2 +- v/2`, facing `u x v`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// Its middle, metres.
    pub center: Triple,
    /// One edge vector, metres.
    pub u: Triple,
    /// The other edge vector, metres.
    pub v: Triple,
}

impl Plane {
    pub(crate) fn mesh(&self) -> Result<Mesh, String> {
        let (u, v) = (self.u.vec(), self.v.vec());
        let mut mesh = Mesh::default();
        mesh.push_quad(self.center.vec() - u / 2.0 - v / 2.0, u, v);
        // Of the corners as rounded: far from the origin small edges vanish.
        let area = |[a, b, c]: [Vec3; 3]| (b.as_dvec3() - a.as_dvec3()).cross(c.as_dvec3() - a.as_dvec3()).length();
        if mesh.corners().any(|t| area(t) <= 0.0) {
            return Err("plane: u and v must span an area at center: not parallel, and not too short for 32-bit coordinates there".into());
        }
        Ok(mesh)
    }
}
