//! One ray at a time down the binary tree: the reference that the wide walks are
//! held against.

use super::{Faces, Hit, Node, Ray, STACK, Tracer, tree8::Block};
use glam::{Vec3, Vec3A};

/// A tracer walked ray by ray, on any machine alike.
#[derive(Clone, Copy, Debug)]
pub struct Scalar<'a>(pub(super) &'a Tracer);

/// Slab test against a padded box, widened by the rounding error of the three
/// operations (Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013). Returns the
/// entry distance, infinity for a miss.
#[inline]
fn enter(node: &Node, origin: Vec3A, inverse: Vec3A, tmax: f32) -> f32 {
    let raw: &[f32; 8] = bytemuck::cast_ref(node);
    let lo = (Vec3A::new(raw[0], raw[1], raw[2]) - origin) * inverse;
    let hi = (Vec3A::new(raw[4], raw[5], raw[6]) - origin) * inverse;
    let near = lo.min(hi).max_element().max(0.0);
    let far = lo.max(hi).min_element().min(tmax);
    if near <= far * 1.000_000_4 { near } else { f32::INFINITY }
}

impl Scalar<'_> {
    /// Whether anything lies on the ray within `(0, tmax]`.
    pub fn occluded(self, ray: &Ray) -> bool {
        self.occluded_by(ray, Faces::Both)
    }

    /// As [`Tracer::occluded_by`].
    #[inline]
    pub fn occluded_by(self, ray: &Ray, faces: Faces) -> bool {
        self.walk(ray, ray.tmax, |triangle, tmax| {
            let corners = &self.0.triangles[triangle];
            if ray.meets(corners, tmax).is_some() && faces.count(corners, ray.direction) { None } else { Some(tmax) }
        })
    }

    /// As [`Tracer::distance`].
    pub fn distance(self, ray: &Ray, faces: Faces) -> Option<f32> {
        let mut nearest = None;
        self.walk(ray, ray.tmax, |triangle, tmax| {
            let corners = &self.0.triangles[triangle];
            match ray.meets(corners, tmax) {
                Some((t, _)) if faces.count(corners, ray.direction) => {
                    nearest = Some(t);
                    Some(t)
                }
                _ => Some(tmax),
            }
        });
        nearest
    }

    /// As [`Tracer::closest`].
    pub fn closest(self, ray: &Ray) -> Option<Hit> {
        let source = &self.0.source;
        let mut best: Option<(f32, usize, Vec3)> = None;
        self.walk(ray, ray.tmax, |triangle, tmax| match ray.meets(&self.0.triangles[triangle], tmax) {
            Some((t, weights)) if best.is_none_or(|b| t < b.0 || source[triangle] < source[b.1]) => {
                best = Some((t, triangle, weights));
                Some(t)
            }
            _ => Some(tmax),
        });
        best.map(|(t, triangle, weights)| self.0.hit(ray, t, triangle, weights))
    }

    /// Walks the tree along a ray, nearer child first. `test` takes a triangle
    /// and how far to look, and returns how far to look from there on, or None to
    /// stop; the walk returns whether it was stopped.
    #[inline(always)]
    fn walk(self, ray: &Ray, tmax: f32, mut test: impl FnMut(usize, f32) -> Option<f32>) -> bool {
        let origin = Vec3A::from(ray.origin);
        let inverse = Vec3A::from(ray.inverse);
        let mut tmax = tmax;
        let mut stack = [0u32; STACK];
        let mut height = 0;
        let Some(root) = self.0.nodes.first() else {
            return false;
        };
        if enter(root, origin, inverse, tmax) == f32::INFINITY {
            return false;
        }
        let mut node = root;
        loop {
            if node.count > 0 {
                for triangle in node.first..node.first + node.count {
                    match test(triangle as usize, tmax) {
                        Some(t) => tmax = t,
                        None => return true,
                    }
                }
            } else {
                let first = node.first as usize;
                let (mut near, mut far) = (&self.0.nodes[first], &self.0.nodes[first + 1]);
                let (mut t_near, mut t_far) = (enter(near, origin, inverse, tmax), enter(far, origin, inverse, tmax));
                let mut far_index = first + 1;
                if t_far < t_near {
                    std::mem::swap(&mut near, &mut far);
                    std::mem::swap(&mut t_near, &mut t_far);
                    far_index = first;
                }
                if t_far < f32::INFINITY {
                    stack[height] = far_index as u32;
                    height += 1;
                }
                if t_near < f32::INFINITY {
                    node = near;
                    continue;
                }
            }
            if height == 0 {
                return false;
            }
            height -= 1;
            node = &self.0.nodes[stack[height] as usize];
        }
    }
}

impl Tracer {
    /// Whether the scalar walk comes to a triangle, as numbered in [`Tracer::triangles`]: to
    /// its leaf's box. It comes to all boxes around that, because rounding is monotonic.
    ///
    /// At its very edge the triangle test meets by rounding what lies up to 8 u of the
    /// largest coordinate beside it, and what passes beyond a corner where a triangle is seen
    /// from its edge: that may be outside of the box.
    #[inline]
    pub(super) fn comes_to(&self, ray: &Ray, triangle: u32) -> bool {
        let leaf = &self.nodes[self.leaves[triangle as usize] as usize];
        enter(leaf, ray.origin.into(), ray.inverse.into(), ray.tmax) < f32::INFINITY
    }

    /// The same of any of a block's lanes.
    #[inline(never)]
    pub(super) fn comes_to_any(&self, block: &Block, lanes: u32, ray: &Ray) -> bool {
        (0..8).any(|lane| lanes >> lane & 1 == 1 && self.comes_to(ray, block.triangle[lane]))
    }
}
