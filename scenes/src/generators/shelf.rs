//! A board against a wall.

use super::{At, Part, sheet::push_sheet};
use crate::{
    Mesh,
    bounded::{Length, Thickness},
};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A level board before a wall that faces +x, with a slit between the two.
/// Parts: `board`, the occluder, and `wall`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Shelf {
    /// Extent of the board away from the wall, along x, metres.
    pub depth: Length<5, 10_000>,
    /// Of the board, along y, metres; 0 for a single, open sheet.
    pub thickness: Thickness,
    /// Extent of the board along z, metres.
    pub length: Length<5, 50_000>,
    /// Height of the board's middle over y = 0, metres.
    pub height: Length<10, 50_000>,
    /// From the wall to the board, metres.
    pub gap: Length<0, 10_000>,
    /// Whether the wall is part of the shape.
    pub wall: bool,
    /// Extent of the wall along y, metres.
    pub wall_height: Length<10, 100_000>,
    /// Extent of the wall along z, metres.
    pub wall_length: Length<10, 100_000>,
    /// x of the wall and z of its middle, metres; the origin unless given.
    pub at: At,
}

impl Default for Shelf {
    fn default() -> Self {
        Shelf {
            depth: Length(0.3),
            thickness: Thickness(0.02),
            length: Length(3.0),
            height: Length(1.2),
            gap: Length(0.05),
            wall: true,
            wall_height: Length(2.6),
            wall_length: Length(5.0),
            at: At::default(),
        }
    }
}

impl Shelf {
    pub(crate) fn parts(&self) -> Result<Vec<Part>, String> {
        if self.wall && self.height.0 > self.wall_height.0 {
            return Err(format!(
                "height {} m is above the wall: it must be at most wall_height {} m",
                self.height.0, self.wall_height.0
            ));
        }
        let mut board = Mesh::default();
        let edge = self.at.point(self.gap.0, self.height.0, -self.length.0 / 2.0);
        let at = |u: f32, v: f32| edge + Vec3::Z * (self.length.0 * u) + Vec3::X * (self.depth.0 * v);
        push_sheet(&mut board, [1, 1], at, Vec3::NEG_Y * self.thickness.0);
        let mut parts = vec![Part::occluder("board", board)];
        if self.wall {
            let mut wall = Mesh::default();
            let foot = self.at.point(0.0, 0.0, -self.wall_length.0 / 2.0);
            wall.push_quad(foot, Vec3::Y * self.wall_height.0, Vec3::Z * self.wall_length.0);
            parts.push(Part::named("wall", wall));
        }
        Ok(parts)
    }
}
