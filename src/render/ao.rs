//! Openness, ray by ray: `classic` and `extended`. Twin: `gpu/shaders/ao.wgsl`.

use super::{
    Estimator, ReceiverPlane,
    sampler::{Sampler, turn},
};
use crate::trace::{Ray, Tracer};
use aogauge_scenes::AoScale;
use glam::Vec3;

/// How the first 32 primary rays of a pixel were decided, a bit a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Decisions {
    /// The primary ray is closed.
    pub primary: u32,
    /// The first secondary ray is closed.
    pub first: u32,
    /// The second secondary ray is closed.
    pub second: u32,
}

/// Two unit tangents that make a right-handed frame with a unit normal (Duff et
/// al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017).
pub fn tangents(n: Vec3) -> [Vec3; 2] {
    let sign = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y)]
}

/// A shaded point with what its rays share.
#[derive(Clone, Copy, Debug)]
pub struct Shading<'a> {
    tracer: &'a Tracer,
    /// Pushed off the surface by the rounding error.
    origin: Vec3,
    normal: Vec3,
    frame: [Vec3; 2],
    ao: AoScale,
    estimator: Estimator,
}

impl<'a> Shading<'a> {
    /// A point on a surface with its unit normal.
    pub fn new(tracer: &'a Tracer, point: Vec3, normal: Vec3, ao: AoScale, estimator: Estimator) -> Self {
        Shading { tracer, origin: point + normal * tracer.offset(), normal, frame: tangents(normal), ao, estimator }
    }

    /// Decides one primary ray: which of primary, first and second secondary ray
    /// are closed.
    #[inline]
    pub fn decide(&self, [u, v]: [f32; 2]) -> [bool; 3] {
        let [cos_phi, sin_phi] = turn(v);
        let (sin_theta, cos_theta) = (u.sqrt(), (1.0 - u).sqrt());
        let [t, b] = self.frame;
        // The direction in the plane of the surface, and across it.
        let along = t * cos_phi + b * sin_phi;
        let w = along * sin_theta + self.normal * cos_theta;
        if self.tracer.occluded(&Ray::new(self.origin, w, self.ao.radius)) {
            return [true, false, false];
        }
        let Estimator::Extended { receiver_plane } = self.estimator else {
            return [false; 3];
        };
        // d1 = w x n / |w x n| and d2 = w x d1, written out in the frame of the
        // surface: there d1 has no singularity where w is parallel to n.
        let d1 = t * sin_phi - b * cos_phi;
        let d2 = along * cos_theta - self.normal * sin_theta;
        let reach = self.ao.secondary_radius;
        let middle = self.origin + w * (0.5 * self.ao.radius);
        let height = 0.5 * self.ao.radius * cos_theta;
        // How far down d2 goes before it meets the tangent plane.
        let down = match receiver_plane {
            ReceiverPlane::Clipped if reach * sin_theta > height => height / sin_theta,
            _ => reach,
        };
        let first = Ray::new(middle - d1 * reach, d1, 2.0 * reach);
        let second = Ray::new(middle - d2 * reach, d2, reach + down);
        [false, self.tracer.occluded(&first), self.tracer.occluded(&second)]
    }

    /// Openness in half rays: 2 for an open primary ray, less 1 for each closed
    /// secondary ray, over `rays` rays. Openness is this over `2 * rays`.
    pub fn open_halves(&self, rays: u32, sampler: &Sampler) -> (u32, Decisions) {
        let mut halves = 0;
        let mut decisions = Decisions::default();
        for i in 0..rays {
            let [primary, first, second] = self.decide(sampler.pair(i, 0));
            if !primary {
                halves += 2 - u32::from(first) - u32::from(second);
            }
            if i < 32 {
                decisions.primary |= u32::from(primary) << i;
                decisions.first |= u32::from(first) << i;
                decisions.second |= u32::from(second) << i;
            }
        }
        (halves, decisions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tangents_make_a_right_handed_frame() {
        for i in 0..2000 {
            let [a, b] = Sampler::new(5, i, 0).pair(0, 0);
            let [c, s] = turn(a);
            let z = 1.0 - 2.0 * b;
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = Vec3::new(r * c, r * s, z).normalize();
            let [t, u] = tangents(n);
            assert!((t.cross(u) - n).length() < 1e-5);
            assert!((t.length() - 1.0).abs() < 1e-5 && t.dot(u).abs() < 1e-5);
        }
    }

    fn plane(half: f32) -> Tracer {
        let mut mesh = aogauge_scenes::Mesh::default();
        mesh.push_quad(Vec3::new(-half, 0.0, -half), Vec3::Z * 2.0 * half, Vec3::X * 2.0 * half);
        Tracer::new(&mesh.corners().collect::<Vec<_>>())
    }

    /// 1 - (k^2/2)/(1 + k^2), k = 2R'/R, where the plane counts; 1 where clipped.
    #[test]
    fn an_empty_plane_reads_what_the_closed_form_says() {
        let tracer = plane(3.0);
        for (ratio, expected) in [(0.25f32, 0.9), (0.125, 1.0 - 0.03125 / 1.0625)] {
            let ao = AoScale { radius: 0.25, secondary_radius: 0.25 * ratio };
            let read = |estimator| {
                let shading = Shading::new(&tracer, Vec3::new(0.1, 0.0, 0.2), Vec3::Y, ao, estimator);
                let (halves, _) = shading.open_halves(65_536, &Sampler::new(1, 2, 3));
                f64::from(halves) / 131_072.0
            };
            let extended = |receiver_plane| Estimator::Extended { receiver_plane };
            assert!((read(Estimator::Classic) - 1.0).abs() < 1e-12);
            assert!((read(extended(ReceiverPlane::Clipped)) - 1.0).abs() < 1e-12);
            assert!((read(extended(ReceiverPlane::Counts)) - expected).abs() < 2e-3);
        }
    }

    #[test]
    fn secondary_directions_are_those_of_the_paper() {
        let n = Vec3::new(0.3, 0.8, -0.5).normalize();
        let [t, b] = tangents(n);
        for v in [0.03, 0.31, 0.77] {
            let [c, s] = turn(v);
            let (st, ct) = (0.36f32.sqrt(), 0.64f32.sqrt());
            let w = (t * c + b * s) * st + n * ct;
            let d1 = t * s - b * c;
            assert!((d1 - w.cross(n).normalize()).length() < 1e-5);
            assert!(((t * c + b * s) * ct - n * st - w.cross(d1)).length() < 1e-5);
        }
    }
}
