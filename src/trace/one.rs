//! One ray down the wide tree, against eight boxes and eight triangles at a time:
//! closest hit, or any.

use super::{
    Tracer,
    faces::fronts,
    free::{Crossed, Sheared, meets},
    lanes::{Lanes, Plain},
    tree8::{LEAF, Node8},
    triangle::Ray,
    walk::{STACK, slabs_of_one},
};
use glam::Vec3;
use std::mem::MaybeUninit;

/// What a ray met.
#[derive(Clone, Copy)]
pub(super) struct Met {
    /// Distance, metres.
    pub t: f32,
    /// The triangle's block, and its place there.
    pub block: u32,
    pub lane: usize,
    /// Barycentric weights of its corners.
    pub weights: Vec3,
}

impl Met {
    /// The triangle, as numbered in [`Tracer::triangles`].
    #[inline(always)]
    pub fn triangle(&self, tracer: &Tracer) -> u32 {
        tracer.tree.blocks[self.block as usize].triangle[self.lane & 7]
    }
}

/// The nearest triangle on a ray, of both faces or of `FRONTS` alone; of several at one
/// distance the first in the scene.
///
/// Whether the scalar walk comes to its leaf is asked of the nearest alone: where it does,
/// no triangle that it does not come to was nearer. Where it does not, which is rare beyond
/// measure, it is asked of every triangle that is met.
#[inline(always)]
pub(super) fn first<L: Lanes, const FRONTS: bool>(tracer: &Tracer, ray: &Ray) -> Option<Met> {
    let (met, sure) = nearest::<L, FRONTS, false>(tracer, ray)?;
    if sure || tracer.comes_to(ray, met.triangle(tracer)) { Some(met) } else { first_with_care::<FRONTS>(tracer, ray) }
}

#[cfg(test)]
thread_local! {
    /// How often this thread had to ask of every triangle.
    pub(super) static WITH_CARE: std::cell::Cell<u32> = const { std::cell::Cell::new(0) };
}

#[cold]
#[inline(never)]
fn first_with_care<const FRONTS: bool>(tracer: &Tracer, ray: &Ray) -> Option<Met> {
    #[cfg(test)]
    WITH_CARE.with(|count| count.set(count.get() + 1));
    nearest::<Plain, FRONTS, true>(tracer, ray).map(|(met, _)| met)
}

/// The nearest triangle, and whether it is met without rounding, too; with `CARE`, of those
/// that the scalar walk comes to.
#[inline(always)]
fn nearest<L: Lanes, const FRONTS: bool, const CARE: bool>(tracer: &Tracer, ray: &Ray) -> Option<(Met, bool)> {
    let Tracer { tree, source, .. } = tracer;
    let sheared = Sheared { origin: ray.origin, axes: ray.axes, shear: ray.shear };
    let mut walk = Walk::<L>::new(tracer, ray)?;
    let mut nearest: Option<(u32, usize)> = None;
    let (mut kept, mut are_sure) = ([[0.0; 8]; 4], 0);
    while let Some(index) = walk.next_leaf::<true>(tracer) {
        let block = &tree.blocks[index as usize];
        let Crossed { mut met, sure, t, volumes, sum } = meets::<L>(&sheared, block, walk.tmax, ray.tmax);
        if met == 0 {
            continue;
        }
        if FRONTS {
            met = fronts::<L>(block, met, ray.direction);
        }
        let mut distances = [0.0; 8];
        t.store(&mut distances);
        let mut is_changed = false;
        while met != 0 {
            let lane = met.trailing_zeros() as usize & 7;
            met &= met - 1;
            let (t, triangle) = (distances[lane], block.triangle[lane]);
            let number = |triangle: u32| source[triangle as usize];
            let is_nearer = t < walk.tmax
                || t == walk.tmax
                    && nearest.is_none_or(|(block, lane)| {
                        number(triangle) < number(tree.blocks[block as usize].triangle[lane])
                    });
            if is_nearer && (!CARE || tracer.comes_to(ray, triangle)) {
                (nearest, walk.tmax, is_changed) = (Some((index, lane)), t, true);
            }
        }
        if is_changed {
            are_sure = sure;
            let [u, v, w] = volumes;
            u.store(&mut kept[0]);
            v.store(&mut kept[1]);
            w.store(&mut kept[2]);
            sum.store(&mut kept[3]);
        }
    }
    let (block, lane) = nearest?;
    let weights = Vec3::new(kept[0][lane], kept[1][lane], kept[2][lane]) / kept[3][lane];
    Some((Met { t: walk.tmax, block, lane, weights }, are_sure >> lane & 1 == 1))
}

