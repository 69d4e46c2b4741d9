//! Which triangles make up one smooth surface.

use glam::Vec3;
use rayon::prelude::*;

/// Triangles that share an edge go on smoothly where they bend by no more than 40
/// degrees there: a round pillar of nine sides is round, one of eight has edges.
const LEAST_COSINE: f32 = 0.766_044_4;
/// An edge that more triangles share joins none of them.
const MOST_AT_AN_EDGE: usize = 8;

/// A triangle's edge, its ends by their bits, the lesser first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    ends: [[u32; 3]; 2],
    triangle: u32,
    /// Whether the triangle runs along it from the lesser end.
    forward: bool,
}

/// The smooth patch of each triangle, by the number of its first triangle.
///
/// Triangles are of one patch where a chain of triangles joins them, each sharing
/// an edge with the next and bending by no more than 40 degrees there, whichever
/// way they are wound. Edges are shared where both ends are the same to the bit.
pub(super) fn smooth_patches(triangles: &[[Vec3; 3]]) -> Vec<u32> {
    let normals: Vec<Vec3> = triangles.iter().map(|[a, b, c]| (b - a).cross(c - a).normalize_or_zero()).collect();
    let mut edges: Vec<Edge> = (0u32..).zip(triangles).flat_map(|(i, corners)| edges_of(i, corners)).collect();
    edges.par_sort_unstable();
    let mut first: Vec<u32> = (0..triangles.len() as u32).collect();
    for shared in edges.chunk_by(|a, b| a.ends == b.ends) {
        if shared.len() > MOST_AT_AN_EDGE {
            continue;
        }
        for (i, a) in shared.iter().enumerate() {
            for b in &shared[i + 1..] {
                let cosine = normals[a.triangle as usize].dot(normals[b.triangle as usize]);
                // Wound alike, neighbours run along their edge in opposite ways.
                let cosine = if a.forward == b.forward { -cosine } else { cosine };
                if cosine >= LEAST_COSINE {
                    join(&mut first, a.triangle, b.triangle);
                }
            }
        }
    }
    (0..first.len() as u32).map(|i| root(&mut first, i)).collect()
}

fn edges_of(triangle: u32, corners: &[Vec3; 3]) -> impl Iterator<Item = Edge> + use<> {
    // Minus zero is zero.
    let [a, b, c] = corners.map(|v| v.to_array().map(|x| (x + 0.0).to_bits()));
    [(a, b), (b, c), (c, a)].into_iter().filter(|(from, to)| from != to).map(move |(from, to)| {
        let forward = from < to;
        Edge { ends: if forward { [from, to] } else { [to, from] }, triangle, forward }
    })
}

fn root(first: &mut [u32], mut i: u32) -> u32 {
    while first[i as usize] != i {
        first[i as usize] = first[first[i as usize] as usize];
        i = first[i as usize];
    }
    i
}

fn join(first: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(first, a), root(first, b));
    first[a.max(b) as usize] = a.min(b);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of quads along y, turned by `bend` degrees from each to the next.
    fn strip(quads: usize, bend: f32) -> Vec<[Vec3; 3]> {
        let mut at = Vec3::ZERO;
        let mut points = vec![at];
        for i in 0..quads {
            let (sin, cos) = (bend * i as f32).to_radians().sin_cos();
            at += Vec3::new(cos, 0.0, sin);
            points.push(at);
        }
        points
            .windows(2)
            .flat_map(|p| {
                let [a, b] = [p[0], p[1]];
                let [c, d] = [b + Vec3::Y, a + Vec3::Y];
                [[a, b, c], [a, c, d]]
            })
            .collect()
    }

    #[test]
    fn a_patch_goes_on_round_small_bends_and_ends_at_edges() {
        assert_eq!(smooth_patches(&strip(6, 39.0)), [0; 12]);
        assert_eq!(smooth_patches(&strip(3, 41.0)), [0, 0, 2, 2, 4, 4]);
        assert_eq!(smooth_patches(&strip(3, 90.0)), [0, 0, 2, 2, 4, 4]);
        assert!(smooth_patches(&[]).is_empty());
    }

    #[test]
    fn the_way_triangles_are_wound_does_not_matter() {
        let mut wound = strip(6, 39.0);
        wound.iter_mut().step_by(3).for_each(|t| t.swap(1, 2));
        assert_eq!(smooth_patches(&wound), [0; 12]);
        let mut wound = strip(3, 90.0);
        wound.iter_mut().step_by(3).for_each(|t| t.swap(1, 2));
        assert_eq!(smooth_patches(&wound), [0, 0, 2, 2, 4, 4]);
    }

    /// A floor with a wall standing on a line of it is still one floor; triangles of
    /// no area belong to nothing, and a thousand at one edge are no surface.
    #[test]
    fn odd_meshes_have_patches_too() {
        let mut cross = strip(2, 0.0);
        cross.push([Vec3::X, Vec3::X + Vec3::Y, Vec3::X + Vec3::Z]);
        assert_eq!(smooth_patches(&cross), [0, 0, 0, 0, 4]);
        let flat = [[Vec3::ZERO; 3], [Vec3::ZERO, Vec3::X, Vec3::X * 2.0], [Vec3::ZERO, Vec3::X, Vec3::Y]];
        assert_eq!(smooth_patches(&flat), [0, 1, 2]);
        let many = vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 1000];
        assert_eq!(smooth_patches(&many), (0..1000).collect::<Vec<u32>>());
    }
}
