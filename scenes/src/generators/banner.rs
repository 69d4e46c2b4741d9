//! A banner: cloth hanging from a rod, its lower edge free.

use super::{
    At, Part,
    rings::{Ring, push_rings},
    sheet::push_sheet,
};
use crate::{
    Mesh,
    bounded::{Count, Length, Thickness},
};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cloth from `gap` to `gap + height` along y and `width` along z, straight at
/// the rod and bowed to +x towards the hem. Parts: `cloth`, the occluder, and
/// `rod`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Banner {
    /// Extent of the cloth along z, metres.
    pub width: Length<50, 50_000>,
    /// From the hem to the axis of the rod, metres.
    pub height: Length<50, 50_000>,
    /// Height of the hem over y = 0, metres.
    pub gap: Length<0, 50_000>,
    /// Of the cloth, along x, metres; 0 for a single, open sheet.
    pub thickness: Thickness,
    /// How far the middle of the hem swings to +x, metres.
    pub bow: Length<0, 5_000>,
    /// Columns and rows of the cloth.
    pub segments: Count<1, 128>,
    /// Radius of the rod, metres.
    pub rod_radius: Length<2, 1_000>,
    /// How far the rod reaches beyond the cloth at each end, metres.
    pub rod_overhang: Length<0, 5_000>,
    /// Sides of the rod.
    pub rod_sides: Count<3, 32>,
    /// x and z of the rod's middle, metres; the origin unless given.
    pub at: At,
}

impl Default for Banner {
    fn default() -> Self {
        Banner {
            width: Length(1.0),
            height: Length(1.8),
            gap: Length(0.1),
            thickness: Thickness(0.0),
            bow: Length(0.04),
            segments: Count(16),
            rod_radius: Length(0.015),
            rod_overhang: Length(0.06),
            rod_sides: Count(16),
            at: At::default(),
        }
    }
}

impl Banner {
    pub(crate) fn parts(&self) -> Vec<Part> {
        let cloth = |u: f32, v: f32| {
            let swell = (std::f64::consts::PI * f64::from(u)).sin() as f32 * (1.0 - v) * (1.0 - v);
            self.at.point(self.bow.0 * swell, self.gap.0 + self.height.0 * v, self.width.0 * (u - 0.5))
        };
        let mut sheet = Mesh::default();
        push_sheet(&mut sheet, [self.segments.0; 2], cloth, Vec3::X * self.thickness.0);
        let end = self.width.0 / 2.0 + self.rod_overhang.0;
        let rings = [-end, end].map(|z| Ring {
            center: self.at.point(0.0, self.gap.0 + self.height.0, z),
            a: Vec3::X * self.rod_radius.0,
            b: Vec3::Y * self.rod_radius.0,
        });
        let mut rod = Mesh::default();
        push_rings(&mut rod, &rings, self.rod_sides.0);
        vec![Part::occluder("cloth", sheet), Part::named("rod", rod)]
    }
}