/// Whether a ray meets any triangle, of both faces or of `FRONTS` alone.
#[inline(always)]
pub(super) fn any<L: Lanes, const FRONTS: bool>(tracer: &Tracer, ray: &Ray) -> bool {
    let sheared = Sheared { origin: ray.origin, axes: ray.axes, shear: ray.shear };
    let Some(mut walk) = Walk::<L>::new(tracer, ray) else { return false };
    while let Some(block) = walk.next_leaf::<false>(tracer) {
        let block = &tracer.tree.blocks[block as usize];
        let Crossed { mut met, mut sure, .. } = meets::<L>(&sheared, block, ray.tmax, ray.tmax);
        if FRONTS && met != 0 {
            met = fronts::<L>(block, met, ray.direction);
            sure &= met;
        }
        if sure != 0 || met != 0 && tracer.comes_to_any(block, met, ray) {
            return true;
        }
    }
    false
}

/// Where to go on, and from which distance.
type Entry = MaybeUninit<(f32, u32)>;

/// The way of a ray from leaf to leaf.
struct Walk<L> {
    slopes: [L; 6],
    near_planes: [usize; 3],
    stack: [Entry; STACK],
    height: usize,
    /// How far to look.
    tmax: f32,
}

impl<L: Lanes> Walk<L> {
    /// From the root, if there is one.
    #[inline(always)]
    fn new(tracer: &Tracer, ray: &Ray) -> Option<Self> {
        if tracer.tree.nodes.is_empty() {
            return None;
        }
        let i = ray.inverse;
        let start = ray.origin * i;
        let mut walk = Walk {
            slopes: [
                L::splat(i.x),
                L::splat(i.y),
                L::splat(i.z),
                L::splat(start.x),
                L::splat(start.y),
                L::splat(start.z),
            ],
            near_planes: [near_plane(i, 0), near_plane(i, 1), near_plane(i, 2)],
            stack: [const { MaybeUninit::uninit() }; STACK],
            height: 1,
            tmax: ray.tmax,
        };
        walk.stack[0].write((0.0, 0));
        Some(walk)
    }

    /// The block of the next leaf; the nearest first where `NEAREST`.
    #[inline(always)]
    fn next_leaf<const NEAREST: bool>(&mut self, tracer: &Tracer) -> Option<u32> {
        while self.height > 0 {
            self.height -= 1;
            // SAFETY: all below `height` are written, and `STACK` is never reached: tested
            // by `the_stack_is_never_full`.
            let (entry, mut at) = unsafe { self.stack[self.height & (STACK - 1)].assume_init() };
            if entry > self.tmax * 1.000_001 {
                continue;
            }
            loop {
                if at & LEAF != 0 {
                    return Some(at & !LEAF);
                }
                let Some(child) = self.children::<NEAREST>(&tracer.tree.nodes[at as usize]) else { break };
                at = child;
            }
        }
        None
    }

    /// The child to go on with, after those that are left were put down: the nearest unless
    /// any will do, else the last that the tree has, its leaves.
    #[inline(always)]
    fn children<const NEAREST: bool>(&mut self, node: &Node8) -> Option<u32> {
        let (mut met, from) = slabs_of_one(node, self.near_planes, self.slopes, L::splat(self.tmax));
        if met == 0 {
            return None;
        }
        let first = met.trailing_zeros() as usize & 7;
        met &= met - 1;
        let mut next = node.child[first];
        if met == 0 {
            return Some(next);
        }
        let mut entries = [0.0; 8];
        from.store(&mut entries);
        let mut next_entry = entries[first];
        let bottom = self.height;
        while met != 0 {
            let k = met.trailing_zeros() as usize & 7;
            met &= met - 1;
            let mut put = (entries[k], node.child[k]);
            // The nearer of two goes on, of two alike the later.
            if !NEAREST || put.0 <= next_entry {
                std::mem::swap(&mut put.0, &mut next_entry);
                std::mem::swap(&mut put.1, &mut next);
            }
            self.put::<NEAREST>(bottom, put);
        }
        Some(next)
    }

