//! Indexed triangles, and nothing else.

use glam::{Mat4, Vec2, Vec3};

/// Indexed triangles in metres; counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions, metres.
    pub positions: Vec<Vec3>,
    /// Three indices into `positions` a triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates a vertex, as many as `positions`, or none.
    pub uvs: Vec<Vec2>,
}

/// Why a list of vertices and indices is no mesh.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum MeshError {
    /// A vertex has a coordinate that is not a finite number.
    #[error("vertex {vertex} is {position:?}: coordinates must be finite numbers")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
        /// Its coordinates as given.
        position: [f32; 3],
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertex {index}, but there are only {vertices} (0 to {last})", last = vertices.saturating_sub(1))]
    OutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex index it names.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// There is nothing to trace.
    #[error("the mesh has no triangles")]
    Empty,
    /// Some vertices have texture coordinates and some have none.
    #[error("there are {uvs} texture coordinates for {vertices} vertices: give one a vertex, or none")]
    Uvs {
        /// How many texture coordinates there are.
        uvs: usize,
        /// How many vertices there are.
        vertices: usize,
    },
}

impl Mesh {
    /// Adds the parallelogram `corner`, `corner + u`, `corner + u + v`,
    /// `corner + v`; its normal points along `u x v`.
    pub fn push_quad(&mut self, corner: Vec3, u: Vec3, v: Vec3) {
        self.push_corners([corner, corner + u, corner + u + v, corner + v]);
    }

    /// Adds a quadrilateral by its corners in counter-clockwise order. Shells
    /// pass the same corner values to neighbours, so that shared edges are
    /// shared to the last bit and no ray slips between.
    pub fn push_corners(&mut self, corners: [Vec3; 4]) {
        let base = self.positions.len() as u32;
        self.positions.extend(corners);
        self.triangles.push([base, base + 1, base + 2]);
        self.triangles.push([base, base + 2, base + 3]);
    }

    /// Adds a closed, axis-aligned box: eight shared vertices, twelve triangles,
    /// normals outward.
    pub fn push_box(&mut self, min: Vec3, max: Vec3) {
        let base = self.positions.len() as u32;
        for corner in 0..8u32 {
            self.positions.push(Vec3::new(
                if corner & 1 == 0 { min.x } else { max.x },
                if corner & 2 == 0 { min.y } else { max.y },
                if corner & 4 == 0 { min.z } else { max.z },
            ));
        }
        const FACES: [[u32; 4]; 6] = [
            [0, 4, 6, 2], // -x
            [1, 3, 7, 5], // +x
            [0, 1, 5, 4], // -y
            [2, 6, 7, 3], // +y
            [0, 2, 3, 1], // -z
            [4, 5, 7, 6], // +z
        ];
        for [a, b, c, d] in FACES {
            self.triangles.push([base + a, base + b, base + c]);
            self.triangles.push([base + a, base + c, base + d]);
        }
    }

    /// Adds a vertex and returns its index.
    pub fn push_vertex(&mut self, position: Vec3) -> u32 {
        self.positions.push(position);
        (self.positions.len() - 1) as u32
    }

    /// Adds another mesh; its texture coordinates are dropped unless both have
    /// them.
    pub fn append(&mut self, other: &Mesh) {
        let base = self.positions.len() as u32;
        let textured = self.uvs.len() == self.positions.len() && other.uvs.len() == other.positions.len();
        self.positions.extend(&other.positions);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + base)));
        if textured {
            self.uvs.extend(&other.uvs);
        } else {
            self.uvs.clear();
        }
    }

    /// The mesh moved by an affine map; mirrored maps keep normals outward.
    #[must_use]
    pub fn transformed(&self, map: Mat4) -> Mesh {
        let flip = map.determinant() < 0.0;
        Mesh {
            positions: self.positions.iter().map(|p| map.transform_point3(*p)).collect(),
            triangles: self.triangles.iter().map(|&[a, b, c]| if flip { [a, c, b] } else { [a, b, c] }).collect(),
            uvs: self.uvs.clone(),
        }
    }

    /// Smallest and largest corner; None of an empty mesh.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        let lo = self.positions.iter().copied().reduce(Vec3::min)?;
        let hi = self.positions.iter().copied().reduce(Vec3::max)?;
        Some([lo, hi])
    }

    /// The corner positions of every triangle, in order.
    pub fn corners(&self) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        self.triangles.iter().map(|t| t.map(|i| self.positions[i as usize]))
    }

    /// Checks that every coordinate is finite and every index in range.
    ///
    /// # Errors
    /// The first vertex or triangle that is wrong.
    pub fn validate(&self) -> Result<(), MeshError> {
        if let Some((vertex, p)) = self.positions.iter().enumerate().find(|(_, p)| !p.is_finite()) {
            return Err(MeshError::NotFinite { vertex, position: p.to_array() });
        }
        let vertices = self.positions.len();
        for (triangle, indices) in self.triangles.iter().enumerate() {
            if let Some(&index) = indices.iter().find(|&&i| i as usize >= vertices) {
                return Err(MeshError::OutOfRange { triangle, index, vertices });
            }
        }
        if self.triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        if !self.uvs.is_empty() && self.uvs.len() != vertices {
            return Err(MeshError::Uvs { uvs: self.uvs.len(), vertices });
        }
        Ok(())
    }
}

/// Whether a triangle has a normal that single precision can tell.
pub(crate) fn has_area([a, b, c]: [Vec3; 3]) -> bool {
    (b - a).cross(c - a).try_normalize().is_some()
}

/// The point of a triangle that is nearest to `p` (Ericson, Real-Time Collision
/// Detection, section 5.1.5).
pub fn closest_point(p: Vec3, &[a, b, c]: &[Vec3; 3]) -> Vec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}

/// The part of a convex polygon where `inside` is 0 or more (Sutherland-Hodgman);
/// `inside` must be linear.
pub fn clip(polygon: &[Vec3], inside: impl Fn(Vec3) -> f32) -> Vec<Vec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = (inside(a), inside(b));
        if da >= 0.0 {
            kept.push(a);
        }
        if (da < 0.0) != (db < 0.0) {
            kept.push(a + (b - a) * (da / (da - db)));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn a_box_is_closed_and_its_normals_point_outward() {
        let mut mesh = Mesh::default();
        mesh.push_box(Vec3::new(-1.0, 0.0, 2.0), Vec3::new(1.0, 0.5, 4.0));
        let centre = Vec3::new(0.0, 0.25, 3.0);
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for t in &mesh.triangles {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert_eq!(edges.len(), 18);
        assert!(edges.values().all(|&n| n == 0), "every edge is walked once each way");
        for [a, b, c] in mesh.corners() {
            let normal = (b - a).cross(c - a);
            assert!(normal.length() > 0.0);
            assert!(normal.dot((a + b + c) / 3.0 - centre) > 0.0);
        }
    }

    #[test]
    fn bad_meshes_are_named() {
        let mut mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(0.0, f32::NAN, 0.0)],
            triangles: vec![[0, 1, 2]],
            uvs: vec![],
        };
        assert!(mesh.validate().unwrap_err().to_string().contains("vertex 2"));
        mesh.positions[2] = Vec3::Y;
        assert_eq!(mesh.validate(), Ok(()));
        mesh.triangles.push([0, 1, 3]);
        assert!(mesh.validate().unwrap_err().to_string().contains("vertex 3"));
    }
}
