//! A covered walk beside an open courtyard: light comes from one side.

use crate::{Mesh, bounded::Length};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The shell of an arcade and its courtyard, seen from inside, open to the sky
/// over the courtyard only. The walk lies at x < 0, the courtyard at x > 0, the
/// floor at y = 0, the opening between them in the plane x = 0; both run along z.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Arcade {
    /// From the opening to the back wall of the walk, metres.
    pub depth: Length<100, 100_000>,
    /// From the floor to the ceiling of the walk, metres.
    pub height: Length<100, 100_000>,
    /// From the opening to the opposite wall of the courtyard, metres.
    pub courtyard: Length<100, 100_000>,
    /// How far the walls round the courtyard rise above the ceiling of the walk, metres.
    pub storey: Length<100, 100_000>,
    /// Extent along z, centred on z = 0, metres; closed by walls at both ends.
    pub length: Length<100, 100_000>,
}

impl Arcade {
    pub(crate) fn mesh(&self) -> Mesh {
        let z = self.length.0 / 2.0;
        let (back, front) = (-self.depth.0, self.courtyard.0);
        let (ceiling, top) = (self.height.0, self.height.0 + self.storey.0);
        let p = Vec3::new;
        let mut mesh = Mesh::default();
        // The floor meets in x = 0, where the end walls change their height.
        mesh.push_corners([p(back, 0.0, z), p(0.0, 0.0, z), p(0.0, 0.0, -z), p(back, 0.0, -z)]);
        mesh.push_corners([p(0.0, 0.0, z), p(front, 0.0, z), p(front, 0.0, -z), p(0.0, 0.0, -z)]);
        // Back wall, ceiling, the facade above the opening, the opposite wall.
        mesh.push_corners([p(back, 0.0, z), p(back, 0.0, -z), p(back, ceiling, -z), p(back, ceiling, z)]);
        mesh.push_corners([p(back, ceiling, -z), p(0.0, ceiling, -z), p(0.0, ceiling, z), p(back, ceiling, z)]);
        mesh.push_corners([p(0.0, ceiling, z), p(0.0, ceiling, -z), p(0.0, top, -z), p(0.0, top, z)]);
        mesh.push_corners([p(front, 0.0, -z), p(front, 0.0, z), p(front, top, z), p(front, top, -z)]);
        // End walls of the walk and of the courtyard.
        mesh.push_corners([p(back, 0.0, -z), p(0.0, 0.0, -z), p(0.0, ceiling, -z), p(back, ceiling, -z)]);
        mesh.push_corners([p(0.0, 0.0, z), p(back, 0.0, z), p(back, ceiling, z), p(0.0, ceiling, z)]);
        for end in [-z, z] {
            let corners = [p(0.0, 0.0, end), p(front, 0.0, end), p(front, top, end), p(0.0, top, end)];
            mesh.push_corners(if end < 0.0 { corners } else { [corners[1], corners[0], corners[3], corners[2]] });
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_wall_faces_into_the_air() {
        let mesh = Arcade {
            depth: Length(2.0),
            height: Length(3.0),
            courtyard: Length(4.0),
            storey: Length(2.0),
            length: Length(6.0),
        }
        .mesh();
        // A point of the opening sees the front of every face but the facade,
        // which lies in its own plane.
        let eye = Vec3::new(0.0, 1.0, 0.0);
        for [a, b, c] in mesh.corners() {
            let facing = (b - a).cross(c - a).dot(eye - a);
            let facade = [a, b, c].iter().all(|p| p.x == 0.0);
            assert!(facade || facing > 0.0, "{a} {b} {c}");
        }
    }
}
