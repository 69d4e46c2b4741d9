//! One primary ray with all its secondary rays, for pictures.

use super::{Decided, Shading};
use crate::trace::Ray;
use glam::Vec3;

/// A primary ray, what became of it, and its secondary rays; points in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Traced {
    /// Where it starts: the shaded point, off its surface by the rounding error.
    pub from: Vec3,
    /// Where it ends: at its hit, or where its reach ends.
    pub to: Vec3,
    /// What became of it.
    pub decided: Decided,
    /// Both ends of each secondary ray, in the order of the bits of `decided.closed`;
    /// none where the primary ray is closed, or the method has none.
    pub secondary: Vec<[Vec3; 2]>,
}

impl Shading<'_> {
    /// The ray that [`Shading::decide`] decides by these numbers, to be drawn.
    pub fn traced(&self, [u, v]: [f32; 2], shift: [f32; 2]) -> Traced {
        let decided = self.decide([u, v], shift);
        let primary = self.primary_at([u, v]);
        let direction = primary.direction;
        let reach = self.method.reach(self.ao.radius);
        let length = self.tracer.distance(&Ray::new(self.origin, direction, reach), self.method.faces).unwrap_or(reach);
        let mut secondary = Vec::new();
        if let Some(extension) = self.method.extension.filter(|_| decided.mu > 0.0) {
            let fan = self.fan(primary, length.min(self.ao.radius), shift, extension);
            for i in 0..extension.secondary_rays {
                let s = fan.segment(self, i, shift[1], extension);
                secondary.push([s.middle - s.direction * s.back, s.middle + s.direction * s.forth]);
            }
        }
        Traced { from: self.origin, to: self.origin + direction * length, decided, secondary }
    }
}

#[cfg(test)]
mod tests {
    use crate::{
        render::{Extension, Falloff, Geometry, Openness, ReceiverPlane, ao::Shading, sampler::Sampler},
        scenes::library::scene,
        trace::Ray,
    };
    use glam::Vec3;

    /// What is drawn is what was decided: each segment meets something exactly where its
    /// bit says so, and primary rays end where they hit.
    #[test]
    fn what_is_drawn_is_what_was_decided() {
        let scene = scene("curtain-arcade").unwrap();
        let tracer = Geometry::new(&scene).unwrap().tracer;
        let extension = Some(Extension::of_the_paper(ReceiverPlane::Clipped));
        let method = Openness { extension, ..Openness::plain(Falloff::Step) };
        let shading = Shading::new(&tracer, Vec3::new(0.03, 0.0, 0.1), Vec3::Y, scene.ao, method);
        let sampler = Sampler::new(1, 2, 3);
        let (mut hits, mut closed) = (0, 0);
        for i in 0..256 {
            let ray = shading.traced(sampler.pair(i, 0), [0.0; 2]);
            assert_eq!(ray.decided, shading.decide(sampler.pair(i, 0), [0.0; 2]));
            let length = ray.to.distance(ray.from);
            assert!(if ray.decided.hit { length < 0.25 } else { (length - 0.25).abs() < 1e-6 }, "{ray:?}");
            assert_eq!(ray.secondary.len(), if ray.decided.hit { 0 } else { 2 });
            hits += u32::from(ray.decided.hit);
            for (k, [a, b]) in ray.secondary.iter().enumerate() {
                let segment = Ray::new(*a, (*b - *a).normalize(), a.distance(*b));
                assert_eq!(tracer.occluded(&segment), ray.decided.closed >> k & 1 == 1, "{ray:?}");
                closed += ray.decided.closed >> k & 1;
            }
        }
        assert!(hits > 10 && closed > 20, "{hits} {closed}");
    }
}
