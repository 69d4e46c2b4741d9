//! One ray down the wide tree, against eight boxes and eight triangles at a time:
//! closest hit, or any.

use super::{
    Tracer,
    free::{Sheared, meets},
    lanes::Lanes,
    tree8::LEAF,
    triangle::Ray,
    walk::{STACK, slabs_of_one},
};
use std::mem::MaybeUninit;

/// What a ray met.
#[derive(Clone, Copy)]
pub(super) struct Met {
    /// Distance, metres.
    pub t: f32,
    /// The triangle, as it was numbered when the tracer was built.
    triangle: u32,
    /// Its block.
    pub block: u32,
    /// Its place there.
    pub lane: usize,
}

/// Where to go on, and from which distance.
type Entry = MaybeUninit<(f32, u32)>;

/// The nearest triangle on a ray, of several at one distance the first in the scene;
/// or whichever is found first, where `ANY` will do.
#[inline(always)]
pub(super) fn walk<L: Lanes, const ANY: bool>(tracer: &Tracer, ray: &Ray) -> Option<Met> {
    let Tracer { tree, source, .. } = tracer;
    if tree.nodes.is_empty() {
        return None;
    }
    let sheared = Sheared { origin: ray.origin, axes: ray.axes, shear: ray.shear };
    let i = ray.inverse;
    let start = ray.origin * i;
    let slopes = [L::splat(i.x), L::splat(i.y), L::splat(i.z), L::splat(start.x), L::splat(start.y), L::splat(start.z)];
    let near_planes = [0, 1, 2].map(|axis| if i[axis] < 0.0 { axis + 3 } else { axis });
    let mut stack: [Entry; STACK] = [const { MaybeUninit::uninit() }; STACK];
    stack[0].write((0.0, 0));
    let mut height = 1;
    let mut tmax = ray.tmax;
    let mut best: Option<Met> = None;
    while height > 0 {
        height -= 1;
        // SAFETY: all below `height` are written, and `STACK` is never reached: tested by
        // `the_stack_is_never_full`.
        let (entry, at) = unsafe { stack[height & (STACK - 1)].assume_init() };
        if entry > tmax * 1.000_001 {
            continue;
        }
        if at & LEAF != 0 {
            let block = at & !LEAF;
            let triangles = &tree.blocks[block as usize];
            let (mut met, t) = meets::<L>(&sheared, triangles, tmax);
            if met == 0 {
                continue;
            }
            let mut distances = [0.0; 8];
            t.store(&mut distances);
            while met != 0 {
                let lane = met.trailing_zeros() as usize & 7;
                met &= met - 1;
                let (t, triangle) = (distances[lane], source[triangles.triangle[lane] as usize]);
                let is_better = best.is_none_or(|b| t < b.t || t == b.t && triangle < b.triangle);
                if is_better && tracer.comes_to(ray, triangles.triangle[lane]) {
                    best = Some(Met { t, triangle, block, lane });
                    tmax = t;
                }
            }
            if ANY && best.is_some() {
                return best;
            }
            continue;
        }
        let node = &tree.nodes[at as usize];
        let (met, from) = slabs_of_one(node, near_planes, slopes, L::splat(tmax));
        let mut entries = [0.0; 8];
        from.store(&mut entries);
        push::<ANY>(&mut stack, &mut height, met, &entries, &node.child);
    }
    best
}

/// Puts down the children that are met, the nearest on top unless any will do: then
/// those that the tree has last, its leaves.
#[inline(always)]
fn push<const ANY: bool>(
    stack: &mut [Entry; STACK],
    height: &mut usize,
    mut met: u32,
    entries: &[f32; 8],
    child: &[u32; 8],
) {
    let first = *height;
    while met != 0 {
        let k = met.trailing_zeros() as usize & 7;
        met &= met - 1;
        let mut place = *height;
        while !ANY && place > first {
            // SAFETY: all from `first` to `height` are written by this function.
            let below = unsafe { stack[(place - 1) & (STACK - 1)].assume_init() };
            if below.0 >= entries[k] {
                break;
            }
            stack[place & (STACK - 1)].write(below);
            place -= 1;
        }
        stack[place & (STACK - 1)].write((entries[k], child[k]));
        *height += 1;
    }
}
