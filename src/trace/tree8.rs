//! The tree as the CPU walks it: eight children a node with their boxes as floats,
//! and leaves of up to eight triangles side by side.
//!
//! Boxes are the binary tree's, with twice its padding. A leaf costs the same for one
//! triangle and for eight, because eight are tested at once.

use super::{
    Node,
    fold::{Costs, Plans, WIDTH, collect, half_area},
};
use glam::Vec3;

/// Set in [`Node8::child`] for a leaf; the other bits count its block.
pub const LEAF: u32 = 1 << 31;

/// A node and a block take about as long. What is short beside `reach` comes to be
/// in one leaf: 0.1 m fills 0.66 of all lanes of a kitchen's blocks, 0 m 0.52.
const COSTS: Costs = Costs { node: 1.0, leaf: 1.0, triangle: 0.0, most: WIDTH as u32, reach: 0.1 };

/// A node, 224 bytes. A slot without a child has a box that nothing meets:
/// see [`NOWHERE`].
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Node8 {
    /// Smallest corners of the boxes by axis, then largest corners, metres.
    pub planes: [[f32; WIDTH]; 6],
    /// A node's index, or a block's with [`LEAF`].
    pub child: [u32; WIDTH],
}

/// Where boxes of slots without a child lie, each a point: near no origin, on no
/// ray, and no NaN in any test.
const NOWHERE: f32 = 1e30;

const EMPTY: Node8 = Node8 { planes: [[NOWHERE; WIDTH]; 6], child: [0; WIDTH] };

/// Triangles of a leaf, 352 bytes. Lanes without one hold NaN, which no test meets.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Block {
    /// Corner, axis, lane, metres.
    pub corners: [[[f32; WIDTH]; 3]; 3],
    /// The triangle in the order of the binary tree.
    pub triangle: [u32; WIDTH],
    /// Smallest and largest corner of all.
    pub bounds: [[f32; 4]; 2],
}

/// The tree.
#[derive(Clone, Debug, Default)]
pub struct Tree8 {
    /// The root first; empty for no triangle.
    pub nodes: Vec<Node8>,
    /// The leaves.
    pub blocks: Vec<Block>,
}

impl Tree8 {
    /// Folds a binary tree over `triangles`, in the tree's order. Boxes grow by `pad`, as
    /// the binary tree's did: what is quicker than its box test errs by that much more.
    pub fn new(nodes: &[Node], triangles: &[[Vec3; 3]], pad: f32) -> Self {
        let mut tree = Tree8::default();
        if nodes.is_empty() {
            return tree;
        }
        let plans = Plans::new(nodes, COSTS);
        tree.nodes.push(EMPTY);
        // Depth first, so that a subtree lies together.
        let mut work = vec![(0usize, 0u32)];
        while let Some((at, root)) = work.pop() {
            let mut node = tree.node(nodes, triangles, &plans, root, &mut work);
            for axis in 0..3 {
                node.planes[axis].iter_mut().for_each(|v| *v -= pad);
                node.planes[axis + 3].iter_mut().for_each(|v| *v += pad);
            }
            tree.nodes[at] = node;
        }
        tree
    }

    /// A node of binary node `root`'s own, with its leaves; its inner children are
    /// put down in `work`.
    fn node(
        &mut self,
        nodes: &[Node],
        triangles: &[[Vec3; 3]],
        plans: &Plans,
        root: u32,
        work: &mut Vec<(usize, u32)>,
    ) -> Node8 {
        let mut found = plans.children(nodes, root);
        // What stands last is walked first: leaves, the largest first of all, because
        // they stop rays.
        found.sort_by(|a, b| {
            let size = |child: u32| half_area(&nodes[child as usize], COSTS.reach);
            a.1.cmp(&b.1).then(size(a.0).total_cmp(&size(b.0)))
        });
        let mut node = EMPTY;
        for (slot, (child, leaf)) in found.into_iter().enumerate() {
            let b = &nodes[child as usize];
            for axis in 0..3 {
                node.planes[axis][slot] = b.min[axis];
                node.planes[axis + 3][slot] = b.max[axis];
            }
            node.child[slot] = if leaf {
                let mut of = Vec::with_capacity(WIDTH);
                collect(nodes, child, &mut of);
                self.blocks.push(Block::new(&of, triangles));
                LEAF | (self.blocks.len() - 1) as u32
            } else {
                work.push((self.nodes.len(), child));
                self.nodes.push(EMPTY);
                (self.nodes.len() - 1) as u32
            };
        }
        node
    }
}

