//! A closed room with one window: light comes from one side, and is scarce.

use crate::{Mesh, bounded::Length};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The inside of a box, centred on x = z = 0 with its floor at y = 0, and one
/// rectangular window in the wall at +x.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Room {
    /// Extent along x, metres.
    pub width: Length<100, 100_000>,
    /// Extent along y, metres.
    pub height: Length<100, 100_000>,
    /// Extent along z, metres.
    pub depth: Length<100, 100_000>,
    /// The window.
    pub window: Window,
}

/// A window, centred on z = 0.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// From the floor to its lower edge, metres.
    pub sill: Length<10, 100_000>,
    /// From its lower to its upper edge, metres.
    pub height: Length<10, 100_000>,
    /// Extent along z, metres.
    pub width: Length<10, 100_000>,
}

impl Room {
    pub(crate) fn mesh(&self) -> Result<Mesh, String> {
        let (x, y, z) = (self.width.0 / 2.0, self.height.0, self.depth.0 / 2.0);
        let (low, high) = (self.window.sill.0, self.window.sill.0 + self.window.height.0);
        let side = self.window.width.0 / 2.0;
        if high >= y || side >= z {
            return Err(format!(
                "room: the window must leave wall around it: window.sill + window.height is {high} m, it must be below height {y} m; \
                 window.width is {} m, it must be below depth {} m",
                2.0 * side,
                2.0 * z
            ));
        }
        let p = Vec3::new;
        let mut mesh = Mesh::default();
        mesh.push_corners([p(-x, 0.0, z), p(x, 0.0, z), p(x, 0.0, -z), p(-x, 0.0, -z)]);
        mesh.push_corners([p(-x, y, -z), p(x, y, -z), p(x, y, z), p(-x, y, z)]);
        mesh.push_corners([p(-x, 0.0, z), p(-x, 0.0, -z), p(-x, y, -z), p(-x, y, z)]);
        mesh.push_corners([p(-x, 0.0, -z), p(x, 0.0, -z), p(x, y, -z), p(-x, y, -z)]);
        mesh.push_corners([p(x, 0.0, z), p(-x, 0.0, z), p(-x, y, z), p(x, y, z)]);
        // The wall with the window: four trapezia from the wall's corners to the
        // window's, so that every edge is shared and nothing leaks.
        let wall = [p(x, 0.0, -z), p(x, 0.0, z), p(x, y, z), p(x, y, -z)];
        let hole = [p(x, low, -side), p(x, low, side), p(x, high, side), p(x, high, -side)];
        for k in 0..4 {
            let n = (k + 1) % 4;
            mesh.push_corners([wall[k], wall[n], hole[n], hole[k]]);
        }
        Ok(mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shell_has_the_area_of_a_box_less_the_window() {
        let room = Room {
            width: Length(6.0),
            height: Length(3.0),
            depth: Length(4.0),
            window: Window { sill: Length(1.0), height: Length(1.0), width: Length(1.5) },
        };
        let mesh = room.mesh().unwrap();
        let centre = Vec3::new(0.0, 1.5, 0.0);
        let mut area = 0.0;
        for [a, b, c] in mesh.corners() {
            let n = (b - a).cross(c - a);
            assert!(n.dot(centre - a) > 0.0, "faces inward");
            area += n.length() / 2.0;
        }
        let expected = 2.0 * (6.0 * 3.0 + 6.0 * 4.0 + 3.0 * 4.0) - 1.5;
        assert!((area - expected).abs() < 1e-4, "{area} against {expected}");
    }

    #[test]
    fn a_window_larger_than_its_wall_is_refused() {
        let room = Room {
            width: Length(6.0),
            height: Length(1.9),
            depth: Length(4.0),
            window: Window { sill: Length(1.0), height: Length(1.0), width: Length(1.5) },
        };
        assert!(room.mesh().unwrap_err().contains("window"));
    }
}
