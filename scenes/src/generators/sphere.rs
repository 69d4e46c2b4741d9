//! A sphere that rests on the floor or hovers over it.

use super::At;
use crate::{
    Mesh,
    bounded::{Count, Length},
};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// An icosahedron, refined, with a vertex at its lowest point.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sphere {
    /// Metres.
    pub radius: Length<5, 50_000>,
    /// Height of its lowest point over y = 0, metres.
    pub gap: Length<0, 50_000>,
    /// How often each triangle is cut into four: 20 x 4^n triangles.
    pub subdivisions: Count<0, 6>,
    /// x and z of its middle, metres; the origin unless given.
    pub at: At,
}

impl Default for Sphere {
    fn default() -> Self {
        Sphere { radius: Length(0.25), gap: Length(0.0), subdivisions: Count(4), at: At::default() }
    }
}

impl Sphere {
    pub(crate) fn mesh(&self) -> Mesh {
        let mut mesh = icosahedron();
        for _ in 0..self.subdivisions.0 {
            subdivide(&mut mesh);
        }
        let center = self.at.point(0.0, self.gap.0 + self.radius.0, 0.0);
        for p in &mut mesh.positions {
            *p = center + *p * self.radius.0;
        }
        mesh
    }
}

/// Two poles on the y axis and two rings of five.
fn icosahedron() -> Mesh {
    let (low, level) = (5.0f64.sqrt().recip(), 2.0 / 5.0f64.sqrt());
    let ring = |k: u32, y: f64| {
        let (s, c) = (std::f64::consts::TAU * f64::from(k) / 10.0).sin_cos();
        Vec3::new((level * s) as f32, y as f32, (level * c) as f32)
    };
    let mut positions = vec![Vec3::Y, Vec3::NEG_Y];
    positions.extend((0..5).map(|k| ring(2 * k, low)));
    positions.extend((0..5).map(|k| ring(2 * k + 1, -low)));
    let triangles = (0..5)
        .flat_map(|k| {
            let next = (k + 1) % 5;
            let (a, b, c, d) = (2 + k, 2 + next, 7 + k, 7 + next);
            [[0, a, b], [a, c, b], [b, c, d], [1, d, c]]
        })
        .collect();
    Mesh { positions, triangles, uvs: vec![] }
}

/// Cuts every triangle of a mesh on the unit sphere into four.
fn subdivide(mesh: &mut Mesh) {
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    let mut triangles = Vec::with_capacity(4 * mesh.triangles.len());
    for [a, b, c] in std::mem::take(&mut mesh.triangles) {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[p, q]| {
            *middles.entry([p.min(q), p.max(q)]).or_insert_with(|| {
                let middle = (mesh.positions[p as usize] + mesh.positions[q as usize]).normalize();
                mesh.push_vertex(middle)
            })
        });
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    mesh.triangles = triangles;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_rests_on_the_floor_and_has_its_volume() {
        let mesh = Sphere::default().mesh();
        assert_eq!(mesh.triangles.len(), 20 * 256);
        assert_eq!(mesh.bounds().unwrap()[0].y, 0.0);
        let centre = Vec3::new(0.0, 0.25, 0.0);
        let volume: f32 = mesh.corners().map(|[a, b, c]| (a - centre).dot((b - centre).cross(c - centre)) / 6.0).sum();
        let exact = 4.0 / 3.0 * std::f32::consts::PI * 0.25f32.powi(3);
        assert!((volume / exact - 1.0).abs() < 0.01, "{volume} against {exact}");
    }
}
