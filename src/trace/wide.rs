//! The tree as the GPU walks it: eight children a node, their boxes in eight bits
//! a plane (Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs
//! Through Compressed Wide BVHs", HPG 2017). Twin of its traversal:
//! `gpu/shaders/trace.wgsl`; the one here is for tests and for counting.
//!
//! A box is never smaller in eight bits than it was, and it is padded by what the
//! shorter arithmetic of its test may err, so no ray misses what the binary tree
//! meets. The library's own eight-wide traversal does: it pads nothing.

use super::{
    Node, Tracer,
    fold::{Costs, Plans, WIDTH, collect},
};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// The deepest tree the GPU walks: the length of its stack. A level puts one
/// entry there at most.
pub const STACK: usize = 24;

/// Costs of the paper; a leaf has three triangles at most, because their number is
/// written in three bits.
const COSTS: Costs = Costs { node: 1.0, leaf: 0.0, triangle: 0.3, most: 3, reach: 0.0 };

/// A node, 80 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct WideNode {
    /// Smallest corner of all boxes, metres.
    pub origin: [f32; 3],
    /// Exponents of the box grid's step by axis, as in the bits of a float, and in
    /// the highest byte a bit for each slot that holds an inner node.
    pub steps: u32,
    /// Index of the first child that is an inner node; the others follow in the
    /// order of their slots.
    pub first_node: u32,
    /// Index of the first triangle of all leaves.
    pub first_triangle: u32,
    /// A byte a slot: 0 for none; 32 + 24 + slot for an inner node; for a leaf the
    /// number of triangles in unary in the three high bits, and how far beyond
    /// `first_triangle` they begin.
    pub meta: [u32; 2],
    /// A byte a slot: where the boxes begin along x, y and z, in steps.
    pub lo: [[u32; 2]; 3],
    /// And where they end.
    pub hi: [[u32; 2]; 3],
}

/// The tree of a tracer, eight wide.
#[derive(Clone, Debug)]
pub struct Wide {
    /// The nodes, the root first.
    pub nodes: Vec<WideNode>,
    /// The triangles in the order of its leaves, as numbered in
    /// [`Tracer::triangles`].
    pub order: Vec<u32>,
    /// Its levels.
    pub depth: usize,
}

impl Wide {
    /// Folds the binary tree of a tracer, so that the expected cost of a ray is
    /// least among all ways to fold it (the paper's section 3).
    pub fn new(tracer: &Tracer) -> Self {
        let nodes = tracer.nodes();
        // 2^-20 of the largest coordinate, four times the binary tree's: see `enter`.
        let pad = tracer.offset() * 0.5;
        // There is always a root, if only one without children.
        let mut wide = Wide { nodes: vec![WideNode::zeroed()], order: vec![], depth: 1 };
        if nodes.is_empty() {
            return wide;
        }
        let plans = Plans::new(nodes, COSTS);
        wide.depth = 0;
        // Breadth first: nodes near the root, which all rays visit, lie together.
        let mut level = vec![(0usize, 0u32)];
        while !level.is_empty() {
            wide.depth += 1;
            let mut next = Vec::new();
            for (at, root) in level {
                wide.fold(nodes, &plans, at, root, pad, &mut next);
            }
            level = next;
        }
        wide
    }

    /// Writes one node, and makes room for its children.
    fn fold(&mut self, nodes: &[Node], plans: &Plans, at: usize, root: u32, pad: f32, next: &mut Vec<(usize, u32)>) {
        let children = plans.children(nodes, root);
        let slots = ordered(nodes, &children);
        let [min, max] = union(nodes, children.iter().map(|c| c.0)).map(Vec3::from);
        let (origin, max) = (min - pad, max + pad);
        let mut node = WideNode {
            origin: origin.to_array(),
            first_node: self.nodes.len() as u32,
            first_triangle: self.order.len() as u32,
            ..WideNode::zeroed()
        };
        let mut step = [0.0; 3];
        for axis in 0..3 {
            let exponent = exponent(origin[axis], max[axis]);
            step[axis] = f32::from_bits(exponent << 23);
            node.steps |= exponent << (8 * axis);
        }
        for (slot, child) in slots.into_iter().enumerate() {
            let Some((child, leaf)) = child else { continue };
            let shift = 8 * (slot % 4);
            let b = &nodes[child as usize];
            for axis in 0..3 {
                let (lo, hi) = grid(origin[axis], step[axis], b.min[axis] - pad, b.max[axis] + pad);
                node.lo[axis][slot / 4] |= lo << shift;
                node.hi[axis][slot / 4] |= hi << shift;
            }
            let meta = if leaf {
                let offset = self.order.len() as u32 - node.first_triangle;
                let before = self.order.len();
                collect(nodes, child, &mut self.order);
                ((1u32 << (self.order.len() - before)) - 1) << 5 | offset
            } else {
                node.steps |= 1 << (24 + slot);
                next.push((self.nodes.len(), child));
                self.nodes.push(WideNode::zeroed());
                32 + 24 + slot as u32
            };
            node.meta[slot / 4] |= meta << shift;
        }
        self.nodes[at] = node;
    }
}

/// Gives children their slots. A ray takes its slots in the order of `slot xor
/// octant`, octant the signs of its direction: so slot s is best taken by the
/// child that lies furthest against the direction of signs s. The best pair
/// first.
fn ordered(nodes: &[Node], children: &[(u32, bool)]) -> [Option<(u32, bool)>; WIDTH] {
    let middle = |i: u32| (Vec3::from(nodes[i as usize].min) + Vec3::from(nodes[i as usize].max)) * 0.5;
    let centre = children.iter().map(|c| middle(c.0)).sum::<Vec3>() / children.len() as f32;
    let mut pairs = Vec::with_capacity(WIDTH * WIDTH);
    for (c, child) in children.iter().enumerate() {
        for slot in 0..WIDTH {
            let sign = |bit: usize| if slot >> bit & 1 == 1 { -1.0 } else { 1.0 };
            let along = (middle(child.0) - centre).dot(Vec3::new(sign(0), sign(1), sign(2)));
            pairs.push((along, c, slot));
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
    let mut slots = [None; WIDTH];
    let mut placed = [false; WIDTH];
    for (_, c, slot) in pairs {
        if !placed[c] && slots[slot].is_none() {
            placed[c] = true;
            slots[slot] = Some(children[c]);
        }
    }
    slots
}

fn union(nodes: &[Node], of: impl Iterator<Item = u32>) -> [[f32; 3]; 2] {
    let (min, max) = of.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), i| {
        let n = &nodes[i as usize];
        (min.min(n.min.into()), max.max(n.max.into()))
    });
    [min.to_array(), max.to_array()]
}

/// The least power of two, as the exponent of a float, that 255 steps of which
/// lead from `lo` to `hi`, with one step to spare for rounding.
fn exponent(lo: f32, hi: f32) -> u32 {
    let step = (f64::from(hi) - f64::from(lo)) / 254.0;
    (step.log2().ceil() as i32 + 127).clamp(1, 254) as u32
}

/// A box's planes in steps, rounded outwards.
fn grid(origin: f32, step: f32, lo: f32, hi: f32) -> (u32, u32) {
    let at = |v: f32| (f64::from(v) - f64::from(origin)) / f64::from(step);
    (at(lo).floor().clamp(0.0, 255.0) as u32, at(hi).ceil().clamp(0.0, 255.0) as u32)
}

#[cfg(test)]
mod tests;
