//! The walk that rays share: down the wide tree with a bit for each ray, testing
//! either eight rays against a box or a ray against eight boxes.

use super::{
    lanes::Lanes,
    tree8::{Block, LEAF, Node8, Tree8},
};
use glam::Vec3;
use std::mem::MaybeUninit;

/// What an operation rounds by, relative.
pub(super) const U: f32 = 1.0 / (1u32 << 24) as f32;

/// Eight vectors side by side, by axis.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Packet(pub [[f32; 8]; 3]);

impl Packet {
    /// All the same vector.
    pub fn splat(v: Vec3) -> Self {
        Packet([[v.x; 8], [v.y; 8], [v.z; 8]])
    }

    /// One of the vectors.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Vec3 {
        Vec3::new(self.0[0][lane & 7], self.0[1][lane & 7], self.0[2][lane & 7])
    }

    /// Writes one of them.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, v: Vec3) {
        for axis in 0..3 {
            self.0[axis][lane & 7] = v[axis];
        }
    }
}

/// What the box test of eight rays needs: 1/d and o/d by axis, and tmax.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub(super) struct Slopes(pub [[f32; 8]; 7]);

impl Slopes {
    /// Of directions, origins and lengths.
    #[inline(always)]
    pub fn new<L: Lanes>(d: [L; 3], o: [L; 3], tmax: L) -> Self {
        let mut slopes = Slopes([[0.0; 8]; 7]);
        for axis in 0..3 {
            // Bounded like the scalar ray's: never infinite, so never NaN below.
            let inverse = L::splat(1.0).div(d[axis].abs().max(L::splat(1e-20))).xor(d[axis].signs());
            inverse.store(&mut slopes.0[axis]);
            inverse.mul(o[axis]).store(&mut slopes.0[axis + 3]);
        }
        tmax.store(&mut slopes.0[6]);
        slopes
    }
}

/// What a kind of rays brings to the walk.
pub(super) trait Bundle<L: Lanes> {
    /// Children that any of the rays may come to, a bit each, and those of them that
    /// all rays come to: a quick test of eight boxes at once, never wrong about a
    /// box that a ray comes to.
    fn near(&self, node: &Node8) -> (u32, u32);
    /// Which of the rays in `mask` meet a triangle of the block.
    fn meets(&self, block: &Block, mask: u32) -> u32;
}

/// Entries of the stack: a level of the tree leaves seven at most, and a power of
/// two saves the check of bounds.
pub(super) const STACK: usize = 512;
const _: () = assert!(STACK > 7 * super::STACK + 8);

/// What is left to walk: children, and the rays that go there. Not cleared, because
/// that would cost more than most walks.
struct Stack {
    entries: [MaybeUninit<(u32, u32)>; STACK],
    height: usize,
}

impl Stack {
    /// Written in any case, kept where a ray goes there: no branch to guess.
    #[inline(always)]
    fn push(&mut self, child: u32, rays: u32) {
        self.entries[self.height & (STACK - 1)].write((child, rays));
        self.height += usize::from(rays != 0);
    }
}

/// A bit for each ray of `all` that meets a triangle.
#[inline(always)]
pub(super) fn any_hit<L: Lanes, B: Bundle<L>, const N: usize>(
    tree: &Tree8,
    bundle: &B,
    slopes: &[Slopes; N],
    all: u32,
) -> u32 {
    if tree.nodes.is_empty() || all == 0 {
        return 0;
    }
    let mut stack = Stack { entries: [const { MaybeUninit::uninit() }; STACK], height: 0 };
    stack.push(0, all);
    let mut closed = 0;
    while stack.height > 0 {
        stack.height -= 1;
        // SAFETY: all below `height` are written, and `STACK` is never reached: tested by
        // `the_stack_is_never_full`.
        let (at, rays) = unsafe { stack.entries[stack.height & (STACK - 1)].assume_init() };
        let rays = rays & !closed;
        if rays == 0 {
            continue;
        }
        if at & LEAF != 0 {
            closed |= bundle.meets(&tree.blocks[(at & !LEAF) as usize], rays);
            if closed == all {
                return closed;
            }
            continue;
        }
        let node = &tree.nodes[at as usize];
        // For one or two rays the quick test does not pay.
        let (near, all_come) = if rays.count_ones() <= 2 { (255, 0) } else { bundle.near(node) };
        if rays.count_ones() < near.count_ones() {
            few::<L, N>(node, slopes, rays, near, &mut stack);
        } else {
            many::<L, N>(node, slopes, rays, near & !all_come, &mut stack);
            let mut left = all_come;
            while left != 0 {
                let k = left.trailing_zeros() as usize & 7;
                left &= left - 1;
                stack.push(node.child[k], rays);
            }
        }
    }
    closed
}

/// Each child against eight rays.
#[inline(always)]
fn many<L: Lanes, const N: usize>(node: &Node8, slopes: &[Slopes; N], rays: u32, mut near: u32, stack: &mut Stack) {
    while near != 0 {
        let k = near.trailing_zeros() as usize & 7;
        near &= near - 1;
        let mut met = 0;
        for (packet, slopes) in slopes.iter().enumerate() {
            if N == 1 || rays >> (8 * packet) & 255 != 0 {
                let tmax = L::load(&slopes.0[6]);
                met |= slabs(spread6(&node.planes, k), load6(&slopes.0), tmax).0 << (8 * packet);
            }
        }
        stack.push(node.child[k], rays & met);
    }
}

