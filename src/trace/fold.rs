//! A binary tree folded eight wide, so that the expected cost of a ray is least
//! among all ways to fold it (Ylitie, Karras, Laine, "Efficient Incoherent Ray
//! Traversal on GPUs Through Compressed Wide BVHs", HPG 2017, section 3).

use super::Node;
use glam::Vec3;

/// Children of a node.
pub const WIDTH: usize = 8;

/// What nodes and leaves cost a ray that comes to them, all in one unit.
#[derive(Clone, Copy, Debug)]
pub struct Costs {
    /// A node.
    pub node: f32,
    /// A leaf, however many triangles it has.
    pub leaf: f32,
    /// Each triangle of a leaf.
    pub triangle: f32,
    /// The most triangles of a leaf.
    pub most: u32,
    /// By how much boxes count as if they were larger, along each axis, metres:
    /// what short rays about a point see.
    pub reach: f32,
}

/// What becomes of a subtree that may take some number of slots of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Plan {
    /// One slot: a leaf.
    Leaf,
    /// One slot: a node of its own.
    Inner,
    /// Its left child takes so many of the slots, its right one the others.
    Split(u8),
    /// As with one slot less.
    Fewer,
}

/// Costs and plans of a binary node for one to seven slots, and the split of its
/// eight where it becomes a node of its own.
#[derive(Clone, Copy)]
struct Choice {
    cost: [f32; WIDTH - 1],
    plan: [Plan; WIDTH - 1],
    own: u8,
    triangles: u32,
}

/// What becomes of each node of a binary tree.
pub struct Plans(Vec<Option<Choice>>);

impl Plans {
    /// Works out the plans of a tree that has nodes.
    pub fn new(nodes: &[Node], costs: Costs) -> Self {
        let mut plans = Plans(vec![None; nodes.len()]);
        plans.choose(nodes, 0, costs);
        plans
    }

    /// Of a subtree, children first.
    fn choose(&mut self, nodes: &[Node], index: u32, costs: Costs) -> Choice {
        let node = &nodes[index as usize];
        let area = half_area(node, costs.reach);
        let mut choice =
            Choice { cost: [f32::INFINITY; WIDTH - 1], plan: [Plan::Fewer; WIDTH - 1], own: 0, triangles: node.count };
        let mut split = [(f32::INFINITY, 0u8); WIDTH + 1];
        if node.count == 0 {
            let left = self.choose(nodes, node.first, costs);
            let right = self.choose(nodes, node.first + 1, costs);
            choice.triangles = left.triangles + right.triangles;
            for (slots, best) in split.iter_mut().enumerate().skip(2) {
                for k in 1..slots.min(WIDTH) {
                    let rest = slots - k;
                    if rest < WIDTH {
                        let cost = left.cost[k - 1] + right.cost[rest - 1];
                        if cost < best.0 {
                            *best = (cost, k as u8);
                        }
                    }
                }
            }
            choice.cost[0] = split[WIDTH].0 + area * costs.node;
            choice.plan[0] = Plan::Inner;
            choice.own = split[WIDTH].1;
        }
        let as_leaf = area * choice.triangles as f32 * costs.triangle + area * costs.leaf;
        if choice.triangles <= costs.most && as_leaf <= choice.cost[0] {
            choice.cost[0] = as_leaf;
            choice.plan[0] = Plan::Leaf;
        }
        for (slots, &(cost, k)) in split.iter().enumerate().take(WIDTH).skip(2) {
            (choice.cost[slots - 1], choice.plan[slots - 1]) = if cost < choice.cost[slots - 2] {
                (cost, Plan::Split(k))
            } else {
                (choice.cost[slots - 2], Plan::Fewer)
            };
        }
        self.0[index as usize] = Some(choice);
        choice
    }

    /// The binary nodes that become the children of a node of its own, and which of
    /// them are leaves.
    pub fn children(&self, nodes: &[Node], root: u32) -> Vec<(u32, bool)> {
        let node = &nodes[root as usize];
        let mut found = Vec::with_capacity(WIDTH);
        if node.count > 0 {
            // Only a tree of one leaf has such a root.
            return vec![(root, true)];
        }
        let own = self.0[root as usize].map_or(1, |c| usize::from(c.own));
        let mut work = vec![(node.first + 1, WIDTH - own), (node.first, own)];
        while let Some((index, mut slots)) = work.pop() {
            let Some(choice) = &self.0[index as usize] else { continue };
            while choice.plan[slots - 1] == Plan::Fewer {
                slots -= 1;
            }
            match choice.plan[slots - 1] {
                Plan::Leaf => found.push((index, true)),
                Plan::Split(k) => {
                    let first = nodes[index as usize].first;
                    work.extend([(first + 1, slots - usize::from(k)), (first, usize::from(k))]);
                }
                Plan::Inner | Plan::Fewer => found.push((index, false)),
            }
        }
        found
    }
}

/// The triangles of a subtree.
pub fn collect(nodes: &[Node], root: u32, order: &mut Vec<u32>) {
    let node = &nodes[root as usize];
    if node.count > 0 {
        order.extend(node.first..node.first + node.count);
    } else {
        collect(nodes, node.first, order);
        collect(nodes, node.first + 1, order);
    }
}

/// Half the surface of a node's box.
pub fn half_area(node: &Node, reach: f32) -> f32 {
    let d = Vec3::from(node.max) - Vec3::from(node.min) + reach;
    d.x * d.y + d.y * d.z + d.z * d.x
}
