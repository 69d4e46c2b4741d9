//! Watertight ray-triangle test, without an epsilon. Twin:
//! `gpu/shaders/triangle.wgsl`.
//!
//! Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013.
//! The vertices are moved and sheared so that the ray is the z axis; the signs of
//! three 2D edge functions decide. A rounded `a * b - c * d` is never of the
//! wrong sign (rounding is monotonic), only zero at worst, and zero counts as
//! inside for both triangles at an edge: so none slips through. The double
//! precision fallback of the paper, which saves some double hits, is not needed
//! where only "anything or nothing" matters.

use glam::Vec3;

/// How far a point on a triangle is moved off it, along its normal, beyond the `offset` of all ray origins, metres. 0 for
/// most triangles.
///
/// How far along a ray a triangle is met is a mean of its corners' distances, weighted by areas. Of a triangle with
/// the longest edge L and the area A these are rounded by u L^2 or so, u = 2^-24: by u L^3 / 2A metres that distance
/// is wrong, which of a needle, 10 m long and 3 cm wide, is 0.2 mm. A ray that leaves it by less meets it.
///
/// At most 256 offsets, which is 2^-11 of the largest coordinate in the scene: of a needle next to nothing wide nobody
/// knows where its sides are. Twin: `lift` in `gpu/shaders/triangle.wgsl`.
pub fn lift([a, b, c]: [Vec3; 3], offset: f32) -> f32 {
    let [ab, ac, bc] = [b - a, c - a, c - b];
    let longest = ab.length_squared().max(ac.length_squared()).max(bc.length_squared());
    let area = ab.cross(ac).length();
    if area > 0.0 {
        (2.0f32.powi(-24) * longest * longest.sqrt() / area - offset).clamp(0.0, 256.0 * offset)
    } else {
        0.0
    }
}

/// A ray from `origin` along the unit vector `direction` for `tmax` metres, with
/// what the triangle and box tests need worked out once.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Start, metres.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Length, metres; a hit at exactly this distance counts.
    pub tmax: f32,
    pub(super) inverse: Vec3,
    pub(super) axes: [usize; 3],
    pub(super) shear: Vec3,
}

/// 1/x, finite for every x: a ray in the plane of a box face then gives 0 * big
/// = 0 in the slab test and not 0 * infinity = NaN. Big times a coordinate must
/// stay finite, too.
fn bounded_reciprocal(x: f32) -> f32 {
    if x.abs() < 1e-20 { 1e20f32.copysign(x) } else { 1.0 / x }
}

/// The axis along which a direction goes furthest.
#[inline(always)]
pub(super) fn main_axis(direction: Vec3) -> usize {
    let a = direction.abs();
    if a.x > a.y {
        if a.x > a.z { 0 } else { 2 }
    } else if a.y > a.z {
        1
    } else {
        2
    }
}

impl Ray {
    /// A ray; `direction` must be of unit length for `tmax` to be in metres.
    pub fn new(origin: Vec3, direction: Vec3, tmax: f32) -> Self {
        let z = main_axis(direction);
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let d = direction.to_array();
        let sz = 1.0 / d[z];
        Ray {
            origin,
            direction,
            tmax,
            inverse: Vec3::new(
                bounded_reciprocal(direction.x),
                bounded_reciprocal(direction.y),
                bounded_reciprocal(direction.z),
            ),
            axes,
            shear: Vec3::new(d[axes[0]] * sz, d[axes[1]] * sz, sz),
        }
    }

    /// Where the ray meets the triangle within `(0, tmax]`: the distance and the
    /// barycentric weights of the three corners. Both sides count.
    #[inline]
    pub fn meets(&self, corners: &[Vec3; 3], tmax: f32) -> Option<(f32, Vec3)> {
        let [x, y, z] = self.axes;
        let [a, b, c] = corners.map(|v| (v - self.origin).to_array());
        let (ax, ay) = (a[x] - self.shear.x * a[z], a[y] - self.shear.y * a[z]);
        let (bx, by) = (b[x] - self.shear.x * b[z], b[y] - self.shear.y * b[z]);
        let (cx, cy) = (c[x] - self.shear.x * c[z], c[y] - self.shear.y * c[z]);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        if det == 0.0 {
            return None;
        }
        let t = self.shear.z * (u * a[z] + v * b[z] + w * c[z]) / det;
        (t > 0.0 && t <= tmax).then(|| (t, Vec3::new(u, v, w) / det))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_and_weights_are_right() {
        let tri = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let from = Vec3::new(0.2, 0.3, 2.0);
        let ray = Ray::new(from, Vec3::NEG_Z, 10.0);
        let (t, w) = ray.meets(&tri, 10.0).unwrap();
        assert!((t - 2.0).abs() < 1e-6);
        assert!((w - Vec3::new(0.5, 0.2, 0.3)).length() < 1e-6);
        assert!(ray.meets(&tri, 1.99).is_none());
        assert!(Ray::new(from, Vec3::Z, 10.0).meets(&tri, 10.0).is_none(), "behind");
        let back = Ray::new(Vec3::new(0.2, 0.3, -1.0), Vec3::Z, 10.0);
        assert!(back.meets(&tri, 10.0).is_some(), "both sides count");
    }

    #[test]
    fn a_ray_that_starts_in_the_plane_does_not_meet_it() {
        let tri = [Vec3::new(-5.0, 0.0, -5.0), Vec3::new(5.0, 0.0, -5.0), Vec3::new(0.0, 0.0, 7.0)];
        for d in [Vec3::Y, Vec3::new(1.0, 0.3, 0.2).normalize(), Vec3::X] {
            assert!(Ray::new(Vec3::new(0.3, 0.0, 0.1), d, 9.0).meets(&tri, 9.0).is_none());
        }
    }
}
