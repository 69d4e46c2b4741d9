//! Blinds: level slats over each other, tilted.

use super::{At, sheet::push_sheet};
use crate::{
    Mesh,
    bounded::{Angle, Count, Length, Thickness},
};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Slats along z, one over the other, each turned about its own length. The
/// lowest edge hangs `gap` over the floor.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Blinds {
    /// How many slats.
    pub slats: Count<1, 500>,
    /// From edge to edge of a slat, metres.
    pub slat_width: Length<5, 1_000>,
    /// Of a slat, metres; 0 for a single, open sheet.
    pub thickness: Thickness,
    /// From the axis of a slat to that of the next, along y, metres.
    pub spacing: Length<2, 1_000>,
    /// From level (0) towards upright; positive lifts the edge at +x, degrees.
    pub tilt: Angle<-85, 85>,
    /// Extent along z, metres.
    pub length: Length<50, 50_000>,
    /// Height of the lowest edge over y = 0, metres.
    pub gap: Length<0, 50_000>,
    /// x and z of their middle, metres; the origin unless given.
    pub at: At,
}

impl Default for Blinds {
    fn default() -> Self {
        Blinds {
            slats: Count(28),
            slat_width: Length(0.05),
            thickness: Thickness(0.002),
            spacing: Length(0.042),
            tilt: Angle(60.0),
            length: Length(2.0),
            gap: Length(0.1),
            at: At::default(),
        }
    }
}

impl Blinds {
    pub(crate) fn mesh(&self) -> Result<Mesh, String> {
        let (sin, cos) = f64::from(self.tilt.0).to_radians().sin_cos();
        let (sin, cos) = (sin as f32, cos as f32);
        let apart = self.spacing.0 * cos;
        if self.slats.0 > 1 && apart <= self.thickness.0 {
            return Err(format!(
                "slats run into each other: spacing x cos(tilt) is {apart} m, it must be above thickness {} m",
                self.thickness.0
            ));
        }
        let chord = Vec3::new(cos, sin, 0.0) * self.slat_width.0;
        let normal = Vec3::new(-sin, cos, 0.0);
        let half = (chord.y.abs() + self.thickness.0 * cos) / 2.0;
        let mut mesh = Mesh::default();
        for slat in 0..self.slats.0 {
            let axis = self.at.point(0.0, self.gap.0 + half + slat as f32 * self.spacing.0, 0.0);
            let at = |u: f32, v: f32| axis + chord * (v - 0.5) + Vec3::Z * (self.length.0 * (u - 0.5));
            push_sheet(&mut mesh, [1, 1], at, -normal * self.thickness.0);
        }
        Ok(mesh)
    }
}
