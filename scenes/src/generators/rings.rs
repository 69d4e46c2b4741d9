//! Round things: cables, rods and pillars, as closed skins over a row of rings.

use crate::Mesh;
use glam::Vec3;

/// A circle: the points `center + a cos(phi) + b sin(phi)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ring {
    /// Its middle.
    pub center: Vec3,
    /// Radius vector at phi = 0.
    pub a: Vec3,
    /// Radius vector at a quarter turn; a x b points to the next ring.
    pub b: Vec3,
}

impl Ring {
    /// A level circle round the y axis through `center`.
    pub fn level(center: Vec3, radius: f32) -> Self {
        Ring { center, a: Vec3::Z * radius, b: Vec3::X * radius }
    }
}

/// Adds a closed skin of `sides` sides over the rings, with a lid at both ends.
pub(crate) fn push_rings(mesh: &mut Mesh, rings: &[Ring], sides: u32) {
    let (Some(first), Some(last)) = (rings.first(), rings.last()) else {
        return;
    };
    let base = mesh.positions.len() as u32;
    // Sines in double precision, so that no platform rounds them differently.
    let turns: Vec<(f32, f32)> = (0..sides)
        .map(|k| {
            let (s, c) = (std::f64::consts::TAU * f64::from(k) / f64::from(sides)).sin_cos();
            (c as f32, s as f32)
        })
        .collect();
    for ring in rings {
        mesh.positions.extend(turns.iter().map(|(c, s)| ring.center + ring.a * *c + ring.b * *s));
    }
    let bottom = mesh.push_vertex(first.center);
    let top = mesh.push_vertex(last.center);
    let end = base + (rings.len() as u32 - 1) * sides;
    for k in 0..sides {
        let n = (k + 1) % sides;
        for ring in (base..end).step_by(sides as usize) {
            let [a, b, c, d] = [ring + k, ring + n, ring + sides + n, ring + sides + k];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
        mesh.triangles.push([bottom, base + n, base + k]);
        mesh.triangles.push([top, end + k, end + n]);
    }
}
