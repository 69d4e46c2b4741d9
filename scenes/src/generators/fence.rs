//! A fence of upright slats.

use super::{At, sheet::push_sheet};
use crate::{
    Mesh,
    bounded::{Count, Length, Thickness},
};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Upright slats in a row along z, from `gap` to `gap + height` along y, on
/// rails behind them, at -x.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SlattedFence {
    /// How many slats.
    pub slats: Count<1, 1000>,
    /// Extent of a slat along z, metres.
    pub slat_width: Length<5, 1_000>,
    /// Between two slats, metres.
    pub opening: Length<1, 1_000>,
    /// Of a slat, along x, metres; 0 for a single, open sheet.
    pub thickness: Thickness,
    /// From the lower to the upper end of a slat, metres.
    pub height: Length<50, 50_000>,
    /// Height of the lower ends over y = 0, metres.
    pub gap: Length<0, 50_000>,
    /// How many rails, spread evenly over the height.
    pub rails: Count<0, 8>,
    /// Extent of a rail along y, metres.
    pub rail_height: Length<5, 1_000>,
    /// Extent of a rail along x, metres.
    pub rail_thickness: Length<1, 1_000>,
    /// x and z of its middle, metres; the origin unless given.
    pub at: At,
}

impl Default for SlattedFence {
    fn default() -> Self {
        SlattedFence {
            slats: Count(40),
            slat_width: Length(0.09),
            opening: Length(0.03),
            thickness: Thickness(0.018),
            height: Length(1.2),
            gap: Length(0.08),
            rails: Count(2),
            rail_height: Length(0.07),
            rail_thickness: Length(0.035),
            at: At::default(),
        }
    }
}

impl SlattedFence {
    pub(crate) fn mesh(&self) -> Result<Mesh, String> {
        let rails = self.rails.0 as f32;
        if (rails + 1.0) * self.rail_height.0 > self.height.0 {
            return Err(format!(
                "{rails} rails of rail_height {} m do not fit height {} m: (rails + 1) x rail_height must be at most height",
                self.rail_height.0, self.height.0
            ));
        }
        let pitch = self.slat_width.0 + self.opening.0;
        let half = (self.slats.0 as f32 * pitch - self.opening.0) / 2.0;
        let mut mesh = Mesh::default();
        for slat in 0..self.slats.0 {
            let z = slat as f32 * pitch - half;
            let at = |u: f32, v: f32| self.at.point(0.0, self.gap.0 + self.height.0 * v, z + self.slat_width.0 * u);
            push_sheet(&mut mesh, [1, 1], at, Vec3::X * self.thickness.0);
        }
        let front = -self.thickness.0 / 2.0;
        for rail in 0..self.rails.0 {
            let middle = self.gap.0 + self.height.0 * (rail as f32 + 1.0) / (rails + 1.0);
            let [low, high] = [-0.5, 0.5].map(|s| middle + s * self.rail_height.0);
            let min = self.at.point(front - self.rail_thickness.0, low, -half);
            mesh.push_box(min, self.at.point(front, high, half));
        }
        Ok(mesh)
    }
}