/// Each ray against eight children.
#[inline(always)]
fn few<L: Lanes, const N: usize>(node: &Node8, slopes: &[Slopes; N], rays: u32, near: u32, stack: &mut Stack) {
    // A byte a child, a bit a ray, for each packet.
    let mut goes = [0u64; N];
    let mut met = 0;
    let planes = load6::<L>(&node.planes);
    let mut left = rays;
    while left != 0 {
        let i = left.trailing_zeros() as usize & 31;
        left &= left - 1;
        let packet = if N == 1 { 0 } else { i / 8 % N };
        let of = &slopes[packet].0;
        let children = slabs(planes, spread6(of, i & 7), L::splat(of[6][i & 7])).0 & near;
        met |= children;
        goes[packet] |= L::spread(children) << (i & 7);
    }
    while met != 0 {
        let k = met.trailing_zeros() as usize & 7;
        met &= met - 1;
        let mut m = 0;
        for (packet, g) in goes.iter().enumerate() {
            m |= ((g >> (8 * k)) as u32 & 255) << (8 * packet);
        }
        stack.push(node.child[k], m);
    }
}

// Helpers are functions, not closures or `map`: those may be compiled on their
// own, without the wide registers, and then are called for each operation.

#[inline(always)]
pub(super) fn splat3<L: Lanes>(v: Vec3) -> [L; 3] {
    [L::splat(v.x), L::splat(v.y), L::splat(v.z)]
}

#[inline(always)]
pub(super) fn load3<L: Lanes>(v: &[[f32; 8]; 3]) -> [L; 3] {
    [L::load(&v[0]), L::load(&v[1]), L::load(&v[2])]
}

#[inline(always)]
pub(super) fn sub3<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

/// Not fused: for what passes triangles over, so that both kinds of lanes pass
/// over the same.
#[inline(always)]
pub(super) fn exact_dot<L: Lanes>(p: [L; 3], q: [L; 3]) -> L {
    p[0].mul(q[0]).add(p[1].mul(q[1])).add(p[2].mul(q[2]))
}

#[inline(always)]
pub(super) fn exact_cross<L: Lanes>(p: [L; 3], q: [L; 3]) -> [L; 3] {
    [p[1].mul(q[2]).sub(q[1].mul(p[2])), p[2].mul(q[0]).sub(q[2].mul(p[0])), p[0].mul(q[1]).sub(q[0].mul(p[1]))]
}

#[inline(always)]
pub(super) fn load6<L: Lanes>(v: &[[f32; 8]]) -> [L; 6] {
    [L::load(&v[0]), L::load(&v[1]), L::load(&v[2]), L::load(&v[3]), L::load(&v[4]), L::load(&v[5])]
}

/// One lane of six rows, everywhere.
#[inline(always)]
pub(super) fn spread6<L: Lanes>(v: &[[f32; 8]], k: usize) -> [L; 6] {
    [L::splat(v[0][k]), L::splat(v[1][k]), L::splat(v[2][k]), L::splat(v[3][k]), L::splat(v[4][k]), L::splat(v[5][k])]
}

#[inline(always)]
fn slab<L: Lanes>(lo: L, hi: L, inverse: L, start: L) -> (L, L) {
    let (a, b) = (lo.mul_sub(inverse, start), hi.mul_sub(inverse, start));
    (a.min(b), a.max(b))
}

/// The slab test: a bit for each lane that is met, and where it is entered, no
/// less than 0.
///
/// `lo * inverse - start`, start = o * inverse rounded, errs by what moves the
/// plane by 2^-24 |o| and by 2^-24 of the distance: the boxes are padded by
/// 2^-22 of the largest coordinate, and `to` is widened (Ize, JCGT 2(2), 2013).
#[inline(always)]
pub(super) fn slabs<L: Lanes>(planes: [L; 6], slopes: [L; 6], tmax: L) -> (u32, L) {
    let (x0, x1) = slab(planes[0], planes[3], slopes[0], slopes[3]);
    let (y0, y1) = slab(planes[1], planes[4], slopes[1], slopes[4]);
    let (z0, z1) = slab(planes[2], planes[5], slopes[2], slopes[5]);
    let from = x0.max(y0).max(z0.max(L::splat(0.0)));
    let to = x1.min(y1).min(z1.min(tmax));
    (from.le(to.mul(L::splat(1.000_001))), from)
}

/// The same for one ray, `near_planes` the row that it comes to first by axis. Not fused:
/// at an edge the closest hit may depend on the order of the walk, which must be the
/// same on any machine.
#[inline(always)]
pub(super) fn slabs_of_one<L: Lanes>(node: &Node8, near_planes: [usize; 3], slopes: [L; 6], tmax: L) -> (u32, L) {
    let [x, y, z] = near_planes;
    let row = |i: usize| &node.planes[i];
    let far = |i: usize| if i < 3 { i + 3 } else { i - 3 };
    let x0 = L::load(row(x)).mul(slopes[0]).sub(slopes[3]);
    let y0 = L::load(row(y)).mul(slopes[1]).sub(slopes[4]);
    let z0 = L::load(row(z)).mul(slopes[2]).sub(slopes[5]);
    let x1 = L::load(row(far(x))).mul(slopes[0]).sub(slopes[3]);
    let y1 = L::load(row(far(y))).mul(slopes[1]).sub(slopes[4]);
    let z1 = L::load(row(far(z))).mul(slopes[2]).sub(slopes[5]);
    let from = x0.max(y0).max(z0.max(L::splat(0.0)));
    let to = x1.min(y1).min(z1.min(tmax));
    (from.le(to.mul(L::splat(1.000_001))), from)
}