    /// Puts one down among those above `bottom`, the nearest on top.
    #[inline(always)]
    fn put<const NEAREST: bool>(&mut self, bottom: usize, entry: (f32, u32)) {
        let mut place = self.height;
        while NEAREST && place > bottom {
            // SAFETY: all from `bottom` to `height` are written by this function.
            let below = unsafe { self.stack[(place - 1) & (STACK - 1)].assume_init() };
            if below.0 >= entry.0 {
                break;
            }
            self.stack[place & (STACK - 1)].write(below);
            place -= 1;
        }
        self.stack[place & (STACK - 1)].write(entry);
        self.height += 1;
    }
}

/// The row of boxes' planes that a ray comes to first along an axis.
#[inline(always)]
fn near_plane(inverse: Vec3, axis: usize) -> usize {
    if inverse[axis] < 0.0 { axis + 3 } else { axis }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        render::sampler::Sampler,
        trace::{Faces, Hit, Queue, Segments},
    };

    /// Small triangles in one place, before and within a large box.
    fn cluster() -> Vec<[Vec3; 3]> {
        let point = |i: u32, salt: u32| {
            let ([a, b], [c, _]) = (Sampler::new(7, i, salt).pair(0, 0), Sampler::new(8, i, salt).pair(0, 0));
            Vec3::new(a, b, c) * 2.0 - 1.0
        };
        let mut mesh = aogauge_scenes::Mesh::default();
        mesh.push_box(Vec3::new(-1.5, -1.6, -1.7), Vec3::new(1.4, 1.3, 1.2));
        let small = (0..64).map(|i| [1, 2, 3].map(|k| point(i, 0) * 0.2 + point(i, k) * 0.08));
        small.chain(mesh.corners()).collect()
    }

    /// Rays in the planes of triangles that pass beyond their corners. Seen from the edge,
    /// sheared corners lie on a line through the ray but for rounding: then the triangle
    /// test meets by rounding what is far beside the ray, and the scalar walk does not come
    /// there. Behind it is a wall.
    #[test]
    fn where_the_nearest_is_not_come_to_the_answer_is_still_the_scalar_walks() {
        let triangles = cluster();
        let fast = Tracer::new(&triangles);
        let portable = fast.clone().portable();
        let with_care = || WITH_CARE.with(std::cell::Cell::get);
        let (mut entered, mut of_fronts, mut hits) = (0, 0, 0);
        for i in 0..400_000u32 {
            let corners = triangles[i as usize % 64];
            let [a, b, c] = [0, 1, 2].map(|k| corners[(i as usize / 64 + k) % 3]);
            let ([s, t], [u, _]) = (Sampler::new(3, i, 0).pair(0, 0), Sampler::new(4, i, 0).pair(0, 0));
            let direction = ((b - a) * (s - 0.5) + (c - a) * (t - 0.5)).normalize();
            let beyond = a + (a * 2.0 - b - c) * (0.5 * u);
            let ray = Ray::new(beyond - direction, direction, 1e30);
            let before = with_care();
            let met = fast.closest(&ray);
            if with_care() > before {
                entered += 1;
                hits += u32::from(met.is_some());
                agrees([&fast, &portable], &ray, met);
            }
            let before = with_care();
            let distance = fast.distance(&ray, Faces::Front);
            if with_care() > before {
                of_fronts += 1;
                assert_eq!(distance, fast.scalar().distance(&ray, Faces::Front), "{ray:?}");
                assert_eq!(distance, portable.distance(&ray, Faces::Front), "{ray:?}");
            }
        }
        assert!(entered > 200 && of_fronts > 100 && hits > 200, "{entered} {of_fronts} {hits}");
    }

    /// All walks say what the scalar one says, of closest hits and of any.
    fn agrees(tracers: [&Tracer; 2], ray: &Ray, met: Option<Hit>) {
        let scalar = tracers[0].scalar();
        assert_eq!(met, scalar.closest(ray), "{ray:?}");
        // Before what is met, where it is met for sure, there is nothing.
        let short = Ray::new(ray.origin, ray.direction, met.map_or(1e30, |hit| hit.t * 0.999));
        let mut rays = Segments::EMPTY;
        rays.set(3, ray.origin, ray.direction, ray.tmax);
        for tracer in tracers {
            assert_eq!(tracer.closest(ray), met, "{ray:?}");
            assert_eq!(tracer.closest_of(&rays, 1 << 3).get(3), met, "{ray:?}");
            assert_eq!(tracer.occluded(&short), scalar.occluded(&short), "{ray:?}");
            let mut queue = Queue::default();
            queue.push(short.origin, short.direction, short.tmax);
            assert_eq!(queue.occluded(tracer, Faces::Both) == 1, scalar.occluded(&short), "{ray:?}");
        }
    }
}
