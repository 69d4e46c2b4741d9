//! The one place that meets triangles on the CPU: a BVH, any-hit, closest hit and
//! closest point.
//!
//! The tree is obvhs's `Bvh2`; its traversal is our own, because the library's
//! triangle test is not watertight and its any-hit has an absolute epsilon. Boxes
//! are padded by the rounding error of the scene, so that no box hides a triangle
//! that the triangle test would meet. The GPU walks the same tree folded eight wide.

mod build;
mod triangle;
mod wide;

pub use build::Node;
pub use triangle::Ray;
pub use wide::{STACK as WIDE_STACK, Wide, WideNode};

use aogauge_scenes::closest_point;
use glam::{Vec3, Vec3A};

/// The deepest tree we walk: the length of the traversal stack.
pub const STACK: usize = 64;

/// The nearest triangle along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance, metres.
    pub t: f32,
    /// The triangle, as it was numbered when the tracer was built.
    pub triangle: u32,
    /// The same, as numbered in [`Tracer::triangles`].
    pub leaf: u32,
    /// The point, interpolated from the corners.
    pub point: Vec3,
    /// Unit geometric normal, turned against the ray.
    pub normal: Vec3,
}

/// Triangles in a tree.
#[derive(Clone, Debug)]
pub struct Tracer {
    nodes: Vec<Node>,
    triangles: Vec<[Vec3; 3]>,
    source: Vec<u32>,
    offset: f32,
}

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

impl Tracer {
    /// Builds the tree. The triangles must be finite.
    pub fn new(triangles: &[[Vec3; 3]]) -> Self {
        let magnitude = triangles.iter().flatten().fold(0.0f32, |m, v| m.max(v.abs().max_element()));
        let (nodes, source) = build::build(triangles, magnitude * 2.0f32.powi(-22));
        Tracer {
            nodes,
            triangles: source.iter().map(|&i| triangles[i as usize]).collect(),
            source,
            offset: magnitude * 2.0f32.powi(-19),
        }
    }

    /// The nodes; the root is the first.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The triangles in leaf order.
    pub fn triangles(&self) -> &[[Vec3; 3]] {
        &self.triangles
    }

    /// How each triangle of [`Self::triangles`] was numbered when the tracer was
    /// built.
    pub fn source(&self) -> &[u32] {
        &self.source
    }

    /// How far ray origins are pushed off a surface, along its normal, metres.
    ///
    /// A bound on the rounding error, after Wächter and Binder (Ray Tracing Gems,
    /// chapter 6): 2^-19, 32 rounding units, of the largest coordinate in the
    /// scene. Their offset scales with the coordinates of the point itself, but
    /// the error here comes from the corners of whatever large triangle shares
    /// the plane, and near the origin theirs becomes a constant, which a scene
    /// scaled to 1/100 would see.
    pub fn offset(&self) -> f32 {
        self.offset
    }

    /// Takes another scene's offset, so that both start rays at the same points.
    pub fn set_offset(&mut self, offset: f32) {
        self.offset = offset;
    }

