//! The one place that meets triangles on the CPU. Renderers ask
//!
//! - [`Tracer::occluded_from`] of all rays of a shaded point together, which share
//!   their origin and length;
//! - [`Tracer::occluded_segments`] of rays with origins of their own;
//! - [`Tracer::closest_of`] of what eight rays meet first;
//! - [`Tracer::closest`], [`Tracer::distance`] and [`Tracer::occluded`] of one ray.
//!
//! [`Faces`] says which side of a triangle counts where anything on a ray, or the
//! distance to it, is asked for. [`Tracer::scalar`] is what all answers are held against.
//!
//! The binary tree is obvhs's `Bvh2`; folded eight wide it is walked by our own
//! traversals, because the library's triangle test is not watertight and its any-hit
//! has an absolute epsilon. Boxes are padded by the rounding error of the scene, so
//! that no box hides a triangle that the triangle test would meet. All walks give
//! the scalar walk's answers, bit by bit, with AVX2 and without: `docs/cpu-speed.md`
//! tells how. The GPU walks the same tree in eight bits a plane.

mod build;
mod eight;
mod faces;
mod fan;
mod fold;
mod free;
mod lanes;
mod nearest;
mod one;
mod scalar;
mod tree8;
mod triangle;
mod walk;
mod wide;

pub use build::Node;
pub use eight::Hits;
pub use faces::Faces;
pub use fan::Fan;
pub use free::{Queue, Segments};
pub use nearest::Nearest;
pub use scalar::Scalar;
pub use triangle::{Ray, lift};
pub use walk::Packet;
pub use wide::{STACK as WIDE_STACK, Wide, WideNode};

use glam::Vec3;
use tree8::Tree8;

/// The deepest tree we walk: the length of the scalar traversal's stack.
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
    /// The point, interpolated from the corners; off a needle by its [`lift`], on the side of the normal.
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
    /// The leaf of the binary tree that holds each triangle.
    leaves: Vec<u32>,
    offset: f32,
    /// [`lift`] of each triangle; none where it is 0 for all.
    lifts: Vec<f32>,
    /// The largest coordinate, metres.
    magnitude: f32,
    tree: Tree8,
    /// Whether the machine has what the fast walks take.
    fast: bool,
}

/// Runs a walk by AVX2 where the machine has it, else by arrays; compiled for each choice of
/// faces where there is one, so that the loops need not ask.
macro_rules! by_lanes {
    (
        $fast:expr, $module:ident::$walk:ident [$($n:ident)?] $([$fronts:literal])?,
        ($($arg:ident: $type:ty),*) -> $out:ty
    ) => {{
        #[cfg(target_arch = "x86_64")]
        if $fast {
            #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt")]
            fn wide $(<const $n: usize>)? ($($arg: $type),*) -> $out {
                $module::$walk::<lanes::Avx2 $(, $n)? $(, $fronts)?>($($arg),*)
            }
            // SAFETY: `fast` is `has_avx2()` or false, and that asks for all of these.
            // Tested against the portable walks by `every_answer_is_the_scalar_walks`.
            return unsafe { wide($($arg),*) };
        }
        $module::$walk::<lanes::Plain $(, $n)? $(, $fronts)?>($($arg),*)
    }};
    ($fast:expr, $faces:expr, $module:ident::$walk:ident [$($n:ident)?], $types:tt -> $out:ty) => {
        match $faces {
            Faces::Both => by_lanes!($fast, $module::$walk [$($n)?] [false], $types -> $out),
            Faces::Front => by_lanes!($fast, $module::$walk [$($n)?] [true], $types -> $out),
        }
    };
}

impl Tracer {
    /// Builds the tree. The triangles must be finite.
    pub fn new(triangles: &[[Vec3; 3]]) -> Self {
        let magnitude = triangles.iter().flatten().fold(0.0f32, |m, v| m.max(v.abs().max_element()));
        let pad = magnitude * 2.0f32.powi(-22);
        let (nodes, source) = build::build(triangles, pad);
        let triangles: Vec<_> = source.iter().map(|&i| triangles[i as usize]).collect();
        let mut leaves = vec![0; triangles.len()];
        for (node, n) in nodes.iter().enumerate().filter(|(_, n)| n.count > 0) {
            leaves[n.first as usize..][..n.count as usize].fill(node as u32);
        }
        let tree = Tree8::new(&nodes, &triangles, pad);
        let offset = magnitude * 2.0f32.powi(-19);
        let lifts = lifts(&triangles, offset);
        Tracer { nodes, triangles, source, leaves, offset, lifts, magnitude, tree, fast: lanes::has_avx2() }
    }

