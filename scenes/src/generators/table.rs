//! A table: a top on four thin legs.

use super::{At, Part};
use crate::{Mesh, bounded::Length};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A table centred over its place. Its legs end `gap` over the floor, as on
/// glides. Parts: `legs`, the occluders, and `top`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Table {
    /// Extent of the top along x, metres.
    pub width: Length<50, 50_000>,
    /// Extent of the top along z, metres.
    pub length: Length<50, 50_000>,
    /// Height of the upper side over y = 0, metres.
    pub height: Length<50, 50_000>,
    /// Of the top, metres.
    pub top_thickness: Length<1, 1_000>,
    /// Extent of a leg along x, metres.
    pub leg_width: Length<1, 1_000>,
    /// Extent of a leg along z, metres.
    pub leg_length: Length<1, 1_000>,
    /// From the edge of the top to a leg, metres.
    pub inset: Length<0, 5_000>,
    /// Height of the legs' lower ends over y = 0, metres.
    pub gap: Length<0, 1_000>,
    /// x and z of its middle, metres; the origin unless given.
    pub at: At,
}

impl Default for Table {
    fn default() -> Self {
        Table {
            width: Length(0.8),
            length: Length(1.4),
            height: Length(0.74),
            top_thickness: Length(0.03),
            leg_width: Length(0.02),
            leg_length: Length(0.06),
            inset: Length(0.05),
            gap: Length(0.01),
            at: At::default(),
        }
    }
}

impl Table {
    pub(crate) fn parts(&self) -> Result<Vec<Part>, String> {
        let (x, z) = (self.width.0 / 2.0, self.length.0 / 2.0);
        let (legs_x, legs_z) = (self.inset.0 + self.leg_width.0, self.inset.0 + self.leg_length.0);
        if legs_x > x || legs_z > z {
            return Err(format!(
                "the legs do not fit: inset + leg_width must be at most width / 2 = {x} m, \
                 and inset + leg_length at most length / 2 = {z} m"
            ));
        }
        let under = self.height.0 - self.top_thickness.0;
        // A leg shorter than a tenth of a millimetre would have no sides.
        if under < self.gap.0 + 1e-4 {
            return Err(format!(
                "there is no room for legs: gap + top_thickness must be below height {} m",
                self.height.0
            ));
        }
        let mut top = Mesh::default();
        top.push_box(self.at.point(-x, under, -z), self.at.point(x, self.height.0, z));
        let mut legs = Mesh::default();
        for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
            let outer = self.at.point(sx * (x - self.inset.0), self.gap.0, sz * (z - self.inset.0));
            let inner = self.at.point(sx * (x - legs_x), under, sz * (z - legs_z));
            legs.push_box(outer.min(inner), outer.max(inner));
        }
        Ok(vec![Part::occluder("legs", legs), Part::named("top", top)])
    }
}