    /// Whether anything lies on the ray within `(0, tmax]`.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.occluded_by(ray, |_| true)
    }

    /// Whether a triangle that `accept` takes (by its corners) lies on the ray
    /// within `(0, tmax]`.
    #[inline]
    pub fn occluded_by(&self, ray: &Ray, accept: impl Fn(&[Vec3; 3]) -> bool) -> bool {
        self.walk(ray, ray.tmax, |triangle, tmax| {
            let corners = &self.triangles[triangle];
            if ray.meets(corners, tmax).is_some() && accept(corners) { None } else { Some(tmax) }
        })
    }

    /// Distance along the ray, within `(0, tmax]`, to the nearest triangle that
    /// `accept` takes.
    pub fn distance(&self, ray: &Ray, accept: impl Fn(&[Vec3; 3]) -> bool) -> Option<f32> {
        let mut nearest = None;
        self.walk(ray, ray.tmax, |triangle, tmax| {
            let corners = &self.triangles[triangle];
            match ray.meets(corners, tmax) {
                Some((t, _)) if accept(corners) => {
                    nearest = Some(t);
                    Some(t)
                }
                _ => Some(tmax),
            }
        });
        nearest
    }

    /// The nearest triangle on the ray within `(0, tmax]`; of several at one
    /// distance the first in the scene, whatever the order of the walk.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut best: Option<(f32, usize, Vec3)> = None;
        self.walk(ray, ray.tmax, |triangle, tmax| match ray.meets(&self.triangles[triangle], tmax) {
            Some((t, weights)) if best.is_none_or(|b| t < b.0 || self.source[triangle] < self.source[b.1]) => {
                best = Some((t, triangle, weights));
                Some(t)
            }
            _ => Some(tmax),
        });
        best.map(|(t, triangle, w)| {
            let [a, b, c] = self.triangles[triangle];
            let normal = (b - a).cross(c - a).normalize_or_zero();
            Hit {
                t,
                triangle: self.source[triangle],
                leaf: triangle as u32,
                point: a * w.x + b * w.y + c * w.z,
                normal: if normal.dot(ray.direction) > 0.0 { -normal } else { normal },
            }
        })
    }

    /// Walks the tree along a ray, nearer child first. `test` takes a triangle
    /// and how far to look, and returns how far to look from there on, or None to
    /// stop; the walk returns whether it was stopped.
    #[inline(always)]
    fn walk(&self, ray: &Ray, tmax: f32, mut test: impl FnMut(usize, f32) -> Option<f32>) -> bool {
        let origin = Vec3A::from(ray.origin);
        let inverse = Vec3A::from(ray.inverse);
        let mut tmax = tmax;
        let mut stack = [0u32; STACK];
        let mut height = 0;
        let Some(root) = self.nodes.first() else {
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
                let (mut near, mut far) = (&self.nodes[first], &self.nodes[first + 1]);
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
            node = &self.nodes[stack[height] as usize];
        }
    }

    /// The nearest point to `point`, within `radius`, on the triangles that
    /// `accept` takes (by their corners).
    pub fn nearest(&self, point: Vec3, radius: f32, accept: impl Fn(&[Vec3; 3]) -> bool) -> Option<Nearest> {
        self.nearest_of(point, radius, |leaf| accept(&self.triangles[leaf as usize]))
    }

    /// The nearest point to `point`, within `radius`, on the triangles that
    /// `accept` takes, by their numbers in [`Self::triangles`].
    pub fn nearest_of(&self, point: Vec3, radius: f32, accept: impl Fn(u32) -> bool) -> Option<Nearest> {
        let mut best = radius * radius;
        let mut found = None;
        let mut stack: Vec<u32> = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if box_distance_squared(node, point) > best {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, node.first + 1]);
                continue;
            }
            for triangle in node.first..node.first + node.count {
                let corners = &self.triangles[triangle as usize];
                let at = closest_point(point, corners);
                let d = (at - point).length_squared();
                if d <= best && accept(triangle) {
                    best = d;
                    found = Some(Nearest { point: at, distance: d.sqrt(), triangle });
                }
            }
        }
        found
    }

    /// Calls `visit` with the corners of every triangle whose tree leaf comes
    /// within `radius` of `point`: at least those that come so near themselves.
    pub fn near(&self, point: Vec3, radius: f32, mut visit: impl FnMut(&[Vec3; 3])) {
        let mut stack: Vec<u32> = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if box_distance_squared(node, point) > radius * radius {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, node.first + 1]);
            } else {
                self.triangles[node.first as usize..(node.first + node.count) as usize].iter().for_each(&mut visit);
            }
        }
    }
}

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The point.
    pub point: Vec3,
    /// Its distance from where the search began, metres.
    pub distance: f32,
    /// The triangle, as numbered in [`Tracer::triangles`].
    pub triangle: u32,
}