    /// Walks without AVX2, as on machines that have none: to test that, and to time it.
    #[must_use]
    pub fn portable(self) -> Self {
        Tracer { fast: false, ..self }
    }

    /// Whether it walks by AVX2.
    pub fn is_fast(&self) -> bool {
        self.fast
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
        self.lifts = lifts(&self.triangles, offset);
    }

    /// The scalar walk.
    pub fn scalar(&self) -> Scalar<'_> {
        Scalar(self)
    }

    /// Which of up to 8 N rays that leave one point meet anything within `(0, tmax]`:
    /// a bit each, of those in `mask`; N is 1 to 4. The unit directions of lanes
    /// outside `mask` may be anything finite.
    #[inline]
    pub fn occluded_from<const N: usize>(&self, fan: &Fan, rays: &[Packet; N], mask: u32) -> u32 {
        let tracer = self;
        by_lanes!(
            self.fast,
            fan.faces,
            fan::occluded[N],
            (tracer: &Tracer, fan: &Fan, rays: &[Packet; N], mask: u32) -> u32
        )
    }

    /// Which of up to 8 N rays with origins of their own meet anything: a bit each, of
    /// those in `mask`; N is 1 to 4. Lanes outside `mask` should repeat another
    /// ([`Segments::fill`]): what they reach is looked at.
    #[inline]
    pub fn occluded_segments<const N: usize>(&self, segments: &[Segments; N], mask: u32, faces: Faces) -> u32 {
        let tracer = self;
        by_lanes!(
            self.fast,
            faces,
            free::occluded[N],
            (tracer: &Tracer, segments: &[Segments; N], mask: u32) -> u32
        )
    }

    /// Whether anything lies on the ray within `(0, tmax]`.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.occluded_by(ray, Faces::Both)
    }

    /// The same, of triangles that turn such a face against the ray.
    #[inline]
    pub fn occluded_by(&self, ray: &Ray, faces: Faces) -> bool {
        let tracer = self;
        by_lanes!(self.fast, faces, one::any[], (tracer: &Tracer, ray: &Ray) -> bool)
    }

    /// Distance along the ray, within `(0, tmax]`, to the nearest triangle that turns
    /// such a face against it.
    pub fn distance(&self, ray: &Ray, faces: Faces) -> Option<f32> {
        self.first(ray, faces).map(|met| met.t)
    }

    /// The nearest triangle on the ray within `(0, tmax]`; of several at one
    /// distance the first in the scene, whatever the order of the walk.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let met = self.first(ray, Faces::Both)?;
        Some(self.hit(ray, met.t, met.triangle(self) as usize, met.weights))
    }

    /// [`Self::closest`] of eight rays, of those in `mask`.
    #[inline]
    pub fn closest_of(&self, rays: &Segments, mask: u32) -> Hits {
        let tracer = self;
        by_lanes!(self.fast, eight::closest[], (tracer: &Tracer, rays: &Segments, mask: u32) -> Hits)
    }

    #[inline]
    fn first(&self, ray: &Ray, faces: Faces) -> Option<one::Met> {
        let tracer = self;
        by_lanes!(self.fast, faces, one::first[], (tracer: &Tracer, ray: &Ray) -> Option<one::Met>)
    }

    /// A point of a triangle, off it by what its shape asks for.
    #[inline(always)]
    fn lifted(&self, leaf: usize, point: Vec3, normal: Vec3) -> Vec3 {
        match self.lifts.get(leaf) {
            Some(&lift) if lift > 0.0 => point + normal * lift,
            _ => point,
        }
    }

    /// What is known of a hit on a triangle, by its barycentric weights.
    fn hit(&self, ray: &Ray, t: f32, leaf: usize, weights: Vec3) -> Hit {
        let [a, b, c] = self.triangles[leaf];
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
        let point = self.lifted(leaf, a * weights.x + b * weights.y + c * weights.z, normal);
        Hit { t, triangle: self.source[leaf], leaf: leaf as u32, point, normal }
    }
}

/// None where no triangle is lifted.
fn lifts(triangles: &[[Vec3; 3]], offset: f32) -> Vec<f32> {
    let lifts: Vec<f32> = triangles.iter().map(|t| lift(*t, offset)).collect();
    if lifts.iter().any(|l| *l > 0.0) { lifts } else { Vec::new() }
}

#[cfg(test)]
mod check;
#[cfg(test)]
mod tests;
