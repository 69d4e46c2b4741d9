//! The tree: obvhs's, or a balanced one where that would be too deep.

use super::STACK;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2_from_tris, triangle::Triangle};
use std::time::Duration;

/// A node of the tree, 32 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct Node {
    /// Smallest corner of the box, metres.
    pub min: [f32; 3],
    /// Inner node: index of the first of two neighbouring children. Leaf: index
    /// of its first triangle.
    pub first: u32,
    /// Largest corner of the box, metres.
    pub max: [f32; 3],
    /// Number of triangles; 0 for an inner node.
    pub count: u32,
}

/// How the tree is built. Two triangles a leaf: with eight, the preset's number,
/// AO rays in the built-in scenes took 1.2 to 1.3 times as long, because the
/// watertight test costs more than a box. No pre-split, so that every triangle
/// stands in the tree once.
const BUILD: BvhBuildParams =
    BvhBuildParams { max_prims_per_leaf: 2, collapse_traversal_cost: 1.0, ..BvhBuildParams::medium_build() };

/// A tree over triangles: nodes, the root first, and the triangles' order in its
/// leaves. It is never deeper than [`STACK`].
pub(super) fn build(triangles: &[[Vec3; 3]], pad: f32) -> (Vec<Node>, Vec<u32>) {
    let input: Vec<Triangle> =
        triangles.iter().map(|[a, b, c]| Triangle { v0: (*a).into(), v1: (*b).into(), v2: (*c).into() }).collect();
    let bvh = build_bvh2_from_tris(&input, BUILD, &mut Duration::default());
    let nodes: Vec<Node> = bvh
        .nodes
        .iter()
        .map(|n| Node {
            min: (Vec3::from(n.aabb.min) - pad).to_array(),
            first: n.first_index,
            max: (Vec3::from(n.aabb.max) + pad).to_array(),
            count: n.prim_count,
        })
        .collect();
    // Hundreds of triangles in one place make a chain of obvhs's clustering.
    if depth(&nodes) > STACK { balanced(triangles, pad) } else { (nodes, bvh.primitive_indices) }
}

/// Levels of a tree.
fn depth(nodes: &[Node]) -> usize {
    let mut deepest = 0;
    let mut stack = if nodes.is_empty() { vec![] } else { vec![(0u32, 1usize)] };
    while let Some((index, level)) = stack.pop() {
        deepest = deepest.max(level);
        let node = &nodes[index as usize];
        if node.count == 0 {
            stack.extend([(node.first, level + 1), (node.first + 1, level + 1)]);
        }
    }
    deepest
}

/// A tree of halves: each node splits its triangles in two equal parts at the
/// median of their middles along the longest axis, wherever they lie.
fn balanced(triangles: &[[Vec3; 3]], pad: f32) -> (Vec<Node>, Vec<u32>) {
    let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut nodes = vec![Node::zeroed()];
    let mut work = vec![(0usize, 0usize, order.len())];
    while let Some((node, start, end)) = work.pop() {
        let corners = || order[start..end].iter().flat_map(|&i| triangles[i as usize]);
        let min = corners().fold(Vec3::INFINITY, Vec3::min);
        let max = corners().fold(Vec3::NEG_INFINITY, Vec3::max);
        let leaf = end - start <= 2;
        let first = if leaf { start } else { nodes.len() } as u32;
        let count = if leaf { end - start } else { 0 } as u32;
        nodes[node] = Node { min: (min - pad).to_array(), first, max: (max + pad).to_array(), count };
        if leaf {
            continue;
        }
        let size = max - min;
        let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
        let middle = (start + end) / 2;
        order[start..end].select_nth_unstable_by(middle - start, |&a, &b| {
            let at = |i: u32| triangles[i as usize].iter().map(|v| v[axis]).sum::<f32>();
            at(a).total_cmp(&at(b)).then(a.cmp(&b))
        });
        nodes.extend([Node::zeroed(); 2]);
        work.push((first as usize, start, middle));
        work.push((first as usize + 1, middle, end));
    }
    (nodes, order)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_triangles_in_one_place_make_no_deep_tree() {
        let triangles = vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 5000];
        let (nodes, order) = build(&triangles, 1e-6);
        assert!(depth(&nodes) <= 14, "{}", depth(&nodes));
        let mut seen = order;
        seen.sort_unstable();
        assert_eq!(seen, (0..5000).collect::<Vec<u32>>());
        let in_leaves: u32 = nodes.iter().map(|n| n.count).sum();
        assert_eq!(in_leaves, 5000);
    }
}
