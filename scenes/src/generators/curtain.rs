//! A flat curtain: the sheet of the paper's Fig. 1 and Fig. 2, and with a large
//! thickness the thick box it is compared with.

use crate::{
    Mesh,
    bounded::{NonNegative, Positive},
};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A closed box hanging over the floor y = 0: `thickness` along x, `length`
/// along z, from `gap` to `gap + height` along y.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curtain {
    /// The paper's w, metres.
    pub thickness: Positive,
    /// The paper's m: height of the hem over y = 0, metres.
    pub gap: NonNegative,
    /// The paper's h: from hem to top, metres.
    pub height: Positive,
    /// Extent along z, metres.
    pub length: Positive,
    /// x and z of its middle, metres; the origin unless given.
    #[serde(default)]
    pub at: At,
}

/// A place on the floor.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct At {
    /// Metres along x.
    pub x: f32,
    /// Metres along z.
    pub z: f32,
}

impl Curtain {
    pub(crate) fn mesh(&self) -> Mesh {
        let (w, l) = (self.thickness.0 / 2.0, self.length.0 / 2.0);
        let (bottom, top) = (self.gap.0, self.gap.0 + self.height.0);
        let mut mesh = Mesh::default();
        mesh.push_box(Vec3::new(self.at.x - w, bottom, self.at.z - l), Vec3::new(self.at.x + w, top, self.at.z + l));
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stands_where_it_is_told() {
        let mesh = Curtain {
            thickness: Positive(0.02),
            gap: NonNegative(0.1),
            height: Positive(1.0),
            length: Positive(4.0),
            at: At { x: 0.5, z: -1.0 },
        }
        .mesh();
        let lo = mesh.positions.iter().copied().reduce(Vec3::min).unwrap();
        let hi = mesh.positions.iter().copied().reduce(Vec3::max).unwrap();
        assert!((lo - Vec3::new(0.49, 0.1, -3.0)).length() < 1e-6);
        assert!((hi - Vec3::new(0.51, 1.1, 1.0)).length() < 1e-6);
    }
}