impl Block {
    /// A triangle of it.
    #[cfg(test)]
    pub fn corners_of(&self, lane: usize) -> [Vec3; 3] {
        [0, 1, 2].map(|c| Vec3::from([0, 1, 2].map(|axis| self.corners[c][axis][lane & 7])))
    }

    fn new(of: &[u32], triangles: &[[Vec3; 3]]) -> Self {
        let mut block = Block {
            corners: [[[f32::NAN; WIDTH]; 3]; 3],
            triangle: [0; WIDTH],
            bounds: [[f32::INFINITY; 4], [f32::NEG_INFINITY; 4]],
        };
        for (lane, &i) in of.iter().enumerate() {
            block.triangle[lane] = i;
            for (corner, v) in triangles[i as usize].iter().enumerate() {
                for axis in 0..3 {
                    block.corners[corner][axis][lane] = v[axis];
                    block.bounds[0][axis] = block.bounds[0][axis].min(v[axis]);
                    block.bounds[1][axis] = block.bounds[1][axis].max(v[axis]);
                }
            }
        }
        block
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{Tracer, build};

    /// Levels, and the most that wait on the stack of a walk that goes everywhere.
    fn most_waiting(tree: &Tree8) -> (usize, usize) {
        let (mut stack, mut deepest, mut most) = (vec![(0u32, 1usize)], 0, 0);
        while let Some((at, level)) = stack.pop() {
            deepest = deepest.max(level);
            if at & LEAF == 0 {
                let node = &tree.nodes[at as usize];
                let held = (0..WIDTH).filter(|&k| node.planes[0][k] < NOWHERE);
                stack.extend(held.map(|k| (node.child[k], level + 1)));
            }
            most = most.max(stack.len());
        }
        (deepest, most)
    }

    #[test]
    fn blocks_hold_every_triangle_once_within_the_boxes_of_their_nodes() {
        for name in ["atrium", "curtain-open", "plane"] {
            let scene = crate::scenes::library::scene(name).unwrap();
            let tracer = Tracer::new(&scene.triangles().map(|t| t.1).collect::<Vec<_>>());
            let tree = &tracer.tree;
            let mut seen = vec![0; tracer.triangles().len()];
            for node in &tree.nodes {
                for (slot, &child) in node.child.iter().enumerate().filter(|(_, child)| *child & LEAF != 0) {
                    let block = &tree.blocks[(child & !LEAF) as usize];
                    for lane in (0..WIDTH).filter(|&l| !block.corners[0][0][l].is_nan()) {
                        seen[block.triangle[lane] as usize] += 1;
                        assert_eq!(block.corners_of(lane), tracer.triangles()[block.triangle[lane] as usize]);
                        for v in block.corners_of(lane) {
                            for axis in 0..3 {
                                assert!(node.planes[axis][slot] < v[axis] && v[axis] < node.planes[axis + 3][slot]);
                                assert!(block.bounds[0][axis] <= v[axis] && v[axis] <= block.bounds[1][axis]);
                            }
                        }
                    }
                }
            }
            assert!(seen.iter().all(|&n| n == 1), "{name}");
        }
    }

    /// No walk can fill the stack: a level leaves seven entries at most, and the
    /// deepest tree that is built has fewer levels than the stack is made for.
    #[test]
    fn the_stack_is_never_full() {
        let chain: Vec<_> = (0..3000)
            .map(|i| {
                let at = Vec3::splat(1.3f32.powi(-(i % 200)) * 1e3);
                [at, at + Vec3::X * 1e-3, at + Vec3::Y * 1e-3]
            })
            .collect();
        let one_place = vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 5000];
        for triangles in [chain, one_place] {
            let (nodes, order) = build::build(&triangles, 1e-6);
            let sorted: Vec<_> = order.iter().map(|&i| triangles[i as usize]).collect();
            let (deepest, most) = most_waiting(&Tree8::new(&nodes, &sorted, 1e-6));
            assert!(deepest <= crate::trace::STACK && most <= 7 * deepest + 1, "{deepest} levels, {most} waiting");
            assert!(most < crate::trace::walk::STACK);
        }
    }
}