fn box_distance_squared(node: &Node, point: Vec3) -> f32 {
    (point.clamp(Vec3::from(node.min), Vec3::from(node.max)) - point).length_squared()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::sampler::Sampler;

    /// Triangles of many sizes and directions, the same every time.
    fn soup(n: u32) -> Vec<[Vec3; 3]> {
        let point = |i: u32, salt: u32| {
            let [a, b] = Sampler::new(7, i, salt).pair(0, 0);
            let [c, _] = Sampler::new(8, i, salt).pair(0, 0);
            Vec3::new(a, b, c) * 2.0 - 1.0
        };
        (0..n)
            .map(|i| {
                let centre = point(i, 0);
                let size = if i % 10 == 0 { 0.8 } else { 0.1 };
                [1, 2, 3].map(|k| centre + point(i, k) * size)
            })
            .collect()
    }

    fn rays(n: u32, tmax: f32) -> impl Iterator<Item = Ray> {
        (0..n).map(move |i| {
            let [a, b] = Sampler::new(1, i, 1).pair(0, 0);
            let [c, d] = Sampler::new(2, i, 1).pair(0, 0);
            let z = 1.0 - 2.0 * d;
            let (s, phi) = ((1.0 - z * z).sqrt(), 6.283_185_5 * c);
            let direction = Vec3::new(s * phi.cos(), s * phi.sin(), z).normalize();
            Ray::new(Vec3::new(a, b, c) * 2.4 - 1.2, direction, tmax)
        })
    }

    #[test]
    fn the_tree_agrees_with_brute_force() {
        let triangles = soup(400);
        let tracer = Tracer::new(&triangles);
        let mut hits = 0;
        for ray in rays(20_000, 1.5) {
            let brute = triangles
                .iter()
                .enumerate()
                .filter_map(|(i, t)| ray.meets(t, ray.tmax).map(|(t, _)| (t, i as u32)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            assert_eq!(tracer.occluded(&ray), brute.is_some());
            assert_eq!(tracer.closest(&ray).map(|h| h.t), brute.map(|b| b.0));
            hits += usize::from(brute.is_some());
        }
        assert!(hits > 5_000, "the test must meet something: {hits}");
    }

    #[test]
    fn no_ray_slips_through_the_edges_and_corners_of_a_closed_box() {
        let mut mesh = aogauge_scenes::Mesh::default();
        mesh.push_box(Vec3::new(-1.0, -0.7, -1.3), Vec3::new(0.9, 1.1, 1.0));
        let triangles: Vec<_> = mesh.corners().collect();
        let tracer = Tracer::new(&triangles);
        for (i, ray) in rays(20_000, 1.0).enumerate() {
            let inside = ray.origin.clamp(Vec3::new(-0.9, -0.6, -1.2), Vec3::new(0.8, 1.0, 0.9));
            let [a, b, _] = triangles[i % triangles.len()];
            let s = (i % 101) as f32 / 100.0;
            let target = a + (b - a) * s;
            let ray = Ray::new(inside, (target - inside).normalize(), 10.0);
            assert!(tracer.occluded(&ray), "{inside} to {target}");
        }
    }

    #[test]
    fn nearest_agrees_with_brute_force() {
        let triangles = soup(200);
        let tracer = Tracer::new(&triangles);
        for ray in rays(500, 1.0) {
            let brute = triangles
                .iter()
                .map(|t| (closest_point(ray.origin, t) - ray.origin).length())
                .min_by(f32::total_cmp)
                .unwrap();
            let found = tracer.nearest(ray.origin, 5.0, |_| true).unwrap();
            assert!((found.distance - brute).abs() < 1e-6);
            assert!((found.point - ray.origin).length() - brute < 1e-6);
            let mut near = 0;
            tracer.near(ray.origin, brute, |_| near += 1);
            assert!(near > 0);
            assert_eq!(tracer.nearest(ray.origin, brute * 0.99, |_| true), None);
        }
    }
}
